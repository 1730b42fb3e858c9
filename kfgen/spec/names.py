"""Names of a spec: what may be one, which are taken, and what the emitted code makes of them."""

from __future__ import annotations

import re
from collections.abc import Iterator

from kfgen.errors import Place
from kfgen.scalar_names import is_fixed
from kfgen.spec.problems import Problems, short
from kfgen.spec.reserved import C_HEADERS, reserved
from kfgen.spec.sensors import filter_of
from kfgen.spec.types import Spec

MAX_NAME = 40
_IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]*\Z", re.ASCII)

STATUS = (
    "OK", "REGULARIZED", "GLITCH_SMALL", "GLITCH_LARGE", "ANOMALY", "GATED", "SATURATED", "DT_CLAMPED",
    "POINT_REJECTED", "ERROR", "NULL_ARGUMENT", "NOT_FINITE", "NOT_POSITIVE",
)  # fmt: skip


def wrong_name(name: str, in_expressions: bool = True) -> tuple[str, str] | None:
    """What is wrong with a name, and what to write instead. in_expressions: not for sensors, components, the filter."""
    if len(name) > MAX_NAME:
        return f"the name {short(name)} is longer than {MAX_NAME} characters", "choose a shorter one"
    if name.startswith("_"):
        return f"the name {short(name)} begins with an underscore", "begin with a letter"
    if not _IDENTIFIER.match(name):
        hint = "use ASCII letters, digits and underscores, beginning with a letter"
        return f"the name {short(name)} is not a C identifier", hint
    why = reserved(name, in_expressions)
    return (f"the name `{name}` {why}", f"choose another one, such as `{name}_` or `{name}0`") if why else None


# names whose `<name>_t` <stdint.h>, <stddef.h> or what they include defines
STANDARD_TYPES = re.compile(
    r"u?int(_least|_fast)?(8|16|32|64|128)|u?int(ptr|max)|s?size|ptrdiff|wchar|max_align|nullptr|float|double"
)


def check_name(name: str, place: Place, problems: Problems, headers: bool = False) -> None:
    wrong = wrong_name(name, in_expressions=not headers)
    if wrong is None and headers and name.lower() in C_HEADERS:
        wrong = f"the name `{name}` is that of a standard header ({name.lower()}.h)", "choose another one"
    if wrong is None and headers and STANDARD_TYPES.fullmatch(name):
        wrong = f"the filter's type would be `{name}_t`, which C has already", "choose another name"
    if wrong is not None:
        problems.add(place, *wrong)


def identifiers(spec: Spec) -> Iterator[tuple[str, str, Place]]:
    """Every identifier that the emitted code declares: (identifier, what it is, where it comes from)."""
    lower, upper = spec.name, spec.name.upper()
    own = spec.place
    sizes = {"NX": True, "NE": bool(spec.rotations), "NU": bool(spec.inputs), "NB": spec.imm is not None}
    for word in (word for word, there in sizes.items() if there):
        yield f"{upper}_{word}", "a size", own
    for word in STATUS:
        yield f"{upper}_{word}", "a status", own
    yield f"{upper}_H_INCLUDED", "the header guard", own
    functions = ["init", "predict", "set_state", "set_covariance", "get_covariance"]
    types = ["t", "real_t", "status_t"] + ["inputs_t"] * bool(spec.inputs) + ["parameters_t"] * bool(spec.parameters)
    types += ["outputs_t"] * bool(spec.outputs)
    functions += ["get_outputs"] * bool(spec.outputs)
    filters = [m.filter for m in spec.imm.modes] if spec.imm else [spec.filter]
    if any(f.covariance == "sqrt" for f in filters):
        functions += ["set_sqrt_covariance", "get_sqrt_covariance"]
    if any(f.adapt_Q is not None for f in filters):
        functions.append("get_Q")
    if any(f.sigma_points is not None and not f.sigma_points.redraw for f in filters):
        functions.append("redraw")
    for word in types:
        yield f"{lower}_{word}", "a type", own
    for word in functions:
        yield f"{lower}_{word}", "a function", own
    for state in spec.states:
        yield f"{upper}_{state.name.upper()}", f"the index of the state `{state.name}`", state.place
    for error in spec.errors if spec.rotations else ():
        yield f"{upper}_ERROR_{error.upper()}", f"the index of the error coordinate `{error}`", own
    for sensor in spec.measurements:
        yield f"{upper}_NZ_{sensor.name.upper()}", f"the size of the sensor `{sensor.name}`", sensor.place
        yield f"{lower}_{sensor.name}_t", f"the type of the sensor `{sensor.name}`", sensor.place
        yield f"{lower}_update_{sensor.name}", f"the update of the sensor `{sensor.name}`", sensor.place
        if sensor.partial:
            text = f"the masked update of the sensor `{sensor.name}`"
            yield f"{lower}_update_{sensor.name}_masked", text, sensor.place
        if any(filter_of(f, sensor).adapt_R is not None for f in filters):
            yield f"{lower}_get_R_{sensor.name}", f"the R of the sensor `{sensor.name}`", sensor.place
    for mode in spec.imm.modes if spec.imm else ():
        yield f"{upper}_MODE_{mode.name.upper()}", f"the index of the mode `{mode.name}`", mode.place
        yield f"{lower}_mode_{mode.name}_t", f"the type of the mode `{mode.name}`", mode.place
    if is_fixed(spec.scalar):
        yield from _scaled(spec, upper)


def _scaled(spec: Spec, upper: str) -> Iterator[tuple[str, str, Place]]:
    """The macros of a q scalar."""
    yield f"{upper}_FRACTION_BITS", "the number of fraction bits", spec.place
    values = [(s.name, f"the state `{s.name}`", s.place) for s in spec.states]
    values += [(i.name, f"the input `{i.name}`", spec.place) for i in spec.inputs]
    values += [(p.name, f"the parameter `{p.name}`", spec.place) for p in spec.parameters]
    values += [
        (f"{s.name}_{c.name}", f"the {'component' if c in s.components else 'input'} `{s.name}.{c.name}`", c.place)
        for s in spec.measurements
        for c in s.fields
    ]
    values += [(o.name, f"the output `{o.name}`", o.place) for o in spec.outputs]
    values += [(e, f"the error coordinate `{e}`", r.place) for r in spec.rotations for e in r.errors]
    for s in spec.measurements:
        of = f"the residual of `{s.name}`"
        values += [(f"{s.name}_{e}", f"{of}, `{e}`", r.place) for r in s.rotations for e in r.errors]
    if spec.dt is not None and spec.dt.run_time:
        values.append(("dt", "dt", spec.place))
    for name, what, place in values:
        for macro in ("LSB", "FROM", "TO"):
            yield f"{upper}_{name.upper()}_{macro}", f"{macro} of {what}", place


def check_identifiers(spec: Spec, problems: Problems) -> None:
    """Two identifiers of the emitted code that are equal after upper-casing are a mistake naming both."""
    if not spec.name:
        return
    seen: dict[str, tuple[str, str, Place]] = {}
    for name, what, place in identifiers(spec):
        key = name.upper()
        if key not in seen:
            seen[key] = name, what, place
            continue
        other, other_what, other_place = seen[key]
        if other_what == what:
            continue  # the same name twice, which has been reported
        if name != other and (name.endswith("_t") or other.endswith("_t")):
            continue  # C tells a type from an index: a temperature is T everywhere
        at = place if place.line >= other_place.line else other_place
        text = f"the emitted `{name}` ({what}) and `{other}` ({other_what}) are equal in upper case"
        problems.add(at, text, "rename one of them")
