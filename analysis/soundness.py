"""Runs the verifier on adversarial queries whose truth is known, and counts its errors.

    python analysis/soundness.py --queries 1000000 --seed 1 --save reports/soundness.md

A false `certified` is a pair proved clear that is not; a false `refuted` the reverse.
`undecided` far from the limit (1 um or more) must stay below 0.1 %. Exit 0 if all hold.

Each query goes to the compiled sweep as the one pair it asks about. One scene in a
hundred also goes through `prove_motion` as a whole, broad phase included, which must
not contradict the truth either. Queries about error boxes are certified falsely where a
motion within the box is known, or found, to come too near; they are far from the limit
where a known plane proves the whole box with 1 um to spare. The same seed gives the
same queries on any number of processes.

Bodies on random trees of 1 to 20 joints go through `prove`, both sides moving, along
lines, cubic and quintic pieces; how near they come is sampled, ever closer, by closed
forms.
"""

import argparse
import os
import platform
import sys
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path as FilePath
from typing import Any, Final

import numpy as np

sys.path.insert(0, str(FilePath(__file__).resolve().parents[1] / "tests"))

from oracles.adversarial import (
    BASE,
    LINK_MOTIONS,
    Batch,
    make_batch,
    make_link_batch,
)
from oracles.adversarial_bodies import pack
from oracles.adversarial_boxes import Boxed, attacked, make_boxed
from oracles.adversarial_truth import exact_bracket
from oracles.tree_queries import (
    TreeQuery,
    clearances,
    make_query,
    random_box,
    wrong_poses,
)
from oracles.tree_queries import at as tree_rows

import vdsm_pin
from vdsm_pin.arm.bodies import arm_bodies
from vdsm_pin.arm.kinematics import arm_tree, link_frame
from vdsm_pin.geometry.convex import Hull
from vdsm_pin.geometry.pieces import PackedPieces, pack_pieces
from vdsm_pin.geometry.solids import ConvexCover
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.bodies import Body, Pair, PairTable
from vdsm_pin.proof.bodies import ErrorBox as ProofBox
from vdsm_pin.proof.budget import Budget, rounding_pad
from vdsm_pin.proof.packing import pack_task, with_errors
from vdsm_pin.proof.parts import PartPlan
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.proofs import Proof
from vdsm_pin.proof.proving import new_proving
from vdsm_pin.proof.question import Question
from vdsm_pin.proof.terms import WORLD
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.brackets import ClearanceChunk
from vdsm_pin.verification.clearance import prove_motion

FAR: Final = 1e-6
"""From here on a query must be decided; [m]."""

KNOWN: Final = 1e-9
"""How well distances on random trees are known; [m]."""

UNDECIDED_LIMIT: Final = 1e-3
"""Largest share of undecided queries among those far from the limit; [-]."""

BOXES: Final = "boxes"
"""Not a motion: error boxes around any of them."""

TREES: Final = {"tree_linear": 1, "tree_cubic": 3, "tree_quintic": 5}
"""Bodies on random trees, both sides moving, and the degree of their paths."""

MOST_JOINTS: Final = 20
"""Of a random tree."""

ATTACKS: Final = 20
"""Configurations tried of an error box that is certified."""

SHARES: Final = {
    "none": 0.391,
    "still": 0.16,
    "rail": 0.13,
    "away": 0.13,
    "base_turn": 0.02,
    "pierce": 0.04,
    "links_none": 0.02,
    "links_still": 0.02,
    "links_swing": 0.02,
    BOXES: 0.06,
    **dict.fromkeys(TREES, 0.003),
}
"""Share of each kind of motion; turns near the limit take many slices each."""

SIZES: Final = {"links_swing": 32, "links_none": 253, "links_still": 253, BOXES: 200}
"""Queries about one motion where they are not as many as asked for."""

LEAST: Final = {"base_turn": 1e-8, "links_swing": 1e-8}
"""Least distance from the limit where it is not 1e-12; [m]."""

BLOCK: Final = 50_000
"""Queries of one random stream."""

