"""One batch of specs from seeds to results: drawn, built, compiled together, called, compared, failures minimised."""

from __future__ import annotations

import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from kfgen.errors import KfgenError
from kfgen.generate import Generated, build
from kfgen.native import compiler, load_filters
from kfgen.spec import loads
from tests.campaign.compare import compare
from tests.campaign.generate import draw, text_of
from tests.campaign.hostile import EVERYTHING, compile_batch, run
from tests.campaign.minimise import minimised
from tests.campaign.model import Data
from tests.campaign.mutate import mutant
from tests.campaign.state import Failure, Result

LONGEST = 90  # seconds for one spec


@dataclass(frozen=True)
class Work:
    """How a batch is to be worked: specs a batch, seconds of calls a spec, seconds for making a failure smaller;
    mend: emitted file -> what replaces a text in it, which is how a test plants a fault."""

    size: int = 8
    seconds: float = 2.0
    smaller: float = 60.0
    segments: int = EVERYTHING
    until: float = float("inf")  # time.time() from which on nothing is made smaller
    mend: Mapping[str, tuple[str, str]] | None = None


class TooSlowError(Exception):
    """A spec takes longer than LONGEST."""


@contextmanager
def _limited(seconds: int) -> Iterator[None]:
    def late(*_: Any) -> None:
        raise TooSlowError

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def quiet() -> None:
    """A worker leaves Ctrl-C to its parent, and clears up when that ends it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))


def spec_of(seed: int) -> Data:
    """Every fourth spec is a mutant of one in specs/."""
    return mutant(seed) if seed % 4 == 3 else draw(seed)


def built(data: Data) -> Generated:
    text = text_of({key: value for key, value in data.items() if key != "campaign"})
    with _limited(LONGEST):
        return build(loads(text))


def work(batch: int, how: Work, seen: frozenset[str] = frozenset()) -> Result:
    """A batch; kinds that were seen often enough are counted, and not made smaller."""
    result = Result(batch)
    counts: Counter[str] = Counter()
    made: dict[str, tuple[Generated, Data]] = {}
    kinds: Counter[str] = Counter()
    refused: Counter[str] = Counter()
    for seed in range(batch * how.size, (batch + 1) * how.size):
        data = spec_of(seed)
        try:
            made[data["name"]] = built(data), data
        except KfgenError as error:
            counts["refused"] += 1
            refused[_short(error)] += 1
        except TooSlowError:
            _fail(result, kinds, f"build takes more than {LONGEST} s", seed, data)
        except Exception:
            told = traceback.format_exc(limit=-3)
            _fail(result, kinds, f"build: {told.strip().splitlines()[-1]}"[:120], seed, data, told)
    with tempfile.TemporaryDirectory(prefix="campaign-") as folder:
        _called(Path(folder), made, how, seen, result, counts, kinds)
    counts["specs"] = len(made)
    counts["failing"] = len({failure.seed for failure in result.failures} | set(_failing(kinds)))
    result.counts, result.kinds, result.refused = dict(counts), dict(_plain(kinds)), dict(refused)
    result.scalars = dict(Counter(g.spec.scalar for g, _ in made.values()))
    return result


def _failing(kinds: Counter[str]) -> Iterator[int]:
    for key in kinds:
        yield int(key.partition("\0")[2])


def _plain(kinds: Counter[str]) -> Counter[str]:
    return Counter(key.partition("\0")[0] for key in kinds)


def _fail(
    result: Result, kinds: Counter[str], kind: str, seed: int, data: Data, calls: str = "", where: str = ""
) -> None:
    kinds[f"{kind}\0{seed}"] += 1
    result.failures.append(Failure(kind, seed, data, where, calls))


def _short(error: KfgenError) -> str:
    """The first mistake without its place and what is particular."""
    line = str(error).splitlines()[0].split(": ", 2)[-1]
    return line.partition(";")[0][:100]


def _called(
    folder: Path, made: dict[str, tuple[Generated, Data]], how: Work, seen: frozenset[str], result: Result,
    counts: Counter[str], kinds: Counter[str],
) -> None:  # fmt: skip
    if not made:
        return
    program = compile_batch(folder, made, _mended(made, how))
    for index, (_, data) in enumerate(made.values()):
        seed = int(data["name"][1:])
        told = run(program, index, 0, how.segments, how.seconds)
        counts.update(calls=told.calls, ok=told.ok, warned=told.warned, refused_calls=told.refused)
        first = min((segment for _, _, segment, _ in told.failures), default=0)
        for kind, _, segment, call in told.failures:
            kinds[f"{kind}\0{seed}"] += 1
            if f"{kind} {class_of(data)}" in seen:
                continue
            small, calls, place = data, "", ""
            if segment == first:  # the rest of what a spec shows is likely to have the same cause
                small = minimised(data, partial(_fails, kind, how, first), _left(how))
                if small is data:
                    calls = run(program, index, segment, 1, 5.0, trace=True).text
                else:
                    calls, place = _trace(small, how, kind, first)
            result.failures.append(Failure(kind, seed, small, place or f"segment {segment}, call {call}", calls))
    counts.update(_compared([(data, g) for g, data in made.values()], how, seen, result, kinds, folder))


def _mended(made: dict[str, tuple[Generated, Data]], how: Work) -> dict[str, str]:
    texts = {name: text for g, _ in made.values() for name, text in g.files.items()}
    return {name: texts[name].replace(*change) for name, change in (how.mend or {}).items() if name in texts}


def _left(how: Work) -> float:
    return min(how.smaller, how.until - time.time())


def _fails(kind: str, how: Work, segment: int, data: Data) -> bool:
    """Whether a spec by itself fails so, in about as many segments as it took before."""
    try:
        generated = built(data)
    except Exception:
        return False
    with tempfile.TemporaryDirectory(prefix="campaign-") as folder:
        program = compile_batch(Path(folder), {data["name"]: (generated, data)}, _mended({"": (generated, data)}, how))
        told = run(program, 0, 0, 2 * segment + 2000, 3.0)
    return kind in {found for found, *_ in told.failures}


def _trace(data: Data, how: Work, kind: str, first: int) -> tuple[str, str]:
    """The calls of the first segment that fails so."""
    generated = built(data)
    with tempfile.TemporaryDirectory(prefix="campaign-") as folder:
        program = compile_batch(Path(folder), {data["name"]: (generated, data)}, _mended({"": (generated, data)}, how))
        told = run(program, 0, 0, 2 * first + 2000, 5.0)
        for found, _, segment, call in told.failures:
            if found == kind:
                return run(program, 0, segment, 1, 5.0, trace=True).text, f"segment {segment}, call {call}"
    return "", ""


def _compared(
    specs: list[tuple[Data, Generated]], how: Work, seen: frozenset[str], result: Result, kinds: Counter[str],
    folder: Path,
) -> Counter[str]:  # fmt: skip
    counts: Counter[str] = Counter()
    chosen = [(data, g) for data, g in specs if g.spec.scalar != "float"]
    unfollowed: Counter[str] = Counter()
    for (data, _), kf in zip(chosen, _loaded([g for _, g in chosen], folder), strict=True):
        seed = int(data["name"][1:])
        found, calls, reason = _compare(kf, data, seed)
        counts["compared"] += calls
        if kf.spec.scalar == "double":
            counts["followed"] += not reason
            unfollowed.update([reason] if reason else [])
        for kind in found:
            bare = kind.partition(", call")[0]
            kinds[f"{bare}\0{seed}"] += 1
            if f"{bare} {class_of(data)}" not in seen:
                small = minimised(data, partial(_still, bare, seed, folder), _left(how))
                result.failures.append(Failure(bare, seed, small, kind.partition(", ")[2], ""))
    result.unfollowed = dict(unfollowed)
    return counts


def _still(kind: str, seed: int, folder: Path, data: Data) -> bool:
    try:
        kf = _loaded([built(data)], folder)[0]
        return kind in {found.partition(", call")[0] for found in _compare(kf, data, seed)[0]}
    except Exception:
        return False


def _compare(kf: Any, data: Data, seed: int) -> tuple[list[str], int, str]:
    try:
        with _limited(LONGEST), np.errstate(all="ignore"):
            return compare(kf, data, seed)
    except TooSlowError:
        return [], 0, "too slow"
    except KfgenError as error:  # no track can be drawn
        return [], 0, str(error)[:80]
    except Exception as error:
        return [f"comparing: {type(error).__name__}: {error}"[:100]], 0, "an exception"


def _loaded(made: list[Generated], folder: Path) -> list[Any]:
    """Compiled filters, whose libraries go with the batch."""
    cache = folder / "cache"
    cache.mkdir(exist_ok=True)
    before, compiler.cache_directory = compiler.cache_directory, lambda: cache
    try:
        return load_filters(made, flags=["-O0", "-ffp-contract=off"])
    finally:
        compiler.cache_directory = before
        shutil.rmtree(cache, ignore_errors=True)


def class_of(data: Data) -> str:
    """What a failure is likely to share with others of its kind."""
    options = data["filter"]
    kind = "imm" if "imm" in data else options.get("type", "ekf")
    return f"{kind} {options.get('covariance', 'ud')} {str(data.get('scalar', 'float'))[0]}"
