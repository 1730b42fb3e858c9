"""Builds shared libraries with the host's C compiler, and caches them by the hash of all that goes in."""

from __future__ import annotations

import hashlib
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

from kfgen.errors import KfgenError
from kfgen.native.cache import cache_directory

DEFAULT_FLAGS = ("-O2",)
# that the driver misunderstands a header must be an error of the compiler, never a crash
_STRICT = ("-Werror=incompatible-pointer-types", "-Werror=implicit-function-declaration")
# Zig traps undefined behaviour where it is not told otherwise
_ZIG = ("cc", "-fno-sanitize=undefined")
_ALWAYS = ("-std=c99", "-shared", "-fPIC", *_STRICT)
_FORMAT = "2"  # of the cache; raise it when what is compiled beside the emitted files changes meaning


def find_compiler() -> list[str]:
    """The C compiler's command: $CC (which may hold options), else cc, gcc, clang, else that of zig, installed or as
    the Python package ziglang. KfgenError without one."""
    chosen = os.environ.get("CC", "").strip()
    if chosen:
        try:
            command = shlex.split(chosen)
        except ValueError as error:
            raise KfgenError(f"$CC is no command: `{chosen}` ({str(error).lower()}); write CC=gcc") from None
        if not command or shutil.which(command[0]) is None:
            raise KfgenError(f"the C compiler `{chosen}` named by $CC was not found")
        return command
    for name in ("cc", "gcc", "clang"):
        if shutil.which(name):
            return [name]
    if shutil.which("zig"):
        return ["zig", *_ZIG]
    if find_spec("ziglang") is not None:
        return [sys.executable, "-m", "ziglang", *_ZIG]
    raise KfgenError("no C compiler found (cc, gcc, clang, zig); install one (pip install ziglang), or name it in $CC")


def build(files: Mapping[str, str], flags: Sequence[str] | None = None, *, afresh: bool = False) -> Path:
    """Compile C files (name -> text; headers among them) into one shared library and return its path.

    One call of the compiler, none if the same text was built before with the same compiler and flags and is whole
    still. `flags` replace `-O2`; afresh: build again in any case. Safe against other processes doing the same.
    KfgenError holds the compiler's messages.
    """
    command = find_compiler()
    options = [*_ALWAYS, *(DEFAULT_FLAGS if flags is None else flags)]
    digest = _digest(files, command, options)
    cache = cache_directory()
    library = cache / f"{digest}.so"
    if not afresh and _is_whole(library):
        return library
    # compiled in a folder of its own inside the cache, so that the rename stays on one file system
    with tempfile.TemporaryDirectory(prefix="build-", dir=cache) as name:
        folder = Path(name)
        for file, text in files.items():
            (folder / file).write_text(text, encoding="utf-8", newline="\n")
        sources = sorted(file for file in files if file.endswith(".c"))
        call = [*command, *options, "-o", "library.so", *sources, "-lm"]
        done = subprocess.run(
            call, cwd=folder, capture_output=True, text=True, errors="replace", check=False, env=zig_environment(cache)
        )
        if done.returncode != 0:
            raise KfgenError(f"the C compiler failed: {shlex.join(call)}\n{_shortened(done.stderr)}")
        made = folder / "library.so"
        with suppress(FileNotFoundError):
            content = made.read_bytes()
            made.write_bytes(content + _seal(digest, content))
            os.replace(made, library)
    if not library.exists():
        raise KfgenError(f"the C compiler wrote no library: {shlex.join(call)}")
    return library


def zig_environment(cache: Path) -> dict[str, str]:
    """The environment for a compiler that may be Zig's: what it keeps goes into a folder, not into $HOME."""
    return {"ZIG_GLOBAL_CACHE_DIR": str(cache / "zig"), **os.environ}


def _seal(digest: str, content: bytes) -> bytes:
    """What is written behind a library, where loaders do not look: that it is whole, and of these sources."""
    return hashlib.sha256(digest.encode() + content).digest()


def _is_whole(library: Path) -> bool:
    """Whether a library of the cache is what was built: loading one that was cut short ends the process."""
    try:
        content = library.read_bytes()
    except OSError:
        return False
    return content[-32:] == _seal(library.stem, content[:-32])


def _digest(files: Mapping[str, str], command: Sequence[str], options: Sequence[str]) -> str:
    parts = [_FORMAT, sys.platform, platform.machine(), _version(tuple(command)), *command, *options]
    for file in sorted(files):
        parts += [file, files[file]]
    digest = hashlib.sha256()
    for part in parts:
        encoded = part.encode()
        digest.update(b"%d:" % len(encoded) + encoded)
    return digest.hexdigest()[:40]


@lru_cache
def _version(command: tuple[str, ...]) -> str:
    """What the compiler says it is: another version gets other libraries."""
    done = subprocess.run([*command, "--version"], capture_output=True, text=True, errors="replace", check=False)
    return done.stdout.partition("\n")[0]


def _shortened(messages: str, limit: int = 40) -> str:
    lines = messages.rstrip().splitlines()
    return "\n".join(lines[:limit] + ([f"... {len(lines) - limit} more lines"] if len(lines) > limit else []))
