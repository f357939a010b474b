"""Campaigns: from a specification to tables and arrays."""

import json
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
import tomli_w

import murmuration as mm
from conftest import SPEC
from murmuration import _programs as programs
from murmuration._progress import step_of
from murmuration.v1 import campaign_pb2 as v1


def test_a_file_and_a_dict_and_the_specification_filled_in_are_the_same_campaign(
    client: mm.Client, campaign: mm.Campaign, tmp_path: Path
) -> None:
    file = tmp_path / "a campaign.toml"
    file.write_text(tomli_w.dumps(SPEC))
    again = client.run(file)
    filled = client.run(campaign.spec)
    assert again.digest() == filled.digest() == campaign.digest()
    assert client.run(SPEC, seed=7).digest() != campaign.digest()


def test_a_specification_may_have_numbers_of_numpy(client: mm.Client) -> None:
    spec = SPEC | {"search": {"population": np.int64(4), "generations": 1, "mutation": np.float32(0.5)}}
    spec |= {"controllers": {"initial": np.array([[1.0, 0.5, -0.5, 1.0]])}}
    campaign = client.run(spec)
    assert campaign.spec["search"]["mutation"] == 0.5
    assert mm.matrix(campaign.archive()["genes"])[0].tolist() == [1.0, 0.5, -0.5, 1.0]


