"""Answers from other tools: tables, and exports of Label Studio and FiftyOne, as rows for `murmuration label --csv`.

The command checks the answers; this module only finds the individual, class, annotator and time of each row.
"""

from __future__ import annotations

import csv
import datetime
import io
import json
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, TypeAlias

from ._arguments import path, shown
from ._errors import InvalidError
from .v1 import campaign_pb2 as v1

Row: TypeAlias = dict[str, Any]

# Our columns that can have other names in a source.
_NAMED = ("index", "class", "annotator", "time", "seed")
# The names that other tools give to these columns, the most telling first.
_USUAL = {
    "annotator": ("annotator", "completed_by"),
    "time": ("time", "updated_at", "last_modified_at", "created_at"),
    "image": ("image", "filepath"),
}
_USUAL_CLASSES = ("choice", "label", "ground_truth", "ground_truth.label")
# Columns that only Label Studio's exports have: its column `id` has numbers of tasks.
_OF_LABEL_STUDIO = ("annotation_id", "lead_time")
_WHOLE = re.compile(r"^\+?([0-9]+)(?:\.0+)?$")
_PICTURE_NUMBER = re.compile(r"([0-9]+)\.[A-Za-z]+$")
_MOST_BYTES = 256 << 20
_READ = "a table, or an export of Label Studio (JSON, JSON-MIN or CSV) or FiftyOne (a FiftyOneDataset or CSV)"


@dataclass(frozen=True)
class Source:
    """Rows of a file or a table.

    Attributes:
        name: The name of the file or table, for errors.
        rows: The values of each row by the names of their columns, of a row of the file or of one annotation.
        places: The place of each row in the source, such as `line 3`.
        classes: Names of the columns that can have the class, if the source says which these are.
        is_of_label_studio: Whether a column `id` has numbers of Label Studio's tasks.
    """

    name: str
    rows: list[Row]
    places: list[str]
    classes: tuple[str, ...] | None = None
    is_of_label_studio: bool = False

    def error(self, place: int, message: str) -> InvalidError:
        """The error about a row. `place` counts rows from 0."""
        return InvalidError(f"{self.name}, {self.places[place]}: {message}")


@dataclass(frozen=True)
class Archive:
    """A campaign's archive, which is read only if a row has no index.

    Attributes:
        campaign: The campaign's id.
        genes: Gives the names of a controller's genes.
        individuals: Gives all individuals.
    """

    campaign: str
    genes: Callable[[], Sequence[str]]
    individuals: Callable[[], Iterable[v1.Individual]]


def is_table(answers: Mapping[Any, Any]) -> bool:
    """Whether a dict has columns or the samples of FiftyOne, and not an answer for each index."""
    return bool(answers) and all(isinstance(name, str) and not isinstance(one, str) for name, one in answers.items())


def is_file(answers: object) -> bool:
    """Whether the answers are the path of a file."""
    return isinstance(answers, (str, os.PathLike))


def plain_csv(file: Path, columns: Mapping[str, str]) -> bool:
    """Whether `murmuration label` can read a file as it is, or can say best why it cannot be read."""
    if file.is_dir() or file.suffix.lower() == ".json":
        return False
    try:
        with file.open(encoding="utf-8-sig", newline="") as lines:
            header = [name.strip() for name in next(csv.reader(lines), [])]
    except (UnicodeDecodeError, csv.Error):
        return True
    # Columns that are not separated by commas, or a text in UTF-16.
    if len(header) < 2 or any("\0" in name for name in header):
        return True
    has = set(header)
    # A column with one of our names says more than a column with another tool's name.
    is_ours = {"index", "class"} <= has and all(
        ours in has or not has.intersection(names) for ours, names in _USUAL.items()
    )
    is_labelled_set = "index" not in has and "id" in has and not has.intersection(_OF_LABEL_STUDIO)
    return not columns and (is_ours or is_labelled_set)


def source(answers: object) -> Source:
    """The rows of a table, or of an export that is a file or a document that was read from JSON.

    Raises:
        InvalidError: If it is neither.
        OSError: If the file cannot be read.
    """
    if is_file(answers):
        file = Path(path("answers", answers))
        if file.is_dir():
            file = file / "samples.json"
        return _of_json(os.fspath(file), _json(file)) if file.suffix.lower() == ".json" else _of_csv(file)
    if isinstance(answers, Mapping) and "samples" in answers:
        return _of_json("answers", answers)
    if isinstance(answers, Sequence) and answers and all(isinstance(one, Mapping) for one in answers):
        return _of_json("answers", answers)
    return _of_table(answers)


