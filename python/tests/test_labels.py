"""Answers from tables, Label Studio and FiftyOne; tasks for them; agreement of annotators."""

import csv
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pandas as pd  # type: ignore[import-untyped]
import polars as pl
import pyarrow as pa
import pytest
from PIL import Image

import murmuration as mm
from conftest import SPEC

EARLY, LATE = "2026-11-20T10:00:00.123456Z", "2026-11-21T10:00:00.123456Z"
Rows = list[dict[str, Any]]


@pytest.fixture(scope="module")
def campaign() -> Iterator[mm.Campaign]:
    with mm.local(workers=2, trainers=0) as client:
        yield client.run(SPEC)


def answers(campaign: mm.Campaign, annotator: str) -> dict[int, str]:
    """The standing answers of an annotator."""
    rows = campaign.labels().to_pylist()
    return {row["index"]: row["answer"] for row in rows if row["annotator"] == annotator}


def seed(campaign: mm.Campaign, index: int) -> str:
    return str(campaign.archive()["seed"][index].as_py())


def task(number: int, data: dict[str, Any], *annotations: dict[str, Any]) -> dict[str, Any]:
    """A task in an export of Label Studio."""
    ours = {"inner_id": number, "predictions": [], "drafts": [], "meta": {}, "total_annotations": len(annotations)}
    return {"id": number, "annotations": list(annotations), "data": data, **ours}


def annotation(person: object, *choices: str, time: str = EARLY, control: str = "class") -> dict[str, Any]:
    result = {"id": "Dx_aB3", "from_name": control, "to_name": "image", "type": "choices", "origin": "manual"}
    return {
        "id": 901,
        "completed_by": person,
        "result": [result | {"value": {"choices": list(choices)}}] if choices else [],
        "was_cancelled": False,
        "created_at": EARLY,
        "updated_at": time,
        "lead_time": 2.1,
    }


def saved(folder: Path, document: object, name: str = "export.json") -> Path:
    file = folder / name
    file.write_text(json.dumps(document), encoding="utf-8")
    return file


