"""Asks the planner's proofs about tips that are reached, by postures at the limits.

    python -m benchmarks.hrm2000.sleeves --postures 1000

A posture is drawn by chance with joints at 99.9 % of the cone, close to an end of the
rail, and tight sleeves are put round its links. Pushed a little along the rail its tip
draws a line. Then every proof that there is no plan is asked about the line's ends.
Each that says so is false.
"""

import argparse
import itertools
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

import numpy as np

from benchmarks.hrm2000.arms import NINE, USUAL
from benchmarks.hrm2000.sweeps import Rng, required_clearance, scale
from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.geometry.solids import Box
from vdsm_pin.planner.impossible.bounds import prove_tips
from vdsm_pin.planner.impossible.cut_off import cut_off
from vdsm_pin.planner.impossible.last_link import hemmed_in
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.verification.link_clearance import link_clearance

SHARE: Final = 0.999
"""Part of the limits that postures use; [-]."""

PUSHED: Final = 9
"""Rows of a push along the rail."""

BOARDS: Final = 6
"""Boards of a sleeve."""

ARMS: Final = tuple({arm.name: arm for arm in (*USUAL, *NINE)}.values())


@dataclass(frozen=True)
class Sleeved:
    """A problem that is solved by pushing the arm along its rail as it stands.

    Args:
        problem: What is asked.
        rows: Joint values on the way, shape (PUSHED, 1 + 2N); [m], [rad].
        room: Least clearance at the rows, proved, less what is required; [m].
    """

    problem: PlanningProblem
    rows: FloatArray
    room: float


Proof: TypeAlias = Callable[[PlanningProblem], BoolArray]
"""Which corners of the path are said to be out of the question."""


def beyond_or_buried(problem: PlanningProblem) -> BoolArray:
    """By the tip alone."""
    return prove_tips(problem, link_clearance(problem), problem.path.points).undrawable


def last_link_blocked(problem: PlanningProblem) -> BoolArray:
    """By the last link."""
    return hemmed_in(problem, link_clearance(problem), problem.path.points)


def no_way(problem: PlanningProblem) -> BoolArray:
    """By the ways of the tip, from the start."""
    return cut_off(problem, problem.path.points)


PROOFS: Final[Mapping[str, Proof]] = {
    "tip beyond reach or buried": beyond_or_buried,
    "last link has no room": last_link_blocked,
    "tip is cut off": no_way,
}
"""Every proof that there is no plan."""


def posture(rng: Rng, arm: Manipulator) -> FloatArray:
    """Joint values at the limits, shape (1 + 2N,): some joints bent, or all, any way.

    Args:
        rng: Randomness.
        arm: Whose cone.
    """
    bend = np.full(arm.n_links, SHARE * arm.max_link_angle)
    kind = int(rng.integers(3))
    if kind == 0:  # curled until it stands square to the rail
        bend[np.cumsum(bend) > np.pi / 2.0] = 0.0
    elif kind == 1:  # here and there
        bend *= rng.random(arm.n_links) < rng.uniform(0.2, 0.9)
    around = np.full(arm.n_links, rng.uniform(0.0, 2.0 * np.pi))
    if rng.random() < 0.6:
        around += np.cumsum(rng.normal(0.0, rng.uniform(0.1, 1.5), arm.n_links))
    # The link's axis in its parent's frame is (cos psi, sin psi cos g, sin psi sin g).
    theta = -np.arcsin(np.sin(bend) * np.sin(around))
    alpha = np.arctan2(np.sin(bend) * np.cos(around), np.cos(bend))
    x0 = rng.uniform(-0.5, 0.5) * arm.total_length
    return np.concatenate([[x0], np.stack([alpha, theta], axis=1).ravel()])


