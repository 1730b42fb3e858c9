"""`unroll` within `flash`: which functions become loops, what is told of it, and what does not fit."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from emitted import problems
from variants import call

from kfgen.commands.build import report
from kfgen.commands.built import Built
from kfgen.commands.tables import lines
from kfgen.errors import SpecError
from kfgen.generate import Generated, build
from kfgen.ir.program import Call, walk
from kfgen.native import load_filters
from kfgen.override import override
from kfgen.reference import reference
from kfgen.simulate import simulate
from kfgen.spec import loads
from kfgen.spec.types import Spec

MARGIN = 1.25


def chain(n: int, unroll: str = "auto", flash: int | None = None, **filter_: str) -> Spec:
    spec = override(loads(problems.chain(n)), "float", **({"filter": filter_} if filter_ else {}))
    return replace(spec, code=replace(spec.code, unroll=unroll, flash=flash))


def flash(made: Generated) -> int:
    assert made.summary.prediction is not None
    return made.summary.prediction.totals["flash"]


SENSORS = """
kfgen: 1
name: two
dt: 0.1
states: {a: {init: 0, std: 1}, b: {init: 0, std: 1}, c: {init: 0, std: 1}, d: {init: 0, std: 1}, e1: {init: 0, std: 1},
  g: {init: 0, std: 1}, k: {init: 0, std: 1}, l: {init: 0, std: 1}}
dynamics: {f: {a: a + dt*b*c, b: b + dt*c*d, c: c + dt*d*e1, d: d + dt*e1*g, e1: e1 + dt*g*k, g: g + dt*k*l},
  Q: {a: 0.1, b: 0.1, c: 0.1, d: 0.1, e1: 0.1, g: 0.1, k: 0.1, l: 0.1}}
measurements:
  often: {z: {x: {h: a + g, std: 1}, y: {h: b*c, std: 1}, z: {h: c, std: 1}}}
  seldom: {rate: RATE, partial: true, z: {x: {h: k + a, std: 1}, y: {h: b*l, std: 1}}}
