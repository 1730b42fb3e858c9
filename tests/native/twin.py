"""A filter as the program that it was printed from, beside what the compiler made of it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from emitted import Program

from kfgen.generate import Generated
from kfgen.native import NativeFilter


class Twin(Program):
    """The same filter twice: as a program, and compiled."""

    def __init__(self, made: Generated, kf: NativeFilter) -> None:
        super().__init__(made.code)
        self.kf = kf
        assert not self.differences()  # init is the first call

    def copy_fields(self) -> None:
        """The program's memory becomes what the struct holds."""
        for name, value in self.fields().items():
            if isinstance(value, np.ndarray):
                self.memory.arrays[name] = [self.type.convert(v) for v in value]
            elif isinstance(value, float):
                self.memory.numbers[name] = self.type.convert(value)
            else:
                self.memory.numbers[name] = value

    def fields(self) -> dict[str, Any]:
        return dict(_flat("kf", self.kf.raw))

    def differences(self) -> list[str]:
        """The fields that are not the same bits."""
        out = []
        for name, value in self.fields().items():
            ours = self.memory.arrays.get(name, self.memory.numbers.get(name))
            if isinstance(value, np.ndarray):
                same = np.array(ours, dtype=value.dtype).tobytes() == value.tobytes()
            elif isinstance(value, float):
                same = np.float64(ours).tobytes() == np.float64(value).tobytes()
            else:
                same = ours == value
            if not same:
                out.append(f"{name}: program {ours}, C {value}")
        return out

    def errors(self) -> float:
        """The largest difference, in units of the last place of the largest number in its field.

        nis, the square of a small difference over its sigma, is taken relative to 1 and to 1000 such units.
        """
        worst = 0.0
        for name, value in self.fields().items():
            if not isinstance(value, np.ndarray | float):
                assert self.memory.numbers[name] == value
                continue
            ours = np.array(self.memory.arrays.get(name, self.memory.numbers.get(name)), dtype=np.float64)
            scale = max(float(np.max(np.abs(value))), 1e-30) * float(self.type.epsilon)
            if name == "kf.nis":
                scale = 1000 * max(scale, float(self.type.epsilon))
            worst = max(worst, float(np.max(np.abs(ours - value))) / scale)
        return worst


def _flat(path: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for key, each in value.items():
            yield from _flat(f"{path}.{key}", each)
    else:
        yield path, value


def compiled_call(kf: NativeFilter, function: str, keywords: dict[str, Any]) -> int:
    if function == "predict":
        return kf.predict(**keywords)
    if function.startswith("update_"):
        return kf.update(function.removeprefix("update_").removesuffix("_masked"), **keywords)
    return int(getattr(kf, function)(*keywords.values()))
