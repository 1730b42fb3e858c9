"""8-bit AVR: avr-gcc with avr-libc, run by simavr, which counts cycles exactly (an ATmega1284P)."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from kfgen.cost.emulated import function_of, shared
from kfgen.cost.figures import Cost, FunctionCost
from kfgen.cost.job import Job
from kfgen.cost.toolchain import CODE, DATA, Gcc, Placed, in_flash, installed_gcc
from kfgen.errors import KfgenError
from kfgen.status import ERROR

MCU = "atmega1284p"
_INSTALL = "install gcc-avr, avr-libc and simavr"
_LINE = re.compile(r"kf:([0-9a-f]{2}):([0-9a-f]{8}):([0-9a-f]{4}):([0-9a-f]{8})")
_SECONDS = 600

# Timer 1 counts cycles, timer 3 every 1024th: together they measure far beyond 16 bits. Every function is called
# through a pointer, as is one that only returns: the difference is the function's own.
_DRIVER = """
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/pgmspace.h>
#include <avr/sleep.h>

typedef struct {{ uint32_t cycles; uint16_t stack; }} figures_t;

static void put(char c) {{ while (!(UCSR0A & _BV(UDRE0))) {{ }} UDR0 = c; }}

static void hex(uint32_t value, uint8_t digits)
{{
    while (digits--) {{ put("0123456789abcdef"[(value >> (4 * digits)) & 15]); }}
}}

__attribute__((noinline)) static void nothing(void) {{ __asm__ volatile("" ::: "memory"); }}

static uint8_t *const lowest = (uint8_t *)({ramend} - {depth});

static uint16_t deepest(void)
{{
    uint8_t *p = lowest;
    while (*p == 0xa5) {{ p++; }}
    return (uint16_t)p;
}}

static void start(void)
{{
    for (uint8_t *p = lowest; p < (uint8_t *)SP - 8; p++) {{ *p = 0xa5; }}
    TCCR1B = 0; TCCR3B = 0;
    TCNT1 = 0; TCNT3 = 0;
    TCCR3B = _BV(CS32) | _BV(CS30);
    TCCR1B = _BV(CS10);
}}

static figures_t stop(uint16_t low)
{{
    const uint32_t coarse = (uint32_t)TCNT3 << 10;
    uint32_t cycles = (coarse & 0xffff0000UL) | low;
    if (cycles > coarse && cycles - coarse > 0x8000) {{ cycles -= 0x10000UL; }}
    if (cycles < coarse && coarse - cycles > 0x8000) {{ cycles += 0x10000UL; }}
    const figures_t found = {{ cycles, deepest() }};
    return found;
}}

static void tell(uint8_t which, figures_t full, figures_t empty, uint32_t status)
{{
    put('k'); put('f'); put(':'); hex(which, 2); put(':'); hex(full.cycles - empty.cycles + 4, 8);
    put(':'); hex(empty.stack - full.stack, 4); put(':'); hex(status, 8); put('\\n');
}}
{functions}
static const uint8_t order[] PROGMEM = {{ {order} }};
static const {name}_real_t numbers[] PROGMEM = {{ {numbers} }};
static const uint32_t masks[] PROGMEM = {{ {masks} }};

