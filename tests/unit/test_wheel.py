"""What an installed kfgen holds, and that it works away from the checkout."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

SPEC = """
kfgen: 1
name: level
dt: 1
states: {x: {init: 0, var: 1}}
dynamics: {form: discrete, f: {x: x}, Q: {x: 0.01}}
measurements: {gauge: {z: {h: {h: x, var: 0.1}}}}
filter: {type: kf}
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built with the backend that is installed here."""
    if find_spec("hatchling") is None:
        message = "hatchling is not installed"
        pytest.fail(message) if os.environ.get("CI") else pytest.skip(message)
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "-w", str(folder)]
    subprocess.run([*command, str(ROOT)], check=True, capture_output=True, text=True)
    (built,) = folder.glob("kfgen-*.whl")
    return built


def test_holds_the_package_and_nothing_else(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    files = [path for path in (ROOT / "kfgen").rglob("*") if path.suffix in (".py", ".j2", ".typed", ".h", ".zig")]
    ours = {str(path.relative_to(ROOT)) for path in files}
    templates = {f"kfgen/{path.relative_to(ROOT)}" for path in (ROOT / "templates").rglob("*.j2")}
    assert ours | templates <= names
    assert "kfgen/py.typed" in names
    assert {name.partition("/")[0] for name in names} == {"kfgen", f"{wheel.name.rsplit('-', 3)[0]}.dist-info"}
    assert not [name for name in names if name.endswith((".pyc", ".bak", ".orig"))]


def test_builds_filters_from_an_environment_of_its_own(wheel, tmp_path):
    # a new environment without kfgen; the dependencies are those of this one, instead of installed again
    environment = tmp_path / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", environment], check=True)
    python = environment / "bin" / "python"
    own = Path(sysconfig.get_path("purelib", "venv", {"base": str(environment)}))
    zipfile.ZipFile(wheel).extractall(own)
    dependencies = [sysconfig.get_path("purelib"), sysconfig.get_path("platlib")]
    (tmp_path / "level.yaml").write_text(SPEC)
    inherited = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "COV_"))}
    settings = {**inherited, "PYTHONPATH": os.pathsep.join([str(own), *dependencies])}

    def run(*arguments: str) -> str:
        done = subprocess.run(
            [python, *arguments], cwd=tmp_path, env=settings, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert Path(run("-c", "import kfgen; print(kfgen.__file__)").strip()).is_relative_to(own)
    assert "level.c" in run("-m", "kfgen", "build", "level.yaml")
    assert (tmp_path / "generated" / "level" / "level.h").read_text().startswith("/* kfgen build level.yaml")
    run("-m", "kfgen", "build", "--check", "level.yaml")
    assert "The kfgen spec language" in run("-m", "kfgen", "language")
    code = "import kfgen; kf = kfgen.compile('level.yaml'); kf.predict(); print(kf.update('gauge', [1.0]))"
    assert run("-c", code) == "0\n"
