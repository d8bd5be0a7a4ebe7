"""What Step 5 leaves open: the paper's words taken literally, and one line at a time.

    python analysis/step5_choices.py --out reports/paper

Writes `step5_choices.json` and `step5_choices.md`.
"""

from dataclasses import dataclass
from typing import Final
from unittest.mock import patch

import numpy as np
import shapely
from paper_figures.runs import Runs
from result_files import at_least, output_folder, table_lines, write_table

from vdsm_pin.app.explanation.cross import DIRECTIONS, leave
from vdsm_pin.arm.kinematics import link_angles
from vdsm_pin.errors import Infeasible
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.paper import joint_paths
from vdsm_pin.planner.paper.along_rail import AlongRail
from vdsm_pin.planner.paper.danger_region import DangerRegion
from vdsm_pin.refinement import plan_and_verify
from vdsm_pin.units import MM_PER_M, percent

SCENES: Final = ("obs1", "obs2", "obs2-small")
GROWTHS: Final = (0.0, 0.02, 0.04, 0.08)
"""By how much more than the least the danger region is grown for the literal rule;
[m]."""
LINES: Final = ("vertical", "horizontal", "oblique, 90°", "oblique, 75°",
                "oblique, 105°", "oblique, 60°", "oblique, 120°", "circle")  # fmt: skip
"""Auxiliary lines in the order of `joint_paths`; oblique ones by their angle to the ray
from P1 through the obstacle."""


@dataclass(frozen=True)
class Literal:
    """The printed rule on the tip's route of a plan.

    Args:
        scene: The scene.
        growth_mm: Of the danger region; [mm].
        waypoints: How many there are.
        short: At how many of them a link is too short.
        jump_mm: Largest way of a joint's projection between two of them; [mm].
        depth_mm: How far the axis of a link comes into the least danger region; [mm].
    """

    scene: str
    growth_mm: float
    waypoints: int
    short: int
    jump_mm: float
    depth_mm: float


@dataclass(frozen=True)
class OneLine:
    """A plan whose joints slide along one line only."""

    scene: str
    line: str
    drawn: float | None
    psi_deg: float | None


def literal_rule(
    ratios: FloatArray, tips: FloatArray, region: DangerRegion
) -> FloatArray:
    """Step 5 as printed: of four points the one nearest to the former P_i.

    Args:
        ratios: k_{i,i+1} for i = 1..N, shape (N,); [-].
        tips: Projected tips, shape (n, 2); [m].
        region: The danger region.

    Returns:
        P_1..P_{N+1}, shape (n, N + 1, 2); [m].
    """
    n_links = len(ratios)
    planar = np.zeros((len(tips), n_links + 1, 2))
    stations = np.cumprod(np.append(ratios[1:], 1.0)[::-1])[::-1]
    former = np.vstack([np.zeros((1, 2)), stations[:, None] * tips[0]])
    for row, tip in enumerate(tips):
        chain = planar[row]
        chain[-1] = tip
        for i in range(n_links - 1, 0, -1):
            chain[i] = ratios[i] * chain[i + 1]
            if region.contains(chain[i][None])[0]:
                points = [leave(region, chain[i], way) for way in DIRECTIONS]
                gaps = np.linalg.norm(np.array(points) - former[i], axis=1)
                chain[i] = points[int(np.argmin(gaps))]
        former = chain
    return planar


def literal(runs: Runs, scene: str) -> list[Literal]:
    """The printed rule with several sizes of the region."""
    run = runs(scene, "paper")
    made, arm = run.plan.steps, run.problem.manipulator
    assert made is not None
    assert isinstance(made.avoidance, AlongRail)
    least = made.avoidance.forbidden
    core = shapely.MultiPoint(least.corners).convex_hull
    ratios = arm.stations[:-1] / arm.stations[1:]
    tips = np.ascontiguousarray(made.route.tip_path.points[:, 1:])
    found = []
    for growth in GROWTHS:
        planar = literal_rule(ratios, tips, least.grown(growth))
        gaps = np.linalg.norm(np.diff(planar, axis=1), axis=2)
        ways = np.linalg.norm(np.diff(planar, axis=0), axis=2)
        distance = shapely.distance(shapely.linestrings(planar), core).min()
        found.append(
            Literal(
                scene,
                growth * MM_PER_M,
                len(tips),
                int((gaps > arm.link_lengths).any(axis=1).sum()),
                float(ways.max()) * MM_PER_M,
                max(0.0, float(least.radius - distance)) * MM_PER_M,
            )
        )
    return found


def one_line(runs: Runs, scene: str, number: int) -> OneLine:
    """The plan whose joints may slide along one line only."""
    problem, lines = runs.problem(scene), joint_paths._lines

    def only(region: DangerRegion, side: int) -> list[FloatArray | None]:
        return [lines(region, side)[number]] * joint_paths.CROSS

    with patch.object(joint_paths, "_lines", only):
        try:
            found = plan_and_verify(problem, "paper")
        except Infeasible:
            return OneLine(scene, LINES[number], None, None)
    rows = found.plan.trajectory
    psi = float(np.rad2deg(link_angles(rows.alpha, rows.theta).max()))
    return OneLine(scene, LINES[number], found.verification.coverage, psi)


def markdown(literals: list[Literal], singles: list[OneLine]) -> str:
    """Both tables for reading."""
    head = ("scene", "region [mm]", "waypoints", "with a link too short",
            "largest jump of a joint [mm]", "link inside by [mm]")  # fmt: skip
    rows = [
        (one.scene, f"+{one.growth_mm:.0f}", one.waypoints, one.short,
         at_least(one.jump_mm), at_least(one.depth_mm))
        for one in literals
    ]  # fmt: skip
    drawn = {
        (one.line, one.scene): "–"
        if one.psi_deg is None or one.drawn is None
        else f"{percent(one.drawn)}, {one.psi_deg:.1f}°"
        for one in singles
    }
    lines = [
        "# What Step 5 leaves open",
        "",
        "Made by `python analysis/step5_choices.py`.",
        "",
        "## The paper's words",
        "",
        '"The point nearest to the position of the former point", of the four points',
        "where the cross through P′ meets the boundary, on the route of the tip that",
        "the strategy `paper` plans. Region: how much wider than the least one.",
        "",
        *table_lines(head, rows),
        "",
        "## One line for all joints",
        "",
        "The share of the path that is drawn, and the largest ψ, where the joints may",
        "slide along one kind of auxiliary line only. A dash: no plan within the",
        "limits. The paper names an oblique line and a circle about P₁ as well and",
        'says that "the latter two make the link angle larger".',
        "",
        *table_lines(
            ("line", *SCENES),
            [(name, *(drawn[name, scene] for scene in SCENES)) for name in LINES],
        ),
        "",
    ]
    return "\n".join(lines)


def main() -> None:
    """Measure both and write the files."""
    folder, runs = output_folder(__doc__), Runs()
    literals = [one for scene in SCENES for one in literal(runs, scene)]
    singles = [
        one_line(runs, scene, number)
        for number in range(len(LINES))
        for scene in SCENES
    ]
    text = markdown(literals, singles)
    write_table(folder, "step5_choices", [*literals, *singles], text)


if __name__ == "__main__":
    main()
