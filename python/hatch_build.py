"""Generates the messages of the contract, `murmuration.v1`, and puts the programs into a wheel that is to have them."""

import os
import re
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

_PROGRAMS = ("murmuration", "murmuration-worker", "murmuration-trainer")


class Contract(BuildHookInterface[Any]):
    """Runs protoc on the contract, of which this project has one copy: `proto` in the repository.

    Generated files are not committed, so they cannot differ from the contract. A source distribution has the contract
    beside the package.

    If the variable MURMURATION_WHEEL names a folder, a wheel gets the programs in it, which pip puts beside Python's,
    and its folder `share` (the manual, completions of shells), which pip puts where shells and man look in an
    environment.
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
            build_data["tag"] = f"py3-none-{_platform(programs.values())}"


# Names that wheels have for the kinds of machine in the header of a program (e_machine, at byte 18 of an ELF file).
_MACHINES = {62: "x86_64", 183: "aarch64"}


def _platform(programs: Iterable[Path]) -> str:
    """The tag of the systems that programs run on: their C library has all symbols that the programs need."""
    contents = [path.read_bytes() for path in programs]
    minors = [int(minor) for content in contents for minor in re.findall(rb"GLIBC_2\.(\d+)", content)]
    machines = {int.from_bytes(content[18:20], "little") for content in contents}
    if len(machines) != 1 or not machines <= _MACHINES.keys():
        sys.exit(f"no wheel can have programs for machines of the kinds {sorted(machines)}")
    return f"manylinux_2_{max(minors)}_{_MACHINES[machines.pop()]}"
