"""The same emitted C gives the same bits on every processor, where it calls no libm and nothing is contracted."""

from __future__ import annotations

import pytest

from kfgen.cost import make_job, target_of
from kfgen.generate import build
from kfgen.native import load_filters
from kfgen.override import override
from kfgen.simulate import simulate
from kfgen.spec import loads
from tests.oracle import problems

FLAGS = ("-ffp-contract=off",)
STEPS = 12
# hardware floats and software ones, of two architectures; beside them this computer's
TARGETS = {
    "cortex-m4f": "arm-none-eabi-gcc", "cortex-m0": "arm-none-eabi-gcc",
    "rv32imc": "riscv64-unknown-elf-gcc", "rv32imafc": "riscv64-unknown-elf-gcc",
}  # fmt: skip


@pytest.fixture(scope="module")
def here():
    """Name -> its job, and the struct's bytes after each call on this computer."""
    found = {}
    for text in (problems.CV4, problems.chain(8)):
        spec = override(loads(text), "float")
        generated = build(spec)
        job = make_job(generated, simulate(spec, STEPS), STEPS)
        (kf,) = load_filters([generated], flags=("-O2", *FLAGS))
        states = [memory(kf)]
        for step in job.steps:
            if step.function == "predict":
                assert kf.predict() == 0
            else:
                assert kf.update("position" if "position" in kf.sensors else "gnss", step.values[zs(step)]) == 0
            states.append(memory(kf))
        found[spec.name] = job, states
    return found


def zs(step) -> str:
    return next(name for name in step.values if name.startswith("z_"))


def memory(kf) -> bytes:
    return bytes(kf.struct.ffi.buffer(kf.struct.data))


def replayed(job, flags: tuple[str, ...], target: str, size: int) -> list[bytes]:
    """The struct's bytes after init and after each call, on an emulated processor."""
    machine = target_of(target).load(job, flags, "gcc")
    p, states = job.prefix, []
    for step in [None, *job.steps]:
        function = step.function if step else "init"
        for variable, values in step.values.items() if step else ():
            if variable in job.variables:
                machine.write(f"{p}{variable}", values)
        machine.call(f"{p}{function}", f"{job.name}_{function}")
        assert machine.word(f"{p}status") == 0
        states.append(machine.read(f"{p}kf", size))
    return states


@pytest.mark.parametrize("name", ["cv4", "chain8"])
@pytest.mark.parametrize("target", TARGETS)
def test_the_same_bits(here, needs, target, name):
    needs(TARGETS[target])
    job, states = here[name]
    assert len(set(states)) == len(states)
    assert replayed(job, FLAGS, target, len(states[0])) == states


def test_contraction_changes_bits(here, needs):
    """What the flag is for: with it left out, a Cortex-M4F fuses products into sums."""
    needs("arm-none-eabi-gcc")
    job, states = here["chain8"]
    assert replayed(job, (), "cortex-m4f", len(states[0])) != states
