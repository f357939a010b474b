"""Puts the pages of the guide together.

Usage: guide/chapters.py PROGRAM FOLDER

FOLDER gets the input of mdbook: book.toml, and in `pages` the pages that SUMMARY.md lists, at the same paths as in the
repository, with the files that they link to. Two chapters are generated: the fields of a campaign, from the comments of
the contract, and the JSON of the commands, from the schemas that the program `murmuration` prints.
"""

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CONTRACT = [ROOT / "proto/murmuration/v1" / file for file in ("campaign.proto", "training.proto")]
# Tables that a message holds as TOML text: message, field, and the message of the table's fields.
RECIPE = "Recipe"
TEXTS = [("CampaignSpec", "training", "Training"), ("Feedback", "recipe", RECIPE)]
# Messages that a campaign file writes as a value, not as a table.
VALUES = {"SensorAngle": 'number, or "free"', "Ratio": "list of whole numbers", "Genes": "list of numbers"}
SCALARS = {
    "double": "number",
    "uint32": "whole number",
    "uint64": "whole number",
    "bool": "true or false",
    "string": "text",
}


def main() -> None:
    program, folder = sys.argv[1], Path(sys.argv[2])
    pages = folder / "pages"
    chapters = links((ROOT / "guide/SUMMARY.md").read_text())
    if missing := sorted({f"docs/{page.name}" for page in (ROOT / "docs").glob("*.md")} - set(chapters)):
        sys.exit(f"chapters.py: guide/SUMMARY.md does not list {', '.join(missing)}")
    shutil.rmtree(folder, ignore_errors=True)
    pages.mkdir(parents=True)
    for file in ("book.toml", "lines.css"):
        shutil.copy(ROOT / "guide" / file, folder)
    shutil.copy(ROOT / "guide/SUMMARY.md", pages)
    (pages / "fields.md").write_text(fields_chapter())
    (pages / "json.md").write_text(json_chapter(program))
    for page in chapters:
        if not (pages / page).exists():
            copy(page, pages)


def links(text: str) -> list[str]:
    """The addresses of a page's links and pictures, except those on the web."""
    found = re.findall(r"\]\(([^)\s]+)\)", text)
    return [link.partition("#")[0] for link in found if "://" not in link and not link.startswith("#")]


def copy(page: str, pages: Path) -> None:
    """Copies a page with the files that it links to; other pages are chapters of their own."""
    place(page, pages)
    for link in links((ROOT / page).read_text()):
        target = (ROOT / page).parent.joinpath(link).resolve()
        if target.suffix != ".md" and target.is_file():
            place(str(target.relative_to(ROOT)), pages)


def place(path: str, pages: Path) -> None:
    target = pages / path
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(ROOT / path, target)


@dataclass
class Field:
    """A field of a message."""

    kind: str
    repeated: bool
    name: str
    about: str


def definitions(text: str) -> dict[str, tuple[str, list[Field]]]:
    """The messages and enums of the contract by name: the comment of each, and its fields or values."""
    found: dict[str, tuple[str, list[Field]]] = {}
    comment: list[str] = []
    inside = ""
    is_choice = False
    for line in map(str.strip, text.splitlines()):
        if line.startswith("//"):
            comment.append(line.removeprefix("//").strip())
            continue
        about = " ".join(comment)
        if opened := re.fullmatch(r"(?:message|enum) (\w+) \{", line):
            inside = opened[1]
            found[inside] = (about, [])
        elif line.startswith("oneof "):
            is_choice = True
        elif line == "}":
            inside, is_choice = (inside if is_choice else ""), False
        elif inside and (field := re.fullmatch(r"(optional |repeated )?(\w+) (\w+) = \d+;", line)):
            # In campaign files, the alternatives of a choice have hyphens.
            name = field[3].replace("_", "-") if is_choice else field[3]
            found[inside][1].append(Field(field[2], field[1] == "repeated ", name, about))
        elif inside and (value := re.fullmatch(r"([A-Z_]+) = \d+;", line)):
            found[inside][1].append(Field("", False, value[1], about))
        comment = []
    return found


def fields_chapter() -> str:
    messages = definitions("".join(file.read_text() for file in CONTRACT))
    for message, name, kind in TEXTS:
        for field in messages[message][1]:
            field.kind = kind if field.name == name else field.kind
    lines = [
        "# Every field of a campaign",
        "",
        "This chapter is generated from the comments of the contract (`campaign.proto` and `training.proto` in",
        "`proto/murmuration/v1`). [Campaign files](docs/campaigns.md) explains the fields by topic.",
        "`murmuration show CAMPAIGN` prints every field of a campaign with its value.",
        "",
    ]
    for path, message in sections(messages):
        about, fields = messages[message][0], fields_at(path, message, messages)
        title = f"`{path}`" if path else "The file"
        lines += [f"## {title}", "", about, "", "| field | type | what it says |", "|---|---|---|"]
        lines += [f"| `{one.name}` | {type_of(one, messages)} | {cell(one.about)} |" for one in fields]
        lines.append("")
    return "\n".join(lines)


