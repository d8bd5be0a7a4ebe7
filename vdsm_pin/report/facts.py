"""Records to file models: one place where a verification becomes words and rows."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from vdsm_pin.arm.kinematics import link_angles
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.planner.records import Plan
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.report.files import (
    AdjustmentRow,
    BatchRow,
    CheckRow,
    ClosestRow,
    CounterexampleRow,
    ErrorBoxRow,
    Hashes,
    JointErrorRow,
    LeftOutRow,
    MinClearance,
    MotionFacts,
    ObstacleErrorRow,
    PlanFile,
    Point,
    ToleranceRow,
    VerificationFile,
)
from vdsm_pin.report.inputs import assumed_sizes, assumption, input_notes
from vdsm_pin.report.run_record import RunRecord, machine, versions
from vdsm_pin.report.words import depth, percent, place, quantity
from vdsm_pin.tolerances import TOLERANCES, UNITS
from vdsm_pin.verification.fk import PLANNED
from vdsm_pin.verification.inside import ARM, LINKS, surfaces
from vdsm_pin.verification.records import (
    ArmVerification,
    Check,
    ClosestApproach,
    Counterexample,
    Pair,
    Verdict,
    Verification,
)
from vdsm_pin.verification.task import ArmPairs

if TYPE_CHECKING:  # whoever verifies needs no planner
    from vdsm_pin.refinement import Refinement

_CHUNK: Final = 65_536  # rows treated at once, so that memory stays bounded
_PASSED: Final = Verdict.CERTIFIED


def finite(value: float) -> float | None:
    """The value, or None where it is NaN or infinite."""
    return float(value) if math.isfinite(value) else None


def changed_angles(psi: FloatArray) -> IntArray:
    """How many link angles differ from zero by more than 0.05 deg, (n_samples,).

    Args:
        psi: Link angles, shape (n_samples, N); [rad].
    """
    return np.asarray((psi > TOLERANCES.changed_angle).sum(axis=1))


def motion_facts(problem: PlanningProblem, trajectory: Trajectory) -> MotionFacts:
    """Extremes over the rows of a trajectory."""
    largest = np.zeros(trajectory.n_links)
    changed = np.zeros(trajectory.n_samples, dtype=np.int64)
    for first in range(0, trajectory.n_samples, _CHUNK):
        part = slice(first, first + _CHUNK)
        psi = link_angles(trajectory.alpha[part], trajectory.theta[part])
        largest = np.maximum(largest, psi.max(axis=0))
        changed[part] = changed_angles(psi)
    on_path = changed[trajectory.on_path & (problem.tip_path is not None)]
    mean = _mean_by_way(changed, trajectory) if on_path.size else None
    return MotionFacts(
        waypoints=trajectory.n_samples,
        on_path_waypoints=None if problem.tip_path is None else int(on_path.size),
        max_link_angle_rad=tuple(float(value) for value in largest),
        x0_min_m=float(trajectory.x0.min()),
        x0_max_m=float(trajectory.x0.max()),
        changed_angle_threshold_rad=TOLERANCES.changed_angle,
        changed_angles_mean_on_path=mean,
        changed_angles_max=int(changed.max()),
    )


def _mean_by_way(values: IntArray, trajectory: Trajectory) -> float:
    """Mean over the length of the drawn path, whatever the distance of the rows.

    Between two rows half the way counts for each; where nothing is drawn between rows
    all count alike.
    """
    on, along = trajectory.on_path, trajectory.path_m
    ways = np.abs(np.diff(along)) * (on[1:] & on[:-1])
    # A closed path goes on from its length to 0.
    ways[ways > np.ptp(along) / 2.0] = 0.0
    if not ways.any():
        return float(values[on].mean())
    return float(ways @ (values[1:] + values[:-1]) / (2.0 * ways.sum()))


def in_file_frame(verification: Verification, point: FloatArray) -> Point | None:
    """A point of the base frame in the frame of the problem file; [m]."""
    pose = verification.problem.T_world_base
    moved = pose[:3, :3] @ point + pose[:3, 3]
    if not np.isfinite(moved).all():
        return None
    return float(moved[0]), float(moved[1]), float(moved[2])


def time_at(verification: Verification, moment: float) -> float | None:
    """When a moment in waypoints is, where the trajectory tells; [s]."""
    if not math.isfinite(moment):
        return None
    times = verification.trajectory.times_at(np.array([moment]))
    return None if times is None else float(times[0])


def check_row(check: Check, time: float | None = None) -> CheckRow:
    """One check as its row, with the time of its moment where that is known; [s]."""
    return CheckRow(
        name=check.name,
        verdict=check.verdict.value,
        count=check.count,
        worst=finite(check.worst),
        limit=finite(check.limit),
        unit=check.unit,
        moment=finite(check.moment),
        time_s=time,
        first_moment=finite(check.first),
        last_moment=finite(check.last),
        too_close_intervals=check.too_close or None,
        too_close_stretches=check.stretches or None,
        where=check.where,
        deeper=check.deeper,
    )


def _both(pair: Pair) -> dict[str, Any]:
    """The bodies of a pair; null for what it has not."""
    return {name: value or None for name, value in asdict(pair).items()}


def closest_row(verification: Verification, approach: ClosestApproach) -> ClosestRow:
    """One closest approach as its row."""
    return ClosestRow(
        interval=approach.interval,
        moment=approach.moment,
        time_s=time_at(verification, approach.moment),
        **_both(approach.pair),
        lower_m=finite(approach.lower),
        upper_m=finite(approach.upper),
        station_m=finite(approach.station),
        link_point_m=in_file_frame(verification, approach.link_point),
        other_point_m=in_file_frame(verification, approach.other_point),
        deeper=approach.deeper,
        coal_m=finite(approach.coal),
    )


def counterexample_row(
    verification: Verification, found: Counterexample
) -> CounterexampleRow:
    """One counterexample as its row."""
    return CounterexampleRow(
        moment=found.moment,
        **_both(found.pair),
        clearance_m=found.clearance,
        required_m=found.required,
        link_point_m=in_file_frame(verification, found.link_point),
        other_point_m=in_file_frame(verification, found.other_point),
        deeper=found.deeper,
        **_configuration(verification, found),
    )


def _configuration(verification: Verification, found: Counterexample) -> dict[str, Any]:
    """The joints of a counterexample: numbered of an arm, by name of another robot."""
    joints, errors = found.joints.tolist(), found.offsets.tolist()
    if not isinstance(verification, ArmVerification):
        from vdsm_pin.report.robot_facts import erring_joints
        from vdsm_pin.robots.judgement import RobotVerification

        assert isinstance(verification, RobotVerification)
        return {"joints": erring_joints(verification.problem.robot, joints, errors)}
    return {
        "x0_m": joints[0],
        "x0_error_m": errors[0],
        "angles_rad": tuple(joints[1:]),
        "angle_errors_rad": tuple(errors[1:]),
    }


@dataclass(frozen=True)
class Failing:
    """A check that did not pass, and when its worst case happens, in waypoints."""

    name: str
    verdict: str
    moment: float | None


def failing(verification: Verification) -> tuple[Failing, ...]:
    """The checks that did not pass: what decides the verdict first."""
    bad = [check for check in verification.checks if check.verdict is not _PASSED]
    bad.sort(key=lambda check: check.verdict is not verification.verdict)
    return tuple(
        Failing(check.name, check.verdict.value, finite(check.moment)) for check in bad
    )


def nearest_to_obstacle(verification: Verification) -> int | None:
    """Index of the closest approach to an obstacle; None without obstacles."""
    near = (i for i, row in enumerate(verification.approaches) if row.pair.obstacle)
    return next(near, None)


def error_box(errors: ErrorBox, n_links: int | None = None) -> ErrorBoxRow:
    """The errors in words of the JSON file; of a robot without a number of links."""
    angles = np.array([[errors.joint]]) if n_links is None else errors.angles(n_links)
    alike = bool((angles == angles.flat[0]).all())
    single = (errors.of_obstacle(one.name) for one in errors.obstacles)
    return ErrorBoxRow(
        joint_error_rad=float(angles.max()),
        joints_rad=() if alike else tuple((float(a), float(t)) for a, t in angles),
        base_error_m=errors.base,
        base_error_rad=errors.base_turn,
        obstacle_error_m=errors.obstacle,
        obstacles=tuple(
            ObstacleErrorRow(name=one.name, shift_m=one.shift, turn_rad=one.turn)
            for one in single
        ),
        slide_error_m=errors.slide,
        named=tuple(
            JointErrorRow(name=one.name, turn_rad=one.turn, shift_m=one.shift)
            for one in errors.named
        ),
    )


def left_out(problem: PlanningProblem) -> tuple[LeftOutRow, ...]:
    """The bodies of an arm, and the obstacles, that are not held apart."""
    rows = ArmPairs(problem).left_out
    return tuple(LeftOutRow.model_validate(row, from_attributes=True) for row in rows)


def left_out_words(rows: Sequence[LeftOutRow]) -> str:
    """The same in one sentence, each reason of links next to each other once."""
    words, joints = [], 0
    for row in rows:
        if row.reason.startswith("meet at joint") and row.other.startswith("link"):
            joints += 1
        else:
            words.append(f"{row.body} and {row.other} ({row.reason})")
    if joints:
        meet = "links next to each other, which meet at their joint in every pose"
        words.insert(0, meet)
    return "; ".join(words)


def min_clearance(verification: Verification) -> MinClearance | None:
    """The smallest clearance from any obstacle; None where there is no obstacle."""
    index = nearest_to_obstacle(verification)
    if index is None:
        return None
    row = verification.approaches[index]
    return MinClearance(
        lower_m=finite(verification.min_clearance),
        upper_m=finite(row.upper),
        moment=row.moment,
        time_s=time_at(verification, row.moment),
        link=row.pair.link,
        body=row.pair.body or None,
        obstacle=row.pair.obstacle,
        deeper=row.deeper,
        coal_m=finite(row.coal),
    )


def reason(verification: Verification) -> str:
    """The verdict in one sentence."""
    if verification.verdict is Verdict.CERTIFIED:
        return _certified_sentence(verification)
    if isinstance(verification, ArmVerification) and (
        verification.verdict is Verdict.INCOMPLETE
    ):
        return _incomplete_sentence(verification, _left_out(verification))
    bad = [c for c in verification.checks if c.verdict is verification.verdict]
    if not bad:
        return "No check was carried out, so nothing is proved."
    first = bad[0]
    found = f"{first.name} is {depth(first.worst, first.deeper, first.unit)}"
    inside = first.name in (ARM, LINKS)
    if inside:
        found = first.where
    elif math.isnan(first.worst):
        found = f'there is no evidence for "{first.name}"'
    elif not math.isnan(first.limit):
        found += f" against a limit of {quantity(first.limit, first.unit)}"
    where = "" if inside else first.where
    at = place(finite(first.moment), where, time_at(verification, first.moment))
    if at:
        found += f" ({at})"
    share = f"{len(bad)} of {len(verification.checks)} checks"
    first_of = ", the first: " if len(bad) > 1 else ": "
    if verification.verdict is Verdict.REFUTED:
        return f"The motion breaks {share}{first_of}{found}."
    undecided = f"The proof is not complete, {share} undecided{first_of}{found}."
    return f"{undecided} This counts as not passed."


def plan_reason(plan: Plan, verification: ArmVerification) -> str:
    """The verdict on a plan in one sentence, with what the strategy knows of it."""
    if verification.verdict is not Verdict.INCOMPLETE or not plan.undrawn:
        return reason(verification)
    why = f"the path is not drawn {'; '.join(plan.undrawn)}"
    return _incomplete_sentence(verification, why)


def _incomplete_sentence(verification: ArmVerification, why: str) -> str:
    drawn = percent(verification.coverage)
    required = percent(verification.problem.path.required_coverage)
    return f"incomplete: {drawn} drawn, because {why}; {required} is required"


def _left_out(verification: ArmVerification) -> str:
    """What the motion leaves out of the desired path, in words."""
    gaps = verification.undrawn
    if not len(gaps):
        return "no waypoint draws the desired path"
    first = " to ".join(quantity(float(station), "m") for station in gaps[0])
    stretches = "1 stretch, from" if len(gaps) == 1 else f"{len(gaps)} stretches, from"
    return f"the motion leaves out {stretches} {first} along the path"


def _certified_sentence(verification: Verification) -> str:
    count = len(verification.checks)
    smallest, drawn, who = min_clearance(verification), "", "robot"
    if isinstance(verification, ArmVerification):
        who, drawn = "arm", "; no desired path is asked for"
        if verification.problem.tip_path is not None:
            share = percent(verification.coverage)
            drawn = f"; {share} of the desired path is drawn"
    if smallest is None:
        return (
            f"All {count} checks passed over the whole motion; no obstacle is there"
            f"{drawn}."
        )
    problem = verification.problem
    required = quantity(problem.required_clearance, "m")
    box = asdict(verification.errors)
    errors = ", with any error of the error box," if any(box.values()) else ""
    return (
        f"All {count} checks passed; at every instant of the motion{errors} the {who} "
        f"keeps at least {quantity(smallest.lower_m, 'm')} from every obstacle, "
        f"{required} are required{drawn}."
        + "".join(f" {name!r} is a surface only." for name in surfaces(problem))
    )


def _own_facts(verification: Verification) -> dict[str, Any]:
    """What the file says of an arm, or of any other robot."""
    if not isinstance(verification, ArmVerification):
        # Whoever verifies an arm needs no robots.
        from vdsm_pin.report.robot_facts import robot_facts
        from vdsm_pin.robots.judgement import RobotVerification

        assert isinstance(verification, RobotVerification)
        return robot_facts(verification)
    problem, rows = verification.problem, verification.trajectory
    path = problem.tip_path
    return {
        "notes": input_notes(problem, rows),
        "coverage": finite(verification.coverage),
        "path_length_m": None if path is None else path.length,
        "undrawn_m": tuple((float(a), float(b)) for a, b in verification.undrawn),
        "error_box": error_box(verification.errors, rows.n_links),
        "left_out": left_out(problem),
        "motion": motion_facts(problem, rows),
    }


def verification_file(
    verification: Verification, record: RunRecord
) -> VerificationFile:
    """verification.json of one verification."""
    problem = verification.problem
    return VerificationFile(
        **_own_facts(verification),
        problem=problem.name,
        date=record.date,
        verdict=verification.verdict.value,
        reason=reason(verification),
        assumed_sizes=assumed_sizes(problem),
        checks=tuple(
            check_row(check, time_at(verification, check.moment))
            for check in verification.checks
        ),
        min_clearance=min_clearance(verification),
        required_clearance_m=problem.required_clearance,
        closest=tuple(
            closest_row(verification, row) for row in verification.approaches
        ),
        max_joint_error_rad=finite(verification.joint_error),
        refuted_joint_error_rad=finite(verification.refuted_joint_error),
        time_limit_s=finite(verification.time_limit),
        not_done=verification.not_done,
        counterexamples=tuple(
            counterexample_row(verification, found)
            for found in verification.counterexamples
        ),
        nominal_clear=verification.nominal_clear
        if verification.counterexamples
        else None,
        hashes=Hashes.model_validate(record, from_attributes=True),
        versions=versions(),
        machine=machine(),
        tolerances=tolerances(),
        command=record.command,
    )


def tolerances() -> dict[str, ToleranceRow]:
    """Every tolerance in force, by name, with its unit."""
    values = asdict(TOLERANCES)
    return {name: ToleranceRow(value=values[name], unit=UNITS[name]) for name in values}


def plan_file(refinement: "Refinement", record: RunRecord) -> PlanFile:
    """plan.json of one plan, its rounds and the verification it was accepted with."""
    plan, verification = refinement.plan, refinement.verification
    return PlanFile(
        problem=plan.problem.name,
        strategy=plan.strategy,
        verdict=verification.verdict.value,
        reason=plan_reason(plan, verification),
        undrawn=plan.undrawn,
        assumed_sizes=assumed_sizes(plan.problem),
        notes=(*plan.notes, *input_notes(plan.problem, plan.trajectory)),
        rounds=len(refinement.rounds),
        adjustments=tuple(
            AdjustmentRow(
                round=number,
                moment=one.moment,
                link=one.link,
                obstacle=one.obstacle,
                measured_by=one.measured_by,
                distance_m=finite(one.distance),
                margin_m=one.margin,
            )
            for number, ended in enumerate(refinement.rounds, start=1)
            for one in ended.adjustments
        ),
        centres_error_m=next(
            (finite(c.worst) for c in verification.checks if c.name == PLANNED), None
        ),
        error_box=error_box(verification.errors, plan.trajectory.n_links),
        coverage=finite(verification.coverage),
        motion=motion_facts(plan.problem, plan.trajectory),
        hashes=Hashes.model_validate(record, from_attributes=True),
        versions=versions(),
        command=record.command,
    )


def batch_row(folder: str, strategy: str, file: VerificationFile) -> BatchRow:
    """The row of one verified problem."""
    smallest, motion = file.min_clearance, file.motion
    of_arm: dict[str, float | None] = {}
    if isinstance(motion, MotionFacts):
        of_arm = {
            "max_link_angle_rad": max(motion.max_link_angle_rad),
            "changed_angles_mean_on_path": motion.changed_angles_mean_on_path,
            "x0_min_m": motion.x0_min_m,
            "x0_max_m": motion.x0_max_m,
        }
    return BatchRow(
        **of_arm,
        folder=folder,
        problem=file.problem,
        strategy=strategy,
        outcome=file.verdict,
        min_clearance_lower_m=smallest.lower_m if smallest else None,
        min_clearance_upper_m=smallest.upper_m if smallest else None,
        closest_link=smallest.link if smallest else None,
        closest_obstacle=smallest.obstacle if smallest else None,
        coverage=file.coverage,
        max_joint_error_rad=file.max_joint_error_rad,
        waypoints=motion.waypoints,
        reason="; ".join(filter(None, (file.reason, assumption(file.assumed_sizes)))),
    )