def write(found: Source, columns: Mapping[str, str], archive: Archive, to: Path) -> None:
    """Writes rows as a file for `murmuration label`, whose line n + 2 has row n.

    Args:
        found: The rows.
        columns: Names of columns of the source, by our names.
        archive: The archive with the individuals.
        to: The file to write.

    Raises:
        InvalidError: If a row does not say which individual it is about, or has several classes.
    """
    names = _names(found, columns)
    taken = {*names.values(), *_NAMED, "id"}
    individuals = _Individuals(found, names, archive)
    rows = []
    for place, row in enumerate(found.rows):
        # The command checks these cells against the individual.
        cells = {name: _cell(value) for name, value in row.items() if name not in taken}
        cells["image"] = _cell(row.get(names["image"]))
        if seed := _cell(row.get(names["seed"])):
            cells["seed"] = seed
        cells["class"] = _class(found, place, names["class"])
        # Rows without a class are ignored, and need no individual.
        cells["index"] = individuals.of(place) if cells["class"] else "0"
        cells["annotator"] = _cell(row.get(names["annotator"]))
        cells["time"] = _cell(row.get(names["time"])) or _cell(row.get("created_at"))
        rows.append(cells)
    if any("seed" in cells for cells in rows):
        # The command needs a seed in each row, or in none.
        for cells in rows:
            cells.setdefault("seed", individuals.seed(cells["index"]))
    header = dict.fromkeys(["index", "class", *(name for cells in rows for name in cells)])
    with to.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(header), restval="")
        writer.writeheader()
        writer.writerows(rows)


def explained(found: Source, error: InvalidError, file: Path) -> InvalidError:
    """An error of the command about the written file, in the words of the source and of Python."""
    message = str(error).replace(os.fspath(file), found.name)
    place = re.match(rf"{re.escape(found.name)}, lines? (\d+)(?: and (\d+))?", message)
    if place:
        rows = [int(line) - 2 for line in place.groups() if line]
        if all(0 <= row < len(found.places) for row in rows):
            words = " and ".join(found.places[row] for row in rows)
            message = f"{found.name}, {words}{message[place.end() :]}"
    return in_python(error.reworded(message))


def in_python(error: InvalidError) -> InvalidError:
    """An error of the command with the arguments of `Campaign.label` instead of options."""
    message = re.sub(r"--columns (\w+)=(\w+)", r'`columns={"\1": "\2"}`', str(error))
    return error.reworded(message.replace("--annotator", "`annotator`"))


class _Individuals:
    """Finds the individual of each row: by its index, its seed, its controller, or the name of a picture of ours."""

    def __init__(self, found: Source, names: Mapping[str, str], archive: Archive) -> None:
        self._found = found
        self._names = names
        self._archive = archive
        # `Campaign.label_tasks` names pictures so.
        self._own_picture = re.compile(rf"(?:.*[/\\-])?{re.escape(archive.campaign)}-(\d+)\.png")

    @cached_property
    def _genes(self) -> Sequence[str]:
        return self._archive.genes()

    @cached_property
    def _seeds(self) -> dict[float, int]:
        return {one.index: one.seed for one in self._archive.individuals()}

    def seed(self, index: str) -> str:
        """The seed of an individual; that of no individual if the index is not in the archive."""
        number = _number(index)
        return str(self._seeds.get(-1.0 if number is None else number, 0))

    @cached_property
    def _known(self) -> dict[str | tuple[float, ...], list[int]]:
        """The individuals with a seed or with a controller."""
        known: dict[str | tuple[float, ...], list[int]] = {}
        for one in self._archive.individuals():
            known.setdefault(str(one.seed), []).append(one.index)
            known.setdefault(tuple(one.controller), []).append(one.index)
        return known

    def of(self, place: int) -> str:
        """The index of a row's individual, as the source has it."""
        row = self._found.rows[place]
        seed = _cell(row.get(self._names["seed"]))
        campaign = _cell(row.get("campaign"))
        if campaign and campaign != self._archive.campaign and not seed:
            raise self._found.error(place, f"campaign = {shown(campaign)}: must be {self._archive.campaign}")
        given = _cell(row.get(self._names["index"]))
        if given:
            number = _WHOLE.search(given)
            if not number and self._names["index"] != "index":
                number = _PICTURE_NUMBER.search(given)
            # An index has one text, so that the command finds two answers about it.
            return str(int(number[1])) if number else given
        if found := self._described(place, row, seed):
            return found
        if picture := self._own_picture.fullmatch(_cell(row.get(self._names["image"]))):
            return str(int(picture[1]))
        fields = ", ".join(name for name, value in row.items() if _cell(value))
        image = self._names["image"]
        column = f'"{image}"' if _PICTURE_NUMBER.search(_cell(row.get(image))) else "NAME"
        raise self._found.error(
            place,
            f"nothing says which individual the row is about (its fields are {fields}): add a field index or seed; "
            f'`columns={{"index": {column}}}` names another field, or takes the numbers of pictures\' names',
        )

    def _described(self, place: int, row: Row, seed: str) -> str:
        """The index of the individual with the row's seed or controller; empty if the row has neither."""
        field, value = self._names["seed"], seed
        key: str | tuple[float, ...] = re.sub(r"\.0+$", "", seed)
        if not seed:
            genes = [gene for name in self._genes if (gene := _number(row.get(name))) is not None]
            if len(genes) < len(self._genes):
                return ""
            field, value, key = "the controller", ", ".join(map(str, genes)), tuple(genes)
        same = self._known.get(key, [])
        if not same:
            rounded = ", or a spreadsheet has rounded the seed" if seed else ""
            limit = f"that of an individual of {self._archive.campaign}: the row belongs to another archive{rounded}"
            raise self._found.error(place, f"{field} = {shown(value)}: must be {limit}")
        if len(same) > 1:
            indices = " and ".join(map(str, same[:2]))
            raise self._found.error(
                place, f"{field} = {shown(value)}: individuals {indices} have it: add a field index"
            )
        number = _cell(row.get("id"))
        if number and not self._found.is_of_label_studio and _number(number) != same[0]:
            raise self._found.error(place, f"id = {shown(number)}: must be {same[0]}, the individual with this {field}")
        return str(same[0])