int main(void)
{{
    const {name}_real_t *next = numbers;
    const uint32_t *next_mask = masks;
    (void)next_mask;
    UCSR0B = _BV(TXEN0);
    measure_init();
    for (uint16_t i = 0; i < sizeof order; i++) {{
        switch (pgm_read_byte(&order[i])) {{
{cases}
        }}
    }}
    cli();
    sleep_enable();
    sleep_cpu();
    return 0;
}}
"""

# the empty call comes first: it changes nothing that the other one reads
_FUNCTION = """
static void measure_{function}(void)
{{
    __typeof__(&{name}_{function}) volatile f = (__typeof__(&{name}_{function}))(uint16_t)nothing;
    uint16_t low;
    start(); (void){call}; low = TCNT1;
    const figures_t empty = stop(low);
    f = {name}_{function};
    start(); const uint32_t status = (uint32_t){call}; low = TCNT1;
    tell({index}, stop(low), empty, status);
}}
"""


@dataclass(frozen=True)
class _Avr:
    name: str = "avr"
    title: str = "AVR, ATmega1284P"

    def takes_gcc_flags(self, compiler: str | None = None) -> bool:
        return True

    def compiler(self, wanted: str | None = None) -> Gcc:
        """avr-gcc. KfgenError says what to install."""
        machine = (f"-mmcu={MCU}",)
        command = installed_gcc(["avr-gcc"], machine)
        if wanted not in (None, "gcc") or command is None:
            raise KfgenError(f"no {wanted or 'compiler'} for avr found; {_INSTALL}")
        return Gcc(command, machine, (), ("-nostartfiles",))

    def measure(self, job: Job, flags: Sequence[str] = (), compiler: str | None = None) -> Cost:
        """Compile, simulate, and read what the program tells. KfgenError where a tool is missing."""
        chosen = self.compiler(compiler)
        if shutil.which("simavr") is None:
            raise KfgenError(f"simavr was not found; {_INSTALL}")
        with TemporaryDirectory(prefix="kfgen-") as name:
            folder = Path(name)
            for file, text in {**job.files, "kfgen_driver.c": job.driver(), "kfgen_main.c": _main(job)}.items():
                (folder / file).write_text(text, encoding="utf-8", newline="\n")
            own = chosen.compile(folder, f"{job.name}.c", flags)
            objects = [own, chosen.compile(folder, "kfgen_driver.c")]
            counted = [each for each, counts in job.functions.items() if counts]
            roots = [f"{job.prefix}{each}" for each in ("init", *counted)]
            sizes = chosen.link(folder, objects, roots, f"{job.name}_init").sections
            main = chosen.compile(folder, "kfgen_main.c")
            linked = Gcc(chosen.command, chosen.machine).link(folder, [own, main], ["main"], "main").sections
            told = _simulate(folder)
        figures: dict[str, list[tuple[int, int]]] = {each: [] for each in ("init", *job.functions)}
        errors = 0
        for which, cycles, stack, status in told:
            figures[list(figures)[which]].append((cycles, stack))
            errors += status >= ERROR
        if len(told) != 1 + len(job.steps):
            raise KfgenError(f"{job.name}: the simulated program ended after {len(told)} of {len(job.steps) + 1} calls")
        flash, ram = in_flash(sizes, (*CODE, ".data")), in_flash(sizes, (*DATA, ".rodata"))
        functions = {
            each: FunctionCost(
                tuple(cycles for cycles, _ in figures[each]), _of_function(linked, f"{job.name}_{each}", own),
                max((stack for _, stack in figures[each]), default=0),
                sum(cycles for cycles, _ in figures[each]) / len(figures[each]) if figures[each] else None,
            )
            for each in job.functions
        }  # fmt: skip
        libraries = sum(size for origin, size in flash.items() if origin not in objects)
        struct = _size_of(linked, main)
        return Cost(
            job.name, job.scalar, self.name, chosen.title, tuple(flags), "cycles", functions, flash.get(own, 0),
            flash.get(own, 0) + libraries, struct + ram.get(own, 0), errors, "",
            shared(job, functions, flash.get(own, 0)), figures["init"][0][1],
        )  # fmt: skip


def _simulate(folder: Path) -> list[tuple[int, ...]]:
    command = ["simavr", "-m", MCU, "-f", "16000000", "program.elf"]
    try:
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, errors="replace", check=False, timeout=_SECONDS
        )
    except subprocess.TimeoutExpired:
        raise KfgenError(f"simavr did not end within {_SECONDS} s") from None
    return [tuple(int(part, 16) for part in match) for match in _LINE.findall(done.stdout + done.stderr)]


def _of_function(sections: Sequence[Placed], name: str, own: str) -> int:
    return sum(each.size for each in sections if each.origin == own and function_of(each.section) == name)


def _size_of(sections: Sequence[Placed], main: str) -> int:
    """The struct, which stands in a section of its own."""
    return sum(s.size for s in sections if s.origin == main and s.section.endswith("_kfgen_kf"))


def _main(job: Job) -> str:
    """A program that makes the calls and tells what each took."""
    names = ["init", *job.functions]
    p = job.prefix
    lines = [f"static {job.name}_t {p}kf;"]
    lines += [f"static {kind} {p}{variable};" for variable, kind in job.variables.items()]
    text = "\n" + "\n".join(lines) + "\n"
    cases: list[str] = []
    numbers: list[str] = []
    masks: list[str] = []
    for index, function in enumerate(names):
        call = job.calls[function].replace(f"{job.name}_{function}(", "f(", 1)
        text += _FUNCTION.format(function=function, name=job.name, call=call, index=index)
        reads = [
            f"next_mask = pgm(&{p}mask, next_mask, sizeof {p}mask);" if variable == "mask" else
            f"next = pgm(&{p}{variable}, next, sizeof {p}{variable});"
            for variable in job.variables if re.search(rf"\b{p}{variable}\b", job.calls[function])
        ]  # fmt: skip
        cases.append(f"        case {index}: {' '.join(reads)} measure_{function}(); break;")
    for step in job.steps:
        for variable in job.variables:
            if re.search(rf"\b{p}{variable}\b", job.calls[step.function]):
                target = masks if variable == "mask" else numbers
                target += [_literal(value) for value in step.values[variable].tolist()]
    return (
        f'#include "{job.name}.h"\n#include <avr/pgmspace.h>\n'
        "static const void *pgm(void *to, const void *from, uint16_t size)\n"
        "{ memcpy_P(to, from, size); return (const char *)from + size; }\n"
        + _DRIVER.format(
            name=job.name, ramend="RAMEND", depth=8192, functions=text,
            order=", ".join(str(names.index(step.function)) for step in job.steps),
            numbers=", ".join(numbers) or "0", masks=", ".join(masks) or "0", cases="\n".join(cases),
        )
    )  # fmt: skip


def _literal(value: float) -> str:
    return f"{value}L" if isinstance(value, int) else repr(value)


TARGETS = [_Avr()]
