"""Checks arguments before they are sent: numbers, paths, texts."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import tomli_w

from ._errors import InvalidError

# Most characters of a wrong value in a message.
_QUOTED = 80


def plain(given: object) -> Any:  # noqa: ANN401
    """The Python value of a pyarrow scalar or of an array of one number; other values unchanged."""
    if isinstance(given, pa.Scalar):
        return given.as_py()
    return given.item() if isinstance(given, np.ndarray) and given.ndim == 0 else given


def shown(given: object) -> str:
    """A value as messages quote it: on one line of limited length."""
    try:
        message = str(given) if isinstance(given, np.generic) else repr(given)
    except ValueError:
        # Python does not print numbers of more than 4,300 digits.
        message = "a number of thousands of digits"
    message = " ".join(message.split())
    return message if len(message) <= _QUOTED else f"{message[:_QUOTED]}..."


def whole(field: str, given: object, least: int, most: int) -> int:
    """A whole number of Python, numpy or pyarrow from `least` to `most`."""
    number = plain(given)
    if isinstance(number, (int, np.integer)) and not isinstance(number, bool) and least <= number <= most:
        return int(number)
    limit = f"a whole number from {least} to {most}"
    if isinstance(number, (float, np.floating)):
        limit += (
            ", and no float: in a row of a data frame, large numbers such as seeds have lost digits "
            "(take it from its column)"
        )
    elif isinstance(number, (bool, np.bool_)):
        limit += ", and no truth value: `numpy.flatnonzero(mask)` has the rows that a mask is true of"
    raise InvalidError.of(field, shown(number), limit)


def positive(field: str, given: object) -> float:
    """A number above 0 of Python, numpy or pyarrow, which is not infinite."""
    number = plain(given)
    if isinstance(number, (int, float, np.integer, np.floating)) and not isinstance(number, bool):
        value = float(number)
        if 0 < value < float("inf"):
            return value
    raise InvalidError.of(field, shown(number), "a number above 0")


def flag(field: str, given: object) -> bool:
    """A truth value of Python or numpy."""
    if isinstance(given, (bool, np.bool_)):
        return bool(given)
    raise InvalidError.of(field, shown(given), "True or False")


def index(number: object) -> int:
    """The place of an individual in an archive."""
    return whole("index", number, 0, (1 << 64) - 1)


def text(field: str, given: object) -> str:
    """A text that can be sent."""
    value = plain(given)
    if isinstance(value, str):
        try:
            value.encode()
            return value
        except UnicodeEncodeError:
            # The text has half of a surrogate pair.
            pass
    raise InvalidError.of(field, shown(value), "a text")


def word(given: object) -> str:
    """An argument of a command: a text, or a file name that Python decoded with surrogate escapes."""
    if isinstance(given, str) and _can_be_passed(given):
        return given
    raise InvalidError.of("word", shown(given), "a text, as all words of a command must")


def path(field: str, given: object, expected: str = "a path") -> str:
    """A path for a program, which must not take it for an option. `~` is the user's home, as in a shell."""
    name = os.fsdecode(given) if isinstance(given, (str, bytes, os.PathLike)) else ""
    if not name or not _can_be_passed(name):
        raise InvalidError.of(field, shown(given), expected)
    # `~` with an unknown user stays a plain name.
    with suppress(RuntimeError):
        name = os.fspath(Path(name).expanduser())
    return f"./{name}" if name.startswith("-") else name


def _can_be_passed(word: str) -> bool:
    try:
        return b"\0" not in os.fsencode(word)
    except UnicodeEncodeError:
        return False


def read(field: str, given: object) -> str:
    """The text of a campaign file.

    Raises:
        OSError: If the file cannot be read.
    """
    file = Path(path(field, given, "a dict, or the path of a campaign file"))
    try:
        return file.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise InvalidError(f"{file} is not a text in UTF-8") from None


def toml(spec: Mapping[str, Any]) -> bytes:
    """A specification as a campaign file."""
    try:
        return tomli_w.dumps(_document(spec)).encode()
    except (TypeError, ValueError, RecursionError) as error:
        if isinstance(error, InvalidError):
            raise
        raise InvalidError(f"the specification cannot be written as TOML: {error}") from None


def _document(spec: Mapping[str, Any]) -> dict[str, Any]:
    return {name: _plain(value) for name, value in spec.items()}


def _plain(value: object) -> object:
    """A value of a specification without numpy's types, which the TOML writer does not support."""
    if isinstance(value, Mapping):
        return _document(value)
    if isinstance(value, (list, tuple)):
        return [_plain(inner) for inner in value]
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    if value is None:
        raise InvalidError("a value of the specification is None: leave its field out")
    return value
