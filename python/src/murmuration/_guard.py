"""Runs a coordinator until a Python process ends.

The guard is a separate program, which imports nothing of the library. The Python process starts the guard, and the
guard starts the coordinator. The guard ends the coordinator when the Python process requests it or ends in any way,
SIGKILL included. For this, the guard has a descriptor of that process (if the system has such descriptors) and the end
of a pipe. If the guard itself is killed, the system kills the coordinator (PR_SET_PDEATHSIG): it does so when the
thread that started the coordinator ends. The guard starts the coordinator because the guard has only one thread.

Arguments: the process id of the Python process; a folder to remove at the end, or an empty text; the command.
"""

import ctypes
import os
import select
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable

PR_SET_PDEATHSIG = 1
# A coordinator finishes running evaluations before it ends. Killing a coordinator loses no acknowledged change.
SECONDS_TO_END = 10


def dies_with_guard() -> Callable[[], None]:
    """Returns a function that the new process runs first, so that the system kills this process when the guard ends."""
    prctl = getattr(ctypes.CDLL(None), "prctl", None)
    guard = os.getpid()

    def ask() -> None:
        if prctl is not None:
            prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
            if os.getppid() != guard:
                os._exit(1)

    return ask


def parent_lives(parent: int) -> int | None:
    """A descriptor that becomes readable when the Python process ends; None if the system has none."""
    try:
        return os.pidfd_open(parent)
    except (AttributeError, OSError):
        return None


def main(parent: int, folder: str, command: list[str]) -> int:
    """Runs the command until it ends or must end, and returns its exit code."""
    told, tell = os.pipe()
    signal.signal(signal.SIGTERM, lambda *_: os.write(tell, b"."))
    for ignored in (signal.SIGINT, signal.SIGHUP):
        signal.signal(ignored, signal.SIG_IGN)
    watched = select.poll()
    lives = parent_lives(parent)
    for descriptor in (sys.stdin.fileno(), told, lives):
        if descriptor is not None:
            watched.register(descriptor, select.POLLIN)
    # The system closes the coordinator's end of this pipe when the coordinator ends.
    ended, held = os.pipe()
    watched.register(ended, select.POLLIN)
    coordinator = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        pass_fds=[held],
        preexec_fn=dies_with_guard(),
    )
    os.close(held)
    try:
        print(coordinator.pid, flush=True)
        # The Python process may have ended before its descriptor was opened.
        if os.getppid() == parent:
            watched.poll()
    except BrokenPipeError:
        pass
    coordinator.terminate()
    try:
        coordinator.wait(SECONDS_TO_END)
    except subprocess.TimeoutExpired:
        coordinator.kill()
        coordinator.wait()
    if folder:
        shutil.rmtree(folder, ignore_errors=True)
    return coordinator.returncode


if __name__ == "__main__":
    sys.exit(abs(main(int(sys.argv[1]), sys.argv[2], sys.argv[3:])))
