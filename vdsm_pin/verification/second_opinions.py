"""Rows of evidence by Pinocchio and Coal, and what to do where a check fails to run."""

from collections.abc import Callable
from math import nan

from vdsm_pin.errors import VdsmError
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.progress import step
from vdsm_pin.time_limit import Deadline
from vdsm_pin.verification import coal_carried, coal_check, fk
from vdsm_pin.verification.coal_log import CoalLog
from vdsm_pin.verification.proved_lowers import ProvedLowers
from vdsm_pin.verification.records import Check, Verdict
from vdsm_pin.verification.robot_model import RobotModel


def by_pinocchio(
    robot: RobotModel,
    problem: PlanningProblem,
    trajectory: Trajectory,
    centres: FloatArray | None,
    deadline: Deadline,
) -> tuple[Check, ...]:
    """Joint centres against the closed form, and against those planned."""
    rows = guarded(fk.NAME, lambda: fk.check_fk(robot, problem, trajectory, deadline))
    if centres is None:
        return rows
    planned = guarded(
        fk.PLANNED, lambda: fk.check_planned(robot, trajectory, centres, deadline)
    )
    return (*rows, *planned)


def by_coal(
    robot: RobotModel,
    problem: PlanningProblem,
    trajectory: Trajectory,
    proved: ProvedLowers,
    deadline: Deadline,
    log: CoalLog,
) -> tuple[Check, ...]:
    """The second opinions on distances."""
    motion = problem, trajectory
    checks = {
        coal_check.OBSTACLES: lambda: coal_check.check_coal_obstacles(
            robot, *motion, proved, deadline, log
        ),
        coal_check.LINKS: lambda: coal_check.check_coal_links(
            robot, *motion, deadline, log
        ),
        coal_carried.CARRIED: lambda: coal_carried.check_coal_carried(
            robot, *motion, proved, log, deadline
        ),
    }
    return tuple(row for name, run in checks.items() for row in guarded(name, run))


def guarded(
    name: str, run: Callable[[], Check | tuple[Check, ...]]
) -> tuple[Check, ...]:
    """A check's rows; one undecided row where it could not be carried out."""
    step("%s", name)
    try:
        rows = run()
    except (VdsmError, ArithmeticError) as error:
        return (Check(name, Verdict.UNDECIDED, 0, nan, nan, "-", f"not done: {error}"),)
    return rows if isinstance(rows, tuple) else (rows,)
