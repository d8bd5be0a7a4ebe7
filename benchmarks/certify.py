"""Time to prove clearances: 10,000 intervals, and how the time grows.

    python -m benchmarks.certify [--repeat N] [--quick] [--save FILE]

The arm sways beside bars at exactly the stated clearance; one hundredth less is
required. `certify_growth` returns the tables of clearance, intervals, obstacles, links
and triangles as rows. Processor time, medians after a run to warm up, one process.
Beside it stands a check of the samples alone with Coal, which proves nothing.
"""

import argparse
import itertools
import json
import sys
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from math import log, nan
from pathlib import Path
from typing import Any

import coal
import numpy as np

from benchmarks.common import surroundings, timed
from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.convex import Hull
from vdsm_pin.geometry.solids import Box, Cylinder, Mesh, Sphere
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Obstacle, Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.bodies import Body, Pair, PairTable
from vdsm_pin.proof.paths import Path as JointPath
from vdsm_pin.proof.proofs import Proof
from vdsm_pin.proof.question import Question
from vdsm_pin.proof.tree import Joint, Kind, Tree, shifted
from vdsm_pin.verification.clearance import ClearanceProof, prove_clearance

ARM = built_in("hrm8")
MM = 1e-3
NEAR = 3.5 * MM
"""The headline clearance; [m]."""

BAR = 0.2
"""Radius of a bar; [m]."""

ROWS_OF_PEER = 200
"""Rows that the peer looks at."""


@dataclass(frozen=True)
class Row:
    """One measured case.

    Args:
        table: What grows in its table.
        size: How much of it.
        intervals: Of the motion.
        pairs: Links and obstacles, and links two or more apart.
        triangles: Of the mesh, 0 without one.
        clearance_mm: Least clearance from the obstacles; [mm].
        not_certified: Intervals and pairs that were not proved.
        cpu_ms: Median processor time; [ms].
        p95_ms: 95th percentile; [ms].
        exponent: Slope against the row before in a log-log plot; NaN in the first.
    """

    table: str
    size: float
    intervals: int
    pairs: int
    triangles: int
    clearance_mm: float
    not_certified: int
    cpu_ms: float
    p95_ms: float
    exponent: float = nan


def arm_of(n_links: int) -> Manipulator:
    """An arm of the same length with so many equal links, thinner where there are more.

    Links as thick as those of 8 would meet: what is shorter than two radii cannot bend.
    """
    if n_links == ARM.n_links:
        return ARM
    holes = np.resize(ARM.cables.hole_angles, (n_links, 3))
    return replace(
        ARM,
        link_radius=ARM.link_radius * min(1.0, ARM.n_links / n_links),
        link_lengths=np.full(n_links, ARM.total_length / n_links),
        cables=replace(ARM.cables, hole_angles=holes),
    )


def sway(n_intervals: int, n_links: int = 8, size: float = 0.1) -> Trajectory:
    """A smooth motion of all joints, with one period whatever the number of rows."""
    rng = np.random.default_rng(0)
    t = np.linspace(0.0, 2.0 * np.pi, n_intervals + 1)[:, None]
    phase = rng.uniform(0.0, 6.0, (2, n_links))
    size *= 8.0 / n_links
    alpha, theta = size * np.sin(t + phase[0]), size * np.cos(t + phase[1])
    n = n_intervals + 1
    x0 = 0.1 * np.sin(t[:, 0])
    return Trajectory(np.zeros(n, bool), np.zeros(n), x0, alpha, theta)


def _nearest(across: FloatArray, point: FloatArray) -> float:
    """Distance of a point from segments in the plane; `across` (n, N + 1, 2); [m]."""
    start, d = across[:, :-1], np.diff(across, axis=1)
    span = np.maximum((d**2).sum(axis=2), np.finfo(float).tiny)
    t = np.clip(((point - start) * d).sum(axis=2) / span, 0.0, 1.0)
    return float(np.linalg.norm(start + t[..., None] * d - point, axis=2).min())


