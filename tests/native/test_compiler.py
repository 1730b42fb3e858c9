from __future__ import annotations

import os
import stat
import subprocess
import sys

import pytest

import kfgen
from kfgen.errors import KfgenError
from kfgen.native import compiler
from kfgen.native.cache import cache_directory

SOURCE = {"a.c": "int a_number(void); int a_number(void) { return 42; }\n"}


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "kfgen"


def test_the_same_text_is_built_once(cache, monkeypatch):
    first = compiler.build(SOURCE)
    assert first.parent == cache
    stamp = first.stat().st_mtime_ns

    def never(*arguments, **keywords):
        raise AssertionError("compiled again")

    monkeypatch.setattr(compiler.subprocess, "run", never)
    assert compiler.build(SOURCE) == first
    assert first.stat().st_mtime_ns == stamp
    assert os.listdir(cache) == [first.name]  # nothing is left beside it


def test_flags_text_and_names_make_another_library(cache):
    paths = {
        compiler.build(SOURCE),
        compiler.build(SOURCE, ["-O0"]),
        compiler.build({"b.c": SOURCE["a.c"]}),
        compiler.build({"a.c": SOURCE["a.c"] + "\n"}),
    }
    assert len(paths) == 4


def test_messages_of_the_compiler_are_shown(cache):
    with pytest.raises(KfgenError, match=r"(?s)compiler failed.*a\.c:1"):
        compiler.build({"a.c": "int x = ;\n"})
    assert os.listdir(cache) == []


def test_no_compiler(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(compiler, "find_spec", lambda name: None)
    monkeypatch.delenv("CC", raising=False)
    with pytest.raises(KfgenError, match="no C compiler"):
        compiler.find_compiler()


def test_cc_chooses_and_may_hold_options(monkeypatch):
    monkeypatch.setenv("CC", "cc -pipe")
    assert compiler.find_compiler() == ["cc", "-pipe"]
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(KfgenError, match=r"no-such-compiler.*\$CC"):
        compiler.find_compiler()


@pytest.mark.parametrize("command", ['gcc "x', "'", "\\"])
def test_cc_may_be_wrong(monkeypatch, command):
    monkeypatch.setenv("CC", command)
    with pytest.raises(KfgenError, match=r"\$CC"):
        compiler.find_compiler()


def test_zig_is_the_last(monkeypatch, tmp_path):
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(compiler, "find_spec", lambda name: object() if name == "ziglang" else None)
    assert compiler.find_compiler()[1:4] == ["-m", "ziglang", "cc"]
    for name in ("zig", "clang"):
        (tmp_path / name).write_text("#!/bin/sh\n")
        (tmp_path / name).chmod(0o755)
        assert compiler.find_compiler()[0] == name


@pytest.mark.parametrize("change", [lambda data: data[:3000], lambda data: b"", lambda data: data[:-1] + b"x"])
def test_a_cut_or_wrong_library_is_built_again(cache, change):
    library = compiler.build(SOURCE)
    whole = library.read_bytes()
    library.write_bytes(change(whole))
    assert compiler.build(SOURCE) == library
    assert library.read_bytes() == whole


def test_a_library_of_other_sources_is_built_again(cache):
    first, other = compiler.build(SOURCE), compiler.build(SOURCE, ["-O0"])
    whole = first.read_bytes()
    first.write_bytes(other.read_bytes())
    assert compiler.build(SOURCE).read_bytes() == whole


def test_a_library_that_cannot_be_loaded_is_built_again(cache, monkeypatch):
    kf = kfgen.compile("specs/gps.yaml")
    library = next(cache.glob("*.so"))
    foreign = b"made on another machine"
    library.unlink()  # what is loaded stays as it is
    library.write_bytes(foreign + compiler._seal(library.stem, foreign))
    assert kfgen.compile("specs/gps.yaml").x.tolist() == kf.x.tolist()


@pytest.mark.parametrize("mode", [0o777, 0o770, 0o720])
def test_a_cache_that_others_may_write_is_not_used(cache, mode):
    cache.mkdir()
    cache.chmod(mode)
    library = compiler.build(SOURCE)
    assert library.parent != cache
    assert os.listdir(cache) == []


def test_a_cache_of_another_user_is_not_used(cache, monkeypatch):
    cache.mkdir(mode=0o700)
    owner = os.getuid()
    monkeypatch.setattr(os, "getuid", lambda: owner + 1)
    assert cache_directory() != cache


def test_a_cache_below_a_folder_that_others_may_write_is_not_used(cache):
    cache.mkdir(mode=0o700)
    cache.parent.chmod(0o777)
    assert cache_directory() != cache
    cache.parent.chmod(0o1777)  # as /tmp: nobody can replace it
    assert cache_directory() == cache


def test_a_cache_that_others_may_read_is_closed(cache):
    cache.mkdir(mode=0o755)
    assert cache_directory() == cache
    assert stat.S_IMODE(cache.stat().st_mode) == 0o700


def test_a_private_folder_is_removed_at_the_end(tmp_path):
    (tmp_path / "home").write_text("")
    code = "import kfgen; print(kfgen.compile('specs/gps.yaml').x)"
    names = {"HOME": str(tmp_path / "home"), "TMPDIR": str(tmp_path)}
    environment = {**os.environ, **names}
    environment.pop("XDG_CACHE_HOME", None)
    subprocess.run([sys.executable, "-c", code], env=environment, check=True, capture_output=True)
    assert os.listdir(tmp_path) == ["home"]


def test_a_relative_cache_home_is_ignored(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache_directory() == tmp_path / ".cache" / "kfgen"


def test_a_cache_that_cannot_be_made_is_replaced(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    folder = cache_directory()
    assert folder.is_dir()
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert compiler.build(SOURCE).exists()
