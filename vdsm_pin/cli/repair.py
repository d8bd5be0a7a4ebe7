"""`vdsm repair`."""

from typing import Annotated

import typer

from vdsm_pin.cli.options import (
    Answer,
    OutFolder,
    TimeLimit,
    Trajectory,
    examples,
    family,
    grouped,
)
from vdsm_pin.cli.robot import ProblemOrNone, RobotOptions, Topic
from vdsm_pin.cli.verify import asked_problem
from vdsm_pin.time_limit import Deadline, enforced

commands = family()


@commands.command(
    epilog=examples(
        "vdsm repair paper/obs1 --trajectory mine.csv --out out/mine",
        "vdsm repair cell.yaml --trajectory plan.csv --out out/cell",
        "vdsm repair --urdf ur5.urdf --srdf ur5.srdf --scene scene.yaml "
        "--trajectory plan.csv --out out/ur5",
    )
)
@grouped
def repair(
    context: typer.Context,
    trajectory: Trajectory,
    out: OutFolder,
    *,
    problem: ProblemOrNone = None,
    robot: RobotOptions,
    topic: Topic = None,
    pin: Annotated[
        list[int] | None,
        typer.Option(metavar="ROW", help="A waypoint, from 0, that stays."),
    ] = None,
    time_limit: TimeLimit = None,
    answer: Answer,
) -> None:
    """Mend a trajectory until it is certified.

    Moves its waypoints; of a snake arm the tip stays on its path. Writes
    trajectory.csv, repair.json (how far each waypoint moved) and what verify writes;
    where no such trajectory is found, nothing, and says why.
    """
    from vdsm_pin.app.motions import MotionOptions
    from vdsm_pin.app.repair import repair_to_folder
    from vdsm_pin.app.workflow import VerifyOrder
    from vdsm_pin.problem.error_boxes import ErrorBox

    deadline = Deadline.after(time_limit)
    with enforced(deadline, grace=0.0):
        asked = asked_problem(problem, ErrorBox(), robot, {}, topic)
    with enforced(deadline):
        options = MotionOptions(deadline, topic=topic)
        order = VerifyOrder(asked, trajectory, out, context.obj, options=options)
        found = repair_to_folder(order, tuple(pin or ()))
    new, most = int((found.given < 0).sum()), found.moved.max()
    changed = f"{new} of them new; moved by {most:.6f} rad (m) at most"
    how = changed if new or most else "none of them moved: it was clear as given"
    answer.tell(
        f"certified with {len(found.moved)} waypoints, {how}; wrote {out}",
        verdict="certified",
        waypoints=len(found.moved),
        new=new,
        moved_at_most=float(most),
        folder=out,
    )
