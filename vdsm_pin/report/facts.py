"""Records to file models: one place where a verification becomes words and rows."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.proof.bodies import LeftOut
from vdsm_pin.report import rows
from vdsm_pin.report.files import BatchRow, PlanFile, VerificationFile
from vdsm_pin.report.inputs import assumed_sizes, assumption, input_notes
from vdsm_pin.report.motion_facts import motion_facts
from vdsm_pin.report.reason import nearest_to_obstacle, plan_reason, reason
from vdsm_pin.report.run_record import RunRecord, machine, versions
from vdsm_pin.report.words import finite
from vdsm_pin.tolerances import TOLERANCES, UNITS
from vdsm_pin.verification.records import (
    ArmVerification,
    Check,
    CheckKind,
    ClosestApproach,
    Counterexample,
    Pair,
    Verification,
)
from vdsm_pin.verification.task import ignored_pairs

if TYPE_CHECKING:  # whoever verifies needs no planner
    from vdsm_pin.planner.records import Adjustment
    from vdsm_pin.refinement import Refinement


def in_file_frame(verification: Verification, point: FloatArray) -> rows.Point | None:
    """A point of the base frame in the frame of the problem file; [m]."""
    pose = verification.problem.T_world_base
    moved = pose[:3, :3] @ point + pose[:3, 3]
    if not np.isfinite(moved).all():
        return None
    return float(moved[0]), float(moved[1]), float(moved[2])


def check_row(check: Check, time: float | None = None) -> rows.CheckRow:
    """One check as its row, with the time of its moment where that is known; [s]."""
    known = asdict(check) | {"verdict": check.verdict.value}
    known = {k: finite(v) if isinstance(v, float) else v for k, v in known.items()}
    for name in ("too_close_intervals", "too_close_stretches"):
        known[name] = known[name] or None  # 0: not counted
    return rows.CheckRow(**known, time_s=time)


def _both(pair: Pair) -> dict[str, Any]:
    """The bodies of a pair; null for what it has not, link 0 for a feed."""
    facts = {name: value or None for name, value in asdict(pair).items()}
    return facts | {"link": pair.link}


def closest_row(
    verification: Verification, approach: ClosestApproach
) -> rows.ClosestRow:
    """One closest approach as its row."""
    return rows.ClosestRow(
        interval=approach.interval,
        moment=approach.moment,
        time_s=verification.time_at(approach.moment),
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
    verification: Verification, found: Counterexample, **joints: Any
) -> rows.CounterexampleRow:
    """One counterexample as its row, with its joints and their errors."""
    return rows.CounterexampleRow(
        moment=found.moment,
        **_both(found.pair),
        clearance_m=found.clearance,
        required_m=found.required,
        link_point_m=in_file_frame(verification, found.link_point),
        other_point_m=in_file_frame(verification, found.other_point),
        deeper=found.deeper,
        **joints,
    )


def _arm_counterexample(
    verification: ArmVerification, found: Counterexample
) -> rows.CounterexampleRow:
    joints, errors = found.joints.tolist(), found.offsets.tolist()
    return counterexample_row(
        verification,
        found,
        x0_m=joints[0],
        x0_error_m=errors[0],
        angles_rad=tuple(joints[1:]),
        angle_errors_rad=tuple(errors[1:]),
    )


def error_box(errors: ErrorBox, n_links: int | None = None) -> rows.ErrorBoxRow:
    """The errors in words of the JSON file; of a robot without a number of links."""
    angles = np.array([[errors.joint]]) if n_links is None else errors.angles(n_links)
    alike = bool((angles == angles.flat[0]).all())
    single = (errors.of_obstacle(one.name) for one in errors.obstacles)
    return rows.ErrorBoxRow(
        joint_error_rad=float(angles.max()),
        joints_rad=() if alike else tuple((float(a), float(t)) for a, t in angles),
        base_error_m=errors.base,
        base_error_rad=errors.base_turn,
        obstacle_error_m=errors.obstacle,
        obstacles=tuple(
            rows.ObstacleErrorRow(name=one.name, shift_m=one.shift, turn_rad=one.turn)
            for one in single
        ),
        slide_error_m=errors.slide,
        named=tuple(
            rows.JointErrorRow(name=one.name, turn_rad=one.turn, shift_m=one.shift)
            for one in errors.named
        ),
    )


def left_out_rows(left_out: Sequence[LeftOut]) -> tuple[rows.LeftOutRow, ...]:
    """The bodies of an arm, and the obstacles, that are not held apart."""
    return tuple(rows.LeftOutRow(**asdict(one)) for one in left_out)


def min_clearance(verification: Verification) -> rows.MinClearance | None:
    """The smallest clearance from any obstacle; None where there is no obstacle."""
    index = nearest_to_obstacle(verification)
    if index is None:
        return None
    row = closest_row(verification, verification.approaches[index])
    known = row.model_dump(include=set(rows.MinClearance.model_fields))
    least = finite(verification.min_clearance)
    return rows.MinClearance.model_validate(known | {"lower_m": least})


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
        "left_out": left_out_rows(
            (*problem.manipulator.self_pairs.left_out, *ignored_pairs(problem))
        ),
        "motion": motion_facts(problem, rows),
        "counterexamples": tuple(
            _arm_counterexample(verification, one)
            for one in verification.counterexamples
        ),
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
            check_row(check, verification.time_at(check.moment))
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
        nominal_clear=verification.nominal_clear
        if verification.counterexamples
        else None,
        hashes=rows.Hashes.model_validate(record, from_attributes=True),
        versions=versions(),
        machine=machine(),
        tolerances=tolerances(),
        command=record.command,
    )


def tolerances() -> dict[str, rows.ToleranceRow]:
    """Every tolerance in force, by name, with its unit."""
    values = asdict(TOLERANCES)
    return {
        name: rows.ToleranceRow(value=values[name], unit=UNITS[name]) for name in values
    }


def _adjustment_row(
    verification: ArmVerification, number: int, one: "Adjustment"
) -> rows.AdjustmentRow:
    """What a link missed after a round."""
    points: dict[str, rows.Point | None] = {}
    if one.miss is not None:
        turned = verification.problem.T_world_base[:3, :3] @ one.miss.normal
        points = {
            "link_point_m": in_file_frame(verification, one.miss.on_link),
            "other_point_m": in_file_frame(verification, one.miss.on_obstacle),
            "normal": (float(turned[0]), float(turned[1]), float(turned[2])),
        }
    return rows.AdjustmentRow(
        round=number,
        moment=one.moment,
        link=one.link,
        obstacle=one.obstacle,
        measured_by=one.measured_by,
        distance_m=finite(one.distance),
        margin_m=None if one.joints else one.margin,
        region_m=one.margin if one.joints else None,
        joints=one.joints,
        moved_m=one.moved if one.joints else None,
        **points,
    )


def plan_file(refinement: "Refinement", record: RunRecord) -> PlanFile:
    """plan.json of one plan, its rounds and the verification it was accepted with."""
    plan, verification = refinement.plan, refinement.verification
    checks = verification.checks
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
            _adjustment_row(verification, number, one)
            for number, ended in enumerate(refinement.rounds, start=1)
            for one in ended.adjustments
        ),
        centres_error_m=next(
            (finite(c.worst) for c in checks if c.name == CheckKind.PLANNED), None
        ),
        error_box=error_box(verification.errors, plan.trajectory.n_links),
        coverage=finite(verification.coverage),
        motion=motion_facts(plan.problem, plan.trajectory),
        hashes=rows.Hashes.model_validate(record, from_attributes=True),
        versions=versions(),
        command=record.command,
    )


def batch_row(folder: str, strategy: str, file: VerificationFile) -> BatchRow:
    """The row of one verified problem."""
    smallest, motion = file.min_clearance, file.motion
    of_arm: dict[str, float | None] = {}
    if isinstance(motion, rows.MotionFacts):
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
