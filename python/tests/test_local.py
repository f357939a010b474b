"""Tests that a local cluster starts, and leaves nothing behind, however its Python process ends."""

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import murmuration as mm

# A script that starts a cluster, prints the cluster's folder, and runs `then`.
SCRIPT = """
import os, signal, sys, threading, time
# Whatever started the tests may ignore it.
signal.signal(signal.SIGINT, signal.default_int_handler)
import murmuration as mm
from murmuration.v1 import campaign_pb2 as v1
client = mm.local(workers=1, trainers=0)
print(client._cluster._guard.pid, flush=True)
{then}
"""
WAITS = "time.sleep(600)"
RUNS = """
with client:
    client.run({"model": "single-sensor", "method": "random", "search": {"generations": 5_000}})
"""
SECONDS_TO_END = 30


def processes_of(session: int) -> list[int]:
    """The running processes of a session: a guard, and the processes that it started."""
    living = []
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            # After the name, which is in brackets, the file has the state, parent, group and session.
            state, _, _, its_session = (folder / "stat").read_text().rpartition(")")[2].split()[:4]
            if int(its_session) == session and state != "Z":
                living.append(int(folder.name))
    return living


def wait_until_none(session: int) -> None:
    last = time.monotonic() + SECONDS_TO_END
    while (left := processes_of(session)) and time.monotonic() < last:
        time.sleep(0.05)
    assert not left


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder for temporary files of this test's processes."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    return tmp_path


@pytest.mark.parametrize("end", ["client.close()", "del client", ""])
def test_no_file_is_left_open(end: str) -> None:
    start = "import murmuration as mm; client = mm.local(workers=0, trainers=0)"
    command = [sys.executable, "-X", "dev", "-W", "error::ResourceWarning", "-c", f"{start}; {end}"]
    ended = subprocess.run(command, check=True, capture_output=True, text=True)
    assert ended.stderr == ""


