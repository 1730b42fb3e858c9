"""Each layout, held against the tools (or the schemas) that it is made for."""

from __future__ import annotations

import json
import subprocess
from configparser import ConfigParser
from pathlib import Path

import jsonschema
import kconfiglib
import pytest
from click.testing import CliRunner
from ruamel.yaml import YAML

from kfgen.cli import cli
from kfgen.layouts import layouts
from tests.oracle import problems

BOARDS = Path(__file__).parents[1] / "boards"
SPEC = """
kfgen: 1
name: on
description: "a \\"quoted\\" title # with = signs"
dt: {nominal: 0.1, min: 0.01}
states: {a: {init: 1, std: 1}, b: {init: 0, std: 1}, c: {init: 0, std: 1}}
inputs: {push: {range: [-1, 1]}}
dynamics: {form: discrete, f: {a: "a + dt*table(b, [-1, 0, 1], [-2, 0, 1])", b: b + dt*push}, Q: {a: 0.1, b: 0.1}}
measurements:
  one: {z: {x: {h: a + c, std: 0.5}}}
  two: {z: {y: {h: a*push, std: 0.5}}}
filter: {type: ekf}
"""


@pytest.fixture
def build(tmp_path):
    """Builds a spec in a layout: the folder of the filter."""

    def call(layout: str, text: str = SPEC, *options: str) -> Path:
        (tmp_path / "spec.yaml").write_text(text)
        arguments = ["build", str(tmp_path / "spec.yaml"), "-o", str(tmp_path), "--layout", layout, *options]
        result = CliRunner().invoke(cli, arguments)
        assert result.exit_code == 0, result.output
        again = CliRunner().invoke(cli, [*arguments, "--check"])
        assert (again.exit_code, again.stdout) == (0, "")
        (folder,) = (path for path in tmp_path.iterdir() if path.is_dir())
        return folder

    return call


def run(folder: Path, *command: str | Path) -> str:
    done = subprocess.run([str(part) for part in command], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def files(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


def test_every_layout_is_tested():
    assert layouts() == ["arduino", "cmake", "plain", "platformio", "zephyr"]


def test_plain_is_the_default(build, tmp_path):
    assert files(build("plain", SPEC, "--selftest")) == {"on.h", "on.c", "on_selftest.c"}


def test_cmake_builds_and_tests_it(build, needs):
    needs("cmake", "cc")
    folder = build("cmake", SPEC, "--selftest")
    assert files(folder) == {"on.h", "on.c", "on_selftest.c", "CMakeLists.txt", "test/main.c"}
    run(folder, "cmake", "-S", ".", "-B", "out")
    run(folder, "cmake", "--build", "out")
    assert "100% tests passed" in run(folder / "out", "ctest")


def test_cmake_target_in_another_project(build, needs):
    """Without a self-test, with the flags that the header of a long filter recommends."""
    needs("cmake", "cc")
    folder = build("cmake", problems.chain(8))
    assert "-fno-schedule-insns" in (folder / "CMakeLists.txt").read_text()
    (folder.parent / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.13)\nproject(firmware C)\nadd_subdirectory(chain8)\n"
        "add_executable(firmware main.c)\ntarget_link_libraries(firmware PRIVATE chain8::chain8)\n"
    )
    (folder.parent / "main.c").write_text(
        "#include <chain8.h>\nint main(void) { chain8_t kf; return (int)chain8_init(&kf); }\n"
    )
    run(folder.parent, "cmake", "-S", ".", "-B", "out")
    run(folder.parent, "cmake", "--build", "out", "--target", "firmware")
    run(folder.parent, "out/firmware")


def test_cmake_package_is_found_where_it_is_installed(build, needs):
    needs("cmake", "cc")
    folder = build("cmake", SPEC, "--selftest")
    run(folder, "cmake", "-S", ".", "-B", "out", "-DCMAKE_INSTALL_PREFIX=../prefix", "-DCMAKE_BUILD_TYPE=Release")
    run(folder, "cmake", "--build", "out", "--target", "install")
    user = folder.parent / "user"
    user.mkdir()
    (user / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.13)\nproject(firmware C)\nfind_package(on REQUIRED)\n"
        "add_executable(firmware main.c)\ntarget_link_libraries(firmware PRIVATE on::on_selftest)\n"
    )
    (user / "main.c").write_text(
        "#include <on.h>\nint on_selftest(void);\n"
        "int main(void) { on_t kf; return (int)on_init(&kf) + on_selftest(); }\n"
    )
    run(user, "cmake", "-S", ".", "-B", "out", f"-DCMAKE_PREFIX_PATH={folder.parent / 'prefix'}")
    run(user, "cmake", "--build", "out")
    run(user, "out/firmware")
    assert "/tmp" not in "".join(path.read_text() for path in (folder.parent / "prefix").rglob("onConfig*.cmake"))


