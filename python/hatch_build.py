"""Generates the messages of the contract, `murmuration.v1`, when the package is built."""

import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class Contract(BuildHookInterface[Any]):
    """Runs protoc on the contract, of which this project has one copy: `proto` in the repository.

    Generated files are not committed, so they cannot differ from the contract. A source distribution has the contract
    beside the package.
    """

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Writes the modules and their type stubs into `src/murmuration/v1`."""
        del version, build_data
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
