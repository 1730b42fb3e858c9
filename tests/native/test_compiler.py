from __future__ import annotations

import os
import stat

import pytest

from kfgen.errors import KfgenError
from kfgen.native import compiler

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
    monkeypatch.delenv("CC", raising=False)
    with pytest.raises(KfgenError, match="no C compiler"):
        compiler.find_compiler()


def test_cc_chooses_and_may_hold_options(monkeypatch):
    monkeypatch.setenv("CC", "cc -pipe")
    assert compiler.find_compiler() == ["cc", "-pipe"]
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(KfgenError, match=r"no-such-compiler.*\$CC"):
        compiler.find_compiler()


def test_a_relative_cache_home_is_ignored(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert compiler.cache_directory() == tmp_path / ".cache" / "kfgen"


def test_a_cache_that_cannot_be_made_is_replaced(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    folder = compiler.cache_directory()
    assert folder.is_dir()
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert compiler.build(SOURCE).exists()