@pytest.mark.parametrize("options", [[], ["--selftest"]])
def test_arduino_sketch_compiles_as_cplusplus(build, needs, options):
    needs("avr-g++")
    folder = build("arduino", SPEC, *options)
    sketch = "examples/on_example/on_example.ino"
    assert {"library.properties", "src/on.h", "src/on.c", sketch} <= files(folder)
    machine = ["-mmcu=atmega328p", "-Os", "-Wall", "-Wextra", "-Werror", "-I", folder / "src", "-I", BOARDS]
    run(folder, "avr-g++", *machine, "-include", "Arduino.h", "-x", "c++", "-c", sketch, "-o", "sketch.o")
    for source in (folder / "src").glob("*.c"):  # and, as some make files do, the library's sources too
        run(folder, "avr-g++", *machine, "-x", "c++", "-c", source, "-o", "cpp.o")
        run(folder, "avr-gcc", *machine, "-std=gnu11", "-c", source, "-o", "c.o")


def test_arduino_properties(build):
    folder = build("arduino")
    lines = (folder / "library.properties").read_text().splitlines()
    properties = dict(line.split("=", 1) for line in lines)
    # https://arduino.github.io/arduino-cli/latest/library-specification
    assert set(properties) == {
        "name", "version", "author", "maintainer", "sentence", "paragraph", "category", "url", "architectures",
        "includes",
    }  # fmt: skip
    assert properties["name"] == "on"
    assert properties["includes"] == "on.h"
    assert properties["sentence"] == 'a "quoted" title # with = signs'
    assert properties["category"] in ("Data Processing", "Other")


@pytest.mark.parametrize(
    ("text", "scalar", "written"),
    [(problems.CV4, "float", "100000UL"), (problems.CV4, "q16.16", "_X_FROM(0)"), (problems.IMM3, "float", "kf.x[")],
)
def test_sketches_of_fixed_steps_fixed_point_and_banks(build, needs, text, scalar, written):
    needs("avr-g++")
    folder = build("arduino", text, "--scalar", scalar)
    (sketch,) = folder.glob("examples/*/*.ino")
    assert written in sketch.read_text()
    run(folder, "avr-g++", "-mmcu=atmega328p", "-Os", "-Wall", "-Wextra", "-Werror", "-I", "src", "-I", BOARDS,
        "-include", "Arduino.h", "-x", "c++", "-c", sketch, "-o", "o.o")  # fmt: skip


# https://docs.platformio.org/en/latest/manifests/library-json: the fields that are used, and no others
LIBRARY_JSON = {
    "type": "object",
    "required": ["name", "version"],
    "additionalProperties": False,
    "properties": {
        "name": {"type": "string", "maxLength": 100, "pattern": "^[^:;/,@<>]+$"},
        "version": {"type": "string", "pattern": r"^\d+\.\d+\.\d+$"},
        "description": {"type": "string", "maxLength": 255},
        "keywords": {"type": "string", "pattern": r"^[a-z]+(, [a-z]+)*$"},
        "frameworks": {"const": "*"},
        "platforms": {"const": "*"},
        "headers": {"type": "string", "pattern": r"^\w+\.h$"},
        "build": {
            "type": "object",
            "additionalProperties": False,
            "properties": {
                "srcDir": {"type": "string"},
                "includeDir": {"type": "string"},
                "flags": {"type": "array", "items": {"type": "string", "pattern": "^-"}},
            },
        },
    },
}


def test_platformio_manifest(build):
    folder = build("platformio", SPEC, "--selftest")
    manifest = json.loads((folder / "library.json").read_text())
    jsonschema.validate(manifest, LIBRARY_JSON)
    assert manifest["name"] == "on"
    example = {f"examples/on_example/{name}" for name in ("platformio.ini", "src/main.cpp")}
    assert files(folder) == {"library.json", "src/on.h", "src/on.c", "src/on_selftest.c"} | example
    assert (folder / manifest["build"]["includeDir"] / manifest["headers"]).is_file()


