"""Workers on a Dask cluster: one on each Dask worker, for as long as it lives."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import uuid
from collections.abc import Callable
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from ._client import Client, hosting
from ._errors import MurmurationError
from ._workers import WorkerProcess

if TYPE_CHECKING:
    import distributed

try:
    from distributed import SchedulerPlugin, WorkerPlugin
    from distributed.deploy.adaptive import Adaptive
except ImportError as missing:
    raise ImportError("`murmuration.on_dask` needs Dask: pip install murmuration[dask]") from missing


_LOG = logging.getLogger("murmuration")


class Workers(WorkerPlugin):
    """Starts a `murmuration-worker` on each Dask worker, with as many threads, and ends it with the Dask worker."""

    def __init__(self, access: str, programs: str | None) -> None:
        """`access` is the text of the coordinator's access file; `programs` the folder of the programs there."""
        self.name = f"murmuration-{uuid.uuid4().hex}"
        self._access, self._programs = access, programs
        self._process: WorkerProcess | None = None

    def setup(self, worker: distributed.Worker) -> None:
        """Starts the worker."""
        name = f"dask {worker.name}"
        try:
            self._process = WorkerProcess(self._access, name, worker.state.nthreads, self._programs)
        except MurmurationError as error:
            # Dask tells the client only of workers that are there when the plugin is registered.
            reason = str(error).replace("`programs`", "`programs_there`")
            worker.log_event(self.name, f"Dask worker {worker.name} takes no work: {reason}")
            raise

    async def teardown(self, worker: distributed.Worker) -> None:  # noqa: ARG002
        """Ends the worker, which returns the work that it has not begun."""
        if self._process is not None:
            await asyncio.to_thread(self._process.close)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_process": None}


class EndWithClient(SchedulerPlugin):
    """Ends the workers when the Dask client that started them is gone, even if its process was killed.

    The scheduler would otherwise start a worker, with the owner's token, on each Dask worker that comes later.
    """

    def __init__(self, client: str, workers: str) -> None:
        """`client` is the id of the Dask client; `workers` the name of its worker plugin."""
        self.name = f"{workers}-end"
        self._client, self._workers = client, workers

    def remove_client(self, scheduler: Any, client: str) -> None:  # noqa: ANN401
        """Ends the workers."""
        if client == self._client and self._workers in scheduler.worker_plugins:
            scheduler.loop.add_callback(scheduler.unregister_worker_plugin, comm=None, name=self._workers)


class DaskAdaptive(Adaptive):
    """Scales a Dask cluster by Murmuration's open work.

    Example:
        >>> cluster.adapt(Adaptive=mm.DaskAdaptive, murmuration=client, maximum=20)  # doctest: +SKIP
    """

    def __init__(self, cluster: Any, *, murmuration: Client, seconds: float | None = None, **options: Any) -> None:  # noqa: ANN401
        """`murmuration` is the client whose coordinator's work counts; `options` are those of Dask's `Adaptive`.

        The open work should be done within about `seconds`, by default five minutes.
        """
        self._murmuration = murmuration
        self._seconds = seconds
        super().__init__(cluster, **options)

    def _threads(self) -> int | None:
        """Threads of a Dask worker to come; None if the cluster does not say."""
        options = (getattr(self.cluster, "new_spec", None) or {}).get("options", {})
        # Clusters of dask-jobqueue have `cores` for a job of several workers.
        threads = options.get("nthreads") or int(options.get("cores") or 0) // int(options.get("processes") or 1)
        return int(threads) or None

    async def target(self) -> int:
        """How many Dask workers the open work of both could use."""
        others = int(await super().target())  # type: ignore[no-untyped-call]
        if self._murmuration.rpc.is_closed:
            return others
        try:
            wanted = await asyncio.to_thread(self._murmuration.workers_wanted, self._threads(), seconds=self._seconds)
        except MurmurationError as error:
            # The coordinator may be starting again. An error would end the scaling.
            _LOG.warning("the number of wanted workers is unknown, so it stays as it is: %s", error)
            wanted = len(self.plan)
        return max(wanted, others)


def on_dask(
    dask: distributed.Client,
    *,
    access: str | os.PathLike[str] | None = None,
    data: str | os.PathLike[str] | None = None,
    trainers: int | None = None,
    contact: str | None = None,
    programs: str | os.PathLike[str] | None = None,
    programs_there: str | None = None,
) -> Client:
    """Starts a worker on each worker of a Dask cluster, now and later, and returns a client of their coordinator.

    Without `access`, the coordinator runs on this machine, and ends with the client. The workers end when the client is
    closed, or the Dask client's process ends. A Dask worker that is lost, replaced or added loses, replaces or adds a
    worker. The programs must be on every machine of the cluster.

    Args:
        dask: The client of the Dask cluster.
        access: The access file of a coordinator that other machines reach, instead of a new coordinator.
        data: The data directory of a new coordinator; by default a temporary one.
        trainers: Number of trainers of a new coordinator, on this machine; by default one.
        contact: The name or address by which the Dask workers reach this machine; by default its address towards the
            scheduler.
        programs: The folder of the programs on this machine.
        programs_there: The folder of the programs on the Dask workers; by default where pip put them, or the PATH.

    Raises:
        ProgramError: If the coordinator cannot start, or a Dask worker has no program. A Dask worker that comes later
            without a program takes no work, and a warning of the logger `murmuration` says so.

    Example:
        >>> with mm.on_dask(dask) as client:  # doctest: +SKIP
        ...     campaign = client.run("examples/quick.toml")
    """

    def start(text: str) -> Callable[[], None]:
        plugin = Workers(text, programs_there)
        dask.subscribe_topic(plugin.name, _warn)
        try:
            dask.register_plugin(EndWithClient(dask.id, plugin.name))
            dask.register_plugin(plugin)
        except BaseException:
            # Dask keeps the plugin, and its token, for workers that come later, even if it failed on some worker.
            with contextlib.suppress(Exception):
                _unregister(dask, plugin.name)
            raise
        return lambda: _unregister(dask, plugin.name)

    if access is None and contact is None:
        contact = _address_towards(dask)
    return hosting(start, access=access, data=data, trainers=trainers, contact=contact, programs=programs)


def _warn(event: tuple[float, str]) -> None:
    _, message = event
    _LOG.warning("%s", message)


def _unregister(dask: distributed.Client, name: str) -> None:
    # A Dask cluster that has ended took the workers with it.
    if dask.status != "running":
        return
    dask.unsubscribe_topic(name)
    try:
        dask.unregister_worker_plugin(name)
    except Exception as error:
        # A Dask worker that is just starting does not have the plugin yet; the others have ended their workers.
        _LOG.warning("not every Dask worker has confirmed the end of its worker: %s", error)
    dask.unregister_scheduler_plugin(f"{name}-end")


def _address_towards(dask: distributed.Client) -> str:
    from distributed.utils import get_ip

    scheduler = urlsplit(str(dask.scheduler.address)).hostname if dask.scheduler else None
    return str(get_ip(scheduler)) if scheduler else str(get_ip())