@pytest.mark.parametrize(
    "call",
    [
        lambda client: client.campaign(),
        lambda client: client.campaigns(),
        lambda client: client.evaluate("single-sensor", [[1.0, 1.0, 1.0, 1.0]]),
    ],
)
def test_who_begins_a_call_as_another_thread_closes_the_client_is_told_so(
    call: Callable[[mm.Client], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    client = mm.local(workers=0, trainers=0)
    # Another thread may close the client between the check and the call.
    monkeypatch.setattr(client.rpc, "check_open", client.close)
    with pytest.raises(mm.UnavailableError, match="closed during the call"):
        call(client)


def test_a_fork_says_nothing_of_the_cluster_that_it_cannot_know(capfd: pytest.CaptureFixture[str]) -> None:
    with mm.local(workers=0, trainers=0) as client:
        assert client._cluster is not None
        if (child := os.fork()) == 0:
            print(repr(client._cluster.why()), flush=True)
            os._exit(0)
        os.waitpid(child, 0)
    assert capfd.readouterr().out == "''\n"


def test_who_has_the_data_directory_is_said(tmp_path: Path) -> None:
    with mm.local(tmp_path, workers=0, trainers=0) as client:
        with pytest.raises(mm.ProgramError) as refused:
            mm.local(tmp_path, workers=0, trainers=0)
        assert f'murmuration.connect(access="{tmp_path / "access.json"}")' in str(refused.value)
        assert client.campaigns() == []


@contextlib.contextmanager
def cluster_of_another_process(then: str) -> Iterator[tuple["subprocess.Popen[str]", int]]:
    """A Python process with a local cluster, and the id of the guard's session."""
    script = [sys.executable, "-c", SCRIPT.format(then=then)]
    with subprocess.Popen(script, stdout=subprocess.PIPE, text=True) as python:
        try:
            assert python.stdout is not None
            session = int(python.stdout.readline())
            yield python, session
        finally:
            python.kill()


@pytest.mark.parametrize("then", [WAITS, RUNS])
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_a_signal_that_ends_python_ends_its_cluster(how: signal.Signals, then: str, temporary: Path) -> None:
    with cluster_of_another_process(then) as (python, session):
        assert len(processes_of(session)) == 2
        # By now, the process is in the middle of `then`.
        time.sleep(0.5)
        assert list(temporary.iterdir())
        python.send_signal(how)
        assert python.wait(SECONDS_TO_END) != 0
        wait_until_none(session)
        assert not list(temporary.iterdir())


@pytest.mark.parametrize("then", ["", "raise SystemExit(3)", "1 / 0", "client.close()"])
def test_python_ends_its_cluster_however_it_ends(then: str, temporary: Path) -> None:
    with cluster_of_another_process(then) as (python, session):
        python.wait(SECONDS_TO_END)
        assert not processes_of(session)
        assert not list(temporary.iterdir())


def test_a_fork_neither_ends_the_cluster_nor_keeps_it_alive(temporary: Path) -> None:
    fork = """
if (child := os.fork()) == 0:
    os.close(1)
    time.sleep(600)
print(child, flush=True)
if os.fork() == 0:
    sys.exit(0)
os.wait()
client.campaigns()
print("it answers", flush=True)
time.sleep(600)
"""
    with cluster_of_another_process(fork) as (python, session):
        assert python.stdout is not None
        child = int(python.stdout.readline())
        try:
            assert python.stdout.readline() == "it answers\n"
            python.kill()
            wait_until_none(session)
            assert not list(temporary.iterdir())
        finally:
            os.kill(child, signal.SIGKILL)


def test_a_thread_that_started_a_cluster_may_end(temporary: Path) -> None:
    del temporary
    started: list[mm.Client] = []
    import threading

    thread = threading.Thread(target=lambda: started.append(mm.local(workers=0, trainers=0)))
    thread.start()
    thread.join()
    with started[0] as client:
        time.sleep(0.2)
        assert client.campaigns() == []


def test_a_coordinator_dies_with_its_guard(temporary: Path) -> None:
    client = mm.local(workers=0, trainers=0)
    assert client._cluster is not None
    guard = client._cluster._guard.pid
    assert len(processes_of(guard)) == 2
    os.kill(guard, signal.SIGKILL)
    wait_until_none(guard)
    with pytest.raises(mm.UnavailableError, match="the local cluster has ended"):
        client.campaigns()
    client.close()
    assert not list(temporary.iterdir())


def test_a_data_directory_stays_and_is_used_by_one_process(tmp_path: Path) -> None:
    data = tmp_path / "data"
    spec = {"model": "single-sensor", "method": "random"}
    with mm.local(data, workers=0) as client:
        campaign = client.submit(spec)
        with pytest.raises(mm.ProgramError, match="only one coordinator can use a data directory"):
            mm.local(data)
    with mm.local(data, workers=0) as client:
        assert [one.id for one in client.campaigns()] == [campaign.id]
        assert client.campaign().state == "running"


def test_a_missing_program_is_an_error_that_says_where_it_was_looked_for(tmp_path: Path) -> None:
    with pytest.raises(mm.ProgramError, match=f"no program `murmuration` in {tmp_path}"):
        mm.local(programs=tmp_path)


def test_variables_of_a_shell_do_not_change_a_local_cluster(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MURMURATION_COORDINATOR", "http://127.0.0.1:1")
    monkeypatch.setenv("MURMURATION_TOKENS", "/nothing")
    monkeypatch.setenv("http_proxy", "http://127.0.0.1:1")
    with mm.local(workers=0, trainers=0) as client:
        assert client.submit({"model": "single-sensor", "method": "random"}).id == "single-sensor-1"


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_a_cluster_that_has_ended_is_said_by_every_way_to_ask(how: signal.Signals) -> None:
    with mm.local(workers=1, trainers=0) as client:
        campaign = client.submit({"model": "single-sensor", "method": "random", "search": {"generations": 5_000}})
        assert client._cluster is not None
        guard = client._cluster._guard.pid
        (coordinator,) = (process for process in processes_of(guard) if process != guard)
        timer = threading.Timer(0.5, os.kill, (coordinator, how))
        timer.start()
        with pytest.raises(mm.UnavailableError, match="the local cluster has ended"):
            campaign.wait()
        with pytest.raises(mm.UnavailableError, match="the local cluster has ended"):
            client.campaigns()
        with pytest.raises(mm.UnavailableError, match="the local cluster has ended"):
            client.command("list")


def test_a_campaign_that_waits_says_for_what(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ORT_DYLIB_PATH", "/nothing/libonnxruntime.so")
    learned = {
        "model": "single-sensor",
        "method": "latent",
        "world": {"horizon": 100},
        "dataset": {"controllers": 20},
        "training": {"recipe": {"in-batch": {"epochs": 1}}},
        "search": {"population": 5, "generations": 1},
        "taxonomy": {"medoids": 2},
    }
    with mm.local(workers=1, trainers=1) as client:
        campaign = client.submit(learned)
        timer = threading.Timer(SECONDS_TO_END, campaign.cancel)
        timer.start()
        try:
            with warnings.catch_warnings():
                warnings.filterwarnings("error", category=RuntimeWarning, message=".*/nothing/libonnxruntime.so.*")
                with pytest.raises(RuntimeWarning, match=f"campaign {campaign.id} waits"):
                    campaign.wait(progress=False)
        finally:
            timer.cancel()