RECHECKED: Final = 500
"""One query in so many has its truth recomputed in ball arithmetic."""

WHOLE: Final = 100
"""One scene in so many is judged as a whole too, with at most so many obstacles."""

CERTIFIED, REFUTED, UNDECIDED = 0, 1, 2
NOMINAL: Final = ErrorBox()
BUDGET: Final = Budget()


def _pack(batch: Batch) -> PackedPieces:
    """The obstacles, or the axes of the links along x, grown by their radius."""
    if batch.groups:
        return pack(batch.groups)
    arm = batch.arm
    return pack_pieces(
        [
            [Hull(np.array([[0.0, 0.0, 0.0], [x, 0.0, 0.0]]), arm.link_radius)]
            for x in arm.link_lengths
        ]
    )


def verdicts(batch: Batch, errors: ErrorBox = NOMINAL) -> Any:
    """The verifier's verdict on each query; 0, 1 or 2, shape (n,)."""
    arm, pieces, n = batch.arm, _pack(batch), batch.size
    values = (pieces.points, pieces.centre, pieces.extent, pieces.radius)
    extent = max(float(np.abs(x).max(initial=0.0)) for x in values)
    extent = max(extent, arm.total_length, *np.abs(arm.base_range))
    rules = BUDGET.rules(rounding_pad(extent))
    tree, path = arm_tree(arm), Path(np.ascontiguousarray(batch.rows))
    moving = [Body(link_frame(b.link), (b.piece,)) for b in arm_bodies(arm)]
    # Obstacles are packed already; links that rest are the links that move.
    obstacles = [Body(WORLD, ())] * n if batch.groups else []
    own = batch.frame == BASE
    table = PairTable(
        one=len(obstacles) + batch.link.astype(np.int64),
        other=np.where(own, np.arange(n), batch.frame).astype(np.int64),
        required=batch.required,
    )
    bodies = [*obstacles, *moving]
    task = pack_task(tree, bodies, table, rules, path.reach, pieces=pieces)
    joints, shifts, tilts = np.zeros((3, len(tree.joints)))
    joints[1:], shifts[0] = errors.angles(arm.n_links).ravel(), errors.base
    tilts[0], surfaces = errors.base_turn, np.zeros(len(bodies))
    surfaces[: len(obstacles)] = errors.obstacle
    task = with_errors(task, ProofBox(joints, shifts, tilts, surfaces))
    # No obstacle is named as such, so that none is settled by its box.
    plan = PartPlan(bodies, table, np.arange(n), own, np.arange(len(bodies)), 0)
    proving = new_proving(plan, task, path.packed(), 1, BUDGET)
    proving.sweep(0, 1)
    return proving.results.counts.argmax(axis=1)


# ---- the same, as the product is called ----------------------------------------------


@dataclass(frozen=True, eq=False)
class _Body(ConvexCover):
    """An obstacle of stated pieces, half-spaces among them."""

    @property
    def reach(self) -> float:
        """Largest distance of a hull's points from the base's origin; [m]."""
        hulls = (one for one in self.pieces if isinstance(one, Hull))
        return max((_far(hull) for hull in hulls), default=0.0)


def _far(hull: Hull) -> float:
    return float(np.linalg.norm(hull.points, axis=1).max()) + hull.radius


