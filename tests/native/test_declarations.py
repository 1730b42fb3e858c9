"""What a view says that its header declares, against the header as the C compiler and pycparser read it."""

from __future__ import annotations

import subprocess
from functools import cache
from pathlib import Path

import cffi
import pytest
from pycparser import c_ast, c_parser
from pycparser.c_generator import CGenerator

from kfgen.generate import Generated, build
from kfgen.native.compiler import find_compiler
from kfgen.spec import load, loads
from tests.oracle import problems

ROOT = Path(__file__).parents[2]
FIXED = ("scalar", "cv4", "vehicle_tutorial")
CASES = [
    *((path.stem, None) for path in sorted((ROOT / "specs").glob("*.yaml"))),
    *((name, "q16.16") for name in FIXED),
    *((f"problem {name}", None) for name in problems.ALL),
]
HEADERS = {
    "stdint.h": "typedef int int32_t; typedef unsigned int uint32_t; typedef unsigned char uint8_t;",
    "stddef.h": "typedef unsigned long size_t;",
    "stdbool.h": "typedef _Bool bool;",
}
"""In place of the system's, which hold more than C."""


@cache
def generated(name: str, scalar: str | None) -> Generated:
    problem = name.removeprefix("problem ")
    spec = load(ROOT / "specs" / f"{name}.yaml") if problem == name else loads(problems.ALL[problem])
    return build(spec, scalar)


def preprocessed(text: str, folder: Path) -> str:
    """C after the preprocessor, with our own headers for the system's."""
    for name, content in HEADERS.items():
        (folder / name).write_text(content)
    call = [*find_compiler(), "-E", "-P", "-nostdinc", f"-I{folder}", "-"]
    return subprocess.run(call, input=text, capture_output=True, text=True, check=True).stdout


def header_of(made: Generated) -> str:
    return made.files[f"{made.spec.name}.h"]


def spelled(text: str) -> dict[str, str]:
    """The types and functions of preprocessed C: name -> its declaration, normalised."""
    kinds = c_ast.Typedef | c_ast.Decl
    tree = c_parser.CParser().parse(text)
    return {node.name: CGenerator().visit(node) for node in tree.ext if isinstance(node, kinds) and node.name}


@pytest.mark.parametrize(("name", "scalar"), CASES)
def test_types_and_functions_are_those_of_the_header(name, scalar, tmp_path):
    made = generated(name, scalar)
    includes = "".join(f"#include <{header}>\n" for header in HEADERS)
    told = spelled(preprocessed(includes + made.declarations.text, tmp_path))
    assert told == spelled(preprocessed(header_of(made), tmp_path))
    assert f"{made.spec.name}_t" in told


@pytest.mark.parametrize(("name", "scalar"), CASES)
def test_functions_and_their_arguments(name, scalar, tmp_path):
    made = generated(name, scalar)
    found = {}
    for node in c_parser.CParser().parse(preprocessed(header_of(made), tmp_path)).ext:
        if isinstance(node, c_ast.Decl) and isinstance(node.type, c_ast.FuncDecl):
            found[node.name] = tuple(argument.name for argument in node.type.args.params)
    prefix = made.spec.name
    assert {f"{prefix}_{function}": names for function, names in made.declarations.functions.items()} == found


@pytest.mark.parametrize(("name", "scalar"), CASES)
def test_the_compiler_lays_the_struct_out_as_cffi_does(name, scalar, tmp_path):
    made = generated(name, scalar)
    ffi = cffi.FFI()
    ffi.cdef(made.declarations.text)
    prefix = made.spec.name
    lines = [f"sizeof({prefix}_t)"]
    wanted = [ffi.sizeof(f"{prefix}_t")]
    for field, place in ffi.typeof(f"{prefix}_t").fields:
        lines += [f"offsetof({prefix}_t, {field})", f"sizeof((({prefix}_t *)0)->{field})"]
        wanted += [place.offset, ffi.sizeof(place.type)]
    assert printed(made, tmp_path, [f'printf("%zu\\n", {line});' for line in lines]) == [str(n) for n in wanted]
    assert ffi.typeof(f"{prefix}_real_t") is ffi.typeof(made.declarations.real)


@pytest.mark.parametrize("name", FIXED)
def test_units_are_the_macros_of_the_header(name, tmp_path):
    made = generated(name, "q16.16")
    units = made.declarations.units
    assert {state.name.upper() for state in made.spec.states} <= set(units)
    macros = [f"{made.spec.name.upper()}_{unit}_LSB" for unit in units]
    calls = [f'printf("%a\\n", (double){macro});' for macro in [*macros, f"{made.spec.name.upper()}_FRACTION_BITS"]]
    found = [float.fromhex(text) for text in printed(made, tmp_path, calls)]
    assert found == [*units.values(), made.declarations.fraction_bits]


def printed(made: Generated, folder: Path, statements: list[str]) -> list[str]:
    """The lines that a program with the filter's header prints."""
    name = f"{made.spec.name}.h"
    (folder / name).write_text(header_of(made))
    main = "\n".join([f'#include "{name}"', "#include <stdio.h>", "int main(void) {", *statements, "return 0; }"])
    (folder / "main.c").write_text(main)
    subprocess.run([*find_compiler(), "-o", "main", "main.c"], cwd=folder, check=True)
    return subprocess.run([folder / "main"], capture_output=True, text=True, check=True).stdout.split()


def test_what_is_asked_by_name():
    declared = generated("vehicle", None).declarations
    assert declared.takes("predict", "u")
    assert not declared.takes("update_gnss", "u")
    assert not declared.takes("no_such_function", "u")
    assert declared.has("get_covariance")
    assert not declared.has("update_gnss_masked")
    assert (declared.real, declared.fraction_bits, declared.units) == ("float", None, {})
