"""Runs the verifier on adversarial queries whose truth is known, and counts its errors.

    python analysis/soundness.py --queries 1000000 --seed 1

A false `certified` is a pair proved clear that is not; a false `refuted` the reverse.
`undecided` far from the limit (1 um or more) must stay below 0.1 %. Exit 0 if all hold.
"""

import argparse
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Final

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from oracles.adversarial import Batch, exact_bracket, make_batch

from vdsm_pin.verification.clearance import prove_clearance
from vdsm_pin.verification.records import ClearanceChunk, ErrorBox

FAR: Final = 1e-6
"""From here on a query must be decided; [m]."""

UNDECIDED_LIMIT: Final = 1e-3
"""Largest share of undecided queries among those far from the limit; [-]."""

SHARES: Final = {
    "none": 0.5,
    "still": 0.2,
    "rail": 0.14,
    "away": 0.14,
    "base_turn": 0.02,
}
"""Share of each kind of motion; turns near the limit take many slices each."""

LEAST: Final = {"base_turn": 1e-8}
"""Least distance from the limit where it is not 1e-12; [m]."""

RECHECKED: Final = 4
"""Queries of each batch whose truth is recomputed in ball arithmetic."""

CERTIFIED, REFUTED, UNDECIDED = 0, 1, 2


def verdicts(batch: Batch) -> np.ndarray:
    """The verifier's verdict on each query, worst over the motion; 0, 1 or 2."""
    chunks: list[ClearanceChunk] = []
    prove_clearance(batch.problem, batch.trajectory, ErrorBox(), [chunks.append])
    found = np.concatenate([chunk.verdict for chunk in chunks])
    n = batch.problem.manipulator.n_links
    pairs = np.arange(len(batch.link)) * n + batch.link
    return np.asarray(found[0, pairs])


def recheck(batch: Batch, rng: np.random.Generator) -> None:
    """Recompute the truth of some queries exactly.

    Raises:
        AssertionError: If the generator's own truth is wrong.
    """
    for k in rng.integers(len(batch.link), size=RECHECKED):
        lower, upper = exact_bracket(batch, int(k))
        clear = bool(batch.excess[k] > 0.0)
        assert bool(lower > 0) if clear else bool(upper < 0), (batch.shape[k], k)


def count(batch: Batch, found: np.ndarray, tally: Counter[str]) -> None:
    """Add one batch to the tally."""
    clear, far = batch.excess > 0.0, np.abs(batch.excess) >= FAR
    wrong = {
        "false certified": (found == CERTIFIED) & ~clear,
        "false refuted": (found == REFUTED) & clear,
        "undecided": found == UNDECIDED,
        "undecided far": (found == UNDECIDED) & far,
    }
    tally["queries"] += found.size
    tally["far"] += int(far.sum())
    for name, which in wrong.items():
        tally[name] += int(which.sum())
        for k in np.flatnonzero(which):
            tally[f"{name}: {batch.motion}, {batch.shape[k]}"] += 1


def run(queries: int, seed: int, size: int) -> Counter[str]:
    """Judge that many queries; one seed gives one set of queries."""
    tally: Counter[str] = Counter()
    rng = np.random.default_rng(seed)
    start = last = time.perf_counter()
    while tally["queries"] < queries:
        motion = str(rng.choice(list(SHARES), p=list(SHARES.values())))
        part = min(size, queries - tally["queries"])
        batch = make_batch(rng, motion, part, LEAST.get(motion, 1e-12))
        count(batch, verdicts(batch), tally)
        recheck(batch, rng)
        if time.perf_counter() - last > 30.0:
            last = time.perf_counter()
            print(f"  {tally['queries']} queries, {last - start:.0f} s", flush=True)
    return tally


def main() -> int:
    """Run, print the counts, and say whether the goals are met."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--queries", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--batch", type=int, default=2000)
    arguments = parser.parse_args()
    start = time.perf_counter()
    tally = run(arguments.queries, arguments.seed, arguments.batch)
    seconds = time.perf_counter() - start
    names = (
        "queries",
        "false certified",
        "false refuted",
        "undecided",
        "undecided far",
    )
    for name in names:
        print(f"{name:16} {tally[name]:>10}")
    share = tally["undecided far"] / max(1, tally["far"])
    print(f"undecided of {tally['far']} at least 1 um from the limit: {share:.5%}")
    print(f"{seconds:.0f} s, {seconds / max(1, tally['queries']) * 1e6:.0f} us a query")
    for name in sorted(name for name in tally if ":" in name):
        print(f"  {name:50} {tally[name]:>8}")
    wrong = tally["false certified"] + tally["false refuted"]
    return int(wrong > 0 or share >= UNDECIDED_LIMIT)


if __name__ == "__main__":
    sys.exit(main())
