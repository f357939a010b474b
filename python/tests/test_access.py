"""Tests of access files, and of links for browsers."""

import json
import os
import subprocess
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

import murmuration as mm
from murmuration import _access, _programs


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The data directory of a coordinator, which requires its owner's token."""
    folder = tmp_path_factory.mktemp("owner") / "data"
    serve = [
        os.fspath(_programs.find(None)),
        "serve",
        "--listen",
        "127.0.0.1:0",
        "--workers",
        "1",
        "--data",
        os.fspath(folder),
    ]
    with subprocess.Popen(serve, stderr=subprocess.PIPE, text=True, env=_programs.environment()) as coordinator:
        try:
            assert coordinator.stderr is not None
            next(line for line in coordinator.stderr if "  pages:" in line)
            yield folder
        finally:
            coordinator.kill()


def test_a_client_finds_a_coordinator_by_its_access_file(data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with mm.connect(access=data / "access.json") as client:
        assert client.url.startswith("https://127.0.0.1:")
        assert client.campaigns() == []
        assert client.documents("list") == []
    monkeypatch.setenv("MURMURATION_DATA", os.fspath(data))
    with mm.connect() as client:
        assert client.campaigns() == []
    monkeypatch.setenv("MURMURATION_ACCESS", os.fspath(data / "other.json"))
    with pytest.raises(FileNotFoundError, match=r"other\.json"):
        mm.connect()


def test_a_link_logs_in_once(data: Path, client: mm.Client) -> None:
    with mm.connect(access=data / "access.json") as other:
        links = [other.link("/studies"), client.link("/studies")]
    for link in links:
        browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
        assert 'content="0;url=./studies"' in browser.open(link).read().decode()
        assert "Log out" in browser.open(link.split("/open?")[0] + "/studies").read().decode()
        with pytest.raises(urllib.error.HTTPError, match="401"):
            urllib.request.build_opener().open(link)
    assert "/open?code=" in client._repr_html_()


def test_another_certificate_and_other_files_are_refused(data: Path, tmp_path: Path) -> None:
    fields = json.loads((data / "access.json").read_text())
    file = tmp_path / "access.json"
    file.write_text(json.dumps(fields | {"fingerprint": "sha256:" + "0" * 64}))
    with pytest.raises(mm.UnavailableError, match="not the one that the access file names"):
        mm.connect(access=file)
    for wrong in ("", "[]", "{}", json.dumps(fields | {"token": 5})):
        file.write_text(wrong)
        with pytest.raises(mm.InvalidError) as raised:
            mm.connect(access=file)
        assert raised.value.field == "access"
    with pytest.raises(mm.InvalidError):
        mm.connect(fields["pages"], access=data / "access.json")
    with pytest.raises(mm.RefusedError, match="token"):
        mm.connect(fields["pages"])


def test_a_default_file_is_that_of_the_data_directory(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("MURMURATION_ACCESS", "MURMURATION_DATA"):
        monkeypatch.delenv(name, raising=False)
    assert _access.default_file() == Path("murmuration-data/access.json")