def whole(batch: Batch) -> tuple[Any, Any]:
    """Some queries and the verdicts of `prove_motion` on them."""
    arm, asked = batch.arm, np.arange(min(batch.size, WHOLE))
    bodies, clearance, between = [], float(batch.required[0]), 0.0
    if batch.groups:
        asked = np.linspace(0, batch.size - 1, len(asked)).astype(int)
        bodies = [_Body(f"b{k}", batch.pieces(int(k))) for k in asked]
        columns = np.arange(len(asked)) * arm.n_links + batch.link[asked]
    else:
        asked, between = asked[:1], float(batch.required[0])
        i, k = np.triu_indices(arm.n_links, 2)
        columns = np.flatnonzero((i == batch.frame[0]) & (k == batch.link[0]))
    tip = np.array([arm.total_length, 0.0, 0.0])
    problem = PlanningProblem(
        manipulator=arm,
        scene=Scene(tuple(bodies)),
        tip_path=DesiredPath(tip, tip[None]),
        required_clearance=clearance,
        name="queries",
        required_self_clearance=between,
    )
    q, blank = batch.rows, np.zeros(len(batch.rows))
    rows = Trajectory(blank > 0.0, blank, q[:, 0], q[:, 1::2], q[:, 2::2])
    chunks: list[ClearanceChunk] = []
    motion = AskedMotion.of_arm(problem, rows, ErrorBox())
    prove_motion(motion, Budget(), [chunks.append])
    return asked, chunks[0].verdict[0, columns]


# ---- counting ------------------------------------------------------------------------


def recheck(batch: Batch, rng: np.random.Generator) -> int:
    """Recompute the truth of some queries exactly; returns how many.

    Raises:
        AssertionError: If the generator's own truth is wrong.
    """
    chosen = np.flatnonzero(rng.random(batch.size) < 1.0 / RECHECKED)
    for k in chosen:
        lower, upper = exact_bracket(batch, int(k))
        clear = bool(batch.excess[k] > 0.0)
        found = float(lower), float(upper), float(batch.excess[k])
        where = (batch.motion, batch.shape[k], found)
        assert bool(lower > 0) if clear else bool(upper < 0), where
    return len(chosen)


def count(batch: Batch, asked: Any, found: Any, tally: Counter[str]) -> None:
    """Add verdicts on some queries of a batch to a tally, by motion and shape."""
    excess = batch.excess[asked]
    truth = Truth(excess < 0.0, excess > 0.0, np.abs(excess) >= FAR)
    _count(batch.motion, batch.shape[asked], truth, found, tally)


@dataclass(frozen=True)
class Truth:
    """What is known of some queries.

    Args:
        lost: Whether certifying one would be wrong, shape (n,).
        kept: Whether refuting one would be, shape (n,).
        far: Whether one must be decided, shape (n,).
    """

    lost: Any
    kept: Any
    far: Any


def _count(
    motion: str, shapes: Any, truth: Truth, found: Any, tally: Counter[str]
) -> None:
    kinds = {
        "queries": found >= 0,
        "false certified": (found == CERTIFIED) & truth.lost,
        "false refuted": (found == REFUTED) & truth.kept,
        "undecided": found == UNDECIDED,
        "far": truth.far,
        "undecided far": (found == UNDECIDED) & truth.far,
    }
    for name, which in kinds.items():
        tally[name] += int(which.sum())
        for shape, number in zip(
            *np.unique(shapes[which], return_counts=True), strict=True
        ):
            tally[f"{name}|{motion}|{shape}"] += int(number)


def judge_boxed(boxed: Boxed, rng: np.random.Generator, tally: Counter[str]) -> None:
    """Judge queries about an error box, attack what is certified, and count."""
    batch = boxed.batch
    found = verdicts(batch, boxed.errors)
    certified, lost = np.flatnonzero(found == CERTIFIED), boxed.lost.copy()
    lost[certified] |= attacked(boxed, _pack(batch), certified, rng)
    truth = Truth(lost, boxed.kept, boxed.proved >= FAR)
    _count(f"box_{batch.motion}", batch.shape, truth, found, tally)
    tally["certified boxes attacked"] += len(certified)


def judge(batch: Batch, rng: np.random.Generator, tally: Counter[str]) -> None:
    """Judge a batch and count what comes of it."""
    count(batch, slice(None), verdicts(batch), tally)
    tally["rechecked"] += recheck(batch, rng)
    if rng.random() < 1.0 / WHOLE:
        count(batch, *whole(batch), tally)
        tally["scenes judged whole"] += 1


def _proof(query: TreeQuery, pair: Pair, errors: ProofBox | None = None) -> Proof:
    """Of the two bodies of a query."""
    asked = Question.of(query.tree, query.bodies, PairTable.of([pair]), errors)
    return asked.about(query.path).prove()