def beside(
    motion: Trajectory, clearance: float, turn: float = 90.0, arm: Manipulator = ARM
) -> Cylinder:
    """A bar along x at that clearance, `turn` degrees from y towards z."""
    across = joint_centres(arm, motion.x0, motion.alpha, motion.theta)[..., 1:]
    out = np.array([np.cos(np.deg2rad(turn)), np.sin(np.deg2rad(turn))])
    wanted = clearance + arm.link_radius + BAR
    low, high = 0.0, float((across @ out).max()) + wanted
    for _ in range(60):
        # From the far side inwards the distance falls until it is the wanted one.
        middle = 0.5 * (low + high)
        low, high = (
            (low, middle) if _nearest(across, middle * out) > wanted else (middle, high)
        )
    centre = np.array([1.5, *(high * out)])
    return Cylinder(f"bar{turn:g}", centre, np.array([1.0, 0.0, 0.0]), 4.0, BAR)


def scattered(motion: Trajectory, count: int) -> list[Sphere]:
    """Balls around the arm, from just outside its reach on."""
    rng = np.random.default_rng(1)
    centres = joint_centres(ARM, motion.x0, motion.alpha, motion.theta)
    reach = float(np.linalg.norm(centres[..., 1:], axis=2).max())
    turn = rng.uniform(0.0, 2.0 * np.pi, count)
    away = rng.uniform(reach + 0.2, reach + 5.0, count)
    places = np.column_stack(
        [rng.uniform(0.0, 3.0, count), away * np.cos(turn), away * np.sin(turn)]
    )
    return [Sphere(f"ball{k}", c, 0.1) for k, c in enumerate(places)]


def tube(motion: Trajectory, clearance: float, n_triangles: int) -> Mesh:
    """A round tube along x with the arm in it, of about so many triangles."""
    centres = joint_centres(ARM, motion.x0, motion.alpha, motion.theta)
    around = max(8, round((n_triangles / 8) ** 0.5))
    along = max(1, round(n_triangles / (2 * around)))
    reach = float(np.linalg.norm(centres[..., 1:], axis=2).max())
    # The flat faces of the tube come nearer than its edges.
    radius = (reach + ARM.link_radius + clearance) / np.cos(np.pi / around)
    turn = 2.0 * np.pi * np.arange(around) / around
    x = np.linspace(-0.5, 4.0, along + 1)
    ring = radius * np.column_stack([np.cos(turn), np.sin(turn)])
    points = np.array([[a, *b] for a in x for b in ring])
    k, j = np.meshgrid(np.arange(along), np.arange(around), indexing="ij")
    a, b = k * around + j, k * around + (j + 1) % around
    faces = np.stack([a, b, a + around, b, b + around, a + around], axis=-1)
    return Mesh("tube", points, faces.reshape(-1, 3), solid=False)


def problem_of(
    arm: Manipulator, obstacles: Iterable[Obstacle], clearance: float
) -> PlanningProblem:
    """Keep one hundredth less than the clearance there is."""
    point = np.array([arm.total_length, 0.0, 0.0])
    path = DesiredPath(point, point[None])
    scene = Scene(tuple(obstacles))
    return PlanningProblem(arm, scene, path, 0.99 * clearance, name="bench")


def measure(
    table: str, size: float, problem: PlanningProblem, motion: Trajectory, repeat: int
) -> Row:
    """Time one proof."""
    proofs: list[ClearanceProof] = []

    def prove() -> None:
        proofs[:] = [prove_clearance(problem, motion, ErrorBox())]

    seconds = timed(prove, repeat)
    meshes = [o for o in problem.scene.obstacles if isinstance(o, Mesh)]
    n_outer = len(problem.scene.obstacles) * problem.manipulator.n_links
    return Row(
        table=table,
        size=size,
        intervals=motion.n_samples - 1,
        pairs=len(proofs[0].pairs),
        triangles=sum(len(mesh.triangles) for mesh in meshes),
        clearance_mm=float(proofs[0].least.upper[:n_outer].min()) / MM,
        not_certified=int(proofs[0].counts[:, 1:].sum()),
        cpu_ms=1e3 * seconds["median"],
        p95_ms=1e3 * seconds["p95"],
    )


