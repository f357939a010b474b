"""Tests of a coordinator in another process, with TLS and tokens."""

import os
import re
import socket
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from fake_coordinator import coordinator

import murmuration as mm
from conftest import SPEC
from murmuration import _client, _programs
from murmuration.v1 import campaign_pb2 as v1


@dataclass
class Elsewhere:
    """A coordinator's URL, the certificate of its authority, and an operator's token."""

    url: str
    ca: Path
    token: str


@pytest.fixture(scope="module")
def elsewhere(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Elsewhere]:
    """A coordinator with certificates and tokens."""
    folder = tmp_path_factory.mktemp("elsewhere")
    program = os.fspath(_programs.find(None))
    subprocess.run([program, "certs", "certs"], cwd=folder, check=True, capture_output=True)
    made = subprocess.run([program, "token", "ana", "--role", "operator"], check=True, capture_output=True, text=True)
    (folder / "tokens.toml").write_text(made.stdout)
    token = re.search(r"mur_\S+", made.stderr)
    assert token is not None
    serve = [program, "serve", "--listen", "127.0.0.1:0", "--workers", "1", "--trainers", "0"]
    secured = ["--certificate", "certs/server.pem", "--key", "certs/server-key.pem", "--tokens", "tokens.toml"]
    with subprocess.Popen(
        [*serve, *secured], cwd=folder, stderr=subprocess.PIPE, text=True, env=_programs.environment()
    ) as coordinator:
        try:
            assert coordinator.stderr is not None
            url = next(found[0] for line in coordinator.stderr if (found := re.search(r"https://\S+", line)))
            yield Elsewhere(url, folder / "certs/ca.pem", token[0])
        finally:
            coordinator.kill()


def test_a_campaign_runs_over_tls_with_a_token(elsewhere: Elsewhere, campaign: mm.Campaign, tmp_path: Path) -> None:
    with mm.connect(elsewhere.url, ca=elsewhere.ca, token=elsewhere.token) as client:
        there = client.run(SPEC)
        assert there.digest() == campaign.digest()
        # Other tests label the campaign, so the classes may differ.
        assert there.archive().drop(["class"]).equals(campaign.archive().drop(["class"]))
        assert there.report(tmp_path / "report").is_file()


def test_a_connection_without_what_the_coordinator_asks_for_is_refused(elsewhere: Elsewhere, tmp_path: Path) -> None:
    with pytest.raises(mm.RefusedError, match="token"):
        mm.connect(elsewhere.url, ca=elsewhere.ca)
    with pytest.raises(mm.RefusedError):
        mm.connect(elsewhere.url, ca=elsewhere.ca, token="mur_" + "A" * 43)
    with pytest.raises(mm.InvalidError) as raised:
        mm.connect(elsewhere.url)
    assert raised.value.field == "ca"
    subprocess.run([_programs.find(None), "certs", tmp_path / "others"], check=True, capture_output=True)
    with pytest.raises(mm.UnavailableError):
        mm.connect(elsewhere.url, ca=tmp_path / "others/ca.pem", token=elsewhere.token)


@pytest.mark.parametrize("url", ["127.0.0.1:7700", "ftp://127.0.0.1", "http://", "http://127.0.0.1:7700/campaigns"])
def test_a_url_that_is_none_is_an_error(url: str) -> None:
    with pytest.raises(mm.InvalidError, match="http://HOST:PORT"):
        mm.connect(url)


def test_a_coordinator_that_does_not_answer_is_an_error() -> None:
    with pytest.raises(mm.UnavailableError, match="no coordinator answers at"):
        mm.connect("http://127.0.0.1:1")


def test_what_takes_the_call_and_answers_nothing_is_no_coordinator(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_client, "_SECONDS_TO_ANSWER", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as silent, pytest.raises(mm.UnavailableError, match="no coordinator"):
        mm.connect(f"http://127.0.0.1:{silent.getsockname()[1]}")
    # The coordinator ends the call successfully: first without a message, then after one message too many.
    for answers, error in (([], mm.AnswerError), ([v1.Campaign(id="told-1")] * 2, mm.MurmurationError)):
        with coordinator({"CampaignService/GetCampaign": answers}) as url, pytest.raises(error):
            mm.connect(url)
