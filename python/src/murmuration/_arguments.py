"""What callers give, checked before it is sent: numbers, paths, texts."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from ._errors import InvalidError


def whole(field: str, number: object, least: int, most: int) -> int:
    """A whole number of Python or numpy from `least` to `most`."""
    if isinstance(number, (int, np.integer)) and not isinstance(number, bool) and least <= number <= most:
        return int(number)
    said = f"{field} = {number}: must be a whole number from {least} to {most}"
    if isinstance(number, (float, np.floating)):
        said += (
            ", and no float: a float, as in a row of a data frame, has lost digits of a seed (take it from its column)"
        )
    raise InvalidError(said)


def index(number: object) -> int:
    """The place of an individual in an archive."""
    return whole("index", number, 0, (1 << 64) - 1)


def text(field: str, given: object) -> str:
    """A text that can be sent."""
    if isinstance(given, str):
        try:
            given.encode()
            return given
        except UnicodeEncodeError:
            # It has half of a pair of surrogates.
            pass
    raise InvalidError(f"{field} = {given!r}: must be a text")


def word(given: object) -> str:
    """A word of a command: a text, or the name of a file as Python reads those that are no text."""
    if isinstance(given, str) and _can_be_passed(given):
        return given
    raise InvalidError(f"word = {given!r}: must be a text, as all words of a command must")


def path(field: str, given: str | os.PathLike[str]) -> str:
    """A path for a program, which must not take it for an option."""
    try:
        name = os.fsdecode(given)
    except TypeError:
        name = ""
    if not name or not _can_be_passed(name):
        raise InvalidError(f"{field} = {given!r}: must be a path")
    return f"./{name}" if name.startswith("-") else name


def _can_be_passed(word: str) -> bool:
    try:
        return b"\0" not in os.fsencode(word)
    except UnicodeEncodeError:
        return False


def read(field: str, given: str | os.PathLike[str]) -> str:
    """The text of a file.

    Raises:
        OSError: If it cannot be read.
    """
    try:
        return Path(path(field, given)).read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise InvalidError(f"{os.fsdecode(given)} is not a text in UTF-8") from None


def toml(spec: Mapping[str, Any]) -> bytes:
    """A specification as a campaign file."""
    try:
        return tomli_w.dumps(_document(spec)).encode()
    except (TypeError, ValueError) as error:
        if isinstance(error, InvalidError):
            raise
        raise InvalidError(f"the specification cannot be written as TOML: {error}") from None


def _document(spec: Mapping[str, Any]) -> dict[str, Any]:
    return {name: _plain(value) for name, value in spec.items()}


def _plain(value: object) -> object:
    """A value of a specification without the types of numpy, which TOML's writer does not know."""
    if isinstance(value, Mapping):
        return _document(value)
    if isinstance(value, (list, tuple)):
        return [_plain(inner) for inner in value]
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    if value is None:
        raise InvalidError("a value of the specification is None: leave its field out")
    return value