def bars(
    table: str,
    size: float,
    repeat: int,
    n_intervals: int = 10_000,
    obstacles: tuple[int, int] = (3, 0),
    clearance: float = NEAR,
    n_links: int = 8,
) -> Row:
    """Time a motion beside bars, all at the same clearance, and scattered balls."""
    n_bars, n_balls = obstacles
    arm, motion = arm_of(n_links), sway(n_intervals, n_links)
    near = [beside(motion, clearance, 90.0 + 120.0 * k, arm) for k in range(n_bars)]
    balls = scattered(motion, n_balls) if n_balls else []
    problem = problem_of(arm, [*near, *balls], clearance)
    return measure(table, size, problem, motion, repeat)


def in_tube(size: int, repeat: int) -> Row:
    """Time a motion inside a mesh."""
    motion = sway(100)
    problem = problem_of(ARM, [tube(motion, NEAR, size)], NEAR)
    return measure("triangles", size, problem, motion, repeat)


def headline(repeat: int = 20) -> Row:
    """10,000 intervals, 24 pairs of links and obstacles, 3.5 mm, and 21 of links."""
    return bars("headline", 24, repeat)


REACHES = ((0.0, 0.09), (0.425, 0.0), (0.392, 0.0), (0.0, 0.109), (0.095, 0.0))
"""Of links 2 to 6 of a tree such as a UR5: along x and z from joint to joint; [m]."""

BOXES = 12


def tree_of_hulls(n_intervals: int = 10_000) -> tuple[Any, ...]:
    """What `prove` takes: 6 joints with hulls of 50 corners, which sway among boxes."""
    rng = np.random.default_rng(0)
    y, z = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    places = [shifted(0.0, 0.0, 0.1), *(shifted(x, 0.0, up) for x, up in REACHES)]
    axes = (z, y, y, y, z, y)
    joints = [
        Joint(k, Kind.REVOLUTE, axis, place, column=k)
        for k, (axis, place) in enumerate(zip(axes, places, strict=True))
    ]
    bodies = []
    for k, (x, up) in enumerate((*REACHES, (0.08, 0.0))):
        corners = rng.normal(size=(50, 3))
        corners *= 0.06 / np.linalg.norm(corners, axis=1)[:, None]
        ends = rng.integers(0, 2, 50)[:, None] * np.array([x, 0.0, up])
        bodies.append(Body(k + 1, (Hull(corners + ends),)))
    turn = 2.0 * np.pi * np.arange(BOXES) / BOXES
    for a in turn:  # a ring that the arm sways within
        centre = np.array([1.1 * np.cos(a), 1.1 * np.sin(a), 0.1])
        bodies += [Body(0, Box("box", centre, np.eye(3), np.full(3, 0.1)).pieces)]
    t = np.linspace(0.0, 2.0 * np.pi, n_intervals + 1)[:, None]
    rows = 0.5 * np.sin(t + rng.uniform(0.0, 6.0, 6)) + np.array([0, -1, 1, 0, 0, 0])
    pairs = [Pair(k, 6 + b) for k in range(6) for b in range(BOXES)]
    pairs += [Pair(i, j) for i in range(6) for j in range(i + 3, 6)]
    return Tree(tuple(joints)), bodies, JointPath(rows), pairs


def robot(repeat: int = 20) -> Row:
    """A robot's tree: 10,000 intervals, 72 pairs with boxes and 6 of its own."""
    (tree, bodies, path, pairs), proofs = tree_of_hulls(), list[Proof]()

    def judge() -> None:
        question = Question.of(tree, bodies, PairTable.of(pairs))
        proofs[:] = [question.about(path).prove()]

    seconds, (proof,) = timed(judge, repeat), proofs
    return Row(
        table="robot",
        size=6,
        intervals=path.n_intervals,
        pairs=len(pairs),
        triangles=0,
        clearance_mm=float(proof.upper.min()) / MM,
        not_certified=int(proof.counts[:, 1:].sum()),
        cpu_ms=1e3 * seconds["median"],
        p95_ms=1e3 * seconds["p95"],
    )


