"""Generates the messages of the contract, `murmuration.v1`, and adds the programs to a wheel on request."""

import os
import re
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

_PROGRAMS = ("murmuration", "murmuration-worker", "murmuration-trainer")


class Contract(BuildHookInterface[Any]):
    """Runs protoc on the contract, whose only copy is `proto` in the repository.

    Generated files are not committed, so they cannot differ from the contract. A source distribution has the contract
    beside the package.

    If the variable MURMURATION_WHEEL names a folder, a wheel gets its programs and its folder `share` (the manual,
    shell completions). Pip installs the programs beside Python's, and `share` where an environment's shells and man
    look.
    """

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Writes the modules and their type stubs into `src/murmuration/v1`, and adds programs."""
        from grpc_tools import protoc

        root = Path(self.root)
        contract = next(place for place in (root / "proto", root.parent / "proto") if (place / "murmuration").is_dir())
        files = sorted((contract / "murmuration/v1").glob("*.proto"))
        source = root / "src"
        folder = source / "murmuration/v1"
        folder.mkdir(exist_ok=True)
        arguments = ["protoc", f"-I{contract}", f"--python_out={source}", f"--pyi_out={source}", *map(str, files)]
        if protoc.main(arguments) != 0:
            sys.exit("protoc cannot generate the messages of the contract")
        docstring = '"""The messages of the gRPC contract, generated from the files of `proto/murmuration/v1`."""\n'
        (folder / "__init__.py").write_text(docstring)
        given = os.environ.get("MURMURATION_WHEEL")
        if given and self.target_name == "wheel" and version != "editable":
            programs = {name: Path(given, name) for name in _PROGRAMS}
            build_data["shared_scripts"] = {str(path): name for name, path in programs.items()}
            build_data["shared_data"] = {os.fspath(Path(given, "share")): "share"}
            build_data["pure_python"] = False
            contents = (path.read_bytes() for path in programs.values())
            build_data["tag"] = f"py3-none-{platform_tag(contents)}"


# Wheels' names for the machine types in a program's header: on Linux (e_machine, at byte 18 of an ELF file), and on
# macOS (cputype, at byte 4 of a Mach-O file).
_LINUX_MACHINES = {62: "x86_64", 183: "aarch64"}
_MACOS_MACHINES = {0x0100_0007: "x86_64", 0x0100_000C: "arm64"}
_MACH_O = bytes.fromhex("cffaedfe")
# Commands of a Mach-O file that name its systems, and the offset of the oldest version in each command.
_OLDEST_SYSTEM = {0x24: 8, 0x32: 12}


def platform_tag(programs: Iterable[bytes]) -> str:
    """The wheel tag of the systems that programs run on, at least as new as the programs need.

    Args:
        programs: The contents of the program files.
    """
    contents = list(programs)
    if all(content.startswith(_MACH_O) for content in contents):
        machines = {_MACOS_MACHINES.get(_word(content, 4)) for content in contents}
        major, minor = max(_macos_version(content) for content in contents)
        # From macOS 11 on, pip uses only the first number.
        name = f"macosx_{major}_{0 if major >= 11 else minor}"
    else:
        # The C library must have all symbols that the programs need.
        minors = [int(minor) for content in contents for minor in re.findall(rb"GLIBC_2\.(\d+)", content)]
        machines = {_LINUX_MACHINES.get(int.from_bytes(content[18:20], "little")) for content in contents}
        name = f"manylinux_2_{max(minors, default=0)}"
    machine = machines.pop()
    if machines or machine is None:
        sys.exit("no wheel can have these programs: they are for several kinds of machine, or for an unknown one")
    return f"{name}_{machine}"


def _macos_version(program: bytes) -> tuple[int, int]:
    """The oldest macOS that a program runs on."""
    place = 32
    for _ in range(_word(program, 16)):
        command, length = _word(program, place), _word(program, place + 4)
        if command in _OLDEST_SYSTEM:
            version = _word(program, place + _OLDEST_SYSTEM[command])
            return version >> 16, version >> 8 & 0xFF
        place += length
    sys.exit("no wheel can have these programs: they do not say for which macOS they are")


def _word(content: bytes, place: int) -> int:
    return int.from_bytes(content[place : place + 4], "little")
