"""Wrong arguments, and the accepted alternatives to lists."""
# Each lambda of the table below takes two arguments, and uses one.
# ruff: noqa: ARG005

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

import murmuration as mm
from conftest import SPEC
from murmuration import _programs as programs

GENES = [-0.7, 0.3, 1.0, 1.0]


def _holding_itself() -> dict[str, object]:
    spec: dict[str, object] = dict(SPEC)
    spec["world"] = spec
    return spec


@pytest.mark.parametrize(
    ("call", "field"),
    [
        (lambda client, campaign: campaign.pictures([-1]), "index"),
        (lambda client, campaign: campaign.pictures([1.9]), "index"),
        (lambda client, campaign: campaign.pictures("12"), "index"),
        (lambda client, campaign: campaign.pictures(5), "indices"),
        (lambda client, campaign: client.run(5), "spec"),
        (lambda client, campaign: campaign.replay(None), "index"),
        (lambda client, campaign: campaign.replay(True), "index"),
        (lambda client, campaign: campaign.replay(0, stride=-1), "stride"),
        (lambda client, campaign: campaign.label({5.9: "ring"}, annotator="ana"), "index"),
        (lambda client, campaign: campaign.label({"0": "ring"}, annotator="ana"), "index"),
        (lambda client, campaign: campaign.label([(0, "ring")], annotator="ana"), "answers"),
        (lambda client, campaign: campaign.label({0: 7}, annotator="ana"), "answer"),
        (lambda client, campaign: campaign.label({0: "\ud800"}, annotator="ana"), "answer"),
        (lambda client, campaign: campaign.label({0: "ring"}, annotator="\ud800"), "annotator"),
        (lambda client, campaign: campaign.report(""), "folder"),
        (lambda client, campaign: campaign.report("\ud800"), "folder"),
        (lambda client, campaign: campaign.export("a\0b"), "folder"),
        (lambda client, campaign: client.run(SPEC, seed=-1), "seed"),
        (lambda client, campaign: client.run(SPEC, weight=0), "weight"),
        (lambda client, campaign: client.run(SPEC | {"name": {1, 2}}), None),
        (lambda client, campaign: client.run(SPEC | {"name": "\ud800"}), None),
        (lambda client, campaign: client.evaluate("single-sensor", [GENES], 1.0), "seeds"),
        (lambda client, campaign: client.evaluate("single-sensor", [[10**400] * 4]), "controllers"),
        (lambda client, campaign: client.evaluate("single-sensor", [GENES], np.array(-1)), "seeds"),
        (lambda client, campaign: client.evaluate("single-sensor", [[1j] * 4]), "controllers"),
        (lambda client, campaign: client.evaluate("single-sensor", np.ma.masked_less([GENES], 0)), "controllers"),
        (lambda client, campaign: client.evaluate("single-sensor", [GENES], pictures="no"), "pictures"),
        (lambda client, campaign: client.replay("single-sensor", GENES, 10**5000), "seed"),
        (lambda client, campaign: client.replay("single-sensor", GENES, np.zeros((3, 3), int)), "seed"),
        (lambda client, campaign: campaign.archive(flat=np.ones(2)), "flat"),
        (lambda client, campaign: campaign.wait(progress=np.ones(2)), "progress"),
        (lambda client, campaign: campaign.export("x", force=np.ones(2)), "force"),
        (lambda client, campaign: campaign.pictures(np.array(3)), "indices"),
        (lambda client, campaign: client.run(_holding_itself()), None),
        (lambda client, campaign: client.command("serve"), None),
        (lambda client, campaign: client.command("show", 5), "word"),
        (lambda client, campaign: client.command("show", "a\0b"), "word"),
        (lambda client, campaign: client.campaign(5), "identifier"),
        (lambda client, campaign: mm.local(workers=-1), "workers"),
        (lambda client, campaign: mm.local(""), "data"),
        (lambda client, campaign: mm.connect("http://127.0.0.1:103961"), "url"),
        (lambda client, campaign: mm.connect("http://127.0.0.1"), "url"),
        (lambda client, campaign: mm.connect(5), "url"),  # type: ignore[arg-type]
        (lambda client, campaign: mm.connect("http://a\ud800:80"), "url"),
        (lambda client, campaign: mm.connect("HTTPS://127.0.0.1:7700"), "ca"),
        (lambda client, campaign: mm.connect(client.url, ca=5), "ca"),  # type: ignore[arg-type]
        (lambda client, campaign: mm.connect(client.url, token="mur ü"), "token"),  # noqa: S106
        (lambda client, campaign: mm.local(programs=5), "programs"),  # type: ignore[arg-type]
        (lambda client, campaign: mm.matrix(pa.array([[1, 2, 3], [4]])), "column"),
        (lambda client, campaign: mm.matrix(pa.array([1, 2])), "column"),
        (lambda client, campaign: mm.matrix([[1.0, None]]), "column"),
        (lambda client, campaign: mm.matrix([["a"]]), "column"),
        (lambda client, campaign: mm.matrix([[10**30]]), "column"),
        (lambda client, campaign: mm.matrix(["\ud800"]), "column"),
        (lambda client, campaign: mm.matrix(7), "column"),  # type: ignore[arg-type]
    ],
)
def test_what_is_not_allowed_is_refused_by_its_name(
    client: mm.Client, campaign: mm.Campaign, call: Callable[[mm.Client, mm.Campaign], object], field: str | None
) -> None:
    labels = campaign.labels().num_rows
    with pytest.raises(mm.InvalidError) as refused:
        call(client, campaign)
    assert refused.value.field == field, str(refused.value)
    assert campaign.labels().num_rows == labels


