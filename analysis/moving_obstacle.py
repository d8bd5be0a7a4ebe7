"""Plans of the paper's scenes beside an obstacle that moves: what they bear.

    python analysis/moving_obstacle.py --out reports/paper

* The obstacle comes in from the side while the arm waits: planned and proved whole?
* The obstacle sways to and fro along y while the arm draws: the plan for the
  resting one is judged at every instant; the largest sway that keeps the required
  clearance, and the largest that touches nothing, by bisection.
"""

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml
from result_files import at_least, output_folder, table_lines, write_table

from vdsm_pin.io.problem_file import built_in_text, read_problem
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.refinement import plan_and_verify
from vdsm_pin.units import MM_PER_M
from vdsm_pin.verification.records import Verdict
from vdsm_pin.verification.verify import verify

SCENES: Final = ("obs1", "obs2-small", "obs3")
STRATEGIES: Final = ("paper", "fewest")
ROW_S: Final = 0.05
"""From row to row of a plan; [s]."""
SWING_S: Final = 2.0
"""From one side to the other; [s]."""
LARGEST: Final = 0.1
"""Sway beyond which none is tried; [m]."""
ROUNDS: Final = 9
FROM_MM: Final = 500.0
"""From how far the obstacle comes in, along y; [mm]."""


@dataclass(frozen=True)
class Line:
    """What one strategy's plan of one scene bears."""

    scene: str
    strategy: str
    arrival: str
    sway_kept_mm: float
    sway_clear_mm: float


def with_motion(scene: str, motion: dict[str, Any], **changes: Any) -> PlanningProblem:
    """A built-in problem whose obstacle moves."""
    data = yaml.safe_load(built_in_text(f"paper/{scene}"))
    data["obstacles"][0]["motion"] = motion
    data.update(changes)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"{scene}.yaml"
        file.write_text(yaml.safe_dump(data), encoding="utf-8")
        return read_problem(file)


def arrival(scene: str, strategy: str) -> str:
    """The verdict of the plan for an obstacle that comes in and rests."""
    motion = {"times_s": [0, 3], "positions": [[0, FROM_MM, 0], [0, 0, 0]]}
    problem = with_motion(scene, motion)
    found = plan_and_verify(problem, strategy)
    return str(found.verification.verdict)


def bears(scene: str, motion: Trajectory, sway_mm: float, **changes: Any) -> bool:
    """Whether a motion is certified beside an obstacle that sways so far each way."""
    assert motion.times is not None
    times = np.arange(0.0, motion.times[-1] + SWING_S, SWING_S)
    sides = [[0, sway_mm * (-1) ** k, 0] for k in range(len(times))]
    moves = {"times_s": times.tolist(), "positions": sides}
    problem = with_motion(scene, moves, **changes)
    verdict = verify(problem, motion).verdict
    return verdict is Verdict.CERTIFIED


def most_sway(scene: str, motion: Trajectory, **changes: Any) -> float:
    """Largest sway that is certified, from below; [mm]."""
    low, high = 0.0, LARGEST * MM_PER_M
    for _ in range(ROUNDS):
        middle = (low + high) / 2.0
        good = bears(scene, motion, middle, **changes)
        low, high = (middle, high) if good else (low, middle)
    return low


def line(scene: str, strategy: str) -> Line:
    """One plan, made for the resting obstacle."""
    problem = read_problem(f"paper/{scene}")
    plan = plan_and_verify(problem, strategy).plan.trajectory
    timed = replace(plan, times=ROW_S * np.arange(plan.n_samples))
    return Line(
        scene,
        strategy,
        arrival(scene, strategy),
        most_sway(scene, timed),
        most_sway(scene, timed, required_clearance=0),
    )


def markdown(lines: list[Line]) -> str:
    """The table for reading."""
    head = [
        "# Obstacles that move",
        "",
        "Made by `python analysis/moving_obstacle.py`. The obstacle comes in from",
        f"{FROM_MM:.0f} mm aside while the arm waits; or it sways along y, from",
        f"side to side in {SWING_S:g} s, beside the plan for the resting one (a row in",
        f"{ROW_S:g} s), and every instant is judged.",
        "",
    ]
    names = ("scene", "strategy", "plan for the arriving obstacle",
             "sway borne, required clearance kept [mm]",
             "sway borne without contact [mm]")  # fmt: skip
    rows = [
        (one.scene, one.strategy, one.arrival,
         f"±{at_least(one.sway_kept_mm, 1)}", f"±{at_least(one.sway_clear_mm, 1)}")
        for one in lines
    ]  # fmt: skip
    return "\n".join([*head, *table_lines(names, rows), ""])


def main() -> None:
    """Measure, print, save."""
    folder = output_folder(__doc__)
    lines = [line(scene, strategy) for scene in SCENES for strategy in STRATEGIES]
    write_table(folder, "moving_obstacle", lines, markdown(lines))


if __name__ == "__main__":
    main()
