"""Writes pictures of individuals as tasks for Label Studio and FiftyOne."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from ._arguments import shown
from ._errors import InvalidError
from ._html import png


@dataclass(frozen=True)
class Task:
    """An individual to label.

    Attributes:
        name: The name of its picture's file.
        picture: Grey values, uint8 (side, side).
        data: What identifies the individual: `index`, `seed` as a text, because many tools round large numbers, and
            `campaign`.
    """

    name: str
    picture: npt.NDArray[np.uint8]
    data: dict[str, Any]


def tasks(
    campaign: str, indices: Iterable[int], seeds: Iterable[int], pictures: npt.NDArray[np.uint8]
) -> Iterator[Task]:
    """The tasks of individuals; channels of a picture are merged."""
    grey = pictures.max(axis=1) if pictures.ndim == 4 else pictures
    for index, seed, picture in zip(indices, seeds, grey, strict=True):
        data = {"index": index, "seed": str(seed), "campaign": campaign}
        yield Task(f"{campaign}-{index:05d}.png", picture, data)


def write(form: str, folder: Path, found: Sequence[Task], classes: Sequence[str], url: str | None, force: bool) -> Path:
    """Writes tasks into a folder, and returns the path of the file to import: the folder itself for FiftyOne.

    Raises:
        InvalidError: If `form` is unknown, or the folder is not empty and `force` is false.
        OSError: If the folder cannot be written.
    """
    if form not in _FORMS:
        raise InvalidError.of("format", shown(form), f"one of {', '.join(map(repr, _FORMS))}")
    with suppress(FileNotFoundError):
        if not force and any(folder.iterdir()):
            raise InvalidError(f"{folder} is not empty: name a new folder, or replace its tasks with `force=True`")
    return _FORMS[form](folder, found, classes, url, force)


def _label_studio(folder: Path, found: Sequence[Task], classes: Sequence[str], url: str | None, force: bool) -> Path:
    # Label Studio serves files below its LOCAL_FILES_DOCUMENT_ROOT at this address.
    place = f"/data/local-files/?d={folder.resolve().name}/pictures/" if url is None else url
    _write_pictures(folder / "pictures", found, force)
    view = ElementTree.Element("View")
    ElementTree.SubElement(view, "Image", name="image", value="$image")
    choices = ElementTree.SubElement(view, "Choices", name="class", toName="image", choice="single")
    for name in (*classes, "not sure"):
        ElementTree.SubElement(choices, "Choice", value=name)
    ElementTree.indent(view)
    _write(folder / "config.xml", ElementTree.tostring(view), force)
    document = [{"data": {"image": f"{place}{task.name}", **task.data}} for task in found]
    return _write(folder / "tasks.json", json.dumps(document, indent=1).encode(), force)


def _fiftyone(folder: Path, found: Sequence[Task], classes: Sequence[str], _url: str | None, force: bool) -> Path:
    _write_pictures(folder / "data", found, force)
    samples = [{"filepath": f"data/{task.name}", "tags": [], **task.data} for task in found]
    # Without a version, FiftyOne reads the fields of the samples themselves.
    about = {"media_type": "image", "info": {"classes": [*classes, "not sure"]}}
    _write(folder / "metadata.json", json.dumps(about).encode(), force)
    _write(folder / "samples.json", json.dumps({"samples": samples}, indent=1).encode(), force)
    return folder


_FORMS: dict[str, Callable[[Path, Sequence[Task], Sequence[str], str | None, bool], Path]] = {
    "label-studio": _label_studio,
    "fiftyone": _fiftyone,
}


def _write_pictures(folder: Path, found: Sequence[Task], force: bool) -> None:
    for task in found:
        _write(folder / task.name, png(task.picture), force)


def _write(file: Path, content: bytes, force: bool) -> Path:
    """Writes a file that does not exist, or with `force` in place of the file of this name."""
    file.parent.mkdir(parents=True, exist_ok=True)
    if not force:
        with file.open("xb") as new:
            new.write(content)
        return file
    # A link of the file's name is replaced, and not followed.
    part = file.with_name(f".{file.name}.part")
    part.unlink(missing_ok=True)
    with part.open("xb") as new:
        new.write(content)
    return part.replace(file)