@pytest.mark.parametrize("options", [[], ["--selftest"]])
def test_platformio_example(build, needs, options):
    """The project names the library beside it, and its program is C++ for the board."""
    needs("avr-g++")
    folder = build("platformio", SPEC, *options)
    example = folder / "examples/on_example"
    project = ConfigParser()
    project.read(example / "platformio.ini")
    assert (example / project["env"]["lib_deps"].removeprefix("symlink://")).resolve() == folder.resolve()
    assert {"platform", "board"} <= set(project["env:board"])
    assert ("on_selftest()" in (example / "src/main.cpp").read_text()) == bool(options)
    run(folder, "avr-g++", "-mmcu=atmega328p", "-Os", "-Wall", "-Wextra", "-Werror", "-I", "src", "-I", BOARDS, "-c",
        example / "src/main.cpp", "-o", "o.o")  # fmt: skip


# scripts/zephyr_module.py of Zephyr: the part of its schema that is used
MODULE_YML = {
    "type": "object",
    "required": ["name", "build"],
    "additionalProperties": False,
    "properties": {
        "name": {"type": "string"},
        "build": {
            "type": "object",
            "additionalProperties": False,
            "properties": {"cmake": {"type": "string"}, "kconfig": {"type": "string"}},
        },
        "samples": {"type": "array", "items": {"type": "string"}},
    },
}


def test_zephyr_module(build, needs):
    needs("cmake", "cc")
    folder = build("zephyr", SPEC, "--selftest")
    module = YAML(typ="safe", pure=True).load((folder / "zephyr/module.yml").read_text())
    jsonschema.validate(module, MODULE_YML)
    assert module["name"] == "on"
    kconfig = kconfiglib.Kconfig(folder / module["build"]["kconfig"], warn_to_stderr=False)
    assert set(kconfig.syms) >= {"KFGEN_ON", "KFGEN_ON_SELFTEST"}
    selftest = kconfig.syms["KFGEN_ON_SELFTEST"]
    selftest.set_value("y")
    assert selftest.str_value == "n"  # it depends on the filter
    kconfig.syms["KFGEN_ON"].set_value("y")
    assert selftest.str_value == "y"
    # Zephyr's functions, as far as they are used
    (folder.parent / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.13)\nproject(zephyr C)\nset(CONFIG_KFGEN_ON y)\n"
        "set(CONFIG_KFGEN_ON_SELFTEST y)\nfunction(zephyr_include_directories)\n  include_directories(${ARGN})\n"
        'endfunction()\nmacro(zephyr_library_named name)\n  set(library ${name})\n  file(WRITE none.c "")\n'
        "  add_library(${name} STATIC none.c)\nendmacro()\nmacro(zephyr_library_sources)\n"
        "  target_sources(${library} PRIVATE ${ARGN})\nendmacro()\nmacro(zephyr_library_sources_ifdef feature)\n"
        "  if(${${feature}})\n    target_sources(${library} PRIVATE ${ARGN})\n  endif()\nendmacro()\n"
        "macro(zephyr_library_compile_options)\n  target_compile_options(${library} PRIVATE ${ARGN})\nendmacro()\n"
        "include_directories(on)\nadd_subdirectory(on)\n"
    )
    run(folder.parent, "cmake", "-S", ".", "-B", "out")
    run(folder.parent, "cmake", "--build", "out")
    symbols = run(folder.parent, "nm", "out/on/libon.a")
    assert "on_predict" in symbols
    assert "on_selftest" in symbols


@pytest.mark.parametrize(("options", "says"), [([], "on: ready\n"), (["--selftest"], "on: self-test passed\n")])
def test_zephyr_sample(build, needs, options, says):
    """The application runs on the host, with a printk that prints; west's own files name what is there."""
    needs("cc")
    folder = build("zephyr", SPEC, *options)
    (samples,) = YAML(typ="safe", pure=True).load((folder / "zephyr/module.yml").read_text())["samples"]
    sample = folder / samples / "on"
    told = YAML(typ="safe", pure=True).load((sample / "sample.yaml").read_text())
    assert told["tests"]["sample.kfgen.on"]["harness_config"]["regex"] == [says.rstrip()]
    assert ("CONFIG_KFGEN_ON_SELFTEST=y" in (sample / "prj.conf").read_text()) == bool(options)
    kernel = folder.parent / "zephyr/kernel.h"
    kernel.parent.mkdir()
    kernel.write_text("#include <stdio.h>\n#define printk printf\n")
    sources = [*folder.glob("*.c"), sample / "src/main.c"]
    run(folder, "cc", "-Wall", "-Wextra", "-Werror", "-I", folder.parent, "-I", ".", *sources, "-lm", "-o", "sample")
    assert run(folder, folder / "sample") == says
