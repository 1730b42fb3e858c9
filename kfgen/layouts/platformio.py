"""A library of PlatformIO: library.json, src/, and an example project, which runs the self-test where there is one."""

from __future__ import annotations

import json

from kfgen.emit.render import render_text
from kfgen.layouts import Package


def arrange(package: Package) -> dict[str, str]:
    manifest = {
        "name": package.name,
        "version": "1.0.0",
        "description": f"{package.title} (kfgen build {package.command})",
        "keywords": "kalman, filter, estimation",
        "frameworks": "*",
        "platforms": "*",
        "headers": f"{package.name}.h",
        "build": {"srcDir": "src", "includeDir": "src", "flags": ["-fno-math-errno"]},
    }
    text = json.dumps(manifest, indent=2, ensure_ascii=False) + "\n"
    example = f"examples/{package.name}_example"
    return {
        "library.json": text,
        **{f"src/{name}": text for name, text in package.sources.items()},
        f"{example}/platformio.ini": render_text("layouts/platformio_ini.j2", p=package),
        f"{example}/src/main.cpp": render_text("layouts/platformio_main.j2", p=package),
    }
