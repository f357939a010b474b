"""Workers on a Ray cluster: one on each node, for as long as it lives."""

from __future__ import annotations

import logging
import os
import threading
from typing import Any

from ._client import Client, hosting
from ._errors import ProgramError
from ._workers import WorkerProcess

try:
    import ray
    from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy
except ImportError as missing:
    raise ImportError("`murmuration.on_ray` needs Ray: pip install murmuration[ray]") from missing

_LOG = logging.getLogger("murmuration")
_SECONDS_TO_LOOK_AGAIN = 2.0
# Time for the first workers to begin.
_SECONDS_TO_BEGIN = 20.0
# Time that a worker has to return its work, before its actor is killed.
_SECONDS_TO_END = 40.0


class _Actor:
    """Keeps a `murmuration-worker` on its node."""

    def __init__(self, access: str, name: str, threads: int, programs: str | None) -> None:
        self._process = WorkerProcess(access, name, threads, programs)

    def process(self) -> int | None:
        return self._process.process

    def wait(self) -> None:
        self._process.wait()

    def close(self) -> None:
        self._process.close()


class Workers:
    """One worker on each node of the Ray cluster; nodes that come later get one too.

    Attributes:
        actors: The actor of each node, by the id of the node.
    """

    def __init__(self, access: str, programs: str | None) -> None:
        """`access` is the text of the coordinator's access file; `programs` the folder of the programs there.

        Raises:
            ProgramError: If a node has no program.
        """
        self._access, self._programs = access, programs
        self.actors: dict[str, Any] = {}
        # The first answer of each actor, which tells whether its worker could be started.
        self._begun: dict[str, Any] = {}
        # An answer of each actor that comes when its worker has ended for good.
        self._over: dict[str, Any] = {}
        self._left: set[str] = set()
        self._ending = threading.Event()
        self._look()
        if begun := list(self._begun.values()):
            # An actor whose node is busy begins later.
            ready, _ = ray.wait(begun, num_returns=len(begun), timeout=_SECONDS_TO_BEGIN)
            try:
                ray.get(ready)
            except ray.exceptions.RayError as error:
                self._kill()
                raise ProgramError(f"a worker cannot be started on a node: {error}") from None
        self._thread = threading.Thread(target=self._follow, name="murmuration-ray", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Ends all workers, which return the work that they have not begun."""
        self._ending.set()
        # Ray itself may not answer.
        self._thread.join(_SECONDS_TO_END)
        if not ray.is_initialized():
            return
        if ends := [actor.close.remote() for actor in list(self.actors.values())]:
            ray.wait(ends, num_returns=len(ends), timeout=_SECONDS_TO_END)
        self._kill()

    def _kill(self) -> None:
        for actor in list(self.actors.values()):
            ray.kill(actor)

    def _look(self) -> None:
        """Starts workers on nodes that have none, and forgets nodes that are gone."""
        alive = {node["NodeID"]: node for node in ray.nodes() if node["Alive"]}
        for gone in self.actors.keys() - alive.keys():
            del self.actors[gone]
            self._begun.pop(gone, None)
            self._over.pop(gone, None)
        for identifier in alive.keys() - self.actors.keys() - self._left:
            if self._ending.is_set():
                return
            threads = int(alive[identifier].get("Resources", {}).get("CPU", 0))
            if threads < 1:
                # A node for other resources, such as a head that runs no tasks.
                continue
            actor = ray.remote(_Actor).options(
                num_cpus=threads,
                max_restarts=-1,
                # One for `wait`.
                max_concurrency=2,
                scheduling_strategy=NodeAffinitySchedulingStrategy(identifier, soft=False),
            )
            name = f"ray {alive[identifier].get('NodeManagerHostname') or identifier[:8]}"
            self.actors[identifier] = actor.remote(self._access, name, threads, self._programs)
            self._begun[identifier] = self.actors[identifier].process.remote()
            self._over[identifier] = self.actors[identifier].wait.remote()

    def _check(self) -> None:
        """Logs which nodes could not start their worker."""
        for identifier, begun in list(self._begun.items()):
            if not ray.wait([begun], timeout=0)[0]:
                continue
            del self._begun[identifier]
            try:
                ray.get(begun)
            except ray.exceptions.RayError as error:
                _LOG.error("Ray's node %s has no worker, because it cannot be started there: %s", identifier, error)

    def _give_up(self) -> None:
        """Frees the CPUs of nodes whose worker has lost its coordinator for good."""
        for identifier, over in list(self._over.items()):
            if not ray.wait([over], timeout=0)[0]:
                continue
            try:
                ray.get(over)
            except ray.exceptions.RayError:
                # The actor was restarted.
                self._over[identifier] = self.actors[identifier].wait.remote()
                continue
            del self._over[identifier]
            self._left.add(identifier)
            ray.kill(self.actors.pop(identifier))
            _LOG.error(
                "Ray's node %s has no worker any more, which lost its coordinator: call on_ray again", identifier
            )

    def _follow(self) -> None:
        while not self._ending.wait(_SECONDS_TO_LOOK_AGAIN):
            if not ray.is_initialized():
                return
            try:
                self._look()
                self._check()
                self._give_up()
            except Exception as error:
                # Ray's own server may be starting again.
                _LOG.warning("Ray's nodes cannot be listed, will try again: %s", error)


def on_ray(
    *,
    access: str | os.PathLike[str] | None = None,
    data: str | os.PathLike[str] | None = None,
    trainers: int | None = None,
    contact: str | None = None,
    programs: str | os.PathLike[str] | None = None,
    programs_there: str | None = None,
) -> Client:
    """Starts a worker on each node of the Ray cluster, now and later, and returns a client of their coordinator.

    Call `ray.init` first. A worker takes all CPUs of its node, so other tasks wait until the client is closed. Without
    `access`, the coordinator runs on this machine, and ends with the client. A node that is lost or added loses or adds
    a worker, and a worker that fails is started again. The programs must be on every machine of the cluster.

    Args:
        access: The access file of a coordinator that other machines reach, instead of a new coordinator.
        data: The data directory of a new coordinator; by default a temporary one.
        trainers: Number of trainers of a new coordinator, on this machine; by default one.
        contact: The name or address by which the nodes reach this machine; by default Ray's address of it.
        programs: The folder of the programs on this machine.
        programs_there: The folder of the programs on the nodes; by default where pip put them, or the PATH.

    Raises:
        ProgramError: If the coordinator cannot start, or a node has no program.

    Example:
        >>> ray.init()  # doctest: +SKIP
        >>> with mm.on_ray() as client:  # doctest: +SKIP
        ...     campaign = client.run("examples/quick.toml")
    """
    if access is None and contact is None:
        contact = str(ray.util.get_node_ip_address())
    return hosting(
        lambda text: Workers(text, programs_there).close,
        access=access,
        data=data,
        trainers=trainers,
        contact=contact,
        programs=programs,
    )
