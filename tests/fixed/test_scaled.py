"""The multiply-adds of lowered programs: both ways to compute them give what the interpreter says, at every edge."""

from __future__ import annotations

import random
import subprocess
from types import SimpleNamespace

import numpy as np
import pytest
from cffi import FFI

from kfgen.emit.render import macro
from kfgen.fixed.arithmetic import tables
from kfgen.fixed.arithmetic.routines import closure
from kfgen.fixed.arithmetic.scalar import INSIDE, Fixed
from tests.boards.machines import BOARDS
from tests.fixed.routines import COMPILERS, HEAD

CALLS = """
void macs(int n, const int32_t *c, const int32_t *a, const int32_t *b, const int32_t *s, int32_t *out, uint32_t *status)
{
    for (int i = 0; i < n; i++) { out[i] = t_q_mac(c[i], a[i], b[i], s[i], &status[i]); }
}
void fmas(int n, const int32_t *c, const int32_t *a, const int32_t *b, const int32_t *s, int32_t *out)
{
    for (int i = 0; i < n; i++) { out[i] = t_q_fma(c[i], a[i], b[i], s[i]); }
}
"""
DRAWN = """
static uint32_t state, total;
static int32_t drawn(void)
{
    state ^= state << 13;
    state ^= state >> 17;
    state ^= state << 5;
    return t_q_bits(state);
}
static int32_t inside(void)
{
    const int32_t value = drawn();
    return t_q_sar32(value, 2 + (int)(state & 15u));
}
static void count(int32_t value) { total = total * 31u + (uint32_t)value; }
int tests(void);
int tests(void)
{
    state = 1u;
    total = 0;
    for (int i = 0; i < ROUNDS; i++) {
        const int32_t c = inside(), a = inside(), b = inside(), d = drawn(), e = drawn();
        const int s = 17 + (int)(state & 15u);
        uint32_t status = 0;
        count(t_q_mac(c, a, b, s, &status));
        if (status == 0) { count(t_q_fma(c, a, b, s)); }
        count(t_q_mul(d, e, s, &status));
        count((int32_t)status);
    }
    return total != EXPECTED;
}
"""
ROUNDS = 2000
PROTOTYPES = "\n".join(line + ";" for line in CALLS.splitlines() if line.startswith("void"))


def factors(source: random.Random) -> tuple[int, int, int, int]:
    """c, a, b, s; half of them so that the sum is beside one of its limits."""
    s = source.randint(17, 32)
    a, b = (source.choice((-1, 1)) * source.getrandbits(source.randint(1, 30)) for _ in range(2))
    a, b = (max(-INSIDE, min(INSIDE, v)) for v in (a, b))
    c = source.randint(-INSIDE, INSIDE)
    if source.random() < 0.5:
        limit = source.choice((INSIDE, 24576 << 16, 2**31)) * source.choice((-1, 1)) + source.randint(-(2**17), 2**17)
        c = limit - (a * b >> s)
    return max(-INSIDE, min(INSIDE, c)), a, b, s


def routines(floor: bool) -> str:
    """The multiply-adds, and the product that saturates."""
    view = SimpleNamespace(
        name="t", NAME="T", routines=SimpleNamespace(own=("fit", "fma", "mac"), floor=floor), helpers=()
    )
    basic = macro("helpers/q.j2", "routines", "t", closure(["asr", "moved", "mul", "product", "round"], floor), tables,
                  "T_SATURATED", floor=floor)  # fmt: skip
    head = HEAD + "#define T_SATURATED SATURATED\ntypedef uint32_t t_status_t;\n"
    return head + basic + macro("helpers/scaled.j2", "define", view)


