from __future__ import annotations

import subprocess
import sys

import pytest

import kfgen
from kfgen.errors import KfgenError
from kfgen.files import write_all, writing
from kfgen.override import override
from kfgen.status import Status, describe

SLOW = ("sympy", "numpy", "cffi", "matplotlib", "jinja2", "ruamel", "scipy")


def python(code):
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout


def test_importing_kfgen_is_cheap():
    code = f"import sys, kfgen, kfgen.cli; print([m for m in {SLOW!r} if m in sys.modules])"
    assert python(code).strip() == "['numpy']" or python(code).strip() == "[]"
    code = f"import sys, kfgen; print([m for m in {SLOW!r} if m in sys.modules])"
    assert python(code).strip() == "[]"


def test_reference_is_a_function_and_a_module_in_either_order(spec):
    assert python("import kfgen, kfgen.reference; print(callable(kfgen.reference))") == "True\n"
    assert python("import kfgen; f = kfgen.reference; print(callable(f), f.ReferenceFilter)").startswith(
        "True"
    )
    assert kfgen.reference(spec).x.shape == (3,)


def test_public_names():
    assert callable(kfgen.load)
    assert callable(kfgen.compile)
    assert issubclass(kfgen.SpecError, kfgen.KfgenError)
    assert {"generate", "compile_many"} <= set(dir(kfgen))
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        kfgen.nothing  # noqa: B018


def test_statuses():
    assert describe(0) == "OK"
    assert describe(0x50) == "GATED | DT_CLAMPED"
    assert describe(0x1000 | 0x100) == "NULL_ARGUMENT | 0x1000"
    from kfgen.reference import Status as Theirs

    for name, value in Status.__members__.items():
        assert Theirs[name] == value


def test_overrides(spec):
    changed = override(spec, "double", filter={"covariance": "ud", "update": "bierman"}, description="x")
    assert (changed.scalar, changed.filter.covariance, changed.description) == ("double", "ud", "x")
    assert changed.filter.type == spec.filter.type
    assert override(spec, filter={"covariance": "ud"}).filter.update == "bierman"
    assert override(spec, filter={"covariance": "sqrt"}).filter.update is None
    assert override(spec, filter={"covariance": "full", "update": "standard"}).filter.update == "standard"
    assert spec.scalar == "float"
    with pytest.raises(KfgenError, match="no field `filtre`; did you mean `filter`"):
        override(spec, filtre={})
    with pytest.raises(KfgenError, match=r"spec\.filter has no field `covarience`"):
        override(spec, filter={"covarience": "ud"})
    for scalar in ("half", "q8.8", "q30.2", "q16.16 "):
        with pytest.raises(KfgenError, match="is unknown"):
            override(spec, scalar)


def test_files_appear_whole_or_not_at_all(tmp_path):
    old = tmp_path / "a.txt"
    old.write_text("old")
    (tmp_path / "folder").mkdir()
    with pytest.raises(IsADirectoryError):
        write_all({old: "new", tmp_path / "folder": "x"})
    with pytest.raises(TypeError), writing(old) as stream:
        stream.writelines([b"half", None])
    assert old.read_text() == "old"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.txt", "folder"]


def test_links_stay_links_and_devices_stay_devices(tmp_path):
    (tmp_path / "real").write_text("old")
    (tmp_path / "link").symlink_to("real")
    write_all({tmp_path / "link": "new\n"})
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real").read_bytes() == b"new\n"
    from pathlib import Path

    null = Path("/dev/null")
    with writing(null) as stream:
        stream.write(b"x")
    assert null.is_char_device()
