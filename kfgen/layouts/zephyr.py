"""A module of Zephyr: zephyr/module.yml, CMakeLists.txt, Kconfig, and a sample application."""

from __future__ import annotations

from kfgen.emit.render import render_text
from kfgen.layouts import Package


def arrange(package: Package) -> dict[str, str]:
    sample = f"samples/{package.name}"
    return {
        **package.sources,
        "zephyr/module.yml": render_text("layouts/zephyr_module.j2", p=package),
        "zephyr/Kconfig": render_text("layouts/zephyr_kconfig.j2", p=package),
        "CMakeLists.txt": render_text("layouts/zephyr_cmake.j2", p=package),
        f"{sample}/CMakeLists.txt": render_text("layouts/zephyr_sample_cmake.j2", p=package),
        f"{sample}/prj.conf": render_text("layouts/zephyr_sample_conf.j2", p=package),
        f"{sample}/sample.yaml": render_text("layouts/zephyr_sample.j2", p=package),
        f"{sample}/src/main.c": render_text("layouts/zephyr_sample_main.j2", p=package),
    }
