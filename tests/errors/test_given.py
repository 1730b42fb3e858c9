"""Mistakes around what comes with measurements, what the first of them sets, and what is told: place and cure."""

from __future__ import annotations

import pytest

from kfgen.errors import SpecError
from kfgen.spec import loads

TEXT = """
kfgen: 1
name: bad
dt: 0.1
parameters: {s0: 1}
inputs: {u1: {}}
states: {p: {init: 0, std: 1}, v: {init: 0, std: 1}}
dynamics: {f: {p: "p + 0.1*v", v: "v + u1"}, Q: {v: 0.1}}
measurements:
  m: {inputs: {b: {}}, z: {z1: {h: p - b, std: 1}}}
  n: {z: {z1: {h: p, std: 1}}}
"""
OWN = "inputs: {b: {}}, z: {z1: {h: p - b, std: 1}}"


@pytest.mark.parametrize(("own", "said"), [
    ("inputs: {p: {}}, z: {z1: {h: v - p, std: 1}}", ["`p`", "a state", "another"]),
    ("inputs: {u1: {}}, z: {z1: {h: p - u1, std: 1}}", ["`u1`", "already", "another"]),
    ("inputs: {s0: {}}, z: {z1: {h: p - s0, std: 1}}", ["`s0`", "a parameter", "another"]),
    ("inputs: {z1: {}}, z: {z1: {h: p - z1, std: 1}}", ["`z1`", "component"]),
    ("inputs: {b: {range: [2, 1]}}, z: {z1: {h: p - b, std: 1}}", ["[2, 1]", "order"]),
    ("inputs: {b: {std: 1}}, z: {z1: {h: p - b, std: 1}}", ["std"]),
])  # fmt: skip
def test_inputs_of_sensors(own: str, said: list[str]) -> None:
    with pytest.raises(SpecError) as caught:
        loads(TEXT.replace(OWN, own))
    assert all(word in str(caught.value) for word in said), caught.value


@pytest.mark.parametrize("where", ["let: {k: b + 1}", "outputs: {o: {value: p + b}}"])
def test_they_are_known_to_their_sensor_alone(where: str) -> None:
    with pytest.raises(SpecError, match="input of the sensor `m`"):
        loads(TEXT + where + "\n")
    with pytest.raises(SpecError, match="input of the sensor `m`"):
        loads(TEXT.replace("v + u1", "v + b"))


def test_two_sensors_may_call_theirs_alike() -> None:
    spec = loads(TEXT.replace("n: {z: {z1: {h: p,", "n: {inputs: {b: {}}, z: {z1: {h: v - b,"))
    assert [[i.name for i in sensor.inputs] for sensor in spec.measurements] == [["b"], ["b"]]


@pytest.mark.parametrize(("rule", "said"), [
    ("[{from: m, states: {p: z1}}, {from: m, states: {v: z1}}]", ["`m`", "twice"]),
    ("{from: m, states: {p: z1}, var: {p: -2}}", ["-2", "negative"]),
    ("{from: m, states: {p: zz}}", ["`zz`", "z1"]),
    ("{from: m, states: {p: z1 + v}}", ["`v`", "components"]),
    ("{from: n, states: {p: z1 + b}}", ["`b`"]),
    ("{from: m, states: {p: z1 + t}}", ["`t`"]),
    ("{from: m, states: {p: z1}, var: {q: 1}}", ["`q`", "p, v"]),
    ("{from: k, states: {p: z1}}", ["`k`"]),
])  # fmt: skip
def test_first_measurements(rule: str, said: list[str]) -> None:
    with pytest.raises(SpecError) as caught:
        loads(TEXT + f"initialize: {rule}\n")
    assert all(word in str(caught.value) for word in said), caught.value


def test_a_steady_gain_keeps_no_variances() -> None:
    rest = "filter: {type: kf, gain: steady}\ninitialize: {from: m, states: {p: z1}, var: {p: 1}}\n"
    with pytest.raises(SpecError, match="keeps no variances"):
        loads(TEXT + rest)
    loads(TEXT + rest.replace(", var: {p: 1}", ""))


@pytest.mark.parametrize(("text", "said"), [
    ("outputs: {o: {value: p + u1}}", ["`u1`", "states"]),
    ("let: {k: u1 + p}\noutputs: {o: {value: k}}", ["`u1`", "`k`"]),
    ("outputs: {o: {value: p > 1}}", ["condition"]),
    ("outputs: {int: {value: p}}", ["int"]),
    ("scalar: q16.16\noutputs: {p: {value: 2*p}}", ["BAD_P_LSB", "rename"]),
])  # fmt: skip
def test_outputs(text: str, said: list[str]) -> None:
    with pytest.raises(SpecError) as caught:
        loads(TEXT + text + "\n")
    assert all(word in str(caught.value) for word in said), caught.value


def test_a_sensor_named_outputs_is_refused_beside_some() -> None:
    text = TEXT.replace("  n: {", "  outputs: {")
    loads(text)
    with pytest.raises(SpecError, match="bad_outputs_t"):
        loads(text + "outputs: {o: {value: p}}\n")


def test_modes_have_the_same_inputs() -> None:
    bank = """imm:
  modes: {a: {}, c: {measurements: {m: {OWN, z: {z1: {h: p, std: 2}}}, n: {z: {z1: {h: p, std: 1}}}}}}
  transition: [[0.9, 0.1], [0.1, 0.9]]
  mu0: [0.5, 0.5]
"""
    loads(TEXT + bank.replace("OWN", "inputs: {b: {}}"))
    for other in ("partial: false", "inputs: {k: {}}"):
        with pytest.raises(SpecError, match="other sensors or components"):
            loads(TEXT + bank.replace("OWN", other))
