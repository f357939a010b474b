"""Tests where the library finds programs and ONNX Runtime, and the systems that a wheel with programs is for."""

import importlib
import struct
import sys
from pathlib import Path

import pytest

from hatch_build import platform_tag
from murmuration import _programs as programs


@pytest.mark.parametrize(
    "library", ["libonnxruntime.so.1.28.0", "libonnxruntime.1.28.0.dylib", "libonnxruntime.so", "libonnxruntime.dylib"]
)
def test_the_library_in_pythons_package_is_found_as_linux_and_as_macos_call_it(
    library: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "onnxruntime/capi"
    folder.mkdir(parents=True)
    (folder.parent / "__init__.py").touch()
    for name in (library, "libonnxruntime_providers_shared.so"):
        (folder / name).touch()
    monkeypatch.delitem(sys.modules, "onnxruntime", raising=False)
    monkeypatch.delenv("ORT_DYLIB_PATH", raising=False)
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()
    assert programs.environment()["ORT_DYLIB_PATH"] == str(folder / library)


def elf(machine: int, symbols: bytes) -> bytes:
    return b"\x7fELF".ljust(18) + struct.pack("<H", machine) + symbols


def mach_o(machine: int, *commands: bytes) -> bytes:
    header = struct.pack("<IIIIIIII", 0xFEEDFACF, machine, 0, 2, len(commands), sum(map(len, commands)), 0, 0)
    return header + b"".join(commands)


def test_a_wheel_is_for_systems_as_new_as_its_programs_need() -> None:
    linux = [elf(62, b"..GLIBC_2.17..GLIBC_2.34.."), elf(62, b"GLIBC_2.28")]
    assert platform_tag(linux) == "manylinux_2_34_x86_64"
    assert platform_tag([elf(183, b"GLIBC_2.17")]) == "manylinux_2_17_aarch64"
    segment = struct.pack("<III", 0x19, 12, 0)
    new = struct.pack("<IIIIII", 0x32, 24, 1, 11 << 16 | 3 << 8, 0, 0)
    old = struct.pack("<IIII", 0x24, 16, 10 << 16 | 12 << 8, 0)
    assert platform_tag([mach_o(0x0100_000C, segment, new)] * 3) == "macosx_11_0_arm64"
    assert platform_tag([mach_o(0x0100_0007, segment, old)]) == "macosx_10_12_x86_64"
    assert platform_tag([mach_o(0x0100_0007, old), mach_o(0x0100_0007, new)]) == "macosx_11_0_x86_64"


@pytest.mark.parametrize(
    ("contents", "said"),
    [
        ([elf(62, b"GLIBC_2.17"), elf(183, b"GLIBC_2.17")], "several kinds of machine"),
        ([elf(40, b"GLIBC_2.17")], "an unknown one"),
        ([b"MZ"], "an unknown one"),
        ([mach_o(0x0100_000C)], "for which macOS"),
    ],
)
def test_programs_that_no_wheel_can_have(contents: list[bytes], said: str) -> None:
    with pytest.raises(SystemExit, match=said):
        platform_tag(contents)
