"""Films of robots: tables, and datasets as the library `movement` makes them."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
import pandas as pd  # type: ignore[import-untyped]
import polars as pl
import pytest
import xarray as xr

import murmuration as mm
from conftest import SPEC

Table = dict[str, npt.NDArray[np.float64]]


@pytest.fixture(scope="module")
def campaign() -> Iterator[mm.Campaign]:
    with mm.local(workers=2, trainers=0) as client:
        yield client.run(SPEC)


def film(campaign: mm.Campaign) -> Table:
    """The film of individual 7."""
    poses = campaign.replay(7).poses.astype(np.float64)
    frames, robots, _ = poses.shape
    return {
        "frame": np.repeat(np.arange(frames), robots),
        "robot": np.tile(np.arange(robots), frames),
        "x": poses[:, :, 0].ravel(),
        "y": poses[:, :, 1].ravel(),
        "heading": poses[:, :, 2].ravel(),
    }


def test_a_table_of_any_library_is_recognised(campaign: mm.Campaign) -> None:
    tracks = film(campaign)
    for table in (tracks, pd.DataFrame(tracks), pl.DataFrame(tracks)):
        found = campaign.recognise(table, count=3)
        assert found.neighbours["index"][0].as_py() == 7
        assert (found.campaign, found.robots, len(found.neighbours), found.inside) == (campaign.id, 24, 3, 1.0)
        assert not found.is_unlike


def test_other_axes_and_names_are_understood(campaign: mm.Campaign) -> None:
    tracks = film(campaign)
    other = pd.DataFrame(tracks)
    other["robot"] = [f"ant_{robot}" for robot in tracks["robot"]]
    other["x"] = (other["x"] - 250) / 250
    other["y"] = (250 - other["y"]) / 250
    other["heading"] = -np.degrees(other["heading"])
    found = campaign.recognise(other, arena=(2, 2), origin="centre", y="up", degrees=True, fps=1)
    assert found.neighbours["index"][0].as_py() == 7
    with pytest.raises(mm.InvalidError, match=r"^tracks: .*`arena=\(WIDTH, HEIGHT\)`"):
        campaign.recognise(other.assign(x=other["x"] + 1, y=other["y"] + 1), degrees=True)
    with pytest.raises(mm.InvalidError, match=r'`arena=\(WIDTH, HEIGHT\)`.*`origin="centre"`'):
        campaign.recognise(other.assign(x=other["x"] * 250), degrees=True)


def test_the_times_of_a_dataset_are_its_frames(campaign: mm.Campaign) -> None:
    poses = campaign.replay(7).poses.astype(np.float64)
    frames, robots, _ = poses.shape

    def dataset(times: npt.NDArray[np.float64], chosen: npt.NDArray[np.int64], fps: float | None) -> xr.Dataset:
        names = [f"ant_{robot}" for robot in range(robots)]
        position = (("time", "space", "individuals"), poses[chosen, :, :2].transpose(0, 2, 1))
        coordinates = {"time": times[chosen], "space": ["x", "y"], "individuals": names}
        return xr.Dataset({"position": position}, coordinates, {} if fps is None else {"fps": fps})

    every, halved = np.arange(frames), np.arange(frames - 1, -1, -2)[::-1]
    numbers = every.astype(np.float64)
    whole = campaign.recognise(dataset(numbers, every, None), count=1)
    # A frame of two, and seconds at 30 frames a second.
    for found in (
        campaign.recognise(dataset(numbers, halved, None), count=1),
        campaign.recognise(dataset(numbers / 30, every, 30.0), count=1),
    ):
        assert found.neighbours["index"] == whole.neighbours["index"]
    assert any("a robot looks where it moves" in note for note in whole.notes)
    with pytest.raises(mm.InvalidError, match=r"the time 0\.5.*frames, or seconds beside fps"):
        campaign.recognise(dataset(numbers / 2, every, None))


def test_what_is_no_table_of_tracks_is_refused(campaign: mm.Campaign) -> None:
    tracks = film(campaign)
    del tracks["robot"]
    with pytest.raises(mm.InvalidError, match="a column 'robot'"):
        campaign.recognise(tracks)
    with pytest.raises(mm.InvalidError, match="tracks"):
        campaign.recognise(7)
