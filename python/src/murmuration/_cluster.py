"""A cluster on this machine that ends with this process."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import weakref
from pathlib import Path
from typing import IO

from . import _guard
from ._errors import ProgramError
from ._programs import environment

# A coordinator checks its database before it listens.
_SECONDS_TO_START = 120
_SECONDS_TO_LOOK_AGAIN = 0.01
# Time limit for a coordinator that answers no more, and its guard, to end: a coordinator needs up to 5 s.
_SECONDS_TO_END = 6
# Most bytes of the log that a message quotes.
_QUOTED_BYTES = 2_000


class Cluster:
    """A coordinator with workers and trainers in its process.

    Attributes:
        url: The URL of the coordinator, for this machine.
        token: The token of this machine's commands; None if the coordinator requires none.
        access_file: The access file of the coordinator.
    """

    def __init__(
        self,
        program: Path,
        data: Path | None,
        workers: int | None,
        trainers: int | None,
        listen: str | None = None,
        contact: str | None = None,
    ) -> None:
        """Starts the cluster, and waits until it answers. Without `data`, it has a temporary data directory.

        `listen` is an address and port, by default any port of 127.0.0.1. `contact` is the name by which other machines
        reach this machine.
        """
        # The file has no name, so that the system deletes it.
        self._log = tempfile.TemporaryFile()  # noqa: SIM115
        self._process = os.getpid()
        own = "" if data else tempfile.mkdtemp(prefix="murmuration-")
        data = data or Path(own, "data")
        self.access_file = data / "access.json"
        command = [os.fspath(program), "serve", "--data", os.fspath(data), "--listen", listen or "127.0.0.1:0"]
        for option, value in (("--workers", workers), ("--trainers", trainers), ("--contact", contact)):
            if value is not None:
                command += [option, str(value)]
        try:
            self._guard = _start_guard(command, own, self._log)
            # If the cluster was not closed, this function also runs at the interpreter's end.
            self._end = weakref.finalize(self, _end, self._guard, self._process, own, self._log)
            self.url, self.token = self._wait_for_address(data)
        except BaseException:
            if hasattr(self, "_end"):
                self._end()
            else:
                self._log.close()
                shutil.rmtree(own, ignore_errors=True)
            raise

    def close(self) -> None:
        """Ends the cluster, and returns when its processes have ended."""
        self._end()

    def why(self) -> str:
        """If the cluster has ended, the last lines of its log, as the reason for missing answers; otherwise empty."""
        if os.getpid() != self._process:
            # A fork cannot know whether the cluster has ended.
            return ""
        try:
            self._guard.wait(_SECONDS_TO_END)
        except subprocess.TimeoutExpired:
            return ""
        return f"the local cluster has ended:\n{self._tail()}"

    def _wait_for_address(self, data: Path) -> tuple[str, str | None]:
        """The coordinator's address and token, from its data directory."""
        assert self._guard.stdout is not None  # noqa: S101
        process = self._guard.stdout.readline().strip()
        last = time.monotonic() + _SECONDS_TO_START
        while self._guard.poll() is None and time.monotonic() < last:
            holder = _holder(data)
            if str(holder.get("process")) == process and holder.get("address"):
                return str(holder["address"]), _token(data)
            time.sleep(_SECONDS_TO_LOOK_AGAIN)
        raise ProgramError(f"the local cluster did not start:\n{self._tail()}{_instead(data)}")

    def _tail(self) -> str:
        if self._log.closed:
            return ""
        # Seeking would move the cluster's position in the file too.
        log = self._log.fileno()
        begin = max(0, os.fstat(log).st_size - _QUOTED_BYTES)
        return os.pread(log, _QUOTED_BYTES, begin).decode(errors="replace").strip()


def _start_guard(command: list[str], own: str, log: IO[bytes]) -> subprocess.Popen[str]:
    if not sys.executable:
        raise ProgramError(
            "this Python does not say where its program is (`sys.executable`), so it cannot start a cluster"
        )
    guard = [sys.executable, "-I", "-S", _guard.__file__, str(os.getpid()), own]
    return subprocess.Popen(
        [*guard, *command],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=log,
        text=True,
        env=environment(),
        # Ctrl-C in a terminal reaches only Python, which then ends the cluster.
        start_new_session=True,
    )


def _end(guard: subprocess.Popen[str], process: int, own: str, log: IO[bytes]) -> None:
    log.close()
    if os.getpid() != process:
        # This process is a fork of the process that started the cluster, and must not end the cluster.
        return
    assert guard.stdin is not None and guard.stdout is not None  # noqa: S101
    try:
        # Closing the pipe is not enough, because a fork may have the pipe open too.
        guard.stdin.write("end\n")
        guard.stdin.close()
    except BrokenPipeError:
        pass
    guard.wait()
    guard.stdout.close()
    if own:
        # The guard has already removed the folder, unless the guard was killed.
        shutil.rmtree(own, ignore_errors=True)


def _holder(data: Path) -> dict[str, object]:
    """Details of the process that uses a data directory; empty while they are being written."""
    try:
        holder = json.loads((data / "lock.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return holder if isinstance(holder, dict) else {}


def _instead(data: Path) -> str:
    """How to use the coordinator that already uses the data directory; empty without such a coordinator."""
    holder = _holder(data)
    try:
        os.kill(int(str(holder.get("process"))), 0)
    except (OSError, OverflowError, ValueError):
        return ""
    if not holder.get("address"):
        return ""
    return f'\nuse the coordinator that has it: murmuration.connect(access="{data / "access.json"}")'


def _token(data: Path) -> str | None:
    try:
        return (data / "local-token").read_text(encoding="utf-8").strip()
    except FileNotFoundError:
        return None