def test_an_archive_is_what_the_program_says_of_each_individual(client: mm.Client, campaign: mm.Campaign) -> None:
    archive = campaign.archive()
    assert archive["index"].to_pylist() == list(range(100))
    assert archive["generation"].to_pylist() == [index // 20 for index in range(100)]
    assert archive.schema.field("genes").type == pa.list_(pa.float64(), 4)
    about = archive.schema.field("features").metadata or {}
    assert about[b"names"].decode().split(", ") == list(mm.FEATURES)
    assert archive["embedding"].null_count == 100
    with pytest.raises(mm.InvalidError, match="nulls"):
        mm.matrix(archive["embedding"])
    for row in (0, 42, 99):
        individual = archive.slice(row, 1).to_pylist()[0]
        shown = client.command("show", campaign.id, "--index", str(row))
        assert int(shown["seed"]) == individual["seed"]
        assert shown["controller"] == individual["genes"]
        features = shown["features"]
        assert (list(features.values()) if isinstance(features, dict) else features) == individual["features"]


def test_pictures_are_as_a_replay_draws_them(campaign: mm.Campaign) -> None:
    pictures = campaign.pictures([3, 5, 3])
    assert pictures.dtype == np.uint8
    assert (pictures[0] == pictures[2]).all() and (pictures[0] != pictures[1]).any()
    assert (campaign.pictures()[[3, 5]] == pictures[:2]).all()
    # The world is 500 wide and high, and a picture shows the last 160 steps.
    replay = campaign.replay(3)
    assert replay.steps.tolist() == list(range(201))
    last = replay.poses[-1, :, :2]
    columns, rows = (last / 10).astype(int).clip(0, 49).T
    assert (pictures[0][rows, columns] > 0).mean() > 0.9
    assert (pictures[0] > 0).mean() < 0.5
    assert campaign.pictures([]).shape[0] == 0
    # The library does not request many pictures one by one.
    many = np.arange(99, 49, -1)
    assert (campaign.pictures(many) == campaign.pictures()[many]).all()
    with pytest.raises(mm.NotFoundError):
        campaign.pictures([*many, 100])


def test_controllers_are_evaluated_as_individuals(client: mm.Client, campaign: mm.Campaign) -> None:
    archive = campaign.archive()
    genes, seeds = mm.matrix(archive["genes"]), archive["seed"].to_numpy()
    result = client.evaluate(SPEC, genes, seeds, pictures=True)
    assert len(result) == 100
    assert (result.features == mm.matrix(archive["features"])).all()
    assert result.pictures is not None
    assert (result.pictures == campaign.pictures()).all()
    assert result.embeddings is None
    trials = [client.evaluate(SPEC, genes[:3], seed).features for seed in (1, 2)]
    assert (trials[0] != trials[1]).any()


def test_controllers_without_seeds_have_those_of_the_command(client: mm.Client, tmp_path: Path) -> None:
    table = tmp_path / "controllers.csv"
    genes = [[-0.7, 0.3, 1.0, 1.0]] * 70
    table.write_text("\n".join(",".join(map(str, row)) for row in genes))
    spec = tmp_path / "spec.toml"
    spec.write_text('name = "x"\nmodel = "single-sensor"\nmethod = "random"\nworld.horizon = 200\n')
    told = client.documents("evaluate", str(spec), str(table))
    result = client.evaluate(spec, genes)
    assert result.seeds.tolist() == [int(row["seed"]) for row in told] and len(set(result.seeds.tolist())) == 70
    assert result.features.tolist() == [row["features"] for row in told]
    assert client.evaluate(spec, genes[:2], [7, 8]).seeds.tolist() == [7, 8]


def test_the_digest_of_half_an_archive_is_asked_for_by_name(client: mm.Client) -> None:
    campaign = client.submit(SPEC | {"search": {"population": 20, "generations": 50_000}, "seed": 9})
    campaign.pause()
    with pytest.raises(mm.RefusedError, match=f"campaign {campaign.id} is paused: its archive is not complete"):
        campaign.digest()
    assert len(campaign.digest(partial=True)) == 64
    campaign.cancel()


def test_several_starts_are_averaged(client: mm.Client) -> None:
    spec: dict[str, Any] = {"model": "single-sensor", "method": "random", "evaluation": {"starts": 3}}
    spec |= {"world": {"horizon": 200}, "search": {"population": 4, "generations": 1}, "taxonomy": {"medoids": 2}}
    campaign = client.run(spec)
    archive = campaign.archive()
    result = client.evaluate(spec, mm.matrix(archive["genes"]), archive["seed"].to_numpy())
    assert (result.features == mm.matrix(archive["features"])).all()


@pytest.mark.parametrize(
    ("controllers", "seeds", "said"),
    [
        ([[0.1, 0.2, 0.3]], 1, "4 values"),
        ([[0.1, 0.2, 0.3, 2.0]], 1, "must be"),
        ([[0.1, 0.2, 0.3, 0.4]], [1, 2], "seeds"),
        ([0.1, 0.2, 0.3, 0.4], 1, "controllers"),
        (np.zeros((0, 4)), 1, "controllers"),
        ([[0.1, 0.2, 0.3, "left"]], 1, "controllers"),
        ([[0.1, 0.2, 0.3, 0.4]], -1, "seeds"),
        ([[0.1, 0.2, 0.3, 0.4]], [1 << 64], "seeds"),
        ([[0.1, 0.2, 0.3, 0.4]], [1.5], "seeds"),
    ],
)
def test_controllers_that_cannot_be_evaluated(
    client: mm.Client, controllers: list[list[float]], seeds: int | list[int], said: str
) -> None:
    with pytest.raises(mm.InvalidError, match=said):
        client.evaluate("single-sensor", controllers, seeds)


def test_a_controller_moves_as_an_individual_and_as_the_program_says(
    client: mm.Client, campaign: mm.Campaign, tmp_path: Path
) -> None:
    archive = campaign.archive()
    for index in (0, 42):
        genes, seed = archive["genes"][index].as_py(), archive["seed"][index].as_py()
        motion = client.replay(campaign.spec, genes, seed)
        assert motion.dtype == np.float64 and motion.shape == (201, 24, 3)
        assert (motion.astype(np.float32) == campaign.replay(index).poses).all()
        assert (client.replay(SPEC, np.array(genes), np.uint64(seed), steps=20) == motion[:21]).all()
        # The program writes every digit.
        file, robots = tmp_path / f"{index}.csv", tmp_path / "spec.toml"
        robots.write_text(tomli_w.dumps(SPEC))
        words = ("simulate", f"--controller={','.join(map(str, genes))}", "--seed", str(seed), "--spec", str(robots))
        programs.run(programs.find(None), [*words, "--tracks", str(file)], {})
        rows = np.genfromtxt(file, delimiter=",", names=True)
        tracks = np.stack([rows[name].reshape(201, 24) for name in ("x", "y", "heading")], axis=-1)
        assert (tracks == motion).all()


def test_a_motion_comes_in_parts_and_needs_no_worker_and_no_embedder() -> None:
    spec = {"model": "two-sensor", "method": "latent", "world": {"agents": 50, "horizon": 2_000}}
    genes = [0.8, 0.5, 0.6, -0.5, -0.5, 0.0, -0.2, 0.5, -1.0]
    with mm.local(workers=0, trainers=0) as client:
        motion = client.replay(spec, genes)
        assert motion.shape == (2_001, 50, 3)
        assert np.isfinite(motion).all()
        assert (motion[:, :, :2] >= 0).all() and (motion[:, :, :2] <= 500).all()


@pytest.mark.parametrize(
    ("controller", "seed", "steps", "field", "limit"),
    [
        ([0.1, 0.2, 0.3, 0.4], 0, 166_666, "steps", "a whole number from 1 to 166665 for 24 robots"),
        ([0.1, 0.2, 0.3, 0.4], 0, 0, "steps", "a whole number from 1"),
        ([0.1, 0.2, 0.3, 0.4], 0, -1, "steps", "a whole number from 1"),
        ([0.1, 0.2, 0.3, 0.4], 1 << 64, None, "seed", "a whole number from 0"),
        ([0.1, 0.2, 0.3], 0, None, "controller", "4 values"),
        ([0.1, 0.2, 0.3, 2.0], 0, None, "controller.right_1", "a number from -1 to 1"),
        ([[0.1, 0.2, 0.3, 0.4]], 0, None, "controller", "the genes of one"),
        ([0.1, 0.2, 0.3, "left"], 0, None, "controller", "numbers"),
    ],
)
def test_motions_that_cannot_be_simulated(
    client: mm.Client, controller: list[float], seed: int, steps: int | None, field: str, limit: str
) -> None:
    with pytest.raises(mm.InvalidError) as refused:
        client.replay("single-sensor", controller, seed, steps=steps)
    assert refused.value.field == field
    assert refused.value.limit is not None and limit in refused.value.limit


def test_a_stride_keeps_the_last_step(campaign: mm.Campaign) -> None:
    replay = campaign.replay(0, stride=150)
    assert replay.steps.tolist() == [0, 150, 200]
    assert (replay.poses == campaign.replay(0).poses[[0, 150, 200]]).all()


def test_a_taxonomy_divides_the_archive(campaign: mm.Campaign) -> None:
    taxonomy = campaign.taxonomy()
    sizes = taxonomy.medoids["cluster_size"].to_numpy()
    assert sizes.tolist() == np.bincount(taxonomy.clusters, minlength=4).tolist()
    assert sizes.sum() == 100 and (np.diff(sizes.astype(int)) <= 0).all()
    medoids = taxonomy.medoids["index"].to_numpy()
    assert taxonomy.clusters[medoids].tolist() == [0, 1, 2, 3]
    assert (taxonomy.pictures == campaign.pictures(medoids)).all()
    # The behaviour space of this campaign consists of the features.
    features = mm.matrix(campaign.archive()["features"])
    distances = np.linalg.norm(features - features[medoids[taxonomy.clusters]], axis=1)
    assert taxonomy.loss == pytest.approx(distances.sum())
    assert taxonomy.robustness is None
    assert taxonomy._repr_html_().count("data:image/png;base64,") == 4


def test_an_archive_may_be_empty() -> None:
    with mm.local(workers=0, trainers=0) as client:
        archive = client.submit(SPEC).archive()
    assert archive.num_rows == 0 and archive.column_names[:3] == ["index", "generation", "genes"]
    assert mm.matrix(archive["features"]).shape[0] == mm.matrix(archive["genes"]).shape[0] == 0


def test_trials_and_species_have_columns_and_channels(client: mm.Client) -> None:
    spec = SPEC | {
        "species": [
            {"name": "red", "model": "single-sensor", "count": 6},
            {"name": "blue", "model": "turbopi", "count": 6},
        ],
        "image": {"channels": "species", "resolution": 30},
        "evaluation": {"starts": 3},
        "search": {"population": 10, "generations": 2},
    }
    del spec["model"]
    campaign = client.run(spec)
    assert campaign.pictures().shape == (20, 2, 30, 30)
    archive = campaign.archive()
    trials: list[Any] = archive["trials"].to_pylist()
    assert [len(one) for one in trials] == [3] * 20
    assert [one[0]["seed"] for one in trials] == archive["seed"].to_pylist()
    means = np.array([[trial["features"] for trial in one] for one in trials]).mean(axis=1)
    np.testing.assert_allclose(mm.matrix(archive["features"]), means)
    taxonomy = campaign.taxonomy()
    assert taxonomy.robustness is not None
    assert set(np.round(taxonomy.robustness * 3, 6)) <= {0.0, 1.0, 2.0, 3.0}
    assert "<img" in taxonomy._repr_html_()


def test_the_last_class_that_was_given_counts(client: mm.Client) -> None:
    campaign = client.run(SPEC | {"name": "labelled"})
    campaign.label({0: "milling", 1: "not sure", 2: "a class with spaces", 3: "milling"}, annotator="ana")
    campaign.label({0: "aggregation", 3: "skip"}, annotator="ben")
    classes = campaign.archive()["class"].to_pylist()
    assert classes[:4] == ["aggregation", None, "a class with spaces", "milling"]
    assert campaign.labels().num_rows == 6
    with pytest.raises(mm.NotFoundError):
        campaign.label({5: "milling", 10_000: "milling"}, annotator="ana")
    assert campaign.labels().num_rows == 6


def test_a_report_is_written(campaign: mm.Campaign, tmp_path: Path) -> None:
    page = campaign.report(tmp_path / "a report")
    assert page.parent == tmp_path / "a report" and "<html" in page.read_text()


def test_errors_have_field_value_and_limit(client: mm.Client, tmp_path: Path) -> None:
    def refused(spec: dict[str, object]) -> mm.InvalidError:
        with pytest.raises(mm.InvalidError) as raised:
            client.submit({"model": "single-sensor", "method": "random"} | spec)
        assert "spec.toml" not in str(raised.value) and "TOML" not in str(raised.value)
        return raised.value

    of_range = refused({"search": {"mutation": 1.5}})
    assert (of_range.field, of_range.value, of_range.limit) == ("search.mutation", "1.5", "a number from 0 to 1")
    of_type = refused({"search": {"population": "many"}})
    assert (of_type.field, of_type.limit) == ("search.population", "a whole number, 0 or more")
    unknown = refused({"search": {"populaton": 10}})
    assert unknown.field == "search.populaton" and "did you mean `population`?" in str(unknown)
    assert "None" in str(refused({"seed": None}))
    with pytest.raises(FileNotFoundError):
        client.submit(tmp_path / "nothing.toml")
    # These errors come over gRPC, without a program.
    with pytest.raises(mm.InvalidError, match=r"^unknown field `modl`: did you mean `model`\?"):
        client.replay({"modl": "single-sensor"}, [0.0] * 4)
    with pytest.raises(mm.InvalidError) as raised:
        client.campaign("example-1").replay(0, stride=0)
    assert raised.value.field == "stride" and raised.value.limit is not None
    with pytest.raises(mm.NotFoundError):
        client.campaign("nothing-1")
    with pytest.raises(mm.NotFoundError):
        client.campaign("example-1").pictures([100])
    with pytest.raises(mm.RefusedError):
        client.campaign("example-1").pause()
    with pytest.raises(mm.MurmurationError):
        client.command("nothing")


def test_a_campaign_that_is_paused_or_cancelled_ends_the_wait(client: mm.Client) -> None:
    long = SPEC | {"search": {"population": 20, "generations": 5_000}}
    campaign = client.submit(long)
    with pytest.raises(mm.RefusedError):
        campaign.taxonomy()
    for change, state in ((campaign.pause, "paused"), (campaign.cancel, "cancelled")):
        threading.Timer(0.5, change).start()
        with pytest.raises(mm.CampaignError) as raised:
            campaign.wait(progress=False)
        assert raised.value.state == state
        if state == "paused":
            campaign.resume()
    while campaign.archive().num_rows == 0:
        time.sleep(0.05)


def test_a_completed_campaign_searches_on(client: mm.Client) -> None:
    campaign = client.run(SPEC | {"search": {"population": 10, "generations": 2}}, progress=False)
    with pytest.raises(mm.RefusedError, match="more than the 2"):
        campaign.extend(2)
    campaign.extend(4)
    campaign.wait(progress=False)
    whole = client.run(SPEC | {"search": {"population": 10, "generations": 4}}, progress=False)
    assert campaign.digest() == whole.digest()


def test_tags_and_a_note_are_kept(client: mm.Client) -> None:
    campaign = client.run(SPEC, progress=False)
    campaign.note("Repeat", add=["paper", "baseline"])
    campaign.note(remove=["paper"])
    status = campaign.status()
    assert (list(status.tags), status.note) == (["baseline"], "Repeat")
    with pytest.raises(mm.InvalidError, match="tag"):
        campaign.note(add=["two words"])
    for given in ({"add": "baseline"}, {"remove": "baseline"}):
        with pytest.raises(mm.InvalidError, match="a list of tags"):
            campaign.note(**given)
    assert list(campaign.status().tags) == ["baseline"]


def test_progress_is_a_bar_for_each_stage(client: mm.Client, capfd: pytest.CaptureFixture[str]) -> None:
    campaign = client.run(SPEC, progress=True)
    assert "100/100" in capfd.readouterr().err
    # The library shows no bar if stderr is a file.
    campaign.wait()
    assert not capfd.readouterr().err


def test_a_stage_counts_what_its_coordinator_counts(client: mm.Client) -> None:
    campaign = client.campaign("example-1").status()
    assert step_of(campaign) == ("evolve", 100, 100, "evaluations")
    campaign.stage = v1.CAMPAIGN_STAGE_FINE_TUNE
    campaign.progress.MergeFrom(v1.StageProgress(done=5, total=6, unit="epoch"))
    assert step_of(campaign) == ("fine-tune", 5, 6, "epochs")
    # Before a trainer has reported, the campaign has no progress.
    campaign.ClearField("progress")
    assert step_of(campaign) is None


def test_pages_of_the_coordinator_are_at_its_url(client: mm.Client) -> None:
    from urllib.request import urlopen

    with urlopen(f"{client.url}/readyz") as answer:  # noqa: S310
        assert answer.status == 200
    assert json.dumps(client.command("digest", "example-1"))


def test_a_command_may_print_no_document_or_several(client: mm.Client, campaign: mm.Campaign, tmp_path: Path) -> None:
    another = client.run(SPEC | {"name": "another"})
    listed = client.documents("list")
    assert {campaign.id, another.id} <= {one["id"] for one in listed}
    with pytest.raises(mm.InvalidError, match=rf"`murmuration list` prints {len(listed)} documents: use `documents`"):
        client.command("list")
    # The program prints this document over many lines.
    assert client.documents("schema", "run")[0]["title"] == "Run"
    assert client.documents("show", campaign.id) == [client.command("show", campaign.id)]
    file = tmp_path / "labels.csv"
    assert client.command("labels", another.id, "--csv", str(file)) == {}
