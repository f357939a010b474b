"""Runs the Python blocks of pages, each page as one script."""

import re
import sys
from pathlib import Path

import pytest
import tomli_w

from conftest import SPEC

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("page", ["README.md", "docs/python.md", "python/README.md"])
def test_the_blocks_of_a_page_run(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    blocks = BLOCK.findall((ROOT / page).read_text())
    assert blocks
    monkeypatch.chdir(tmp_path)
    # A smaller campaign, in place of the README's example.
    (tmp_path / "examples").mkdir()
    (tmp_path / "examples/quick.toml").write_text(tomli_w.dumps(SPEC))
    names: dict[str, object] = {}
    for block in blocks:
        exec(compile(block, page, "exec"), names)  # noqa: S102


def test_the_page_names_every_column_and_every_exception() -> None:
    text = (ROOT / "docs/python.md").read_text()
    murmuration = sys.modules["murmuration"]
    errors = [name for name in murmuration.__all__ if name.endswith("Error")]
    assert len(errors) == 9
    for name in errors:
        assert f"`{name}`" in text or f"`mm.{name}`" in text


def test_the_licence_of_the_package_is_that_of_the_repository() -> None:
    assert (ROOT / "python/LICENSE").read_bytes() == (ROOT / "LICENSE").read_bytes()
