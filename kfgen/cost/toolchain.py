"""Cross compilers: a gcc where one is installed, else clang as the Python package `ziglang` brings it.

Both compile for size of what is used (`-ffunction-sections`, `--gc-sections`) with the flags of an ordinary release
build, `-O2 -fno-math-errno`, and leave a map of what came from where, which the figures of flash are read from.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from importlib.resources import as_file, files
from importlib.util import find_spec
from pathlib import Path
from typing import Protocol

from kfgen.errors import KfgenError
from kfgen.native.cache import cache_directory
from kfgen.native.compiler import zig_environment

FLAGS = ("-O2", "-std=gnu99", "-fno-math-errno", "-ffunction-sections", "-fdata-sections")

_IN_DOUBLE = re.compile(r"\b(?:sin|cos|tan|exp|log|pow)f\(")


@dataclass(frozen=True)
class Placed:
    """A section that the linker has kept: the object (or archive) it came from, its name, its bytes."""

    origin: str
    section: str
    size: int


@dataclass(frozen=True)
class Linked:
    """A program (ELF), and what is in it."""

    program: bytes
    sections: tuple[Placed, ...]


class Compiler(Protocol):
    """Compiles and links in a folder."""

    @property
    def title(self) -> str:
        """Name and version, for the reader."""
        ...

    @property
    def gcc(self) -> bool:
        """Whether it takes the options of gcc that a header may recommend."""
        ...

    def remark(self, text: str) -> str:
        """What the reader of the figures of a C file should know."""
        ...

    def compile(self, folder: Path, source: str, flags: Sequence[str] = ()) -> str:
        """Compile a file of the folder; the object's name."""
        ...

    def link(self, folder: Path, objects: Sequence[str], roots: Sequence[str], entry: str) -> Linked:
        """Link objects and the libraries they need, of all that only what the roots (and entry) use."""
        ...


@dataclass(frozen=True)
class Gcc:
    """A gcc. machine: options that choose the processor; libraries, layout: options of the link alone."""

    command: str
    machine: tuple[str, ...]
    libraries: tuple[str, ...] = ()
    layout: tuple[str, ...] = ()
    gcc: bool = True

    @property
    def title(self) -> str:
        return _version(self.command)

    def remark(self, text: str) -> str:
        return ""

    def compile(self, folder: Path, source: str, flags: Sequence[str] = ()) -> str:
        compiled = Path(source).with_suffix(".o").name
        run(folder, self.command, *self.machine, *FLAGS, *flags, "-c", source, "-o", compiled)
        return compiled

    def link(self, folder: Path, objects: Sequence[str], roots: Sequence[str], entry: str) -> Linked:
        run(
            folder, self.command, *self.machine, *objects, "-lm", *self.libraries, "-o", "program.elf",
            "-Wl,--gc-sections,-Map=program.map", *self.layout, f"-Wl,-e,{entry}",
            *(f"-Wl,-u,{root}" for root in roots),
        )  # fmt: skip
        placed = tuple(sections_of_gnu_map((folder / "program.map").read_text()))
        return Linked((folder / "program.elf").read_bytes(), placed)


def installed_gcc(names: Sequence[str], machine: Sequence[str], needs: str = "libm.a") -> str | None:
    """The first gcc of these that is installed and has a file of its C library for the machine."""
    return next((name for name in names if shutil.which(name) and has_file(name, tuple(machine), needs)), None)


@lru_cache
def has_file(command: str, machine: tuple[str, ...], file: str) -> bool:
    """Whether a compiler finds a file in its folders (it prints the bare name otherwise)."""
    call = [command, *machine, f"-print-file-name={file}"]
    return "/" in subprocess.run(call, capture_output=True, text=True, check=False).stdout


