"""Checks a coordinator's answers before they become tables and arrays.

A coordinator may be broken or of another version, and the server at its address may not be a coordinator.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence, Sized
from typing import Any

import numpy as np
import numpy.typing as npt

from ._arguments import shown
from ._errors import AnswerError

# The form of an id is NAME-N. Commands take an id as an argument, so the id must not look like an option.
_ID = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]{0,63}-[0-9]{1,20}")
_DIGEST = re.compile(r"[0-9a-f]{64}")
# Most pixels along a side of a picture, and most channels of a picture.
_LARGEST_SIDE = 1_000
_MOST_CHANNELS = 4
# The first millisecond of the year 10000. Python's dates end before this millisecond.
_END_OF_TIME_MS = 253_402_300_800_000


def wrong(message: str) -> AnswerError:
    """The error for an impossible answer. `message` describes the fault."""
    return AnswerError(f"the coordinator sent an impossible answer: {message}")


def identifier(text: str, asked: str = "latest") -> str:
    """Checks the id of a campaign, which must be the requested one."""
    if not _ID.fullmatch(text):
        raise wrong(f"a campaign has the id {shown(text)}, which is not NAME-N")
    if asked not in ("latest", text):
        raise wrong(f"it was asked for campaign {asked}, and answered of {text}")
    return text


def digest(what: str, text: str) -> str:
    """Checks a digest: 64 hexadecimal digits."""
    if not _DIGEST.fullmatch(text):
        raise wrong(f"{what} is {shown(text)}, and not 64 hexadecimal digits")
    return text


def word(name: Callable[[int], str], number: int, prefix: str) -> str:
    """The name of an enum's value; `unknown` for the values of a newer coordinator."""
    try:
        return name(number).removeprefix(prefix).lower() if number else "unknown"
    except ValueError:
        return "unknown"


def count(what: str, given: int, promised: int) -> None:
    """Checks that the number of items is the promised one."""
    if given != promised:
        raise wrong(f"there are {given} {what}, and not {promised}")


def lengths(of: str, what: str, lists: Iterable[Sized], length: int) -> None:
    """Checks the length of each list. Errors name the list's owner, an `of` such as an individual, by its number."""
    for number, one in enumerate(lists):
        if len(one) != length:
            raise wrong(f"{of} {number} has {len(one)} {what}, and not {length}")


def finite(what: str, numbers: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Checks that all numbers, of any shape, are finite."""
    is_one = np.isfinite(numbers)
    if not is_one.all():
        place = tuple(int(axis[0]) for axis in np.nonzero(~is_one))
        raise wrong(f"{what}[{', '.join(map(str, place))}] is {numbers[place]}, and no finite number")
    return numbers


def measure(what: str, number: float) -> float:
    """Checks a sum or a mean of distances: finite, and not below 0."""
    if not (math.isfinite(number) and number >= 0):
        raise wrong(f"{what} is {number}, and not a finite number from 0")
    return number


def same(what: str, number: int, expected: int) -> None:
    """Checks that an item has the expected number: the requested one, or the next one."""
    if number != expected:
        raise wrong(f"{what} {number} came in the place of {what} {expected}")


def below(what: str, numbers: Sequence[int], end: int) -> None:
    """Checks that each number is an index into `end` items."""
    for place, number in enumerate(numbers):
        if number >= end:
            raise wrong(f"{what} {place} is {number}, and must be below {end}")


def time(milliseconds: int) -> int:
    """Checks a time, milliseconds since 1970-01-01 UTC, up to the year 9999."""
    if milliseconds >= _END_OF_TIME_MS:
        raise wrong(f"a time is {milliseconds} ms after 1970, which is after the year 9999")
    return milliseconds


def channels(images: Sequence[bytes], side: int) -> int:
    """The number of channels, which must be the same in all pictures; 1 if there are no pictures.

    Args:
        images: The grey values of each picture, a byte for each pixel.
        side: Pixels along a side.
    """
    if not 1 <= side <= _LARGEST_SIDE:
        raise wrong(f"pictures have a side of {side} pixels, which must be from 1 to {_LARGEST_SIDE}")
    if not images:
        return 1
    number, left = divmod(len(images[0]), side * side)
    if left or not 1 <= number <= _MOST_CHANNELS:
        raise wrong(
            f"picture 0 has {len(images[0])} bytes, and not {side * side} for each of 1 to {_MOST_CHANNELS} channels"
        )
    lengths("picture", "bytes", images, len(images[0]))
    return number