def judge_tree(rng: np.random.Generator, motion: str, tally: Counter[str]) -> None:
    """Judge a query about two bodies of a random tree: missed, kept, with errors.

    A limit beyond the nearest that is known is missed, so it must not be certified.
    What is refuted must come as near as its witness says. A box is attacked from
    corners. No limit is below 0, as in a problem: how deep bodies of several pieces
    meet is not measured.
    """
    query = make_query(rng, TREES[motion], int(rng.integers(1, MOST_JOINTS + 1)))
    off = float(10.0 ** rng.uniform(-9.0, -3.0))
    for limit in (query.nearest + off, query.nearest - off):
        required = max(0.0, limit)
        missing = required - query.nearest
        proof = _proof(query, Pair(*rng.permutation(2).tolist(), required))
        met = np.array([proof.share[0]])
        poses = query.tree.poses(tree_rows(query.path, met))
        nearest = clearances(query.tree, query.bodies, poses)[0]
        truth = Truth(
            lost=np.array([missing > KNOWN]),
            kept=np.array([nearest >= required + KNOWN]),
            far=np.array([missing >= FAR]),
        )
        _count(motion, np.array([query.shape]), truth, proof.verdict, tally)
    box, required = random_box(rng, query.tree), max(0.0, query.nearest - 10.0 * off)
    proof = _proof(query, Pair(0, 1, required), box)
    wrong = False
    for t in rng.uniform(size=ATTACKS if proof.is_certified else 0):
        row = tree_rows(query.path, np.array([t]))[0]
        poses = wrong_poses(query.tree, row, box, rng)[None]
        near = clearances(query.tree, query.bodies, poses)[0]
        wrong |= bool(near < required - KNOWN)
    truth = Truth(np.array([wrong]), np.array([False]), np.array([False]))
    _count(f"box_{motion}", np.array([query.shape]), truth, proof.verdict, tally)
    tally["certified boxes attacked"] += int(proof.is_certified)


def run_block(seed: np.random.SeedSequence, queries: int, size: int) -> Counter[str]:
    """Judge the queries of one random stream, at least as many as asked for."""
    tally: Counter[str] = Counter()
    rng = np.random.default_rng(seed)
    start = time.process_time()
    for motion, share in SHARES.items():
        wanted = int(np.ceil(share * queries))
        done = 0
        while done < wanted:
            if motion in TREES:
                judge_tree(rng, motion, tally)
                done += 3
                continue
            part = min(SIZES.get(motion, size), wanted - done)
            if motion == BOXES:
                boxed = make_boxed(rng, part, 1e-12)
                if boxed.batch.size:
                    judge_boxed(boxed, rng, tally)
                done += boxed.batch.size
                continue
            make = make_link_batch if motion in LINK_MOTIONS else make_batch
            batch = make(rng, motion, part, LEAST.get(motion, 1e-12))
            if batch.size:
                judge(batch, rng, tally)
            done += batch.size
    tally["cpu_us"] += int(1e6 * (time.process_time() - start))
    return tally


