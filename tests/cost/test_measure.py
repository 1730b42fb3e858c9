"""kfgen.cost against an independent measurement, on every target, with either compiler."""

from __future__ import annotations

import pytest

from kfgen.cost import measure, target_of, targets
from kfgen.cost.targets import avr
from kfgen.cost.toolchain import sections_of_gnu_map, sections_of_lld_map
from kfgen.errors import KfgenError
from kfgen.generate import build
from kfgen.override import override
from kfgen.simulate import simulate
from kfgen.spec import loads
from tests.cost import independent
from tests.oracle import problems

PARTIAL = """
kfgen: 1
name: partial
dt: {nominal: 0.1, min: 0.01}
states: {a: {init: 1, std: 1}, b: {init: 0, std: 1}}
inputs: {push: {range: [-1, 1]}}
dynamics: {form: discrete, f: {a: a + dt*sin(b), b: b + dt*push}, Q: {a: 0.01*dt, b: 0.01*dt}}
measurements:
  both: {partial: true, z: {a: {h: a, std: 0.5}, b: {h: a + b, std: 0.5}}}
filter: {type: ekf}
"""


@pytest.mark.parametrize("text", [problems.VEHICLE4, PARTIAL], ids=["vehicle4", "partial"])
def test_agrees_with_an_independent_measurement(needs, text):
    needs("arm-none-eabi-gcc")
    spec = override(loads(text), "float")
    generated, log = build(spec), simulate(spec, 15)
    found = measure(generated, log, compiler="gcc")
    other = independent.measure(spec, generated.files, log)
    assert {name: list(each) for name, each in found.instructions.items() if each} == other.instructions
    assert (found.flash, found.ram, found.stack, found.errors) == (other.flash, other.ram, other.stack, 0)
    assert found.flash_linked > found.flash  # sinf
    assert found.flash == found.shared + sum(f.flash for name, f in found.functions.items() if "masked" not in name)


def test_a_masked_update_is_measured_where_the_log_has_gaps(needs):
    needs("arm-none-eabi-gcc")
    spec = loads(PARTIAL)
    log = simulate(spec, 12)
    log.columns["both.a"][::3] = float("nan")
    log.columns["both.b"][5] = log.columns["both.a"][5] = float("nan")
    found = measure(build(spec), log)
    assert len(found.functions["predict"].counts) == 12
    assert len(found.functions["update_both"].counts) == 7
    assert len(found.functions["update_both_masked"].counts) == 4
    assert found.functions["update_both_masked"].flash > 0


@pytest.fixture(scope="module")
def cv4():
    spec = override(loads(problems.CV4), "float")
    return build(spec), simulate(spec, 3)


# one predict and one update of cv4, roughly: in hardware, in software
HARD, SOFT = (200, 450), (6000, 20000)
EXPECTED = {
    "cortex-m4f": HARD, "cortex-m7": HARD, "cortex-m33": HARD, "rv32imafc": HARD, "host": HARD,
    "cortex-m0": SOFT, "cortex-m3": SOFT, "rv32imc": SOFT, "avr": (20000, 40000),
}  # fmt: skip
TOOLS = {"rv32": "riscv64-unknown-elf-gcc", "cort": "arm-none-eabi-gcc", "avr": "simavr", "host": "cc"}


def test_every_target_is_tested():
    assert set(targets()) == set(EXPECTED)


# ziglang takes some seconds to build its library for a processor it has not seen
BOTH = [*((name, "gcc") for name in EXPECTED), *((name, "zig") for name in ("cortex-m4f", "rv32imc", "avr"))]


