#!/usr/bin/env python3
"""Cost and limits of remote workers.

    pip install '.[ray]'
    python benches/scaling.py ray [--rounds 5]     # one and two Ray workers on this machine, compared with threads
    python benches/scaling.py extrapolate          # up to 1000 simulated workers

`extrapolate` runs two generations of a population once and records the result of every batch. Then it runs them again
with workers that return the recorded results after the time that the simulations would take on a core of their own.
Everything except simulations and network is measured, so this is the limit of the dispatching machine.
"""

import argparse
import statistics
import tempfile
import threading
import time
from collections.abc import Sequence
from pathlib import Path

import btr
from btr import executors

ROBOTS = Path(__file__).parents[1] / "robots"


class Counted:
    """An executor that counts its messages; its workers are threads of this process."""

    def __init__(self, workers: int) -> None:
        self.workers, self.lock = workers, threading.Lock()
        self.sent, self.answered, self.payloads = [], [], {}

    def work(self, payloads: Sequence, batch: bytes) -> bytes:
        answer = self.answer(payloads, batch)
        with self.lock:
            self.sent.append(len(batch))
            self.answered.append(len(answer))
            self.payloads |= {payload.key: len(payload.content) for payload in payloads}
        return answer

    def answer(self, payloads: Sequence, batch: bytes) -> bytes:
        return executors.serve([p.key for p in payloads], batch, *[p.content for p in payloads])


class Recorded(Counted):
    """Records results."""

    def __init__(self, workers: int) -> None:
        super().__init__(workers)
        self.known: dict[bytes, bytes] = {}

    def answer(self, payloads: Sequence, batch: bytes) -> bytes:
        answer = self.known[batch] = super().answer(payloads, batch)
        return answer


class Replayed(Counted):
    """Returns recorded results after the time that they would take."""

    def __init__(self, recorded: Recorded, candidates: int, seconds: float) -> None:
        super().__init__(recorded.workers)
        self.known = recorded.known
        self.per_byte = candidates * seconds / sum(recorded.sent)

    def answer(self, payloads: Sequence, batch: bytes) -> bytes:
        time.sleep(self.per_byte * len(batch))
        return self.known[batch]


def seconds(run) -> float:
    began = time.perf_counter()
    run()
    return time.perf_counter() - began


def sizes(name: str, executor: Counted) -> None:
    batches = len(executor.sent)
    sent, answered = sum(executor.sent) / batches, sum(executor.answered) / batches
    print(f"{name}: {batches} batches of {sent:.0f} bytes, answers of {answered:.0f},", end=" ")
    print(f"{len(executor.payloads)} payloads of {sum(executor.payloads.values()) / 1e3:.0f} kB in all")


def diagnosis(executor) -> None:
    learn = sorted((ROBOTS / "arm").glob("learn_*.csv"))
    btr.diagnose(btr.load_model(ROBOTS / "arm.toml"), learn, executor=executor)


def loop(executor, **settings) -> None:
    with tempfile.TemporaryDirectory() as folder:
        btr.coevolve(btr.load_model(ROBOTS / "nao.toml", settings), out=folder, executor=executor)


def ray(rounds: int) -> None:
    one, two = executors.Ray(1, num_cpus=2), executors.Ray(2)
    for name, work in (("diagnose, arm", diagnosis), ("coevolve, nao.toml", loop)):
        counted = Counted(2)
        work(counted)
        sizes(name, counted)
        work(two)  # every worker opens its payloads
        taken = {label: [] for label in ("1 thread", "2 threads", "Ray, 1 worker", "Ray, 2 workers")}
        for _ in range(rounds):
            for label, executor in zip(taken, (1, 2, one, two)):
                taken[label].append(seconds(lambda: work(executor)))
        for label, times in taken.items():
            print(f"  {label:<16}{statistics.median(times):6.2f} s   {min(times):.2f} .. {max(times):.2f}")


def population(size: int, executor) -> float:
    settings = {
        "coevolve.iterations": 1,
        "coevolve.controllers.generations": 2,
        "coevolve.controllers.search.population": size,
        "coevolve.transfer.count": 1,
        "coevolve.simulators.generations": 1,
        "coevolve.simulators.search.population": 2,
    }
    with tempfile.TemporaryDirectory() as folder:
        model = btr.load_model(ROBOTS / "ant.toml", settings)
        return seconds(lambda: btr.coevolve(model, out=folder, executor=executor))


def extrapolate(size: int, taking_s: float, several: list[int]) -> None:
    print(f"two generations of {size} candidates that take {1e3 * taking_s:.0f} ms each")
    print(f"{'workers':>8}{'batches':>9}{'ideal s':>9}{'s':>8}{'share of the ideal':>20}")
    for workers in several:
        recorded = Recorded(workers)
        population(size, recorded)
        replayed = Replayed(recorded, 2 * size, taking_s)
        idle = population(size, Replayed(recorded, 2 * size, 0.0))
        took, ideal = population(size, replayed), 2 * size * taking_s / workers
        row = f"{workers:>8}{len(recorded.sent):>9}{ideal:>9.2f}{took:>8.2f}{100 * ideal / took:>18.0f} %"
        print(f"{row}   (nothing to wait for: {idle:.2f} s)")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["ray", "extrapolate"])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--size", type=int, default=4000)
    parser.add_argument("--taking", type=float, default=0.05, help="seconds per candidate")
    parser.add_argument("--workers", type=int, nargs="+", default=[10, 100, 300, 1000])
    args = parser.parse_args()
    if args.what == "ray":
        ray(args.rounds)
    else:
        extrapolate(args.size, args.taking, args.workers)


if __name__ == "__main__":
    main()
