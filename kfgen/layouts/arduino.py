"""A library of the Arduino IDE: library.properties, src/, and an example sketch."""

from __future__ import annotations

from kfgen.emit.render import render_text
from kfgen.layouts import Package


def arrange(package: Package) -> dict[str, str]:
    sketch = f"{package.name}_example"
    return {
        "library.properties": render_text("layouts/arduino_library.j2", p=package),
        **{f"src/{name}": text for name, text in package.sources.items()},
        f"examples/{sketch}/{sketch}.ino": render_text("layouts/arduino_sketch.j2", p=package),
    }
