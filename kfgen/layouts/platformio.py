"""A library of PlatformIO: library.json and src/."""

from __future__ import annotations

import json

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
    return {"library.json": text, **{f"src/{name}": text for name, text in package.sources.items()}}
