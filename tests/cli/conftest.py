"""The commands, run in-process on the hand-written filter of tests/native in place of generated code."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType

import pytest
from click.testing import CliRunner, Result

from kfgen.cli import cli
from kfgen.emit.declarations import Declarations
from kfgen.logs import Log
from kfgen.spec.types import Spec
from tests.native.small import vehicle_small

NATIVE = Path(__file__).parent.parent / "native"


@dataclass
class Prediction:
    flash: dict[str, int] = field(default_factory=lambda: {"init": 60, "predict": 400, "update_gnss": 700})
    stack: dict[str, int] = field(default_factory=lambda: {"init": 0, "predict": 40, "update_gnss": 64})
    totals: dict[str, int] = field(default_factory=lambda: {"flash": 1160, "ram": 48, "stack": 64})


@dataclass
class Summary:
    rows: list[tuple[str, dict[str, int]]] = field(
        default_factory=lambda: [
            ("predict", {"mul": 31, "add": 27, "sin": 1}),
            ("update_gnss", {"div": 2, "sqrt": 0}),
        ]
    )
    ram: int = 48
    notes: list[str] = field(default_factory=lambda: ["states are kept in the order px, py, th"])
    forms: dict[str, str] = field(default_factory=dict)
    prediction: Prediction = field(default_factory=Prediction)


@dataclass
class Generated:
    files: Mapping[str, str]
    spec: Spec
    declarations: Declarations
    summary: Summary = field(default_factory=Summary)
    fixed: None = None


def build(spec: Spec, log: Log | None = None) -> Generated:
    made = vehicle_small(spec)
    return Generated(made.files, spec, made.declarations)


@pytest.fixture(autouse=True)
def _generator(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> None:
    module = ModuleType("kfgen.generate")
    module.build = build  # type: ignore[attr-defined]
    module.Generated = Generated  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "kfgen.generate", module)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.getbasetemp().parent / "kfgen-test-cache"))
    monkeypatch.setenv("COLUMNS", "100")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working directory, with `vehicle_small.yaml` in it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "vehicle_small.yaml").write_text((NATIVE / "vehicle_small.yaml").read_text())
    return tmp_path


@pytest.fixture
def kfgen(folder: Path) -> Callable[..., Result]:
    """Calls `kfgen ARGUMENTS` in that directory; an exception that gets out fails the test."""

    def call(*arguments: str) -> Result:
        result = CliRunner().invoke(cli, list(arguments), prog_name="kfgen")
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        assert "Traceback" not in result.output
        return result

    return call
