"""`python -m tests.campaign --minutes N`: random specs, hostile calls under sanitizers, two oracles; resumable."""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import time
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from pathlib import Path

# matrices are small: a pool of threads in each process only makes them wait for each other
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from tests.campaign.batch import Work, class_of, quiet, work
from tests.campaign.state import Result, State

KEPT = 2  # failures of a kind and class that are minimised and kept


def arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.campaign", description=__doc__)
    parser.add_argument("--minutes", type=float, default=10, help="how long to go on (default 10)")
    parser.add_argument("--specs", type=int, help="end after so many specs in all, counted over all runs")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes (default: all cores)")
    parser.add_argument("--seconds", type=float, default=2.0, help="of calls for each spec (default 2)")
    parser.add_argument("--smaller", type=float, default=60.0, help="seconds for minimising a failure (default 60)")
    parser.add_argument("--state", type=Path, default=Path("out/campaign"), help="folder to go on in (out/campaign)")
    parser.add_argument("--report", action="store_true", help="only tell what the folder holds")
    return parser


class Campaign:
    """Batches handed to processes until the time is over; what comes back is kept at once."""

    def __init__(self, state: State, how: Work, jobs: int, end: float, specs: int | None) -> None:
        self.state, self.how, self.jobs, self.end, self.specs = state, how, jobs, end, specs
        self.often: dict[str, int] = {}
        self.started = time.monotonic()

    def run(self) -> None:
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(self.jobs, mp_context=context, initializer=quiet) as pool:
            running: dict[Future[Result], int] = {}
            try:
                while not self.over() or running:
                    for batch in self.state.next_batches(len(running) + self.jobs):
                        if len(running) < self.jobs and batch not in running.values() and not self.over():
                            running[pool.submit(work, batch, self.how, self.seen())] = batch
                    done, _ = wait(running, return_when=FIRST_COMPLETED)
                    for future in done:
                        del running[future]
                        self.take(future)
            except KeyboardInterrupt:  # what is still at work is done again by the next run
                for process in list(pool._processes.values()):
                    process.terminate()
                raise

    def take(self, future: Future[Result]) -> None:
        result = future.result()
        for failure in result.failures:
            key = f"{failure.kind} {class_of(failure.data)}"
            self.often[key] = self.often.get(key, 0) + 1
        self.state.add(result)
        counts = self.state.totals["counts"]
        print(
            f"{time.monotonic() - self.started:6.0f} s  {counts['specs']} specs  {counts['calls']:.2e} calls  "
            f"{counts['failing']} failing, {len(self.state.totals['kinds'])} kinds",
            file=sys.stderr, flush=True,
        )  # fmt: skip

    def seen(self) -> frozenset[str]:
        return frozenset(key for key, often in self.often.items() if often >= KEPT)

    def over(self) -> bool:
        enough = self.specs is not None and self.state.totals["counts"]["specs"] >= self.specs
        return enough or time.time() > self.end


def main() -> int:
    chosen = arguments().parse_args()
    state = State(chosen.state)
    if not chosen.report:
        end = time.time() + 60 * chosen.minutes
        how = Work(seconds=chosen.seconds, smaller=chosen.smaller, until=end)
        campaign = Campaign(state, how, chosen.jobs, end, chosen.specs)
        try:
            campaign.run()
        except KeyboardInterrupt:
            print("interrupted; another run goes on from here", file=sys.stderr)
    print(state.report())
    return 1 if state.totals["kinds"] else 0


if __name__ == "__main__":
    sys.exit(main())