def table(folder: Path, rows: Rows, name: str = "export.csv") -> Path:
    file = folder / name
    with file.open("w", encoding="utf-8", newline="") as lines:
        writer = csv.DictWriter(lines, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    return file


def test_tables_of_any_library_are_read(campaign: mm.Campaign) -> None:
    columns = {"index": [3, 10, 42, 57], "class": ["milling", "random", None, "not sure"]}
    makers: list[Callable[[Any], object]] = [dict, pd.DataFrame, pl.DataFrame, pa.table]
    for number, maker in enumerate(makers):
        campaign.label(maker(columns), annotator=f"table {number}")
        assert answers(campaign, f"table {number}") == {3: "milling", 10: "random", 57: "not sure"}
    # A column of pandas with a missing number has floats, and `nan` is no class.
    frame = pd.DataFrame({"index": [3.0, 10.0], "class": ["milling", np.nan], "annotator": ["floats"] * 2})
    campaign.label(frame)
    assert answers(campaign, "floats") == {3: "milling"}


def test_of_two_answers_the_newer_one_counts_in_any_order(campaign: mm.Campaign) -> None:
    times = pd.to_datetime([LATE, EARLY])
    frame = pd.DataFrame({"index": [3, 3], "class": ["milling", "random"], "annotator": ["twice"] * 2, "time": times})
    for rows in (frame, frame[::-1]):
        campaign.label(rows)
        assert answers(campaign, "twice") == {3: "milling"}
    with pytest.raises(mm.InvalidError, match="answers, row 0 and row 1: one annotator has two answers about 3"):
        campaign.label(frame.drop(columns="time"))


def test_an_individual_is_found_by_seed_or_controller(campaign: mm.Campaign) -> None:
    archive = campaign.archive(flat=True).to_pandas()
    rows = archive.loc[[7, 9], ["seed", *campaign.gene_names]].assign(**{"class": "milling"})
    campaign.label(rows[["seed", "class"]], annotator="by seed")
    campaign.label(rows.drop(columns="seed"), annotator="by controller")
    assert answers(campaign, "by seed") == answers(campaign, "by controller") == {7: "milling", 9: "milling"}
    campaign.label(rows.assign(id=[7, 9]), annotator="by id")
    assert answers(campaign, "by id") == {7: "milling", 9: "milling"}
    with pytest.raises(mm.InvalidError, match="row 1: id = '8': must be 9, the individual with this seed"):
        campaign.label(rows.assign(id=[7, 8]), annotator="by id")
    with pytest.raises(mm.InvalidError, match="row 0: seed = '1': must be that of an individual"):
        campaign.label(rows.assign(seed=1), annotator="by seed")
    rounded = rows.assign(index=[7, 9], seed=rows["seed"].astype(float))
    with pytest.raises(mm.InvalidError, match="a spreadsheet has rounded it"):
        campaign.label(rounded, annotator="by seed")


@pytest.mark.parametrize("kind", ["file", "document"])
def test_label_studios_json_is_read(campaign: mm.Campaign, tmp_path: Path, kind: str) -> None:
    email = f"ana-{kind}@example.org"
    ana = {"id": 1, "email": email, "first_name": "Ana"}
    export = [
        task(4, {"image": "/data/upload/1/ab12-00003.png", "index": 3}, annotation(ana, "milling", time=LATE)),
        task(5, {"image": "a.png", "seed": seed(campaign, 9)}, annotation(ana, "random"), annotation(ana)),
        task(6, {"index": 11}, annotation(ana, "ring"), annotation(ana, "milling", time=LATE)),
        task(7, {"index": 12}, annotation(ana, "ring") | {"was_cancelled": True}),
        task(8, {"image": f"/data/local-files/?d=tasks/{campaign.id}-00042.png"}, annotation(ana, "ring")),
        task(9, {"index": 13}),
        task(10, {"index": "017", "time": "3.2 s", "annotator": "nobody"}, annotation(ana, "ring")),
    ]
    campaign.label(saved(tmp_path, export) if kind == "file" else export)
    assert answers(campaign, email) == {3: "milling", 9: "random", 11: "milling", 17: "ring", 42: "ring"}


def test_label_studios_flat_exports_are_read(campaign: mm.Campaign, tmp_path: Path) -> None:
    rows = [
        {"image": "/data/1-00003.png", "index": 3, "id": 4, "choice": "milling", "annotator": 31, "updated_at": EARLY},
        {"image": "/data/1-00003.png", "index": 3, "id": 4, "choice": "random", "annotator": 31, "updated_at": LATE},
        {"image": "/data/1-00008.png", "index": 8, "id": 5, "choice": "", "annotator": 31, "updated_at": LATE},
    ]
    rows = [row | {"annotation_id": 901, "created_at": EARLY, "lead_time": 2.5} for row in rows]
    for number, export in enumerate((table(tmp_path, rows), saved(tmp_path, rows), pd.DataFrame(rows))):
        campaign.label(export)
        assert answers(campaign, "31") == {3: "random"}
        campaign.label({3: f"class {number}"}, annotator="21")


def test_a_number_of_a_task_is_no_index(campaign: mm.Campaign, tmp_path: Path) -> None:
    rows = [{"annotation_id": 901, "annotator": "raw", "choice": "milling", "id": 4, "image": "/data/1-00003.png"}]
    for export in (table(tmp_path, rows), saved(tmp_path, rows), rows, pd.DataFrame(rows)):
        with pytest.raises(mm.InvalidError, match=r'nothing says which .* `columns={"index": "image"}`'):
            campaign.label(export)
        campaign.label(export, columns={"index": "image"})
        assert answers(campaign, "raw") == {3: "milling"}
    twice = [rows[0] | {"image": "/data/2-00003.png", "choice": "random"}, *rows]
    with pytest.raises(mm.InvalidError, match="row 0 and row 1: one annotator has two answers about 3"):
        campaign.label(pd.DataFrame(twice), columns={"index": "image"})
    # Without a sign of another tool, the command says so.
    plain = table(tmp_path, [{"id": 4, "class": "ring", "annotator": "raw", "image": "/data/1-00003.png"}])
    with pytest.raises(mm.InvalidError, match=r'`columns={"index": "image"}` takes the numbers'):
        campaign.label(plain)


def test_a_picture_with_another_number_is_refused(campaign: mm.Campaign, tmp_path: Path) -> None:
    export = [task(4, {"image": "/data/upload/1/ab12-00003.png", "index": 5}, annotation("other", "ring"))]
    with pytest.raises(mm.InvalidError, match=r"export.json, task 4, annotation 901: index = .* must be 3, the number"):
        campaign.label(saved(tmp_path, export))
    with pytest.raises(mm.InvalidError, match="campaign = 'other-7': must be example-1"):
        campaign.label([task(4, {"index": 5, "campaign": "other-7"}, annotation("other", "ring"))])
    assert answers(campaign, "other") == {}


def test_several_choices_are_refused_by_name(campaign: mm.Campaign, tmp_path: Path) -> None:
    several = [task(4, {"index": 3}, annotation("several", "milling", "random"))]
    with pytest.raises(mm.InvalidError, match="task 4, annotation 901: class = 'milling, random': must be one class"):
        campaign.label(several)
    cell = json.dumps({"choices": ["milling", "random"]})
    rows = [{"index": 3, "choice": cell, "annotator": "several", "annotation_id": 901}]
    with pytest.raises(mm.InvalidError, match=r"export.csv, line 2: choice = 'milling, random': must be one class"):
        campaign.label(table(tmp_path, rows))
    campaign.label([task(4, {"index": 3}, annotation("several", "milling", control="a"))])
    controls = annotation("several", "milling", control="a")
    controls["result"] += annotation("several", "fast", control="b")["result"]
    with pytest.raises(mm.InvalidError, match=r'a, b can be the class; `columns={"class": NAME}`'):
        campaign.label([task(4, {"index": 3}, controls)])
    campaign.label([task(4, {"index": 5}, controls)], columns={"class": "b"})
    assert answers(campaign, "several") == {3: "milling", 5: "fast"}


def sample(name: str, label: str | None, **fields: object) -> dict[str, Any]:
    """A sample of a FiftyOneDataset."""
    one: dict[str, Any] = {
        "_id": {"$oid": "65f0"},
        "filepath": f"data/{name}",
        "tags": [],
        "_media_type": "image",
        "_rand": 0.5,
    }
    classification: dict[str, Any] = {
        "_id": {"$oid": "65f1"},
        "_cls": "Classification",
        "tags": [],
        "label": label,
        "logits": None,
    }
    time = {"$date": "2026-11-20T10:00:00.123Z"}
    return one | {"ground_truth": classification, "last_modified_at": time, **fields}


def test_datasets_of_fiftyone_are_read(campaign: mm.Campaign, tmp_path: Path) -> None:
    samples = [
        sample("ab-00003.png", "milling", index=3, seed=seed(campaign, 3)),
        sample("b.png", "random", seed=seed(campaign, 9)),
        sample(f"{campaign.id}-00042.png", "ring"),
        sample("c.png", None),
        sample("d-3.png", "old", index=11, last_modified_at={"$date": 1_700_000_000_000}),
    ]
    samples[-1]["filepath"] = "data/d-11.png"
    saved(tmp_path, {"samples": samples}, "samples.json")
    for number, export in enumerate((tmp_path, tmp_path / "samples.json", {"samples": samples})):
        campaign.label(export, annotator=f"fiftyone {number}")
        expected = {3: "milling", 9: "random", 11: "old", 42: "ring"}
        assert answers(campaign, f"fiftyone {number}") == expected
    with pytest.raises(mm.InvalidError, match=r"sample 0: annotator is missing: must be a name, .* `annotator`"):
        campaign.label(tmp_path)
    rows = [{"filepath": "/tmp/x-00003.png", "ground_truth.label": "milling", "index": 3}]  # noqa: S108
    campaign.label(table(tmp_path, rows), annotator="fiftyone csv")
    assert answers(campaign, "fiftyone csv") == {3: "milling"}
    with pytest.raises(mm.InvalidError, match=r"line 2: index = .* must be 3, the number in the name of the picture"):
        campaign.label(table(tmp_path, [rows[0] | {"index": 4}]), annotator="fiftyone csv")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"[1, 2]", "must be a table, or an export of Label Studio"),
        (b'{"type": "FeatureCollection"}', "must be a table, or an export of Label Studio"),
        (b'[{"id": 1,', "is not JSON"),
        ('[{"class": "Mühle"}]'.encode("cp1252"), "save the file as UTF-8"),
        (b"[" * 100_000, "is not JSON"),
        (b'[{"index": 3, "x": "milling"}]', "no column has the class: index, x"),
        (b"[]", "no row has a class"),
    ],
)
def test_other_json_is_refused(campaign: mm.Campaign, tmp_path: Path, content: bytes, message: str) -> None:
    file = tmp_path / "export.json"
    file.write_bytes(content)
    with pytest.raises(mm.InvalidError, match=message):
        campaign.label(file, annotator="ana")