@pytest.mark.parametrize(("name", "compiler"), BOTH)
def test_targets(needs, cv4, name, compiler):
    """Figures of a sensible size, the filter working."""
    if compiler == "gcc":
        needs(TOOLS[name[:4]])
    elif name == "avr":
        with pytest.raises(KfgenError, match=r"no zig for avr found; install gcc-avr, avr-libc and simavr"):
            measure(*cv4, name, compiler=compiler)
        return
    else:
        pytest.importorskip("ziglang")
    found = measure(*cv4, name, compiler=compiler)
    low, high = EXPECTED[name]
    assert low <= found.step <= high
    assert found.errors == 0
    assert found.ram == 60
    assert 0 < found.functions["predict"].stack < 300
    assert 800 < found.flash < 5500
    assert found.flash <= found.flash_linked < found.flash + 6000
    cycles = found.functions["predict"].cycles
    assert cycles is not None
    assert cycles >= (0.4 if name == "host" else 0.8) * found.functions["predict"].mean
    assert ("gcc" in found.compiler or "cc (" in found.compiler) == (compiler == "gcc")


def test_flags_reach_the_compiler(needs, cv4):
    needs("arm-none-eabi-gcc")
    plain, small = (measure(*cv4, flags=flags) for flags in ((), ("-Os",)))
    assert small.flags == ("-Os",)
    assert small.functions != plain.functions


def test_what_is_missing_is_named(cv4, monkeypatch):
    monkeypatch.setattr("kfgen.cost.emulated.has_zig", lambda: False)
    monkeypatch.setattr("shutil.which", lambda name: None)
    with pytest.raises(KfgenError, match=r"no compiler for cortex-m0 found; install arm-none-eabi-gcc"):
        measure(*cv4, "cortex-m0")
    with pytest.raises(KfgenError, match=r"no compiler for avr found; install gcc-avr, avr-libc and simavr"):
        measure(*cv4, "avr")
    monkeypatch.setattr("kfgen.cost.emulated.find_spec", lambda name: None)
    with pytest.raises(KfgenError, match=r"pip install 'kfgen\[cost\]'"):
        measure(*cv4, "cortex-m4f")
    with pytest.raises(KfgenError, match=r"target `z80` is unknown; write one of avr, cortex-m4f"):
        target_of("z80")


def test_double_and_its_arguments(needs):
    """A step given as a double, beside a pointer: the compiler's own affair, on each ABI."""
    needs("arm-none-eabi-gcc", "riscv64-unknown-elf-gcc")
    spec = loads(PARTIAL.replace("name: partial", "name: partial\nscalar: double"))
    generated, log = build(spec), simulate(spec, 3)
    for name in ("cortex-m4f", "cortex-m7", "rv32imafc"):
        found = measure(generated, log, name)
        assert found.errors == 0
        assert len(found.functions["predict"].counts) == 3


def test_maps():
    text = """Linker script and memory map

 .text.f_init   0x00008000       0x1c f.o
 .text.f_a_very_long_name
                0x0000801c       0x20 f.o
 .text          0x00000000        0x8 f.o
 *fill*         0x0000803c        0x4
 .text          0x00008040       0x40 /usr/lib/libm.a(sf_sin.o)
"""
    assert [(p.origin, p.section, p.size) for p in sections_of_gnu_map(text)] == [
        ("f.o", ".text.f_init", 28), ("f.o", ".text.f_a_very_long_name", 32),
        ("/usr/lib/libm.a(sf_sin.o)", ".text", 64),
    ]  # fmt: skip
    text = """     VMA      LMA     Size Align Out     In      Symbol
    8000     8000     5338     8 .text
    8000     8000       8e     4         f.o:(.text.f_init)
    8090     8090        0     1                 {}
    8090     8090      130     8         libm.a(m_zcu.o):(.text..Lmath.pow)
""".replace("{}", "")
    assert [(p.origin, p.size) for p in sections_of_lld_map(text)] == [("f.o", 142), ("libm.a(m_zcu.o)", 304)]


def test_the_avr_program_holds_every_call(cv4):
    from kfgen.cost import make_job

    text = avr._main(make_job(*cv4))
    assert "order[] PROGMEM = { 1, 2, 1, 2, 1, 2 };" in text


def test_what_ziglang_lacks_is_told():
    pytest.importorskip("ziglang")
    spec = loads(PARTIAL)
    found = measure(build(spec), simulate(spec, 2), compiler="zig")
    assert found.remark.startswith("sinf, cosf")
    assert found.functions["predict"].mean > 300  # a double sine without doubles
