"""Agreement of any number of annotators."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

import pyarrow as pa

from ._arguments import shown, text
from ._errors import InvalidError
from ._tables import NO_CLASS
from .v1 import label_pb2 as v1

# The annotator that is the rule-based judge.
_JUDGE = "synthetic"


@dataclass(frozen=True, repr=False)
class Agreement:
    """The agreement of annotators, over the individuals to which two or more of them gave a class.

    Attributes:
        alpha: Krippendorff's alpha for names: 1 if all agree, 0 if they agree as often as by chance. None if no
            individual has classes from two annotators, or all these classes are the same.
        individuals: Number of individuals to which two or more annotators gave a class.
        pairs: Each two annotators: `first`, `second`; `both`, the number of individuals to which both gave a class;
            `agreed`, the number of these with the same class; `share`, `agreed` / `both`, null if `both` is 0.
    """

    alpha: float | None
    individuals: int
    pairs: pa.Table

    def __repr__(self) -> str:
        alpha = "none" if self.alpha is None else f"{self.alpha:.3f}"
        return f"Agreement(alpha {alpha} over {self.individuals} individual{'' if self.individuals == 1 else 's'})"


def agreement(standing: Iterable[v1.Label], annotators: Sequence[str] | None) -> Agreement:
    """The agreement of annotators in the standing answers; by default, of all persons.

    Raises:
        InvalidError: If there are fewer than two annotators, or one of them gave no class.
        ImportError: If the extra `labels` is not installed.
    """
    classes: dict[str, dict[int, str]] = {}
    for label in standing:
        answer = label.answer
        if answer.answer not in NO_CLASS:
            classes.setdefault(answer.annotator, {})[answer.index] = answer.answer
    names = sorted(name for name in classes if name != _JUDGE)
    if annotators is not None:
        names = list(dict.fromkeys(text("annotators", name) for name in annotators))
        if missing := [name for name in names if name not in classes]:
            raise InvalidError.of(
                "annotators", shown(missing[0]), f"one of {', '.join(sorted(classes))}, who gave classes"
            )
    if len(names) < 2:
        raise InvalidError.of("annotators", shown(", ".join(names)), "two or more that gave classes")
    return Agreement(*_alpha({name: classes[name] for name in names}), _pairs(names, classes))


def _alpha(classes: dict[str, dict[int, str]]) -> tuple[float | None, int]:
    """Krippendorff's alpha, and the number of individuals that count."""
    try:
        from nltk.metrics.agreement import AnnotationTask
    except ImportError as missing:
        raise ImportError("`Campaign.agreement` needs NLTK: pip install murmuration[labels]") from missing
    count: dict[int, int] = {}
    for given in classes.values():
        for index in given:
            count[index] = count.get(index, 0) + 1
    compared = {index for index, annotators in count.items() if annotators > 1}
    triples = [
        (name, index, one) for name, given in classes.items() for index, one in given.items() if index in compared
    ]
    if len({one for _, _, one in triples}) < 2:
        return None, len(compared)
    return float(AnnotationTask(triples).alpha()), len(compared)


def _pairs(names: Sequence[str], classes: dict[str, dict[int, str]]) -> pa.Table:
    rows = []
    for first, second in combinations(names, 2):
        one, other = classes[first], classes[second]
        both = one.keys() & other.keys()
        agreed = sum(one[index] == other[index] for index in both)
        rows.append((first, second, len(both), agreed, agreed / len(both) if both else None))
    fields = [pa.string(), pa.string(), pa.uint64(), pa.uint64(), pa.float64()]
    columns = list(zip(*rows, strict=True))
    return pa.table(
        {
            name: pa.array(column, kind)
            for name, kind, column in zip(("first", "second", "both", "agreed", "share"), fields, columns, strict=True)
        }
    )