def test_other_tables_are_refused(campaign: mm.Campaign, tmp_path: Path) -> None:
    file = tmp_path / "labels.csv"
    for content, message in [
        ("index,class\n3,Mühle\n".encode("utf-16"), "the text is UTF-16"),
        (b"index;class\n3;ring\n", "save the file with commas"),
        (b"index,choice,annotation_id\n3,ring\n", "line 2: the row has other cells"),
        ("index,choice\n3,Mühle\n".encode("cp1252"), "line 2: the text is not UTF-8"),
        (b"index,choice\r3,ring\r" * 9_000 + "4,Mühle\r".encode("cp1252"), "line 18001: the text is not UTF-8"),
        ("index,choice\n3,Mühle\n".encode("utf-16-le"), "the text is UTF-16"),
        (b"index,choice,choice\n3,ring,ring\n", "more than one column 'choice'"),
    ]:
        file.write_bytes(content)
        with pytest.raises(mm.InvalidError, match=message):
            campaign.label(file, annotator="ana")
    with pytest.raises(mm.InvalidError, match="there is no column 'y'"):
        campaign.label({"index": [3], "class": ["ring"]}, annotator="ana", columns={"time": "y"})
    with pytest.raises(mm.InvalidError, match="columns = 'frame'"):
        campaign.label({"index": [3], "class": ["ring"]}, annotator="ana", columns={"frame": "index"})
    with pytest.raises(OSError, match=r"missing.csv"):
        campaign.label(tmp_path / "missing.csv", annotator="ana")


