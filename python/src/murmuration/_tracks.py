"""Tracks of filmed robots: tables, and datasets of the library `movement`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
from pyarrow import csv

from ._arguments import shown
from ._errors import InvalidError

COLUMNS = ("frame", "robot", "x", "y", "heading", "species")
_NEEDED = COLUMNS[:4]
# The names of a dimension in versions of `movement`.
_INDIVIDUALS = ("individual", "individuals")
_KEYPOINTS = ("keypoint", "keypoints")


@dataclass(frozen=True, repr=False)
class Recognition:
    """What a filmed swarm is like.

    Attributes:
        campaign: Id of the campaign with which the swarm was compared.
        robots: Number of robots in the film.
        frames: The first and the last frame.
        inside: Share of the positions that are between the walls, 0 to 1.
        width: The longer side of the rectangle that the positions span, world units.
        notes: What was understood and assumed, in sentences: robots that were left out, headings that were missing,
            moves that no robot can make, and what makes the distances mean less.
        features: The five hand-crafted features; float64.
        embedding: The swarm's place in the campaign's embedding; float32, empty without an embedder.
        neighbours: The nearest individuals, nearest first: `index`, `distance`, `cluster` (from 0), `class`.
        medoid: Index of the nearest medoid.
        is_unlike: Whether the swarm is unlike every behaviour of the campaign.
    """

    campaign: str
    robots: int
    frames: tuple[int, int]
    inside: float
    width: float
    notes: tuple[str, ...]
    features: npt.NDArray[np.float64]
    embedding: npt.NDArray[np.float32]
    neighbours: pa.Table
    medoid: int
    is_unlike: bool

    def __repr__(self) -> str:
        nearest = self.neighbours["index"][0].as_py() if len(self.neighbours) else None
        return f"Recognition({self.robots} robots, nearest individual {nearest})"


def write(tracks: object, keypoint: str | None, file: Path) -> None:
    """Writes tracks as a CSV file.

    Raises:
        InvalidError: If they are neither a table with the columns `frame`, `robot`, `x` and `y` nor a dataset of
            `movement`.
    """
    table = _of_dataset(tracks, keypoint) if _is_dataset(tracks) else _of_table(tracks)
    missing = [name for name in _NEEDED if name not in table.column_names]
    if missing:
        has = ", ".join(table.column_names)
        raise InvalidError.of("tracks", f"a table with the columns {has}", f"a table with a column {missing[0]!r}")
    csv.write_csv(table.select([name for name in COLUMNS if name in table.column_names]), file)


def recognition(document: Mapping[str, Any]) -> Recognition:
    """The document that `murmuration recognise` printed."""
    near = document["neighbours"]
    return Recognition(
        campaign=document["campaign"],
        robots=document["robots"],
        frames=(document["frames"][0], document["frames"][1]),
        inside=document["inside"],
        width=document["width"],
        notes=tuple(document["notes"]),
        features=np.array(document["features"], np.float64),
        embedding=np.array(document["embedding"], np.float32),
        neighbours=pa.table(
            {
                "index": pa.array([int(one["index"]) for one in near], pa.uint64()),
                "distance": pa.array([one["distance"] for one in near], pa.float64()),
                "cluster": pa.array([one["cluster"] for one in near], pa.uint32()),
                "class": pa.array([one["class"] or None for one in near], pa.string()),
            }
        ),
        medoid=int(document["medoid"]["index"]),
        is_unlike=document["is_unlike"],
    )


def in_python(error: InvalidError, file: Path) -> InvalidError:
    """An error of the command with the arguments of `Campaign.recognise` instead of options."""
    message = str(error).replace(f"{file}", "tracks")
    message = re.sub(r"--arena WIDTHxHEIGHT", "`arena=(WIDTH, HEIGHT)`", message)
    message = re.sub(r"--(frame-time TIME|fps FRAMES|min-frames N|origin centre)", _argument, message)
    return error.reworded(message.replace("--degrees", "`degrees=True`"))


def _argument(option: re.Match[str]) -> str:
    name, value = option[1].split(" ")
    given = f'"{value}"' if value.islower() else value
    return f"`{name.replace('-', '_')}={given}`"


def _is_dataset(tracks: object) -> bool:
    """Whether it is an xarray dataset with positions, as `movement` loads them."""
    return hasattr(tracks, "data_vars") and "position" in tracks.data_vars


def _of_table(tracks: object) -> pa.Table:
    if isinstance(tracks, pa.Table):
        return tracks
    try:
        return pa.table(tracks)
    except (TypeError, ValueError, pa.ArrowInvalid):
        expected = "a table (of pandas, polars or pyarrow, or a dict of columns) or a dataset of movement"
        raise InvalidError.of("tracks", shown(type(tracks).__name__), expected) from None


def _of_dataset(dataset: Any, keypoint: str | None) -> pa.Table:  # noqa: ANN401
    """The tracks of a dataset. A robot is at the mean of its keypoints, or at one."""
    position = dataset["position"]
    keypoints = next((name for name in _KEYPOINTS if name in position.dims), None)
    if keypoint is not None:
        known = [] if keypoints is None else [str(name) for name in position[keypoints].values]
        if keypoint not in known:
            raise InvalidError.of("keypoint", shown(keypoint), f"one of {', '.join(known)}")
        position = position.sel({keypoints: keypoint})
    elif keypoints is not None:
        position = position.mean(keypoints, skipna=True)
    individuals = next((name for name in _INDIVIDUALS if name in position.dims), None)
    if individuals is None or not {"time", "space"} <= set(position.dims):
        raise InvalidError.of(
            "tracks", f"positions by {', '.join(map(str, position.dims))}", "positions by time, space and individuals"
        )
    names = [str(name) for name in position[individuals].values]
    places = position.sel(space=["x", "y"]).transpose("time", individuals, "space").to_numpy()
    frames = _frames(dataset)
    return pa.table(
        {
            "frame": np.repeat(frames, len(names)),
            "robot": names * len(frames),
            "x": places[:, :, 0].ravel(),
            "y": places[:, :, 1].ravel(),
        }
    )


def _frames(dataset: Any) -> npt.NDArray[np.int64]:  # noqa: ANN401
    """The frame of each time of a dataset: its times are frames, or seconds if it has frames per second."""
    times = np.asarray(dataset["time"].values, np.float64)
    rate = dataset.attrs.get("fps")
    in_frames = times * float(rate) if rate else times
    frames = np.rint(in_frames)
    is_whole = np.abs(in_frames - frames) < 0.01 if len(frames) else np.array([], bool)
    if not is_whole.all() or (frames < 0).any():
        strange = times[~is_whole | (frames < 0)][0]
        raise InvalidError.of(
            "tracks", f"a dataset with the time {strange}", "times that are frames, or seconds beside fps"
        )
    return frames.astype(np.int64)