def sections(messages: dict[str, tuple[str, list[Field]]]) -> Iterator[tuple[str, str]]:
    """The tables of a campaign file with their messages, each before those within it."""
    open_tables = [("", "CampaignSpec")]
    seen = set()
    while open_tables:
        path, message = open_tables.pop(0)
        # The robot of a species has the fields of `[robot]`.
        if message in seen and message != RECIPE:
            continue
        seen.add(message)
        if messages[message][1]:
            yield path, message
        for field in fields_at(path, message, messages):
            if is_table(field, messages):
                inner = f"{path.strip('[]')}.{field.name}".strip(".")
                open_tables.append((f"[[{inner}]]" if field.repeated else f"[{inner}]", field.kind))


def fields_at(path: str, message: str, messages: dict[str, tuple[str, list[Field]]]) -> list[Field]:
    """The fields of the table at `path`. Recipes with labels are in `feedback.recipe`, others in `training.recipe`."""
    with_labels = path.startswith("[feedback.")
    fields = messages[message][1]
    return [one for one in fields if message != RECIPE or one.name.endswith("labelled") == with_labels]


def is_table(field: Field, messages: dict[str, tuple[str, list[Field]]]) -> bool:
    return field.kind in messages and field.kind not in VALUES and not is_enum(field.kind, messages)


def is_enum(kind: str, messages: dict[str, tuple[str, list[Field]]]) -> bool:
    return kind in messages and any(not value.kind for value in messages[kind][1])


def type_of(field: Field, messages: dict[str, tuple[str, list[Field]]]) -> str:
    if field.kind in SCALARS or field.kind in VALUES:
        name = SCALARS.get(field.kind) or VALUES[field.kind]
        return f"list, each a {name}" if field.repeated else name
    if is_enum(field.kind, messages):
        # The first value means unspecified.
        names = [value.name for value in messages[field.kind][1][1:]]
        prefix = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", field.kind).upper() + "_"
        return ", ".join(f"`{name.removeprefix(prefix).lower().replace('_', '-')}`" for name in names)
    return "list of tables" if field.repeated else "table"


def cell(text: str) -> str:
    return text.replace("|", "\\|")


def json_chapter(program: str) -> str:
    lines = [
        "# The JSON of every command",
        "",
        "With `--json`, a command prints one document, or one on each line. This chapter is generated from the JSON",
        "Schemas of the documents, which `murmuration schema DOCUMENT` prints. A field `a.b` is the field `b` of the",
        "object `a`; `a[]` is each item of the list `a`, and `a.*` each value of an object with names of its own.",
        "",
    ]
    for kind, about in kinds(program):
        schema = json.loads(output(program, "schema", kind))
        lines += [f"## {kind}", "", f"{about}.", "", "| field | type | contents |", "|---|---|---|"]
        lines += [f"| `{path}` | {types} | {cell(contents)} |" for path, types, contents in json_fields(schema, "")]
        lines.append("")
    return "\n".join(lines)


def output(program: str, *words: str) -> str:
    return subprocess.run([program, *words], check=True, capture_output=True, text=True).stdout


def kinds(program: str) -> list[tuple[str, str]]:
    """The kinds of documents, and the commands that print each."""
    text = " ".join(output(program, "schema", "--help").split())
    options = text.partition("Possible values:")[2].partition("Options:")[0]
    found = re.findall(r"- ([a-z-]+): (.*?)(?= - [a-z-]+: |$)", options.strip())
    if not found:
        sys.exit(f"chapters.py: `{program} schema --help` lists no documents")
    return found


def json_fields(schema: dict, path: str) -> Iterator[tuple[str, str, str]]:
    """The fields of a schema: path, type and description."""
    for name, inner in schema.get("properties", {}).items():
        yield from json_field(inner, f"{path}.{name}".strip("."))
    if isinstance(others := schema.get("additionalProperties"), dict):
        yield from json_field(others, f"{path}.*".strip("."))
    if isinstance(items := schema.get("items"), dict) and ("properties" in items or "items" in items):
        yield from json_fields(items, f"{path}[]")


def json_field(schema: dict, path: str) -> Iterator[tuple[str, str, str]]:
    yield path, json_type(schema), " ".join(schema.get("description", "").split())
    yield from json_fields(schema, path)


def json_type(schema: dict) -> str:
    if "const" in schema:
        return f"`{json.dumps(schema['const'])}`"
    if "enum" in schema:
        return ", ".join(f"`{value}`" for value in schema["enum"])
    kinds = schema.get("type", "any")
    named = kinds if isinstance(kinds, str) else " or ".join(kinds)
    if isinstance(items := schema.get("items"), dict):
        return named.replace("array", f"list of {json_type(items)}")
    return f"{named} ({schema['format']})" if schema.get("format") == "date-time" else named


if __name__ == "__main__":
    main()