def certify_growth(repeat: int = 5, quick: bool = False) -> list[Row]:
    """The tables: what grows, and the time.

    Args:
        repeat: Runs of each case after one to warm up.
        quick: Whether to leave out the largest sizes.
    """
    rows = [bars("clearance", c, repeat, clearance=c * MM) for c in (0.1, 1, 10, 100)]
    sizes = (100, 1_000, 10_000, 100_000, 1_000_000)[: 4 if quick else 5]
    rows += [bars("intervals", n, repeat, n_intervals=n) for n in sizes]
    for n in (1, 10, 100, 1_000):
        rows.append(bars("obstacles", n, repeat, obstacles=(1, n - 1)))
    rows += [bars("links", n, repeat, n_links=n) for n in (2, 4, 8, 16, 40)]
    sizes = (100, 1_000, 10_000, 100_000, 1_000_000)[: 4 if quick else 5]
    rows += [in_tube(n, repeat if n < 1_000_000 else 1) for n in sizes]
    return with_exponents(rows)


def with_exponents(rows: list[Row]) -> list[Row]:
    """The same rows with the slopes of their tables in a log-log plot."""
    result = rows[:1]
    for before, row in itertools.pairwise(rows):
        slope = nan
        if before.table == row.table:
            slope = log(row.cpu_ms / before.cpu_ms) / log(row.size / before.size)
        result.append(replace(row, exponent=slope))
    return result


def sampled_by_coal() -> float:
    """Processor time of Coal for one row of the headline: 24 distances; [us]."""
    motion = sway(10_000)
    obstacles = [beside(motion, NEAR, 90.0 + 120.0 * k) for k in range(3)]
    shapes = [
        (coal.Cylinder(o.radius, 2.0 * o.half_length), _along(o.centre, o.axis))
        for o in obstacles
    ]
    links = [coal.Capsule(ARM.link_radius, x) for x in ARM.link_lengths.tolist()]
    some = np.linspace(0, 10_000, ROWS_OF_PEER).astype(int)
    rows = motion.x0[some], motion.alpha[some], motion.theta[some]
    centres = joint_centres(ARM, *rows)
    request, result = coal.DistanceRequest(), coal.DistanceResult()

    def check() -> None:
        for row in centres:
            for link, start, end in zip(links, row[:-1], row[1:], strict=True):
                axis = (end - start) / np.linalg.norm(end - start)
                place = _along(0.5 * (start + end), axis)
                for shape, there in shapes:
                    result.clear()
                    coal.distance(link, place, shape, there, request, result)

    return 1e6 * timed(check, 5)["median"] / ROWS_OF_PEER


def _along(centre: FloatArray, axis: FloatArray) -> coal.Transform3s:
    """A pose with z along an axis."""
    other = np.eye(3)[np.argmin(np.abs(axis))]
    x = np.cross(other, axis)
    x /= np.linalg.norm(x)
    return coal.Transform3s(np.column_stack([x, np.cross(axis, x), axis]), centre)


def as_markdown(rows: list[Row]) -> str:
    """The rows as one table."""
    lines = [
        "| what grows | size | intervals | pairs | triangles | least clearance [mm] "
        "| processor time [ms] | exponent |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        slope = "" if np.isnan(row.exponent) else f"{row.exponent:.2f}"
        lines.append(
            f"| {row.table} | {row.size:g} | {row.intervals:,} | {row.pairs:,} "
            f"| {row.triangles:,} | {row.clearance_mm:.3f} | {row.cpu_ms:.3g} "
            f"| {slope} |"
        )
    return "\n".join(lines)


def main() -> int:
    """Measure, print, save."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--save", type=Path)
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--quick", action="store_true", help="without the largest")
    options = parser.parse_args()
    rows = [headline(max(20, options.repeat)), robot(max(20, options.repeat))]
    rows += certify_growth(options.repeat, options.quick)
    peer = sampled_by_coal()
    print(as_markdown(rows))
    print(f"\nThe samples alone with Coal: {peer:.1f} us a row, ", end="")
    print(f"{peer * 10:.0f} ms for 10,000.")
    unproved = sum(row.not_certified for row in rows)
    if unproved:
        print(f"{unproved} intervals were not certified", file=sys.stderr)
    if options.save:
        record = {
            "surroundings": surroundings(),
            "coal_us_a_row": peer,
            "rows": [asdict(row) for row in rows],
        }
        options.save.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    return 1 if unproved else 0


if __name__ == "__main__":
    sys.exit(main())
