"""explain.html: a plan of the paper's rule followed step by step at one waypoint."""

from pathlib import Path
from typing import Final

import numpy as np

from vdsm_pin.app.explanation import steps
from vdsm_pin.app.explanation.parts import Moment, Step, mm, table
from vdsm_pin.arm.kinematics import link_angles
from vdsm_pin.errors import InvalidInput
from vdsm_pin.planner.paper.steps import PaperSteps
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.refinement import Refinement, plan_and_verify
from vdsm_pin.report.folder import check_outputs, staged
from vdsm_pin.report.html import rendered
from vdsm_pin.report.words import at_least, at_most
from vdsm_pin.verification.coal_arm import CoalArm
from vdsm_pin.verification.pinocchio_arm import load_arm

PAGE: Final = "explain.html"


def explain_to_folder(
    problem: PlanningProblem, waypoint: int | None, folder: Path
) -> tuple[Path, int]:
    """Plan by the paper's seven steps and write down what each did at a waypoint.

    Args:
        problem: As it was read.
        waypoint: From 0; None for the one with the largest link angle past joint 1.
        folder: Where the page goes.

    Returns:
        The page and its waypoint.

    Raises:
        InvalidInput: If there is no such waypoint, no path of the tip, or the folder
            cannot be written.
        Infeasible: If the paper's rule has no plan.
    """
    _ = problem.path  # says where there is nothing to draw
    check_outputs(problem.files, folder=folder, names=[PAGE])
    if problem.scene.moving:
        name = problem.scene.moving[0].name
        message = f"obstacle {name!r} moves, which the paper's steps know nothing of"
        raise InvalidInput(message)
    found = plan_and_verify(problem, "paper")
    made = found.plan.steps
    assert made is not None  # the strategy `paper` tells them
    row = _row(made, waypoint)
    moment = Moment(found.plan, made, row)
    parts = (
        steps.reach_step(moment),
        steps.projection_step(moment),
        steps.scaling_step(moment),
        steps.route_step(moment),
        steps.joints_step(moment),
        steps.lift_step(moment),
        steps.angles_step(moment),
        _checks(found, row),
    )
    with staged(folder) as staging:
        text = rendered(  # pictures are our own SVG
            "explain.html.j2",
            problem=problem,
            waypoint=row,
            n_waypoints=made.trajectory.n_samples,
            parts=parts,
        )
        (staging / PAGE).write_text(text, encoding="utf-8")
    return folder / PAGE, row


def _row(made: PaperSteps, waypoint: int | None) -> int:
    rows = made.trajectory
    if waypoint is None:
        psi = link_angles(rows.alpha, rows.theta)[:, 1:]
        return int(np.argmax(psi.max(axis=1)))
    if not 0 <= waypoint < rows.n_samples:
        message = f"waypoint is {waypoint}, expected 0 to {rows.n_samples - 1}"
        raise InvalidInput(message)
    return waypoint


def _checks(found: Refinement, row: int) -> Step:
    """What others say of the same configuration."""
    plan, problem = found.plan, found.plan.problem
    one = plan.trajectory.part(row, row + 1)
    model = load_arm(problem.manipulator)
    centres = model.joint_centres(one.x0, one.alpha, one.theta)[0]
    error = float(np.linalg.norm(centres - plan.centres[row], axis=1).max())
    arm, rows = CoalArm(problem, links=False), []
    for seen in arm.near(one, np.inf):
        for k, (pair, low) in enumerate(zip(seen.pair, seen.lower, strict=True)):
            proved = at_least(float(low)), at_most(float(seen.upper[k]))
            rows.append((*arm.pairs.named(pair), mm(seen.distance[k]), *proved))
    head = ("link", "obstacle", "by Coal [mm]", "proved at least", "proved at most")
    return Step(
        "Checked",
        "section 6.3, Eq. 22–24",
        (
            f"Pinocchio's joint centres for these angles are within {error:.1e} m of "
            "those of Step 6.",
            f"The whole motion is {found.verification.verdict.value}: "
            f"{at_least(found.verification.min_clearance)} proved between the "
            "surfaces at every instant."
            if problem.scene.obstacles
            else f"The whole motion is {found.verification.verdict.value}.",
        ),
        (table(head, rows),) if rows else (),
    )
