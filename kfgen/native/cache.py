"""The folder that keeps what was compiled: of one's own, since what lies in it is loaded and run."""

from __future__ import annotations

import atexit
import os
import shutil
import stat
import tempfile
from functools import lru_cache
from pathlib import Path


def cache_directory() -> Path:
    """`$XDG_CACHE_HOME/kfgen`, else `~/.cache/kfgen`, where that is the caller's alone (mode 0700).

    Else a fresh private folder, which is removed at the end of the process.
    """
    base = os.environ.get("XDG_CACHE_HOME", "")
    # the XDG specification asks to ignore relative paths
    try:
        root = Path(base) if os.path.isabs(base) else Path.home() / ".cache"
        folder = Path(os.path.realpath(root / "kfgen"))
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        if _is_private(folder) and os.access(folder, os.W_OK | os.X_OK):
            return folder
    except (OSError, RuntimeError):
        pass
    return _private_directory()


def _is_private(folder: Path) -> bool:
    """Whether nobody else can put anything there, or put another folder in its place."""
    if not hasattr(os, "getuid"):
        return True  # no such modes on this system: a folder below the user's own
    found, above = folder.stat(), folder.parent.stat()
    if found.st_uid != os.getuid() or _open_to_others(found):
        return False
    if stat.S_IMODE(found.st_mode) != 0o700:
        folder.chmod(0o700)
    return above.st_uid in (0, os.getuid()) and (not _open_to_others(above) or bool(above.st_mode & stat.S_ISVTX))


def _open_to_others(found: os.stat_result) -> bool:
    return bool(found.st_mode & (stat.S_IWGRP | stat.S_IWOTH))


@lru_cache(maxsize=1)
def _private_directory() -> Path:
    folder = tempfile.mkdtemp(prefix="kfgen-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)
