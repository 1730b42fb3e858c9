"""The C routines of fixed point as a library that a test can call, beside the Python that says what they compute."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterable, Sequence
from functools import cache
from itertools import count
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np
from cffi import FFI

from kfgen.emit.render import macro
from kfgen.fixed.arithmetic import tables
from kfgen.fixed.arithmetic.operations import Status
from kfgen.fixed.arithmetic.routines import NEEDS, closure
from kfgen.fixed.arithmetic.twins import TWINS, WITHOUT_STATUS

# routine -> its arguments: w an int64_t, h a positive one, l one of 52 bits, i a raw int32_t, m one below 2^30; other
# letters are ints of a range of their own
ARGUMENTS = {
    "gather": "liis", "stretch": "wiu", "word": "ws", "rest": "lc", "ratio": "iiit",
    "narrow": "ws", "mul": "iis", "madd": "imms", "add": "ii", "sub": "ii", "shift": "it", "div": "iit",
    "reciprocal": "is", "sqrt": "it", "floor": "if", "wrap": "ih", "hypot": "ii", "sin": "iff", "cos": "iff",
    "atan": "iff", "atan2": "iir", "exp": "iff", "log": "iff", "tan": "ifg",
    "asin": "ifg", "acos": "ifg", "sinh": "ifg", "cosh": "ifg", "tanh": "ifg", "pow": "ififg",
}  # fmt: skip
C_TYPES = {"w": "int64_t", "h": "int64_t", "l": "int64_t", "i": "int32_t", "m": "int32_t"}
NUMPY_TYPES = {"w": np.int64, "h": np.int64, "l": np.int64, "i": np.int32, "m": np.int32}
RANGES = {
    "l": (-(2**52), 2**52), "m": (1 - 2**30, 2**30 - 1), "s": (0, 62), "t": (-62, 62), "f": (0, 31), "g": (0, 30),
    "r": (0, 29), "u": (17, 62), "c": (1, 31),
}  # fmt: skip
COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)]
HEAD = "#include <stdbool.h>\n#include <stdint.h>\n#define SATURATED UINT32_C(0x20)\n"


def source(ops: Iterable[str] = ARGUMENTS, floor: bool = False) -> str:
    """The static functions, prefix `t`."""
    return HEAD + macro("helpers/q.j2", "routines", "t", closure(ops, floor), tables, "SATURATED", floor=floor)


def callers() -> str:
    """For each routine a function that calls it with n sets of arguments; status 1 is set before each call."""
    out = []
    for op, letters in ARGUMENTS.items():
        names = [f"{letter}{i}" for i, letter in enumerate(letters)]
        taken = ", ".join(f"const {C_TYPES.get(name[0], 'int')} *{name}" for name in names)
        given = ", ".join(f"{name}[i]" for name in names)
        out += [f"void call_{op}(int n, {taken}, int64_t *result, uint32_t *status);"]
        out += [f"void call_{op}(int n, {taken}, int64_t *result, uint32_t *status)", "{"]
        out += ["    for (int i = 0; i < n; i++) {", "        status[i] = 1;"]
        given += "" if op in WITHOUT_STATUS else ", &status[i]"
        out += [f"        result[i] = t_q_{op}({given});", "    }", "}"]
    return "\n".join(out)


class Routines:
    """One compilation of all routines."""

    def __init__(self, library: Path) -> None:
        self.ffi = FFI()
        self.ffi.cdef("\n".join(line for line in callers().split("\n") if line.endswith(";") and line[0] == "v"))
        self.library = self.ffi.dlopen(str(library))

    def __call__(self, op: str, *columns: Sequence[int]) -> tuple[list[int], list[int]]:
        """Results and statuses for columns of arguments."""
        n = len(columns[0])
        letters = ARGUMENTS[op]
        types = [NUMPY_TYPES.get(letter, np.intc) for letter in letters]
        arrays: list[Any] = [np.array(c, dtype=t) for c, t in zip(columns, types, strict=True)]
        result, status = np.zeros(n, np.int64), np.zeros(n, np.uint32)
        names = [C_TYPES.get(letter, "int") for letter in letters]
        pointers = [self.ffi.from_buffer(f"{t}[]", a) for t, a in zip(names, arrays, strict=True)]
        outputs = [self.ffi.from_buffer("int64_t[]", result), self.ffi.from_buffer("uint32_t[]", status)]
        getattr(self.library, f"call_{op}")(n, *pointers, *outputs)
        return result.tolist(), status.tolist()


def expected(op: str, *columns: Sequence[int], **options: Any) -> tuple[list[int], list[int]]:
    """The same, by the Python routines."""
    function = TWINS[op]
    results, statuses = [], []
    for arguments in zip(*columns, strict=True):
        status = Status()
        flags = () if op in WITHOUT_STATUS else (status,)
        results.append(function(*arguments, *flags, **options))
        statuses.append(status.bits | 1)
    return results, statuses


_numbers = count()


@cache
def _folder() -> Path:
    return Path(mkdtemp(prefix="kfgen-fixed-"))


@cache
def compiled(compiler: str, flags: tuple[str, ...], floor: bool = False) -> Routines:
    """The routines as one compiler makes them; warnings are errors."""
    name = f"routines{next(_numbers)}"
    text = source(floor=floor) + "\n" + callers() + "\n"
    (_folder() / f"{name}.c").write_text(text)
    warnings = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Wshadow", "-Werror"]
    command = [compiler, "-std=c99", *warnings, *flags, "-shared", "-fPIC", f"{name}.c", "-o", f"{name}.so"]
    done = subprocess.run(command, cwd=_folder(), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return Routines(_folder() / f"{name}.so")


__all__ = ["ARGUMENTS", "COMPILERS", "NEEDS", "RANGES", "compiled", "expected", "source"]
