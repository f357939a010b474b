"""Turns the coordinator's messages into tables and arrays."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeAlias, cast

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc

from . import _answers as answers_
from ._errors import InvalidError
from .v1 import campaign_pb2 as v1
from .v1 import label_pb2 as labels

FEATURES = ("average_speed", "angular_momentum", "radial_variance_x20", "scatter", "group_rotation")
"""The hand-crafted features of Brown et al., in the order of the column `features`.

The third is 20 times the radial variance.
"""

# A column of a table, with its field in the schema.
Column: TypeAlias = "tuple[pa.Field[Any], pa.Array[Any] | pa.ChunkedArray[Any]]"
# Names of a column's numbers, if they differ from the column's name.
_NUMBERS_OF = {"embedding": "dimensions of the embedding"}
# Answers that name no class.
NO_CLASS = ("not sure", "skip")


def matrix(column: pa.ChunkedArray[Any] | pa.Array[Any] | Iterable[Any]) -> npt.NDArray[Any]:
    """A column of lists of one length, such as genes, features or embeddings, as an array.

    Args:
        column: A column of a table or of a data frame of pandas or polars, without nulls.

    Returns:
        An array with the shape (rows, length of a list) and the column's kind of numbers.

    Raises:
        InvalidError: If the column has nulls, or does not consist of lists of numbers of one length.

    Example:
        >>> mm.matrix(campaign.archive()["features"]).shape
        (100, 5)
    """
    array = _array(column)
    if not (
        pa.types.is_list(array.type) or pa.types.is_fixed_size_list(array.type) or pa.types.is_large_list(array.type)
    ):
        raise InvalidError.of("column", f"one of {array.type}", "one of lists")
    if array.null_count:
        raise InvalidError("the column has nulls, like the embeddings of a campaign without embedder")
    flat = pc.list_flatten(array)
    kind = flat.type
    if flat.null_count or not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_null(kind)):
        what = "nulls" if flat.null_count else str(kind)
        raise InvalidError.of("column", f"lists of {what}", "of numbers")
    lengths = (
        {array.type.list_size}
        if pa.types.is_fixed_size_list(array.type)
        else set(pc.list_value_length(array).unique().to_pylist())
    )
    if len(lengths) > 1:
        raise InvalidError.of("column", f"lists of {min(lengths)} to {max(lengths)} numbers", "of one length")
    numbers: npt.NDArray[Any] = flat.to_numpy(zero_copy_only=False)
    if pa.types.is_null(kind):
        # Empty lists have no type of numbers.
        numbers = numbers.astype(np.float64)
    return numbers.reshape(len(array), lengths.pop() if lengths else 0)


def _array(column: pa.ChunkedArray[Any] | pa.Array[Any] | Iterable[Any]) -> pa.Array[Any]:
    if isinstance(column, pa.ChunkedArray):
        return column.combine_chunks()
    if isinstance(column, pa.Array):
        return column
    try:
        # Polars converts without a copy; in pandas each row is a list or an array.
        array = column.to_arrow() if hasattr(column, "to_arrow") else pa.array(list(column))
        if not isinstance(array, pa.Array):
            raise TypeError(f"its `to_arrow` gives a {type(array).__name__}")
        return array
    except (TypeError, ValueError, OverflowError, pa.ArrowException) as error:
        raise InvalidError.of("column", type(column).__name__, f"a column of lists: {error}") from None


def archive(individuals: Sequence[v1.Individual], classes: Mapping[int, str]) -> pa.Table:
    """The table of an archive, by index; `classes` maps individuals to their classes."""
    first = individuals[0] if individuals else v1.Individual()
    columns = [
        _column("index", pa.uint64(), (one.index for one in individuals), about="place in the archive, from 0"),
        _column("generation", pa.uint32(), (one.generation for one in individuals), about="from 0"),
        _lists("genes", pa.float64(), [one.controller for one in individuals], len(first.controller)),
        _lists(
            "features",
            pa.float64(),
            [one.features for one in individuals],
            len(FEATURES),
            names=", ".join(FEATURES),
        ),
        _lists("embedding", pa.float32(), [one.embedding for one in individuals], len(first.embedding)),
        _column(
            "novelty",
            pa.float64(),
            (one.novelty for one in individuals),
            about="when evaluated, in the archive as it was after the individual's generation",
            unit="behaviour space",
        ),
        _column(
            "class", pa.string(), (classes.get(one.index) for one in individuals), about="null where there is none"
        ),
        _column("seed", pa.uint64(), (one.seed for one in individuals), about="of the first start"),
    ]
    if any(one.trials for one in individuals):
        columns.append(_trials(individuals, len(first.embedding)))
    return _table(columns)


def flat(
    archive: pa.Table, genes: Sequence[str], clusters: npt.NDArray[np.uint32] | None, sample: int | None = None
) -> pa.Table:
    """The table of an archive with a column for each number.

    `clusters` are row numbers of the medoids, from 0, for all individuals or for the first `sample`.
    """
    columns: list[Column] = []
    for field in archive.schema:
        column = archive[field.name]
        if field.name == "trials":
            continue
        if not pa.types.is_nested(field.type):
            columns.append((field, column))
        elif len(archive) and not column.null_count:
            names = {"genes": genes, "features": FEATURES}.get(field.name)
            numbers = matrix(column)
            if names:
                answers_.lengths("individual", field.name, numbers[:1], len(names))
            for place, values in enumerate(numbers.T):
                name = names[place] if names else f"{field.name}_{place}"
                columns.append(_column(name, pa.from_numpy_dtype(numbers.dtype), values))
    if clusters is not None:
        answers_.count("individuals in the taxonomy", len(clusters), min(len(archive), sample or len(archive)))
        numbered = (clusters + np.uint32(1)).tolist() + [None] * (len(archive) - len(clusters))
        columns.append(_column("cluster", pa.uint32(), numbered, about="number of the behaviour, from 1"))
    return _table(columns)


def medoids(taxonomy: v1.Taxonomy, classes: Mapping[int, str]) -> pa.Table:
    """The table of the medoids of a taxonomy, at least one, largest cluster first."""
    ours = taxonomy.medoids
    individuals = [medoid.individual for medoid in ours]
    columns = [
        _column("index", pa.uint64(), (one.index for one in individuals), about="place in the archive, from 0"),
        _column("cluster_size", pa.uint64(), (medoid.cluster_size for medoid in ours), unit="individuals"),
        _column("mean_distance", pa.float64(), (medoid.mean_distance for medoid in ours), unit="behaviour space"),
        _column(
            "novelty",
            pa.float64(),
            (medoid.novelty for medoid in ours),
            about="in the whole archive",
            unit="behaviour space",
        ),
        _column(
            "class", pa.string(), (classes.get(one.index) for one in individuals), about="null where there is none"
        ),
        _column(
            "cluster_name",
            pa.string(),
            (medoid.name.name or None for medoid in ours),
            about="the class of the medoid, or the name from an earlier version; null where there is none",
        ),
        _lists("genes", pa.float64(), [one.controller for one in individuals], len(individuals[0].controller)),
        _column("seed", pa.uint64(), (one.seed for one in individuals), about="of the first start"),
    ]
    return _table(columns)


def answers(standing: Sequence[labels.Label]) -> pa.Table:
    """The table of standing answers, by individual, then annotator."""
    times = (answers_.time(label.answer.time_ms) for label in standing)
    return _table(
        [
            _column("index", pa.uint64(), (label.answer.index for label in standing), about="place in the archive"),
            _column(
                "answer",
                pa.string(),
                (label.answer.answer for label in standing),
                about="a class, `not sure` or `skip`",
            ),
            _column("annotator", pa.string(), (label.answer.annotator for label in standing)),
            _column("time", pa.timestamp("ms", tz="UTC"), times),
            _column("entry", pa.uint64(), (label.entry for label in standing), about="place in the label log, from 0"),
        ]
    )


def generations(summaries: Sequence[v1.GenerationSummary]) -> pa.Table:
    """The table of generations."""
    return _table(
        [
            _column("generation", pa.uint32(), (one.generation for one in summaries), about="from 0"),
            _column("best_novelty", pa.float64(), (one.best_novelty for one in summaries), unit="behaviour space"),
            _column("mean_novelty", pa.float64(), (one.mean_novelty for one in summaries), unit="behaviour space"),
            _column(
                "filtered", pa.uint64(), (one.filtered for one in summaries), about="proposals that the filter rejected"
            ),
        ]
    )


def classes_of(standing: Iterable[labels.Label]) -> dict[int, str]:
    """The class of each individual that has a class; if annotators differ, the class given last."""
    given = (label for label in standing if label.answer.answer not in NO_CLASS)
    return {label.answer.index: label.answer.answer for label in sorted(given, key=lambda label: label.entry)}


def pictures(images: Sequence[bytes], side: int) -> npt.NDArray[np.uint8]:
    """Pictures in the usual order: rows from the top down, columns from left to right."""
    channels = answers_.channels(images, side)
    # The coordinator sends pictures column by column.
    columns = np.frombuffer(b"".join(images), np.uint8).reshape(len(images), channels, side, side)
    rows = np.ascontiguousarray(columns.swapaxes(2, 3))
    return rows[:, 0] if channels == 1 else rows


def poses(what: str, numbers: Sequence[float], agents: int) -> npt.NDArray[np.float64]:
    """The poses of a motion: frames, agents, (x, y, heading). Errors call their owner `what`."""
    if agents == 0 or len(numbers) % (agents * 3):
        raise answers_.wrong(f"{what} have {len(numbers)} numbers, and not 3 for each of {agents} robots")
    return answers_.finite("poses", np.array(numbers, np.float64).reshape(-1, agents, 3))


def _trials(individuals: Sequence[v1.Individual], dimensions: int) -> Column:
    starts = len(individuals[0].trials)
    answers_.lengths("individual", "trials", (one.trials for one in individuals), starts)
    every = [trial for one in individuals for trial in one.trials]
    columns = [
        _column("seed", pa.uint64(), (trial.seed for trial in every)),
        _lists("features", pa.float64(), [trial.features for trial in every], len(FEATURES), of="trial"),
        _lists("embedding", pa.float32(), [trial.embedding for trial in every], dimensions, of="trial"),
    ]
    arrays = cast("list[pa.Array[Any]]", [column for _, column in columns])
    trials = pa.StructArray.from_arrays(arrays, fields=[field for field, _ in columns])
    offsets = pa.array(range(0, len(every) + 1, starts), pa.int32())
    lists = pa.ListArray.from_arrays(offsets, trials)
    about = {"about": "the simulations of an individual, the first first"}
    return pa.field("trials", lists.type, metadata=about), lists


def _column(name: str, kind: pa.DataType, values: Iterable[Any], **about: str) -> Column:
    listed = list(values)
    if pa.types.is_floating(kind):
        answers_.finite(name, np.array(listed, np.float64))
    return pa.field(name, kind, metadata=about or None), pa.array(listed, kind)


def _lists(
    name: str, kind: pa.DataType, lists: Sequence[Sequence[float]], length: int, of: str = "individual", **about: str
) -> Column:
    """A column of lists of finite numbers, all of one length; nulls if the length is 0. Errors call a row an `of`."""
    column: pa.Array[Any]
    answers_.lengths(of, _NUMBERS_OF.get(name, name), lists, length)
    if length == 0:
        column = pa.nulls(len(lists), pa.list_(kind))
    else:
        numbers = answers_.finite(name, np.array(lists, kind.to_pandas_dtype()).reshape(-1, length))
        column = pa.FixedSizeListArray.from_arrays(pa.array(numbers.ravel(), kind), length)
    return pa.field(name, column.type, metadata=about or None), column


def _table(columns: Sequence[Column]) -> pa.Table:
    schema = pa.schema([field for field, _ in columns])
    return pa.Table.from_arrays([column for _, column in columns], schema=schema)
