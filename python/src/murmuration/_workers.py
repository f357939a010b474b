"""Workers and trainers: those that are connected, and those that another engine's processes start."""

from __future__ import annotations

import logging
import os
import subprocess
import tempfile
import threading
import time
from dataclasses import dataclass

from . import _programs as programs
from ._errors import ProgramError
from .v1 import node_pb2 as v1

_LOG = logging.getLogger("murmuration")
# Pauses before a worker that ended is started again, in seconds: each is twice the last one.
_FIRST_PAUSE, _LONGEST_PAUSE = 1.0, 60.0
# A worker that ran for this time had a good start.
_GOOD_START = 60.0
# A worker drains within seconds; one that does not is killed.
_SECONDS_TO_DRAIN = 30.0
# A worker whose coordinator is away for this time ends, so that it does not occupy its machine for nothing.
_MINUTES_WITHOUT_COORDINATOR = 10


@dataclass(frozen=True)
class Worker:
    """A connected worker or trainer.

    Attributes:
        name: The name of its machine and job, or the name that it was given, and its address.
        kind: `"worker"` or `"trainer"`.
        threads: Number of tasks that it works on at the same time; 0 if it is leaving.
        tasks: Number of tasks that it holds now.
        campaigns: The ids of the campaigns of these tasks.
    """

    name: str
    kind: str
    threads: int
    tasks: int
    campaigns: tuple[str, ...]

    @classmethod
    def of(cls, node: v1.Node) -> Worker:
        """The worker of a message."""
        kind = "trainer" if node.kind == v1.NODE_KIND_TRAINER else "worker"
        campaigns = dict.fromkeys(work.campaign for work in node.work if work.campaign)
        tasks = sum(work.tasks for work in node.work)
        return cls(node.name, kind, node.threads, tasks, tuple(campaigns))


class WorkerProcess:
    """A process `murmuration-worker` on this machine, which is started again if it fails."""

    def __init__(self, access: str, name: str, threads: int, folder: str | None) -> None:
        """Starts the worker. `access` is the text of an access file; `folder` has the programs.

        Raises:
            ProgramError: If the program is not on this machine.
        """
        program = programs.find(folder).with_name("murmuration-worker")
        if not program.exists():
            raise ProgramError(f"there is no program {program}: install Murmuration on every machine of the cluster")
        # The file has the token of the owner. It has no name, so it is gone with the processes that have it open.
        self._file = tempfile.TemporaryFile()  # noqa: SIM115
        self._file.write(access.encode())
        self._file.flush()
        place = f"/proc/self/fd/{self._file.fileno()}"
        self._command = [os.fspath(program), "--access", place, "--name", name, "--threads", str(threads)]
        self._command += ["--end-with-parent", "--on-coordinator-lost", f"retry={_MINUTES_WITHOUT_COORDINATOR}m"]
        self._ending = threading.Event()
        self._over = threading.Event()
        self._process: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._keep, name="murmuration-worker", daemon=True)
        self._thread.start()

    @property
    def process(self) -> int | None:
        """The number of the running process; None while there is none."""
        with self._lock:
            running = self._process
        return running.pid if running is not None and running.poll() is None else None

    def wait(self) -> None:
        """Returns when the worker has ended for good."""
        self._over.wait()

    def close(self) -> None:
        """Ends the worker, which returns the work that it has not begun."""
        self._ending.set()
        with self._lock:
            running = self._process
        if running is not None:
            running.terminate()
            try:
                running.wait(_SECONDS_TO_DRAIN)
            except subprocess.TimeoutExpired:
                running.kill()
        self._thread.join()
        self._file.close()

    def _keep(self) -> None:
        try:
            self._keep_running()
        finally:
            self._over.set()

    def _keep_running(self) -> None:
        pause = _FIRST_PAUSE
        while not self._ending.is_set():
            begun = time.monotonic()
            if not self._start():
                return
            assert self._process is not None  # noqa: S101
            code = self._process.wait()
            lasted = time.monotonic() - begun
            # Neither a worker that ended well nor one that never found its coordinator is wanted again.
            if code == 0 or (code == 1 and lasted >= 60 * _MINUTES_WITHOUT_COORDINATOR):
                return
            pause = _FIRST_PAUSE if lasted > _GOOD_START else min(2 * pause, _LONGEST_PAUSE)
            _LOG.warning("the worker ended with code %s, and starts again in %g s", code, pause)
            self._ending.wait(pause)

    def _start(self) -> bool:
        with self._lock:
            if self._ending.is_set():
                return False
            try:
                self._process = subprocess.Popen(
                    self._command,
                    stdin=subprocess.DEVNULL,
                    env=programs.environment(),
                    start_new_session=True,
                    pass_fds=[self._file.fileno()],
                )
            except OSError as error:
                _LOG.error("%s cannot be started on this machine, which has no worker now: %s", self._command[0], error)
                return False
        return True
