"""Finds and runs the programs of Murmuration."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import sysconfig
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ._arguments import path
from ._errors import InvalidError, MurmurationError, NotFoundError, ProgramError, UnavailableError

_NAME = "murmuration"
# The programs' exit code for wrong usage or input.
_WRONG_INPUT = 2


def find(folder: str | os.PathLike[str] | None) -> Path:
    """The program `murmuration`: in `folder`, or else beside this Python's scripts, or else in the PATH.

    Raises:
        ProgramError: If none of these places has the program.
    """
    if folder is not None:
        places = [path("programs", folder)]
    else:
        # A wheel puts programs of this library's version beside Python's scripts. With pip's `--target`, the programs
        # are in the folder `bin` beside the library.
        scripts = [sysconfig.get_path("scripts"), sysconfig.get_path("scripts", f"{os.name}_user")]
        scripts.append(os.fspath(Path(__file__).parents[1] / "bin"))
        places = [*scripts, *os.environ.get("PATH", os.defpath).split(os.pathsep)]
    if found := shutil.which(_NAME, path=os.pathsep.join(places)):
        return Path(found)
    looked = "in the PATH" if folder is None else f"in {places[0]}"
    raise ProgramError(
        f"there is no program `{_NAME}` {looked}: install it, or name the folder that it is in (`programs`)"
    )


def environment() -> dict[str, str]:
    """The environment of programs: this process's, without the variables for commands in a shell (`MURMURATION_*`).

    Embedders run on ONNX Runtime. If ORT_DYLIB_PATH names no library, it is set to the library in the Python package
    `onnxruntime`, if this package is installed. From version 1.29 on, ONNX Runtime reports the machine to its makers
    when it is loaded, unless ORT_DISABLE_TELEMETRY is 1. If this variable has no value, it is set to 1.
    """
    kept = {name: value for name, value in os.environ.items() if not name.startswith("MURMURATION_")}
    if not kept.get("ORT_DYLIB_PATH") and (library := _onnxruntime()):
        kept["ORT_DYLIB_PATH"] = str(library)
    kept.setdefault("ORT_DISABLE_TELEMETRY", "1")
    return kept


def _onnxruntime() -> Path | None:
    """The library in the package `onnxruntime`, which is not imported."""
    package = importlib.util.find_spec("onnxruntime")
    places = package.submodule_search_locations if package else None
    for place in places or ():
        # The library's names on Linux and on macOS.
        for name in ("libonnxruntime.so*", "libonnxruntime.*dylib"):
            for library in sorted(Path(place, "capi").glob(name)):
                return library
    return None


def run(program: Path, words: Sequence[str], variables: dict[str, str]) -> list[dict[str, Any]]:
    """Runs a command of `murmuration`, and returns the JSON documents that it prints, one after the other.

    Raises:
        InvalidError: If the command refuses its input.
        NotFoundError: If the command names something that does not exist.
        UnavailableError: If the coordinator does not answer the command.
        ProgramError: If the command fails.
    """
    command = [os.fspath(program), *words, "--json"]
    try:
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            env=environment() | variables,
            check=False,
        )
    except OSError as error:
        raise ProgramError(f"`murmuration {words[0]}` cannot be run: {error}") from None
    if done.returncode != 0:
        raise _failed(words[0], done.returncode, done.stderr.strip().rpartition("error: ")[2])
    documents = []
    left = done.stdout.strip()
    while left:
        try:
            document, end = json.JSONDecoder().raw_decode(left)
        except ValueError:
            document = None
        if not isinstance(document, dict):
            raise ProgramError(f"`murmuration {' '.join(words)}` printed something that is not a JSON document")
        documents.append(document)
        left = left[end:].lstrip()
    return documents


def _failed(command: str, code: int, message: str) -> MurmurationError:
    # For wrong usage, the first line is the error; the other lines are help.
    message = message.partition("\n\nFor more information")[0] or f"{command} failed with exit code {code}"
    if message.startswith("no coordinator answers "):
        return UnavailableError(message)
    if code != _WRONG_INPUT:
        return ProgramError(message)
    return NotFoundError(message) if message.startswith("there is no ") else InvalidError(message)
