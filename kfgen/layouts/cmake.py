"""A library target of CMake, `<name>::<name>`, to add or to install; with a self-test, a test of CTest."""

from __future__ import annotations

from kfgen.emit.render import render_text
from kfgen.layouts import Package


def arrange(package: Package) -> dict[str, str]:
    added = {"CMakeLists.txt": render_text("layouts/cmake_lists.j2", p=package)}
    if package.selftest:
        added["test/main.c"] = render_text("selftest/main.j2", p=package)
    return {**package.sources, **added}
