"""Where the rounding of states can be carried on: in floating point, by filters that linearise."""

from __future__ import annotations

from kfgen.scalar_names import is_fixed
from kfgen.spec.rules.facts import Facts


def check(facts: Facts) -> None:
    spec = facts.spec
    if not spec.code.compensated:
        return
    at = spec.code.places.get("compensated", spec.place)
    if is_fixed(spec.scalar):
        facts.add(at, f"`compensated` does not go with `scalar: {spec.scalar}`: fixed point carries on what it needs",
                  "remove the key")  # fmt: skip
    elif spec.imm is not None:
        text = "`compensated` does not go with `imm`: modes are mixed in one word"
        facts.add(at, text, "use double, or a local origin")
    elif spec.filter.type == "ukf" or spec.filter.gain is not None:
        what = "ukf: its points are drawn about x" if spec.filter.type == "ukf" else "`gain: steady`"
        facts.add(at, f"`compensated` does not go with {what}", "use double, a local origin, or another filter")
    if len(set(spec.code.compensated)) < len(spec.code.compensated):
        facts.add(at, "a state stands twice in `compensated`", "name each once")