def _blocks(queries: int, seed: int) -> Iterator[tuple[np.random.SeedSequence, int]]:
    count = -(-queries // BLOCK)
    for k, child in enumerate(np.random.SeedSequence(seed).spawn(count)):
        yield child, min(BLOCK, queries - k * BLOCK)


def counted(
    queries: int, seed: int, size: int, processes: int
) -> Iterator[Counter[str]]:
    """The tally after each block; one seed gives one set of queries."""
    tally: Counter[str] = Counter()
    seeds, numbers = zip(*_blocks(queries, seed), strict=True)
    arguments = seeds, numbers, [size] * len(seeds)
    if processes == 1:
        for part in map(run_block, *arguments):
            tally.update(part)
            yield tally
        return
    with ProcessPoolExecutor(processes, get_context("spawn")) as pool:
        for part in pool.map(run_block, *arguments):
            tally.update(part)
            yield tally


def run(queries: int, seed: int, size: int, processes: int = 1) -> Counter[str]:
    """Judge that many queries."""
    *_, tally = counted(queries, seed, size, processes)
    return tally


# ---- the report ----------------------------------------------------------------------

COLUMNS: Final = (
    "queries",
    "false certified",
    "false refuted",
    "undecided",
    "far",
    "undecided far",
)


def _table(tally: Counter[str], part: int, title: str) -> list[str]:
    """Rows by motion (part 1) or by shape (part 2)."""
    keys = sorted({key.split("|")[part] for key in tally if "|" in key})
    lines = [f"| {title} | " + " | ".join(COLUMNS) + " |", "|---" * 7 + "|"]
    for key in keys:
        numbers = [
            sum(n for name, n in tally.items() if _is(name, column, part, key))
            for column in COLUMNS
        ]
        lines.append(f"| {key} | " + " | ".join(f"{n:,}" for n in numbers) + " |")
    return lines


def _is(name: str, column: str, part: int, key: str) -> bool:
    split = name.split("|")
    return len(split) == 3 and split[0] == column and split[part] == key


def report(tally: Counter[str], command: str) -> str:
    """The page: what was asked, what came of it, where and with what."""
    share = tally["undecided far"] / max(1, tally["far"])
    each = tally["cpu_us"] / max(1, tally["queries"])
    packages = [(name, version(name)) for name in ("numpy", "numba", "python-flint")]
    known = [("vdsm-pin", vdsm_pin.__version__), *packages]
    versions = ", ".join(f"{name} {number}" for name, number in known)
    lines = [
        "# Soundness",
        "",
        "Adversarial queries with known truth against the verifier's verdicts; made by",
        f"`{command}`.",
        "",
        f"* {tally['queries']:,} queries, {tally['cpu_us'] / 1e6:.0f} s of processor "
        f"time, {each:.0f} us a query",
        f"* false `certified`: **{tally['false certified']}**; false `refuted`: "
        f"**{tally['false refuted']}**",
        f"* `undecided`: {tally['undecided']:,}; of the {tally['far']:,} at least 1 um "
        f"from the limit {tally['undecided far']:,} ({share:.5%}, allowed 0.1 %)",
        f"* truth recomputed in ball arithmetic for {tally['rechecked']:,}; "
        f"{tally['scenes judged whole']:,} scenes judged through `prove_motion` too",
        f"* {tally['certified boxes attacked']:,} queries certified for an error box, "
        "each attacked from corners of it",
        f"* {versions}, Python {platform.python_version()}, {platform.machine()}",
        "",
        "What the motions and shapes are: `tests/oracles/adversarial.py`,",
        "`adversarial_bodies.py`, `adversarial_boxes.py` and `tree_queries.py`. `far`:",
        "at least 1 um from the limit; of a box, proved by a known plane with as much",
        "to spare; on a random tree, a limit that is missed.",
        "",
        *_table(tally, 1, "motion"),
        "",
        *_table(tally, 2, "shape"),
        "",
    ]
    return "\n".join(lines)


def main() -> int:
    """Run, print the counts, and say whether the goals are met."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--queries", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--batch", type=int, default=1000, help="queries of a scene")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--save", type=FilePath, help="write the page here as well")
    arguments = parser.parse_args()
    wanted = arguments.queries, arguments.seed
    command = "python analysis/soundness.py --queries {} --seed {}".format(*wanted)
    start, page = time.perf_counter(), ""
    for tally in counted(*wanted, arguments.batch, arguments.processes):
        page = report(tally, command)
        seconds = time.perf_counter() - start
        print(f"  {tally['queries']:,} queries, {seconds:.0f} s", flush=True)
        if arguments.save:  # whoever stops it keeps what was counted
            arguments.save.write_text(page)
    print(page)
    wrong = tally["false certified"] + tally["false refuted"]
    return int(wrong > 0 or tally["undecided far"] >= UNDECIDED_LIMIT * tally["far"])


if __name__ == "__main__":
    sys.exit(main())
