"""A processor in the emulator unicorn that counts the instructions of every call."""

from __future__ import annotations

import io
import struct
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from kfgen.errors import KfgenError

RETURN = 0x00700000  # nothing is there: a function that returns to it has ended
LOW = 0x00800000  # bytes of memory from 0 on
STACK, STACK_TOP, SIZE = 0x10000, 0x300FFF00, 0x100000
STACK_BASE = 0x30000000
PAINT = b"\xa5"


class Core(Protocol):
    """How a family of processors is emulated."""

    def open(self) -> Any:
        """A new unicorn engine."""
        ...

    def enter(self, uc: Any, address: int) -> int:
        """Prepare a call that returns to RETURN: stack pointer, return address; where to start."""
        ...

    def stack_pointer(self, uc: Any) -> int:
        """Its value where a function begins."""
        ...

    def offsets(self, code: bytes) -> list[int] | None:
        """Where the instructions of a piece of straight code begin; None where only the processor can tell.

        With it whole blocks are counted as they run and taken apart afterwards, which is far faster.
        """
        ...


@dataclass(frozen=True)
class Call:
    """What one call took. visits: address -> executions of the instruction there."""

    instructions: int
    stack: int
    visits: Mapping[int, int]


class Machine:
    """A program on a processor. Memory stays between calls."""

    def __init__(self, program: bytes, core: Core, ram: int = 0x20000000) -> None:
        from elftools.elf.elffile import ELFFile
        from unicorn import UC_HOOK_BLOCK, UC_HOOK_CODE

        self.core = core
        self.uc = core.open()
        self.uc.mem_map(0, LOW)
        self.uc.mem_map(ram, SIZE)
        self.uc.mem_map(STACK_BASE, SIZE)
        elf = ELFFile(io.BytesIO(program))
        for segment in elf.iter_segments("PT_LOAD"):
            if segment["p_filesz"]:
                self.uc.mem_write(segment["p_vaddr"], segment.data())
        table = elf.get_section_by_name(".symtab")
        self.symbols = {each.name: (each["st_value"], each["st_size"]) for each in table.iter_symbols()}
        self.relocations = elf.get_section_by_name(".rela.iplt") or elf.get_section_by_name(".rela.plt")
        self._visits: Counter[tuple[int, int]] = Counter()
        self._blocks: dict[tuple[int, int], list[int]] = {}
        self._entry, self._pointer = -1, 0
        # before anything runs: blocks that are translated without the hook never get it
        blocks = core.offsets(b"") is not None
        self.uc.hook_add(UC_HOOK_BLOCK if blocks else UC_HOOK_CODE, self._counted)

    def _counted(self, uc: Any, address: int, size: int, data: Any) -> None:
        self._visits[address, size] += 1
        if address == self._entry and not self._pointer:
            self._pointer = self.core.stack_pointer(uc)

    def read(self, symbol: str, size: int) -> bytes:
        return bytes(self.uc.mem_read(self.symbols[symbol][0], size))

    def word(self, symbol: str) -> int:
        """A uint32_t."""
        value: int = struct.unpack("<I", self.read(symbol, 4))[0]
        return value

    def write(self, symbol: str, values: NDArray[Any]) -> None:
        self.uc.mem_write(self.symbols[symbol][0], np.ascontiguousarray(values).tobytes())

    def call(self, wrapper: str, function: str) -> Call:
        """Run a wrapper without arguments: what the function that it calls takes, the wrapper left out."""
        from unicorn import UcError

        start, size = self.symbols[wrapper]
        self._entry, self._pointer = self.symbols[function][0] & ~1, 0
        self._visits = Counter()
        base = STACK_TOP - STACK
        self.uc.mem_write(base, PAINT * STACK)
        try:
            self.uc.emu_start(self.core.enter(self.uc, start), RETURN)
        except UcError as error:
            raise KfgenError(f"{function} could not be emulated: {error}") from None
        used = bytes(self.uc.mem_read(base, STACK))
        deepest = base + len(used) - len(used.lstrip(PAINT))
        first = start & ~1
        visits: Counter[int] = Counter()
        for block, times in self._visits.items():
            if not first <= block[0] < first + size:
                for at in self._instructions(block):
                    visits[at] += times
        return Call(visits.total(), max(0, self._pointer - deepest), visits)

    def _instructions(self, block: tuple[int, int]) -> list[int]:
        """The addresses of a block's instructions (address, size)."""
        if block not in self._blocks:
            address, size = block
            offsets = self.core.offsets(bytes(self.uc.mem_read(address, size)))
            self._blocks[block] = [address] if offsets is None else [address + offset for offset in offsets]
        return self._blocks[block]

    def fetch(self, addresses: Sequence[int]) -> dict[int, int]:
        """The four bytes at each address, little-endian: the instruction there."""
        return {at: struct.unpack("<I", bytes(self.uc.mem_read(at, 4)))[0] for at in addresses}


def compressed_offsets(code: bytes, long: int, mask: int, at_least: bool) -> list[int]:
    """Of code in units of two bytes: an instruction takes two units where its first, under a mask, is `long` or above.

    at_least False: where it equals `long`.
    """
    offsets, at = [], 0
    while at + 1 < len(code):
        unit = int.from_bytes(code[at : at + 2], "little") & mask
        offsets.append(at)
        at += 4 if (unit >= long if at_least else unit == long) else 2
    return offsets
