"""Campaigns on a learned embedding. They use the ONNX Runtime of the Python package."""

import os
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import onnxruntime
import pytest

import murmuration as mm
from conftest import SPEC
from murmuration import _programs

LATENT = SPEC | {
    "name": "latent",
    "method": "latent",
    "dataset": {"controllers": 60},
    "training": {"recipe": {"in-batch": {"epochs": 1}}},
}


def test_an_embedding_is_learned_and_refined(client: mm.Client, tmp_path: Path) -> None:
    campaign = client.run(LATENT)
    embeddings = mm.matrix(campaign.archive()["embedding"])
    assert embeddings.dtype == np.float32 and embeddings.shape == (100, 5)
    assert np.isfinite(embeddings).all() and np.ptp(embeddings, axis=0).min() > 0

    file = campaign.embedder(tmp_path / "embedder.onnx")
    columns = campaign.pictures().swapaxes(-1, -2)[:, None].astype(np.float32)
    [embedded] = onnxruntime.InferenceSession(file).run(None, {"images": columns})
    np.testing.assert_allclose(embedded, embeddings, atol=1e-4)

    with pytest.raises(mm.RefusedError):
        campaign.refine()
    campaign.label({index: "left" if index % 2 else "right" for index in range(20)}, annotator="ana")
    campaign.refine()
    campaign.wait()
    assert campaign.status().rounds_done == 1
    assert (mm.matrix(campaign.archive()["embedding"])[:100] != embeddings).any()


def test_the_library_of_the_package_is_used_unless_another_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ORT_DYLIB_PATH", raising=False)
    found = find_spec("onnxruntime")
    assert found is not None and found.origin is not None
    library = Path(_programs.environment()["ORT_DYLIB_PATH"])
    assert library.is_file() and library.parent == Path(found.origin).parent / "capi"
    monkeypatch.setenv("ORT_DYLIB_PATH", "/another/libonnxruntime.so")
    assert _programs.environment()["ORT_DYLIB_PATH"] == "/another/libonnxruntime.so"


def test_the_runtime_tells_nobody_about_the_machine(client: mm.Client) -> None:
    assert client._cluster is not None
    session = client._cluster._guard.pid
    children = Path(f"/proc/{session}/task/{session}/children").read_text().split()
    variables = Path(f"/proc/{children[0]}/environ").read_bytes().split(b"\0")
    assert (b"ORT_DISABLE_TELEMETRY=" + os.environ.get("ORT_DISABLE_TELEMETRY", "1").encode()) in variables


def test_a_campaign_without_an_embedder_says_so(client: mm.Client, tmp_path: Path) -> None:
    with pytest.raises(mm.NotFoundError, match="example-1 has no embedder"):
        client.campaign("example-1").embedder(tmp_path / "embedder.onnx")
    assert not list(tmp_path.iterdir())
