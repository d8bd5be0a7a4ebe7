"""For which turns of the prism of obs2 does the paper's rule find a plan?

    python analysis/obs2_orientations.py --out reports/paper

The paper gives a triangular prism with a tangent circle of radius 200 about (400, 400)
and not how it is turned. The triangle is taken as equilateral, turned from 0 to 105 deg
(it repeats after 120), in both readings of the circle. "Waypoints kept" are checked by
the clearance function; the proof between them is the verifier's.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from result_files import output_folder, table_lines, write_table

from vdsm_pin.arm.kinematics import link_angles
from vdsm_pin.errors import Infeasible
from vdsm_pin.geometry.solids import Prism
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.paper.pipeline import plan_paper
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.units import MM_PER_M
from vdsm_pin.verification.link_clearance import link_clearance

TURNS_DEG: Final = tuple(range(0, 120, 15))
READINGS: Final = {"inscribed": 0.400, "circumscribed": 0.200}
"""Distance of the corners from the axis; [m]."""
AXIS: Final = (0.400, 0.400)


@dataclass(frozen=True)
class Row:
    """One turn in one reading.

    Args:
        circle: The reading.
        turn_deg: Bearing of the first corner from y to z.
        outcome: "plan", or why there is none.
        psi_deg: Largest link angle.
        x0_max_mm: Largest base position.
        drawn_percent: Part of the desired path between drawn waypoints.
    """

    circle: str
    turn_deg: float
    outcome: str
    psi_deg: float | None = None
    x0_max_mm: float | None = None
    drawn_percent: float | None = None


def turned(problem: PlanningProblem, corners_at: float, turn: float) -> PlanningProblem:
    """obs2 with an equilateral prism turned; [m], [rad]."""
    prism = problem.scene.obstacles[0]
    assert isinstance(prism, Prism)
    bearings = turn + 2.0 * np.pi * np.arange(3) / 3.0
    offsets = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    polygon = np.array(AXIS) + corners_at * offsets
    return replace(problem, scene=Scene((replace(prism, polygon=polygon),)))


def row_of(circle: str, turn_deg: float) -> Row:
    """Plan one turn."""
    problem = read_problem("paper/obs2")
    problem = turned(problem, READINGS[circle], float(np.deg2rad(turn_deg)))
    try:
        plan = plan_paper(problem, link_clearance(problem), 0.0)
    except Infeasible as reason:
        return Row(circle, turn_deg, str(reason))
    trajectory = plan.trajectory
    psi = np.rad2deg(link_angles(trajectory.alpha, trajectory.theta).max())
    both = trajectory.on_path[1:] & trajectory.on_path[:-1]
    advance = np.mod(np.diff(trajectory.path_m)[both], problem.path.length)
    drawn = 100.0 * float(advance.sum()) / problem.path.length
    x0_max = float(trajectory.x0.max()) * MM_PER_M
    return Row(circle, turn_deg, "plan", float(psi), x0_max, drawn)


def markdown(rows: list[Row]) -> str:
    """The table for reading."""
    head = (
        "circle",
        "turn [deg]",
        "outcome",
        "max psi [deg]",
        "x0 max [mm]",
        "drawn [%]",
    )
    made = "Made by `python analysis/obs2_orientations.py --out reports/paper`."
    lines = []
    for row in rows:
        numbers = ["-", "-", "-"]
        if row.psi_deg is not None:
            numbers = [f"{row.psi_deg:.2f}", f"{row.x0_max_mm:.1f}"]
            numbers.append(f"{row.drawn_percent:.2f}")
        lines.append([row.circle, f"{row.turn_deg:g}", row.outcome, *numbers])
    text = ["# obs2: turns of the prism", "", made, "", *table_lines(head, lines), ""]
    return "\n".join(text)


def main() -> None:
    """Write both files and print the table."""
    folder = output_folder(__doc__)
    rows = [row_of(circle, turn) for circle in READINGS for turn in TURNS_DEG]
    write_table(folder, "obs2_orientations", rows, markdown(rows))


if __name__ == "__main__":
    main()
