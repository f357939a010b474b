"""Tests of coordinators whose mirror and checkpoints are in a bucket, on moto's S3 server."""

import os
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import pytest
from moto.server import ThreadedMotoServer

import murmuration as mm
from conftest import SPEC

MIRROR = "s3://swarms/mirror"
LONGER = SPEC | {"search": {"population": 20, "generations": 100}}
MODEL = Path(__file__).parents[2] / "tests/models/small.onnx"


@dataclass
class Bucket:
    """A server with the bucket `swarms`."""

    server: ThreadedMotoServer
    url: str

    def post(self, path: str, body: bytes = b"", method: str = "POST") -> None:
        """Sends a request to the server itself."""
        headers = {"Content-Type": "application/octet-stream"}
        request = urllib.request.Request(f"{self.url}{path}", data=body, headers=headers, method=method)  # noqa: S310
        with urllib.request.urlopen(request):  # noqa: S310
            pass

    def serve(self, data: Path, *options: str) -> subprocess.Popen[bytes]:
        """A coordinator that listens, or has ended. It logs to a file beside its data directory."""
        variables = {
            "AWS_ENDPOINT": self.url,
            "AWS_ALLOW_HTTP": "true",
            "AWS_ACCESS_KEY_ID": "somebody",
            "AWS_SECRET_ACCESS_KEY": "something",
            "AWS_REGION": "us-east-1",
        }
        command = ["murmuration", "serve", "--listen", "127.0.0.1:0", "--workers", "1", "--trainers", "0"]
        log = data.with_suffix(".log")
        with log.open("w") as stderr:
            process = subprocess.Popen(
                [*command, "--data", str(data), "--mirror", MIRROR, *options],
                env=os.environ | variables,
                stderr=stderr,
            )
        while "pages:" not in log.read_text() and process.poll() is None:
            time.sleep(0.05)
        return process


@pytest.fixture
def bucket() -> Iterator[Bucket]:
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0)
    server.start()
    host, port = server.get_host_and_port()
    bucket = Bucket(server, f"http://{host}:{port}")
    try:
        bucket.post("/moto-api/reset")
        bucket.post("/swarms", method="PUT")
        yield bucket
    finally:
        server.stop()


def connect(data: Path) -> mm.Client:
    return mm.connect(access=data / "access.json")


def test_a_coordinator_goes_on_from_a_bucket(bucket: Bucket, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with mm.local(workers=2, trainers=0) as client:
        undisturbed = client.run(LONGER).digest()
    # Commands of a client have nothing to do with this folder.
    monkeypatch.chdir(tmp_path)
    first = bucket.serve(tmp_path / "first")
    try:
        with connect(tmp_path / "first") as client:
            client.command("checkpoints", "import", str(MODEL))
            campaign = client.submit(LONGER)
            while campaign.status().generations_done < 4:
                pass
            campaign.label({0: "ring", 3: "clump"}, annotator="ana")
    finally:
        first.kill()
        first.wait()
    second = bucket.serve(tmp_path / "second", "--from-mirror")
    try:
        with connect(tmp_path / "second") as client:
            campaign = client.campaign()
            assert campaign.labels()["answer"].to_pylist() == ["ring", "clump"]
            assert campaign.wait(progress=False).digest() == undisturbed
            (checkpoint,) = client.documents("checkpoints", "list")
            client.command("checkpoints", "export", checkpoint["digest"], str(tmp_path / "copy.onnx"))
            assert (tmp_path / "copy.onnx").read_bytes() == MODEL.read_bytes()
    finally:
        second.terminate()
        assert second.wait() == 0
    assert not (tmp_path / "murmuration-data").exists()


def test_without_its_bucket_a_coordinator_acknowledges_no_decision(bucket: Bucket, tmp_path: Path) -> None:
    process = bucket.serve(tmp_path / "data")
    try:
        with connect(tmp_path / "data") as client, ThreadPoolExecutor() as threads:
            campaign = client.run(SPEC)
            bucket.server.stop()
            waiting = threads.submit(campaign.label, {0: "ring"}, annotator="ana")
            # The coordinator learns of the outage from the first label.
            while "the mirror does not work" not in (tmp_path / "data.log").read_text():
                time.sleep(0.05)
            with pytest.raises(mm.MurmurationError, match="mirror s3://swarms/mirror does not work"):
                campaign.label({1: "ring"}, annotator="ana")
            assert not waiting.done()
            port = int(bucket.url.rpartition(":")[2])
            bucket.server = ThreadedMotoServer(ip_address="127.0.0.1", port=port)
            bucket.server.start()
            waiting.result()
            campaign.label({2: "ring"}, annotator="ana")
    finally:
        process.kill()
        process.wait()
    process = bucket.serve(tmp_path / "other", "--from-mirror")
    try:
        with connect(tmp_path / "other") as client:
            assert client.campaign().labels()["index"].to_pylist() == [0, 2]
    finally:
        process.terminate()
        process.wait()


def test_wrong_credentials_are_named(bucket: Bucket, tmp_path: Path) -> None:
    bucket.post("/moto-api/reset-auth", b"0")
    try:
        process = bucket.serve(tmp_path / "data")
        assert process.returncode == 1
        heard = (tmp_path / "data.log").read_text()
        assert MIRROR in heard, heard
        assert "InvalidAccessKeyId" in heard or "403" in heard, heard
    finally:
        bucket.post("/moto-api/reset-auth", b"inf")
