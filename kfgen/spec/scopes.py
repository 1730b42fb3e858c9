"""Which names mean what, and which may stand where.

A context is a table of names: one for a spec, one per mode of an imm (modes may have noises and
definitions of their own). A formula is checked in every context that uses it.
"""

from __future__ import annotations

import re

from kfgen.errors import Place
from kfgen.spec.contexts import Context
from kfgen.spec.lexer import positions
from kfgen.spec.names import wrong_name
from kfgen.spec.problems import LIMIT, SHARED_STATES, did_you_mean, short, suggestion
from kfgen.spec.raw import Path, Written
from kfgen.spec.shapes import SCOPE_WORDS, SCOPES
from kfgen.spec.tree import names
from kfgen.spec.types import Spec
from kfgen.spec.walk import Walker

DECLARING = ("constants", "parameters", "states", "inputs", "noise", "let")
DECLARED = ("constant", "parameter", "state", "rotation error", "input", "noise", "definition")
REPLACEABLE = (
    "states",
    "covariances",
    "P0",
    "noise",
    "noise_covariance",
    "let",
    "dynamics",
    "measurements",
    "filter",
)


class Scopes:
    """Checks the names of all formulas, and the names of things that are referred to."""

    def __init__(self, walker: Walker, spec: Spec) -> None:
        self.walker, self.spec = walker, spec
        self.problems = walker.problems
        self.contexts: dict[str, Context] = {}  # "" is the spec's own
        self.doubtful = set(walker.doubtful)
        self.unknown: dict[str, list[Place]] = {}  # names that resemble no other, by where they are used
        self.said_dt = False
        self._declare()

    # --- declarations

    def _declare(self) -> None:
        modes = self.spec.imm.modes if self.spec.imm else ()
        taken: dict[str, dict[str, tuple[str, Place]]] = {"": {}, **{mode.name: {} for mode in modes}}
        for kind, name, place, path in self.walker.declared:
            if (wrong := wrong_name(name, kind not in ("sensor", "component", "output"))) is not None:
                self.problems.add(place, *wrong)
                self.doubtful.update(re.findall(r"[A-Za-z_]\w*", name, re.ASCII))
            if kind not in DECLARED or (kind == "input" and "measurements" in path):
                continue  # the inputs of a sensor are known in its formulas alone
            if kind == "noise" and "measurements" in path:
                kind = "sensor noise"
            for context in self._users(path, everywhere=True):
                names_here = taken[context]
                if name in names_here:
                    other, where = names_here[name]
                    text = f"the name {short(name)} is already that of a {other} (line {where.line})"
                    self.problems.add(place, text, "choose another one")
                else:
                    names_here[name] = kind, place
        kinds = {context: {n: kind for n, (kind, _) in found.items()} for context, found in taken.items()}
        self.contexts[""] = Context(self.spec, self.spec.let, self.spec.measurements, kinds[""])
        for mode in modes:
            self.contexts[mode.name] = Context(self.spec, mode.let, mode.measurements, kinds[mode.name])

    def _users(self, path: Path, everywhere: bool = False) -> list[str]:
        """The contexts that use what stands at a path."""
        if path[:2] == ("imm", "modes") and len(path) > 2:
            return [path[2]] if len(path) > 3 else []
        if self.spec.imm is None:
            return [""]
        if path[0] not in REPLACEABLE or path[0] == "states":
            return ["", *(m.name for m in self.spec.imm.modes)] if everywhere else [""]
        inheriting = [m.name for m in self.spec.imm.modes if f"imm.modes.{m.name}.{path[0]}" not in self.walker.keys]
        return (["", *inheriting]) if everywhere else (inheriting or [""])

    # --- formulas

    def check(self) -> None:
        for written in self.walker.formulas:
            for context in self.users(written.path):
                self._formula(written, context)
        for name, places in self.unknown.items():
            self._undeclared(name, sorted(places))
        self._references()

    def users(self, path: Path) -> list[Context]:
        """The contexts that use the formula at a path."""
        return [self.contexts[name] for name in self._users(path) if name in self.contexts]

    def _formula(self, written: Written, context: Context) -> None:
        allowed = SCOPES[written.scope]
        if written.scope == "initialize":
            self._starting(written, context, allowed)
            return
        for name in dict.fromkeys(names(written.expression.tree)):
            if name == "e" and "innovation" in allowed:
                continue
            if name in ("pi", "e") or (name in ("z", "h") and name in allowed):
                continue
            if name in ("dt", "t"):
                self._time(written, name, allowed, name)
                continue
            self._name(written, name, context, allowed)

    def _name(self, written: Written, name: str, context: Context, allowed: frozenset[str]) -> None:
        kind = self._kind(name, written, context)
        if kind is None:
            self._unknown(written, name, context)
        elif kind not in allowed:
            self._not_here(written, name, f"the {kind} {short(name)}")
        elif kind == "constant" and written.path[0] == "constants":
            self._above(written, name)
        elif kind == "definition":
            self._definition(written, name, context, allowed)

    def _starting(self, written: Written, context: Context, allowed: frozenset[str]) -> None:
        """In `initialize` the components of the sensor hide all other names."""
        sensor = self._started(written.path)
        if sensor is None:
            return  # which is a mistake of its own
        components, own = context.component_names(sensor), context.sensor_names(sensor)
        for name in dict.fromkeys(names(written.expression.tree)):
            if name in components or own.get(name) == "sensor input" or name in ("pi", "e"):
                continue
            if name in ("dt", "t"):
                self._time(written, name, allowed, name)
            elif name in context.kinds and context.kinds[name] in allowed:
                continue
            elif name in context.kinds:
                self._not_here(written, name, f"the {context.kinds[name]} {short(name)}")
            elif name not in self.doubtful:
                known = [*components, *(n for n, kind in own.items() if kind == "sensor input")]
                near = did_you_mean(name, sorted(known), f"components of {sensor}")
                self._say(written, name, f"there is no component of {sensor} {short(name)}", near)

    def _started(self, path: Path) -> str | None:
        """The sensor of the rule of `initialize` in which a formula stands."""
        rules = self.spec.initialize
        index = int(path[1].strip("[]")) if path[1].startswith("[") else 0
        known = {s.name for s in self.spec.measurements}
        return rules[index].sensor if index < len(rules) and rules[index].sensor in known else None

    def _kind(self, name: str, written: Written, context: Context) -> str | None:
        kind = context.kinds.get(name)
        if "measurements" in written.path:
            sensor = written.path[written.path.index("measurements") + 1]
            own = context.sensor_names(sensor)
            if own.get(name) == "sensor input":
                return "sensor input"
            if kind == "sensor noise" and "sensor noise" in SCOPES[written.scope] and name not in own:
                return "noise of another sensor"
        return kind

    def _time(self, written: Written, name: str, allowed: frozenset[str], shown: str) -> None:
        step = self.spec.dt
        through = "" if shown == name else f" (through {short(shown)})"
        if step is None and "dt" in self.spec.places:
            return
        if name == "t":
            if "t" not in allowed:
                self._not_here(written, shown, f"the time `t`{through}")
                return
        elif "dt" not in allowed and (step is None or step.run_time or "fixed dt" not in allowed):
            what = "a dt that is an argument of predict" if step is not None and step.run_time else "`dt`"
            if step is not None or "fixed dt" not in allowed:
                self._not_here(written, shown, what + through)
                return
        if step is None and not self.said_dt and "dt" not in self.walker.meant:
            self.said_dt = True  # one missing key is one mistake, however often it is used
            self._say(written, shown, f"`{name}` is used, but the spec has no key `dt`", "write `dt: 0.1`")

    def _definition(self, written: Written, name: str, context: Context, allowed: frozenset[str]) -> None:
        for inner in sorted(context.closures.get(name, ())):
            if inner in ("pi", "e"):
                continue
            if inner in ("dt", "t"):
                self._time(written, inner, allowed, name)
                continue
            kind = context.kinds.get(inner)
            if kind is not None and kind != "definition" and kind not in allowed:
                self._not_here(written, name, f"the {kind} {short(inner)} (through {short(name)})")
                return

    def _above(self, written: Written, name: str) -> None:
        order = [constant.name for constant in self.spec.constants]
        own = written.path[1]
        if name in order and own in order and order.index(name) >= order.index(own):
            text = f"the constant {short(name)} is used " + ("by itself" if name == own else "above its definition")
            hint = "write a value" if name == own else f"move {short(name)} above {short(own)}"
            self._say(written, name, text, hint)

    def _not_here(self, written: Written, name: str, what: str) -> None:
        where = place_words(written.path)
        self._say(written, name, f"{what} may not stand in {where}", f"use {SCOPE_WORDS[written.scope]}")

    def _unknown(self, written: Written, name: str, context: Context) -> None:
        """A misspelt name is a mistake wherever it stands; one never declared is a single mistake."""
        if name in self.doubtful or self._incomplete(written.path):
            return
        if len(self.problems.mistakes) > LIMIT:
            return  # these are not shown any more
        near = suggestion(name, [n for n, kind in context.kinds.items() if kind in SCOPES[written.scope]])
        hint = f"did you mean `{near}`?" if near else ""
        if name.lower() in ("inf", "nan", "infinity"):
            hint = "numbers are finite"
        elif name.lower() in ("true", "false"):
            hint = "booleans are not numbers"
        if hint:
            self._say(written, name, f"the name {short(name)} is not known", hint)
        else:
            self.unknown.setdefault(name, []).append(self._where(written, name))

    def _undeclared(self, name: str, places: list[Place]) -> None:
        lines = sorted({place.line for place in places} - {places[0].line})
        also = f" (also in line{'s' * (len(lines) > 1)} {', '.join(map(str, lines[:10]))})" if lines else ""
        hint = "declare it: a constant, parameter, state, input, noise or definition"
        self.problems.add(places[0], f"the name {short(name)} is not known{also}", hint)

    def _incomplete(self, path: Path) -> bool:
        """Whether a section that declares names could not be read, so that unknown names mean nothing."""
        walker = self.walker
        sections = list(DECLARING)
        if path[:2] == ("imm", "modes"):
            sections += [f"imm.modes.{path[2]}.{key}" for key in ("noise", "let")]
        unreadable = any(s in walker.broken or s in walker.meant for s in sections)
        return unreadable or "states" not in walker.keys

    def _say(self, written: Written, name: str, message: str, hint: str) -> None:
        self.problems.add(self._where(written, name), message, hint)

    def _where(self, written: Written, name: str) -> Place:
        offset = next(iter(positions(written.expression.text, name)), 0)
        return self.walker.offset_place(written.expression, offset)

    # --- references

    def _references(self) -> None:
        states = [s.name for s in self.spec.states]
        vectors = [g.name for g in self.spec.groups if g.parts[0] in states]
        sensors = [s.name for s in self.spec.measurements]
        of_kind = {
            "state": [*states, *vectors],
            "error": [*self.spec.errors, *vectors],
            "sensor": sensors,
            "function": ["predict", *(f"update_{sensor}" for sensor in sensors)],
        }
        for reference, word, path in self.walker.references:
            known = of_kind.get(reference.of, [])
            of = "state" if reference.of == "error" else reference.of
            if known and word.text not in known and word.text not in self.doubtful:
                hint = did_you_mean(word.text, known, f"{of}s")
                if path[:2] == ("imm", "modes") and "states" in path and not hint.startswith("did you mean"):
                    hint = SHARED_STATES
                self.problems.add(word.place, f"there is no {of} {short(word.text)}", hint)


def place_words(path: Path) -> str:
    """Where a formula stands, in words."""
    keys = [part for part in path if not part.startswith("[")]
    for part in reversed(keys):
        if part in (
            "Q",
            "R",
            "P0",
            "h",
            "f",
            "residual",
            "reject",
            "noise",
            "covariances",
            "noise_covariance",
        ):
            return f"`{part}`"
        if part in ("constants", "let", "dt", "parameters", "transition", "mu0"):
            return f"`{part}`"
    return f"`{keys[-1]}`"
