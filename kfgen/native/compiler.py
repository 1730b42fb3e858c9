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
from pathlib import Path

from kfgen.errors import KfgenError

DEFAULT_FLAGS = ("-O2",)
# that the driver misunderstands a header must be an error of the compiler, never a crash
_STRICT = ("-Werror=incompatible-pointer-types", "-Werror=implicit-function-declaration")
_ALWAYS = ("-std=c99", "-shared", "-fPIC", *_STRICT)
_FORMAT = "1"  # of the cache; raise it when what is compiled beside the emitted files changes meaning


def find_compiler() -> list[str]:
    """The C compiler's command: $CC (which may hold options), else cc, gcc, clang. KfgenError without one."""
    chosen = os.environ.get("CC", "").strip()
    if chosen:
        command = shlex.split(chosen)
        if shutil.which(command[0]) is None:
            raise KfgenError(f"the C compiler `{chosen}` named by $CC was not found")
        return command
    for name in ("cc", "gcc", "clang"):
        if shutil.which(name):
            return [name]
    raise KfgenError("no C compiler found (cc, gcc, clang); install one or name it in $CC")


def cache_directory() -> Path:
    """`$XDG_CACHE_HOME/kfgen`, else `~/.cache/kfgen`; a temporary folder where that cannot be written."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    # the XDG specification asks to ignore relative paths
    try:
        root = Path(base) if os.path.isabs(base) else Path.home() / ".cache"
        folder = root / "kfgen"
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        if os.access(folder, os.W_OK):
            return folder
    except (OSError, RuntimeError):
        pass
    return _private_directory()


@lru_cache(maxsize=1)
def _private_directory() -> Path:
    return Path(tempfile.mkdtemp(prefix="kfgen-"))


def build(files: Mapping[str, str], flags: Sequence[str] | None = None) -> Path:
    """Compile C files (name -> text; headers among them) into one shared library and return its path.

    One call of the compiler, none if the same text was built before with the same compiler and flags. `flags`
    replace `-O2`. Safe against other processes doing the same. KfgenError holds the compiler's messages.
    """
    command = find_compiler()
    options = [*_ALWAYS, *(DEFAULT_FLAGS if flags is None else flags)]
    digest = _digest(files, command, options)
    cache = cache_directory()
    library = cache / f"{digest}.so"
    if library.exists():
        return library
    # compiled in a folder of its own inside the cache, so that the rename stays on one file system
    with tempfile.TemporaryDirectory(prefix="build-", dir=cache) as name:
        folder = Path(name)
        for file, text in files.items():
            (folder / file).write_text(text, encoding="utf-8", newline="\n")
        sources = sorted(file for file in files if file.endswith(".c"))
        call = [*command, *options, "-o", "library.so", *sources, "-lm"]
        done = subprocess.run(call, cwd=folder, capture_output=True, text=True, errors="replace", check=False)
        if done.returncode != 0:
            raise KfgenError(f"the C compiler failed: {shlex.join(call)}\n{_shortened(done.stderr)}")
        with suppress(FileNotFoundError):
            os.replace(folder / "library.so", library)
    if not library.exists():
        raise KfgenError(f"the C compiler wrote no library: {shlex.join(call)}")
    return library


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