def test_tasks_of_label_studio_come_back_as_answers(campaign: mm.Campaign, tmp_path: Path) -> None:
    file = campaign.label_tasks(tmp_path / "new" / "tasks", indices=[3, 42], classes=["milling", "a & b"])
    written = json.loads(file.read_text())
    place = "/data/local-files/?d=tasks/pictures/example-1-00003.png"
    assert written[0] == {"data": {"image": place, "index": 3, "seed": seed(campaign, 3), "campaign": "example-1"}}
    picture = np.asarray(Image.open(file.parent / "pictures" / "example-1-00042.png"))
    assert (picture == campaign.pictures([42])[0]).all()
    interface = ElementTree.parse(file.parent / "config.xml")  # noqa: S314
    assert [choice.get("value") for choice in interface.iter("Choice")] == ["milling", "a & b", "not sure"]
    answered = [task(place, one["data"], annotation("back", "a & b")) for place, one in enumerate(written)]
    campaign.label(answered)
    assert answers(campaign, "back") == {3: "a & b", 42: "a & b"}


def test_tasks_of_fiftyone_come_back_as_answers(campaign: mm.Campaign, tmp_path: Path) -> None:
    campaign.label({3: "milling"}, annotator="first")
    folder = campaign.label_tasks(tmp_path / "set", format="fiftyone", indices=[3, 42])
    samples = json.loads((folder / "samples.json").read_text())["samples"]
    assert samples[0]["filepath"] == "data/example-1-00003.png"
    assert (folder / samples[1]["filepath"]).is_file()
    assert "milling" in json.loads((folder / "metadata.json").read_text())["info"]["classes"]
    for one in samples:
        one["ground_truth"] = {"_cls": "Classification", "label": "ring"}
    saved(folder, {"samples": samples}, "samples.json")
    campaign.label(folder, annotator="back again")
    assert answers(campaign, "back again") == {3: "ring", 42: "ring"}