filter: {type: ekf}
code: CODE
"""


def two(code: str, rate: str = "1/100") -> Generated:
    return build(loads(SENSORS.replace("RATE", rate).replace("CODE", code)))


def test_what_is_called_least_is_rolled_first():
    """A budget that the largest saving alone would meet still rolls what is called seldom."""
    full, none = two("{unroll: full}"), two("{unroll: none}")
    budgets = np.linspace(MARGIN * flash(none), MARGIN * flash(full), 10).astype(int) + 1
    made = [two(f"{{flash: {budget}}}") for budget in budgets]
    seen = [each.summary.forms for each in made]
    assert any(forms["update_seldom"] == "loops" and forms["predict"] == "unrolled" for forms in seen)
    for each, forms, budget in zip(made, seen, budgets, strict=True):
        assert MARGIN * flash(each) <= budget
        if forms["update_seldom"] == "unrolled":  # then it had to be nothing that is called more often, or it is small
            assert forms["update_often"] == "unrolled" or forms["predict"] == "loops"
    often = [two(f"{{flash: {budget}}}", "100").summary.forms for budget in budgets]
    assert any(forms["update_seldom"] == "unrolled" and forms["predict"] == "loops" for forms in often)


def test_functions_by_name():
    made = two("{unroll: {predict: full, update_seldom: none}}")
    forms = {"predict": "unrolled", "update_often": "unrolled", "update_seldom": "loops"}
    assert {name: form for name, form in made.summary.forms.items() if "masked" not in name} == forms
    assert made.summary.forms.get("update_seldom_masked", "loops") == "loops"
    straight, loops = two("{unroll: full}"), two("{unroll: none}")
    assert flash(loops) < flash(made) < flash(straight)
    tight = two(f"{{unroll: {{predict: full}}, flash: {int(MARGIN * flash(made))}}}")
    assert tight.summary.forms["predict"] == "unrolled"
    everything = two("{unroll: {predict: none, update_often: none, update_seldom: none}}")
    bodies = [f.files["two.c"].split("*/", 1)[1] for f in (everything, loops)]
    assert bodies[0] == bodies[1]


def test_a_function_by_name_with_sigma_points():
    text = SENSORS.replace("RATE", "1").replace("type: ekf", "type: ukf, covariance: full")
    text = text.replace("l: {init: 0, std: 1}}", "l: {init: 0, std: 1}, m: {init: 0, std: 1}, n: {init: 0, std: 1}}")
    text = text.replace("k*l}", "k*l, m: m + dt*n*a}")
    mixed = build(loads(text.replace("CODE", "{unroll: {predict: full}}"))).files["two.c"]
    full, auto = (build(loads(text.replace("CODE", f"{{unroll: {how}}}"))).files["two.c"] for how in ("full", "auto"))

    def body(text: str, name: str) -> str:
        return text.split(f"two_{name}(two_t *kf", 1)[1].split("\n}\n", 1)[0]

    assert body(mixed, "predict") == body(full, "predict") != body(auto, "predict")
    assert body(mixed, "update_often") == body(auto, "update_often")


def test_without_a_budget_nothing_changes():
    straight = build(chain(8, "full")).files
    assert build(chain(8)).files == straight
    assert build(chain(8, "auto", 1 << 20)).files == straight
    assert build(chain(8)).summary.forms == {}


def test_every_budget_is_kept():
    """From what loops need to what straight-line code needs: the larger it is, the less becomes loops."""
    least, most = flash(build(chain(8, "none"))), flash(build(chain(8, "full")))
    assert MARGIN * least < most
    seen = []
    for budget in np.linspace(MARGIN * least, MARGIN * most, 6).astype(int) + 1:
        made = build(chain(8, "auto", int(budget)))
        assert MARGIN * flash(made) <= budget
        seen.append(sorted(made.summary.forms.items()))
    both = [("predict", "loops"), ("update_position", "loops")]
    assert seen[0] == both
    assert seen[-1] == [(name, "unrolled") for name, _ in both]
    assert [("predict", "loops"), ("update_position", "unrolled")] in seen
    loops = [sum(form == "loops" for _, form in each) for each in seen]
    assert loops == sorted(loops, reverse=True)


def test_a_mixed_filter_computes_the_right_thing():
    spec = chain(8, "auto", 4500, covariance="ud", update="bierman")
    made = build(spec)
    assert made.summary.forms == {"predict": "loops", "update_position": "unrolled"}
    names = [f.name for f in made.code.functions]
    called = {s.callee.name for f in made.code.functions for s in walk(f.body) if isinstance(s, Call)}
    assert called == {f.name for f in made.code.functions if f.private}
    assert len(set(names)) == len(names)
    kf, ref = load_filters([made])[0], reference(spec)
    log = simulate(spec, 15, 2)
    for row in range(15):
        z = [log.columns[f"position.{name}"][row] for name in ("z1", "z3")]
        for name, arguments in (("predict", {}), ("position", {"z": z})):
            assert call(kf, name, arguments) == call(ref, name, arguments) == 0
    np.testing.assert_allclose(kf.P, ref.P, rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize("unroll", ["none", "auto", "full"])
def test_what_does_not_fit_is_told(unroll):
    with pytest.raises(SpecError) as caught:
        build(chain(8, unroll, 1000))
    (mistake,) = caught.value.mistakes
    text = r"about (\d+) bytes of flash on a Cortex-M4F, (\d+) more than the budget of 1000 \("
    found = re.match(text, mistake.message)
    assert found is not None
    least = flash(build(chain(8, "full" if unroll == "full" else "none")))
    assert int(found[1]) == least == 1000 + int(found[2])


def test_the_table_tells_the_forms(tmp_path):
    spec = chain(8, "auto", 4500, covariance="ud", update="bierman")
    text = "\n".join(lines(*report([Built(spec, build(spec), {}, tmp_path)])))
    assert "predict: loops" in text
    assert "update_position: unrolled" in text
    assert "loops" not in "\n".join(lines(*report([Built(chain(8), build(chain(8)), {}, tmp_path)])))


def test_a_single_state_has_nothing_to_loop_over():
    spec = loads(problems.ALL["six_sensors"])
    made = build(replace(spec, code=replace(spec.code, unroll="none")))
    assert set(made.summary.forms.values()) == {"unrolled"}


@pytest.mark.parametrize("covariance", ["full", "ud", "sqrt"])
def test_unscented_filters(covariance):
    """Points in loops from two states on, linear parts as in an ekf."""
    text = problems.chain(4).replace("type: ekf", f"type: ukf, covariance: {covariance}")
    spec = loads(text)
    looped, straight = (
        replace(spec, name=name, code=replace(spec.code, unroll=unroll))
        for name, unroll in (("looped", "none"), ("straight", "full"))
    )
    made = [build(spec) for spec in (looped, straight)]
    assert flash(made[0]) < flash(made[1])
    assert set(made[0].summary.forms.values()) == {"loops"}
    a, b = load_filters(made)
    for k in range(20):
        for name, arguments in (("predict", {}), ("position", {"z": [0.1 * (k % 4)]})):
            assert call(a, name, arguments) == call(b, name, arguments) == 0
    np.testing.assert_allclose(a.x, b.x, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(a.P, b.P, rtol=1e-10, atol=1e-12)


def test_banks():
    """Loops of all modes call the same private functions, each emitted once."""
    text = problems.IMM3.replace("{type: ekf}", "{type: ekf, covariance: full, update: standard}")
    spec = loads(text)
    looped = build(replace(spec, code=replace(spec.code, unroll="none")))
    assert looped.summary.forms == {"predict": "loops", "update_position": "loops"}
    private = [f.name for f in looped.code.functions if f.private]
    assert private
    assert len(set(private)) == len(private)
    straight = flash(build(replace(spec, code=replace(spec.code, unroll="full"))))
    assert flash(looped) < straight
    for budget in (straight, int(MARGIN * (straight + 2))):  # a prediction is a sum of whole bytes, a function each
        made = build(replace(spec, code=replace(spec.code, flash=budget)))
        assert ("loops" in made.summary.forms.values()) == (budget == straight)
        assert flash(made) <= budget