def _of_json(name: str, document: object) -> Source:
    if isinstance(document, Mapping) and isinstance(document.get("samples"), list):
        return _of_samples(name, document["samples"])
    if isinstance(document, list) and all(isinstance(one, Mapping) for one in document):
        if any(isinstance(task.get("annotations"), list) for task in document):
            return _of_tasks(name, document)
        places = [f"record {number}" for number in range(1, len(document) + 1)]
        return _flat(name, [dict(row) for row in document], places)
    raise InvalidError.of(name, "another document", _READ)


def _of_tasks(name: str, tasks: Sequence[Mapping[str, Any]]) -> Source:
    """The annotations of Label Studio's tasks, without those that annotators skipped."""
    rows, places = [], []
    classes: dict[str, None] = {}
    for number, task in enumerate(tasks, 1):
        data = task.get("data")
        for annotation in task.get("annotations") or ():
            if not isinstance(annotation, Mapping) or annotation.get("was_cancelled"):
                continue
            row = dict(data) if isinstance(data, Mapping) else {}
            # Fields of the task's data are no annotator and no time.
            for field in ("annotator", "time", "last_modified_at"):
                row.pop(field, None)
            row |= {key: annotation.get(key) for key in ("completed_by", "created_at", "updated_at")}
            for result in annotation.get("result") or ():
                if isinstance(result, Mapping) and result.get("type") == "choices":
                    control = str(result.get("from_name"))
                    classes[control] = None
                    row[control] = result.get("value")
            rows.append(row)
            places.append(f"task {task.get('id', number)}, annotation {annotation.get('id', len(rows))}")
    return Source(name, rows, places, tuple(classes), is_of_label_studio=True)


def _of_samples(name: str, samples: Sequence[Any]) -> Source:
    """The samples of a FiftyOneDataset."""
    rows, places = [], []
    classes: dict[str, None] = {}
    for number, sample in enumerate(samples):
        if not isinstance(sample, Mapping):
            raise InvalidError(f"{name}: sample {number} is no object")
        row = {field: value for field, value in sample.items() if field not in ("id", "_id")}
        for field, value in row.items():
            if isinstance(value, Mapping) and value.get("_cls") in ("Classification", "Classifications"):
                classes[field] = None
        rows.append(row)
        places.append(f"sample {number}")
    return Source(name, rows, places, tuple(classes))


def _of_csv(file: Path) -> Source:
    rows, places = [], []
    try:
        reader = csv.DictReader(io.StringIO(_text(file), newline=""))
        header = [name.strip() for name in reader.fieldnames or ()]
        if repeated := [name for place, name in enumerate(header) if name in header[:place]]:
            raise InvalidError(f"{file}, line 1: there is more than one column {repeated[0]!r}")
        for row in reader:
            if None in row or None in row.values():
                raise InvalidError(f"{file}, line {reader.line_num}: the row has other cells than the header")
            rows.append({column.strip(): cell for column, cell in row.items()})
            places.append(f"line {reader.line_num}")
    except csv.Error as error:
        raise InvalidError(f"{file}: {error}") from None
    return _flat(os.fspath(file), rows, places)


def _of_table(table: Any) -> Source:  # noqa: ANN401
    rows = _rows_of_table(table)
    return _flat("answers", rows, [f"row {place}" for place in range(len(rows))])