def test_tasks_replace_nothing_unless_forced(campaign: mm.Campaign, tmp_path: Path) -> None:
    mine = tmp_path / "tasks.json"
    mine.write_text("mine")
    for form in ("label-studio", "fiftyone"):
        with pytest.raises(mm.InvalidError, match="is not empty"):
            campaign.label_tasks(tmp_path, format=form, indices=[3], classes=["ring"])
    assert [file.name for file in tmp_path.iterdir()] == ["tasks.json"]
    assert mine.read_text() == "mine"
    elsewhere = tmp_path / "elsewhere"
    mine.rename(elsewhere)
    mine.symlink_to(elsewhere)
    campaign.label_tasks(tmp_path, indices=[3], classes=["ring"], url="https://x.org/", force=True)
    assert json.loads(mine.read_text())[0]["data"]["image"] == "https://x.org/example-1-00003.png"
    assert elsewhere.read_text() == "mine"
    with pytest.raises(mm.InvalidError, match="format = 'coco'"):
        campaign.label_tasks(tmp_path / "new", format="coco", classes=["ring"])
    with pytest.raises(mm.NotFoundError):
        campaign.label_tasks(tmp_path / "new", indices=[1000], classes=["ring"])


# Krippendorff, "Computing Krippendorff's alpha-reliability" (2011), part C: four annotators, 12 units, missing answers.
PUBLISHED = {
    "A": [1, 2, 3, 3, 2, 1, 4, 1, 2, None, None, None],
    "B": [1, 2, 3, 3, 2, 2, 4, 1, 2, 5, None, 3],
    "C": [None, 3, 3, 3, 2, 3, 4, 2, 2, 5, 1, None],
    "D": [1, 2, 3, 3, 2, 4, 4, 1, 2, 5, 1, None],
}


def test_agreement_of_four_annotators_is_the_published_one(campaign: mm.Campaign) -> None:
    for name, given in PUBLISHED.items():
        campaign.label({unit: f"c{one}" for unit, one in enumerate(given) if one}, annotator=name)
    campaign.label({11: "not sure"}, annotator="A")
    found = campaign.agreement(list(PUBLISHED))
    assert found.alpha == pytest.approx(0.743, abs=0.001)
    assert found.individuals == 11
    assert found.pairs.slice(0, 1).to_pylist() == [
        {"first": "A", "second": "B", "both": 9, "agreed": 8, "share": pytest.approx(8 / 9)}
    ]
    assert len(found.pairs) == 6
    assert len(campaign.agreement().pairs) > 6


def test_agreement_needs_two_annotators_and_two_classes(campaign: mm.Campaign) -> None:
    campaign.label({60: "ring", 61: "ring"}, annotator="one")
    campaign.label({61: "ring", 62: "ring"}, annotator="two")
    campaign.label({63: "not sure"}, annotator="none")
    campaign.label({64: "ring"}, annotator="alone")
    alike = campaign.agreement(["one", "two"])
    assert (alike.alpha, alike.individuals, alike.pairs["share"].to_pylist()) == (None, 1, [1.0])
    apart = campaign.agreement(["one", "alone"])
    assert (apart.alpha, apart.individuals, apart.pairs["share"].to_pylist()) == (None, 0, [None])
    for names, message in [(["one", "none"], "'none': must be one of"), (["one", "one"], "two or more")]:
        with pytest.raises(mm.InvalidError, match=message):
            campaign.agreement(names)