def sleeved(rng: Rng, arm: Manipulator) -> Sleeved | None:
    """A posture pushed along the rail, in sleeves.

    Args:
        rng: Randomness.
        arm: Its rail is cut to end just beyond the base.

    Returns:
        None where links meet or nothing is left of the sleeves.
    """
    joints = posture(rng, arm)
    push = 10.0 ** rng.uniform(-4.0, -1.0) * arm.total_length
    rows = np.repeat(joints[None], PUSHED, axis=0)
    rows[:, 0] += np.linspace(0.0, push, PUSHED)
    centres = joint_centres(arm, rows[:, 0], rows[:, 1::2], rows[:, 2::2])
    if _meets_itself(arm, centres[0]):
        return None
    spare = (1.0 - SHARE) * arm.total_length
    rail = (float(rows[0, 0] - spare), float(rows[-1, 0] + spare))
    tips = centres[[0, -1], -1]
    bare = PlanningProblem(
        replace(arm, base_range=rail),
        Scene(()),
        DesiredPath(tips[0], tips, start_joints=joints),
        required_clearance(arm),
        name="sleeved",
    )
    links = [arm.n_links - 1, *rng.integers(arm.n_links, size=2).tolist()]
    boards = [b for k in dict.fromkeys(links) for b in _sleeve(rng, arm, centres[0], k)]
    kept = tuple(board for board in boards if _room(bare, (board,), centres) >= 0.0)
    if not kept:
        return None
    problem = replace(bare, scene=Scene(kept))
    return Sleeved(problem, rows, _room(bare, kept, centres))


def _room(
    problem: PlanningProblem, boards: tuple[Box, ...], centres: FloatArray
) -> float:
    """Clearance of the arm from boards less what is required; [m]."""
    among = replace(problem, scene=Scene(boards))
    return float(link_clearance(among)(centres).min()) - problem.required_clearance


def _sleeve(rng: Rng, arm: Manipulator, centres: FloatArray, link: int) -> list[Box]:
    """Boards round a link, 0.01 to 1 mm farther from it than they must be."""
    begin, end = centres[link], centres[link + 1]
    length = float(arm.link_lengths[link])
    x = (end - begin) / length
    up = np.cross(x, np.eye(3)[np.argmin(np.abs(x))])
    up /= np.linalg.norm(up)
    gap = 1e-5 * 10.0 ** rng.uniform(0.0, 2.0) * scale(arm)
    room = arm.link_radius + required_clearance(arm) + gap
    thick, wide = 0.2 * arm.link_radius, room * np.tan(np.pi / BOARDS)
    from_, to = rng.uniform(0.0, 0.5) * length, length
    if link == arm.n_links - 1:
        to += rng.uniform(0.0, 2.0) * arm.link_radius
    turn = rng.uniform(0.0, 2.0 * np.pi)
    boards = []
    for k in range(BOARDS):
        angle = turn + 2.0 * np.pi * k / BOARDS
        out = np.cos(angle) * up + np.sin(angle) * np.cross(x, up)
        middle = begin + (from_ + to) / 2.0 * x + (room + thick / 2.0) * out
        axes = np.column_stack([x, np.cross(out, x), out])
        half = np.array([(to - from_) / 2.0, wide, thick / 2.0])
        boards.append(Box(f"l{link}b{k}", middle, axes, half))
    return boards


def _meets_itself(arm: Manipulator, centres: FloatArray) -> bool:
    """Whether links that are not neighbours come close, seen at points of them."""
    share = np.linspace(0.0, 1.0, 25)[:, None]
    points = [a + share * (b - a) for a, b in itertools.pairwise(centres)]
    step = float(arm.link_lengths.max()) / 24.0
    for i in range(arm.n_links):
        for j in range(i + 2, arm.n_links):
            gaps = np.linalg.norm(points[i][:, None] - points[j][None], axis=2)
            if not gaps.min() > 2.0 * arm.link_radius + step:
                return True
    return False


@dataclass(frozen=True)
class Tally:
    """What proofs said.

    Args:
        asked: Postures.
        false: False proofs by name.
    """

    asked: int
    false: Counter[str]


def fuzz(
    rng: Rng,
    count: int,
    seen: Callable[[PlanningProblem], PlanningProblem] = lambda problem: problem,
) -> Tally:
    """Ask every proof about so many clear postures.

    Args:
        rng: Randomness.
        count: Postures.
        seen: What the proofs are shown instead of a problem, to show that a wrong one
            is caught.
    """
    asked, false = 0, Counter[str]()
    while asked < count:
        made = sleeved(rng, ARMS[int(rng.integers(len(ARMS)))])
        if made is None:
            continue
        asked += 1
        for name, proof in PROOFS.items():
            false[name] += int(proof(seen(made.problem)).any())
    return Tally(asked, false)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--postures", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    tally = fuzz(np.random.default_rng(options.seed), options.postures)
    for name in PROOFS:
        print(f"{name}: {tally.false[name]} false of {tally.asked}")
    if sum(tally.false.values()):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