def _rows_of_table(table: Any) -> list[Row]:  # noqa: ANN401
    """The rows of a table of pandas, polars or pyarrow, or of a dict of columns."""
    if isinstance(table, Mapping):
        columns = {str(name): list(values) for name, values in table.items() if not isinstance(values, str)}
        if len(columns) == len(table) and len({len(values) for values in columns.values()}) == 1:
            return [dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)]
    elif hasattr(table, "to_pylist") and hasattr(table, "column_names"):
        return list(table.to_pylist())
    elif hasattr(table, "to_dicts"):
        return list(table.to_dicts())
    elif hasattr(table, "to_dict") and hasattr(table, "columns"):
        rows = table.to_dict("records")
        return [{str(name).strip(): value for name, value in row.items()} for row in rows]
    raise InvalidError.of("answers", shown(type(table).__name__), _READ)


def _flat(name: str, rows: list[Row], places: list[str]) -> Source:
    is_of_label_studio = any(column in row for row in rows for column in _OF_LABEL_STUDIO)
    return Source(name, rows, places, is_of_label_studio=is_of_label_studio)


def _text(file: Path) -> str:
    if file.stat().st_size > _MOST_BYTES:
        raise InvalidError(f"{file} has more than {_MOST_BYTES >> 20} MiB")
    content = file.read_bytes()
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = len(re.findall(rb"\r\n|\r|\n", content[: error.start])) + 1
        raise InvalidError(f"{file}, line {line}: the text is not UTF-8: save the file as UTF-8") from None


def _json(file: Path) -> Any:  # noqa: ANN401
    text = _text(file)
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InvalidError(f"{file} is not JSON: {error}") from None


def _names(found: Source, columns: Mapping[str, str]) -> dict[str, str]:
    """The names of our columns in the source.

    Raises:
        InvalidError: If a column that `columns` names does not exist, or several columns can have the class.
    """
    has = dict.fromkeys(name for row in found.rows for name in row)
    for ours, name in columns.items():
        if ours not in _NAMED:
            raise InvalidError.of("columns", shown(ours), f"names for columns among {', '.join(_NAMED)}")
        if found.rows and name not in has:
            raise InvalidError(f"{found.name}: there is no column {name!r}; its columns are {', '.join(has)}")
    usual = {ours: next((name for name in names if name in has), ours) for ours, names in _USUAL.items()}
    names = {"index": "index", "seed": "seed", **usual, **columns}
    if "class" not in names:
        names["class"] = _class_column(found, list(has))
    return names


def _class_column(found: Source, has: list[str]) -> str:
    """The name of the column of the classes."""
    candidates = found.classes if found.classes is not None else _USUAL_CLASSES
    possible = [name for name in candidates if name in has]
    if "class" in (has if found.classes is None else possible) or not found.rows:
        return "class"
    if len(possible) == 1:
        return possible[0]
    what = f"{', '.join(possible)} can be the class" if possible else f"no column has the class: {', '.join(has)}"
    raise InvalidError(f'{found.name}: {what}; `columns={{"class": NAME}}` names the column')


def _class(found: Source, place: int, column: str) -> str:
    """The class of a row; empty if the row has none."""
    value = found.rows[place].get(column)
    choices = _choices(value)
    if len(choices) > 1:
        given = shown(", ".join(choices))
        raise found.error(place, f"{column} = {given}: must be one class; this is an answer of several choices")
    return choices[0] if choices else ""


def _choices(value: object) -> list[str]:
    """The classes in a value: a text, a list of choices, or an object of Label Studio or FiftyOne with these."""
    if isinstance(value, str) and value.lstrip().startswith('{"choices"'):
        with suppress(ValueError):
            return _choices(json.loads(value))
    if isinstance(value, Mapping):
        for field in ("choices", "classifications", "label"):
            if field in value:
                return _choices(value[field])
    if isinstance(value, (list, tuple)):
        return [choice for one in value for choice in _choices(one)]
    cell = _cell(value)
    return [cell] if cell else []


def _cell(value: object) -> str:
    """The text of a cell, on one line; empty for no value."""
    if isinstance(value, Mapping):
        # The person of an annotation, or a time as MongoDB writes it.
        for field in ("email", "$date", "id"):
            if field in value:
                return _cell(_time(value[field]) if field == "$date" else value[field])
        return json.dumps(value, default=str)
    if isinstance(value, (list, tuple)):
        return json.dumps(value, default=str)
    cell = " ".join((value.isoformat() if isinstance(value, datetime.datetime) else str(value)).split())
    # Values of numpy and pandas for "no value"; such a word in a text is checked by the command.
    return "" if not isinstance(value, str) and cell in ("None", "nan", "NaT", "<NA>") else cell


def _time(value: object) -> object:
    """A time in milliseconds since 1970 as a text; another value unchanged."""
    if isinstance(value, int):
        return datetime.datetime.fromtimestamp(value / 1000, datetime.timezone.utc)
    return value


def _number(value: object) -> float | None:
    """The number in a cell."""
    try:
        return float(_cell(value))
    except ValueError:
        return None