def test_a_seed_that_has_lost_digits_is_told_so(client: mm.Client, campaign: mm.Campaign) -> None:
    row = campaign.archive(flat=True).to_pandas().drop(columns="class").iloc[42]
    with pytest.raises(mm.InvalidError, match="take it from its column"):
        client.replay(SPEC, row[campaign.gene_names], row["seed"])


def test_columns_of_data_frames_stand_for_lists(client: mm.Client, campaign: mm.Campaign) -> None:
    archive = campaign.archive()
    frame = archive.to_pandas()
    assert (mm.matrix(frame["features"]) == mm.matrix(archive["features"])).all()
    several = client.evaluate(SPEC, frame["genes"], frame["seed"])
    for controllers in (
        archive["genes"],
        mm.matrix(archive["genes"]),
        campaign.archive(flat=True).to_pandas()[campaign.gene_names],
    ):
        again = client.evaluate(SPEC, controllers, archive["seed"].to_numpy())
        assert (again.features == several.features).all()
    assert (several.features == mm.matrix(archive["features"])).all()
    assert repr(several) == "Evaluations(100 controllers, features (100, 5))"


def test_a_campaign_stands_for_its_robots_and_world(client: mm.Client, campaign: mm.Campaign) -> None:
    genes, seed = campaign.archive()["genes"][3].as_py(), campaign.archive()["seed"][3].as_py()
    motion = client.replay(campaign, genes, seed)
    assert (motion.astype(np.float32) == campaign.replay(3).poses).all()
    features = client.evaluate(campaign, [genes], [seed]).features
    assert features[0].tolist() == campaign.archive()["features"][3].as_py()


def test_a_flat_archive_has_a_number_in_each_column(campaign: mm.Campaign) -> None:
    archive, flat = campaign.archive(), campaign.archive(flat=True)
    assert not any(pa.types.is_nested(column.type) for column in flat.columns)
    assert flat.to_pandas()[list(mm.FEATURES)].to_numpy().tolist() == archive["features"].to_pylist()
    assert flat.to_pandas()[campaign.gene_names].to_numpy().tolist() == archive["genes"].to_pylist()
    clusters = campaign.taxonomy().clusters
    assert flat["cluster"].to_pylist() == (clusters + 1).tolist()


def test_the_seed_of_a_controller_is_told_and_repeats_it(client: mm.Client) -> None:
    result = client.evaluate("single-sensor", [GENES, GENES])
    assert len(set(result.seeds.tolist())) == 2
    arguments = ["simulate", "--controller=-0.7,0.3,1,1", "--seed", str(result.seeds[1])]
    said = programs.run(programs.find(None), arguments, {})[0]
    features = result.features[1]
    assert features.tolist() == list(
        said["features"].values() if isinstance(said["features"], dict) else said["features"]
    )
    assert (client.replay("single-sensor", GENES) == client.replay("single-sensor", GENES, seed=1)).all()


def test_a_client_that_was_closed_says_so() -> None:
    client = mm.local(workers=0, trainers=0)
    client.close()
    for call in (client.campaigns, lambda: client.run(SPEC), lambda: client.command("list")):
        with pytest.raises(mm.UnavailableError, match="closed"):
            call()


def test_errors_can_be_sent_to_another_process() -> None:
    error: Any = pickle.loads(pickle.dumps(mm.CampaignError("it failed", "failed")))  # noqa: S301
    assert (str(error), error.state) == ("it failed", "failed")


def test_paths_that_look_like_options_are_paths(
    campaign: mm.Campaign, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert (campaign.export("--help") / "README.md").exists()


def test_values_of_tables_are_taken_as_they_are(client: mm.Client, campaign: mm.Campaign) -> None:
    archive = campaign.archive()
    result = client.evaluate(campaign, archive["genes"], archive["seed"])
    assert (result.features == mm.matrix(archive["features"])).all()
    motion = client.replay(campaign, archive["genes"][3], archive["seed"][3])
    assert (motion == client.replay(campaign, archive["genes"][3].as_py(), archive["seed"][3].as_py())).all()
    assert (campaign.pictures(archive["index"][3:5]) == campaign.pictures([3, 4])).all()
    assert campaign.replay(archive["index"][3]).poses.shape[2] == 3


@pytest.mark.parametrize(("given", "hint"), [("2", "'2'"), (2.0, "no float"), (True, "flatnonzero")])
def test_what_is_wrong_with_a_number_is_said(campaign: mm.Campaign, given: object, hint: str) -> None:
    with pytest.raises(mm.InvalidError, match=hint):
        campaign.replay(given)  # type: ignore[arg-type]


def test_a_path_may_begin_at_home(campaign: mm.Campaign, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    assert campaign.report("~/report") == tmp_path / "report/report.html"
    assert (tmp_path / "report/report.html").exists()


def test_an_export_takes_the_place_of_another_only_if_it_is_told_to(campaign: mm.Campaign, tmp_path: Path) -> None:
    folder = campaign.export(tmp_path / "exported")
    with pytest.raises(mm.InvalidError, match="not empty"):
        campaign.export(folder)
    assert not (folder / "individuals.csv").exists()
    assert (campaign.export(folder, csv=True, force=True) / "individuals.csv").exists()
    (folder / "thesis.txt").touch()
    with pytest.raises(mm.InvalidError, match="has other files"):
        campaign.export(folder, force=True)
    assert (folder / "thesis.txt").exists()