@dataclass(frozen=True)
class Zig:
    """The clang, the linker and the compiler's library in the Python package `ziglang`.

    It has no C library for a bare processor: math.h is kfgen's own, and what it declares is that of Zig's standard
    library, compiled once for each processor and then kept in the cache.
    """

    target: str
    cpu: str
    emulation: str  # the linker's name of the format
    flags: tuple[str, ...] = ()
    gcc: bool = False

    @property
    def title(self) -> str:
        return f"clang of ziglang {_version(sys.executable, '-m', 'ziglang', 'version')}"

    def remark(self, text: str) -> str:
        if not _IN_DOUBLE.search(text):
            return ""
        return (
            "sinf, cosf, tanf, expf, logf of ziglang's library compute in double: where the processor does not, they "
            "cost many times those of a library for microcontrollers"
        )

    def _machine(self) -> list[str]:
        return ["-target", self.target, f"-mcpu={self.cpu}", *self.flags]

    def compile(self, folder: Path, source: str, flags: Sequence[str] = ()) -> str:
        compiled = Path(source).with_suffix(".o").name
        with as_file(files("kfgen.cost") / "freestanding") as include:
            zig(folder, "cc", *self._machine(), *FLAGS, *flags, "-isystem", str(include), "-c", source, "-o", compiled)
        return compiled

    def link(self, folder: Path, objects: Sequence[str], roots: Sequence[str], entry: str) -> Linked:
        zig(
            folder, "ld.lld", "-m", self.emulation, *objects, str(self._library()), "-o", "program.elf",
            "--gc-sections", "-Map=program.map", "--image-base=0x10000", "-e", entry, *(f"-u{root}" for root in roots),
        )  # fmt: skip
        placed = tuple(sections_of_lld_map((folder / "program.map").read_text()))
        return Linked((folder / "program.elf").read_bytes(), placed)

    def _library(self) -> Path:
        """libm and the compiler's library, built once for each version, processor and source."""
        source = files("kfgen.cost").joinpath("freestanding/libm.zig").read_bytes()
        key = sha256("\0".join([self.title, *self._machine()]).encode() + source).hexdigest()[:32]
        cache = cache_directory()
        library = cache / f"libm-{key}.a"
        if not library.exists():
            with tempfile.TemporaryDirectory(prefix="libm-", dir=cache) as name:
                folder = Path(name)
                (folder / "libm.zig").write_bytes(source)
                zig(folder, "build-lib", "libm.zig", "-target", self.target, f"-mcpu={self.cpu}", "-O", "ReleaseSmall",
                    "-fcompiler-rt", "-ffunction-sections", "-fdata-sections", "--name", "m")  # fmt: skip
                with suppress(FileNotFoundError):
                    (folder / "libm.a").replace(library)
        return library


def has_zig() -> bool:
    return find_spec("ziglang") is not None


def zig(folder: Path, *arguments: str) -> None:
    """One of the tools of ziglang."""
    run(folder, sys.executable, "-m", "ziglang", *arguments, environment=zig_environment(cache_directory()))


def run(folder: Path, *command: str, environment: Mapping[str, str] | None = None) -> None:
    """Run a tool; KfgenError holds its messages."""
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, errors="replace", check=False, env=environment
    )
    if done.returncode:
        messages = "\n".join(done.stderr.rstrip().splitlines()[:30])
        raise KfgenError(f"{Path(command[0]).name} failed: {' '.join(command)}\n{messages}")


@lru_cache
def _version(*command: str) -> str:
    call = [*command, "--version"] if len(command) == 1 else list(command)
    done = subprocess.run(call, capture_output=True, text=True, errors="replace", check=False)
    return done.stdout.partition("\n")[0].strip()


# --- maps

_GNU = re.compile(r"^ (\.[\w.$-]+) +0x([0-9a-f]+) +0x([0-9a-f]+) +(\S.*)$", re.MULTILINE)
_SPLIT = re.compile(r"^ (\.[^\s]+)\n\s+(?=0x)", re.MULTILINE)  # a long name stands on a line of its own
_LLD = re.compile(r"^ *[0-9a-f]+ +[0-9a-f]+ +([0-9a-f]+) +\d+ +(\S.*):\((\.[\w.$-]+)\)$", re.MULTILINE)


def sections_of_gnu_map(text: str) -> Iterator[Placed]:
    """The sections that GNU ld has placed."""
    placed = text.split("Linker script and memory map", 1)[1]
    for section, address, size, origin in _GNU.findall(_SPLIT.sub(r" \1 ", placed)):
        if int(address, 16):
            yield Placed(origin, section, int(size, 16))


def sections_of_lld_map(text: str) -> Iterator[Placed]:
    """The sections that lld has placed; what it has merged comes from `<internal>`."""
    for size, origin, section in _LLD.findall(text):
        yield Placed(origin, section, int(size, 16))


CODE = (".text", ".rodata", ".srodata", ".progmem")
DATA = (".data", ".sdata", ".bss", ".sbss")


def in_flash(sections: Sequence[Placed], kinds: Sequence[str] = CODE) -> Mapping[str, int]:
    """Bytes of the sections of some kinds, by the object they came from."""
    sizes: dict[str, int] = {}
    for each in sections:
        if any(each.section == kind or each.section.startswith(f"{kind}.") for kind in kinds):
            sizes[each.origin] = sizes.get(each.origin, 0) + each.size
    return sizes