@pytest.mark.parametrize("rounding", ["nearest", "floor"])
@pytest.mark.parametrize("target", ["", "-D__ARM_ARCH_6M__"])
def test_interpreter_and_c_agree(target, rounding, tmp_path):
    floor = rounding == "floor"
    (tmp_path / "t.c").write_text(routines(floor) + CALLS)
    flags = ["-O1", "-fsanitize=undefined", "-fno-sanitize-recover=all", *target.split()]
    command = [COMPILERS[0], "-std=c99", *flags, "-shared", "-fPIC", "t.c", "-o", "t.so"]
    subprocess.run(command, cwd=tmp_path, check=True)
    ffi = FFI()
    ffi.cdef(PROTOTYPES)
    library = ffi.dlopen(str(tmp_path / "t.so"))
    source, n = random.Random(3), 20000
    rows = [factors(source) for _ in range(n)] + [(c, a, b, s) for c in (INSIDE, -INSIDE) for a in (INSIDE, -INSIDE)
                                                  for b in (INSIDE, -INSIDE) for s in range(17, 33)]  # fmt: skip

    def run(name, given, *status):
        columns = [np.array(column, np.int32) for column in zip(*given, strict=True)]
        out = np.zeros(len(given), np.int32)
        pointers = [ffi.from_buffer("int32_t[]", each) for each in (*columns, out)]
        getattr(library, name)(len(given), *pointers, *(ffi.from_buffer("uint32_t[]", each) for each in status))
        return out.tolist()

    scalar, wanted, flags_wanted, fitting = Fixed("q16.16", rounding), [], [], []
    for c, a, b, s in rows:
        scalar.status.bits = 0
        wanted.append(scalar.evaluate("q_mac", (s,), [c, a, b]))
        flags_wanted.append(scalar.status.bits)
        exact = c + (a * b + (0 if floor else 1 << (s - 1)) >> s)
        assert wanted[-1] == max(-INSIDE, min(INSIDE, exact))
        if abs(exact) < 2**31:
            fitting.append(((c, a, b, s), exact))
    status = np.zeros(len(rows), np.uint32)
    assert run("macs", rows, status) == wanted
    assert status.tolist() == flags_wanted
    assert any(flags_wanted)
    assert not all(flags_wanted)
    assert run("fmas", [row for row, _ in fitting]) == [value for _, value in fitting]


def total_of(rounding: str) -> int:
    """What DRAWN counts, as interpreted."""
    scalar, state, total = Fixed("q16.16", rounding), 1, 0

    def drawn() -> int:
        nonlocal state
        state ^= state << 13 & 0xFFFFFFFF
        state ^= state >> 17
        state ^= state << 5 & 0xFFFFFFFF
        return state - (state >> 31 << 32)

    def inside() -> int:
        value = drawn()
        return value >> (2 + (state & 15))

    for _ in range(ROUNDS):
        c, a, b, d, e = inside(), inside(), inside(), drawn(), drawn()
        s = 17 + (state & 15)
        scalar.status.bits = 0
        found = [scalar.evaluate("q_mac", (s,), [c, a, b])]
        if scalar.status.bits == 0:
            found.append(scalar.evaluate("q_fma", (s,), [c, a, b]))
        found += [scalar.evaluate("q_mul", (s,), [d, e]), scalar.status.bits]
        for value in found:
            total = (total * 31 + value) & 0xFFFFFFFF
    return total


@pytest.mark.parametrize("rounding", ["nearest", "floor"])
@pytest.mark.parametrize("board", ["m0", "m4", "rv32", "avr"])
def test_processors_agree(board, rounding, needs, tmp_path):
    """Each has its own way to multiply."""
    needs(*BOARDS[board].tools)
    given = f"#define ROUNDS {ROUNDS}\n#define EXPECTED {total_of(rounding)}u\n"
    (tmp_path / "t.c").write_text(routines(rounding == "floor") + given + DRAWN)
    (tmp_path / "main.c").write_text("int tests(void);\nint main(void) { return tests(); }\n")
    sources = ["t.c"] if board == "avr" else ["t.c", "main.c"]
    assert BOARDS[board].status(tmp_path, sources, "-w") == 0
