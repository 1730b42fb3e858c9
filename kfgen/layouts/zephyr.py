"""A module of Zephyr: zephyr/module.yml, CMakeLists.txt, Kconfig."""

from __future__ import annotations

from kfgen.emit.render import render_text
from kfgen.layouts import Package


def arrange(package: Package) -> dict[str, str]:
    return {
        **package.sources,
        "zephyr/module.yml": render_text("layouts/zephyr_module.j2", p=package),
        "zephyr/Kconfig": render_text("layouts/zephyr_kconfig.j2", p=package),
        "CMakeLists.txt": render_text("layouts/zephyr_cmake.j2", p=package),
    }
