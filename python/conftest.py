"""A cluster of the programs in the PATH, or in the folder that MURMURATION_PROGRAMS names, for tests and examples."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import murmuration as mm

SPEC: dict[str, Any] = {
    "name": "example",
    "model": "single-sensor",
    "method": "hand-crafted",
    "world": {"horizon": 200},
    "search": {"population": 20, "generations": 5},
    "taxonomy": {"medoids": 4},
}


if folder := os.environ.get("MURMURATION_PROGRAMS"):
    os.environ["PATH"] = f"{folder}{os.pathsep}{os.environ['PATH']}"


@pytest.fixture(scope="session")
def client() -> Iterator[mm.Client]:
    """A cluster with one completed campaign, `example-1`."""
    with mm.local(workers=2, trainers=1) as client:
        client.run(SPEC)
        yield client


@pytest.fixture
def campaign(client: mm.Client) -> mm.Campaign:
    """A campaign of 5 generations of 20 individuals."""
    return client.campaign("example-1")


@pytest.fixture(autouse=True)
def names(
    request: pytest.FixtureRequest, doctest_namespace: dict[str, Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Gives docstring examples the names that they use, and a folder of their own."""
    if isinstance(request.node, pytest.Function):
        return
    monkeypatch.chdir(tmp_path)
    client = request.getfixturevalue("client")
    doctest_namespace.update(
        mm=mm, client=client, campaign=client.campaign("example-1"), spec=SPEC, token=client._token
    )
