"""Tests of workers on Dask and Ray clusters: they follow the cluster's machines, and change no result."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import murmuration as mm
from conftest import SPEC
from murmuration._workers import WorkerProcess

LONGER = SPEC | {"name": "hosted", "search": {"population": 20, "generations": 150}}
SECONDS = 300


def wait_until(holds: Callable[[], bool]) -> None:
    last = time.monotonic() + SECONDS
    while not holds():
        assert time.monotonic() < last, "it took too long"
        time.sleep(0.05)


@pytest.fixture
def ray_address(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A Ray cluster with two CPUs, in a process of its own, whose end is the end of all processes of the cluster."""
    monkeypatch.setenv("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
    monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")
    monkeypatch.setenv("RAY_AUTH_MODE", "disabled")
    start = "import ray, sys; context = ray.init(num_cpus=2, include_dashboard=False, configure_logging=False); "
    start += "print('at', context.address_info['gcs_address'], flush=True); sys.stdin.read()"
    # Ray itself waits for its processes for 30 s at most, which is short on a busy machine.
    for _ in range(5):
        command = [sys.executable, "-c", start]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as head:
            assert head.stdout is not None
            for line in head.stdout:
                if line.startswith("at "):
                    yield line.split()[1]
                    head.kill()
                    return
    pytest.fail("Ray does not start")


@pytest.fixture(autouse=True)
def patient_dask() -> Iterator[None]:
    import dask
    import distributed  # noqa: F401  (its configuration must be there already)

    limits = dict.fromkeys(("distributed.comm.timeouts.connect", "distributed.comm.timeouts.tcp"), "120s")
    with dask.config.set(limits):
        yield


def workers(client: mm.Client) -> list[mm.Worker]:
    return [worker for worker in client.workers() if worker.kind == "worker" and worker.threads]


@pytest.fixture(scope="module")
def digest() -> str:
    """The digest of the campaign on one machine."""
    with mm.local(workers=2, trainers=0) as client:
        return client.run(LONGER).digest()


def test_on_dask_each_worker_has_a_worker_of_ours_and_a_killed_one_is_replaced(digest: str) -> None:
    import distributed

    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as dask,
        mm.on_dask(dask, trainers=0) as client,
    ):
        wait_until(lambda: len(workers(client)) == 2)
        assert all(worker.name.startswith("dask ") for worker in workers(client))

        # Dask sends local functions by value: its workers do not have this module.
        def process(dask_worker: Any) -> Any:  # noqa: ANN401
            plugins = dask_worker.plugins.items()
            return next(plugin for name, plugin in plugins if name.startswith("murmuration-"))._process.process

        before = set(dask.run(process).values())
        victim = next(iter(dask.run(os.getpid).values()))
        campaign = client.submit(LONGER)
        wait_until(lambda: campaign.status().generations_done > 3)
        os.kill(victim, signal.SIGKILL)
        assert campaign.status().generations_done < LONGER["search"]["generations"]
        # Dask starts the killed process again.
        wait_until(lambda: len(set(dask.run(process, on_error="ignore").values()) - before - {None}) == 1)
        cluster.scale(3)
        wait_until(lambda: len(workers(client)) == 3)
        assert campaign.wait(progress=False).digest() == digest
        cluster.scale(1)
        wait_until(lambda: len(workers(client)) == 1)


def test_a_later_dask_worker_without_programs_is_told(caplog: pytest.LogCaptureFixture, tmp_path: Path) -> None:
    import distributed

    with (
        distributed.LocalCluster(n_workers=0, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as dask,
        mm.on_dask(dask, trainers=0, programs_there=str(tmp_path)) as client,
    ):
        cluster.scale(1)
        wait_until(lambda: "takes no work" in caplog.text)
        assert "name the folder that it is in (`programs_there`)" in caplog.text
        assert not workers(client)


def test_dask_scales_by_the_open_work() -> None:
    import distributed

    with (
        distributed.LocalCluster(n_workers=0, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as dask,
        mm.on_dask(dask, trainers=0) as client,
    ):
        cluster.adapt(
            Adaptive=mm.DaskAdaptive,
            murmuration=client,
            seconds=600,
            minimum=0,
            maximum=2,
            interval="200ms",
            wait_count=3,
        )
        assert client.workers_wanted() == 0
        campaign = client.submit(LONGER | {"name": "scaled"})
        wait_until(lambda: client.workers_wanted() == 1)
        wait_until(lambda: len(workers(client)) >= 1)
        campaign.wait(progress=False)
        wait_until(lambda: not workers(client))


def test_workers_on_dask_end_with_the_process_of_the_dask_client(client: mm.Client) -> None:
    import distributed

    access = client.access_file
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        start = (
            f"import distributed, murmuration as mm, time; dask = distributed.Client({cluster.scheduler_address!r}); "
        )
        start += f"mm.on_dask(dask, access={str(access)!r}); time.sleep(600)"
        process = subprocess.Popen([sys.executable, "-c", start])
        try:
            wait_until(lambda: any(worker.name.startswith("dask ") for worker in workers(client)))
        finally:
            process.kill()
            process.wait()
        wait_until(lambda: not any(worker.name.startswith("dask ") for worker in workers(client)))
        assert not [name for name in cluster.scheduler.worker_plugins if name.startswith("murmuration-")]


def test_on_ray_each_node_has_a_worker_and_a_killed_one_is_replaced(digest: str, ray_address: str) -> None:
    import ray

    ray.init(ray_address, log_to_driver=False, configure_logging=False)
    try:
        with mm.on_ray(trainers=0) as client:
            wait_until(lambda: len(workers(client)) == 1)
            assert workers(client)[0].threads == 2
            (actor,) = client._end_workers.__self__.actors.values()  # type: ignore[union-attr]
            process = ray.get(actor.process.remote())
            campaign = client.submit(LONGER)
            wait_until(lambda: campaign.status().generations_done > 3)
            os.kill(process, signal.SIGKILL)
            assert campaign.status().generations_done < LONGER["search"]["generations"]
            wait_until(lambda: ray.get(actor.process.remote()) not in (None, process))
            ray.kill(actor, no_restart=False)
            assert campaign.wait(progress=False).digest() == digest
    finally:
        ray.shutdown()


def test_everything_can_be_imported_without_dask_and_ray() -> None:
    without = "import sys; sys.modules.update(distributed=None, ray=None); from murmuration import *; connect"
    subprocess.run([sys.executable, "-c", without], check=True)


def test_a_worker_process_that_ends_is_started_again(client: mm.Client, tmp_path: Path) -> None:
    access = client.access_file.read_text(encoding="utf-8")
    worker = WorkerProcess(access, "kept", 1, None)
    try:
        wait_until(lambda: any("kept" in one.name for one in client.workers()))
        first = worker.process
        assert first is not None
        os.kill(first, signal.SIGKILL)
        wait_until(lambda: worker.process not in (None, first))
    finally:
        worker.close()
    assert worker.process is None
    with pytest.raises(mm.ProgramError, match="no program"):
        WorkerProcess(access, "lost", 1, str(tmp_path))
