"""Oracles: the JSON Schema, and the records the files were made from."""

import json
import math
from dataclasses import replace

import jsonschema
import made_up
import numpy as np
import pytest

from vdsm_pin.errors import UnknownName
from vdsm_pin.planner.records import Adjustment, Plan
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.refinement import Refinement, Round
from vdsm_pin.report.facts import batch_row, plan_file, verification_file
from vdsm_pin.report.files import (
    SCHEMA_NAMES,
    BatchRow,
    ManifestFile,
    VerificationFile,
    schema,
)
from vdsm_pin.report.motion_facts import motion_facts
from vdsm_pin.report.robot_facts import reached
from vdsm_pin.verification.records import ArmVerification, Check, Pair, Verdict


def written(verification: ArmVerification) -> VerificationFile:
    return verification_file(verification, made_up.RECORD)


@pytest.mark.parametrize("verdict", list(Verdict))
@pytest.mark.parametrize("joint_error", [0.0, 0.01, math.nan])
def test_verification_json_fits_its_schema(
    verdict: Verdict, joint_error: float
) -> None:
    file = written(made_up.verification(verdict, joint_error=joint_error))
    content = json.loads(file.text())
    jsonschema.validate(content, schema("verification"))
    assert content["verdict"] == verdict.value
    assert VerificationFile.model_validate(content) == file
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(content | {"verdict": "sampled"}, schema("verification"))


def test_plan_and_manifest_fit_their_schemas() -> None:
    judged = made_up.verification()
    rows = judged.trajectory
    zero = np.zeros((rows.n_samples, 8, 3))
    plan = Plan(judged.problem, "paper", zero, rows, ("a note",))
    raised = Adjustment(3.0, 7, "pillar", "Coal", 0.001, 0.0032)
    first = Round(0.0, None, 0.001, "too near", (raised,))
    rounds = (first, Round(0.0032, judged.verdict, 0.0035, "every check passed"))
    file = plan_file(Refinement(plan, judged, rounds), made_up.RECORD)
    jsonschema.validate(json.loads(file.text()), schema("plan"))
    assert file.rounds == 2
    assert file.adjustments[0].round == 1
    assert file.adjustments[0].link == 7
    row = batch_row("made-up", "paper", written(judged))
    manifest = ManifestFile(
        problem_sha256="1", settings={"strategy": "paper"}, row=row, files={"a": "b"}
    )
    jsonschema.validate(json.loads(manifest.text()), schema("manifest"))
    assert isinstance(row, BatchRow)


def test_schemas_are_valid_themselves_and_unknown_ones_refused() -> None:
    for name in SCHEMA_NAMES:
        jsonschema.Draft202012Validator.check_schema(schema(name))
    with pytest.raises(UnknownName, match="verification"):
        schema("poem")


def test_undefined_numbers_become_null_and_never_pass() -> None:
    checks = (Check("clearance", Verdict.UNDECIDED, 0, math.nan, math.nan, "m"),)
    judged = made_up.verification()
    bare = ArmVerification(
        problem=judged.problem,
        trajectory=judged.trajectory,
        pairs=judged.pairs,
        checks=checks,
        approaches=(),
        profile=judged.profile,
        least=judged.least,
        coverage=math.nan,
        undrawn=np.zeros((0, 2)),
        joint_error=math.nan,
    )
    file = written(bare)
    assert file.verdict == "undecided"
    assert file.checks[0].worst is None
    assert file.coverage is None
    assert "not complete" in file.reason
    assert "NaN" not in file.text()


def test_the_reason_names_the_check_that_failed() -> None:
    refuted = written(made_up.verification(Verdict.REFUTED))
    assert "clearance is 4.100 mm against a limit of 3.500 mm" in refuted.reason
    certified = written(made_up.verification())
    assert "at least 4.100 mm" in certified.reason
    free = written(made_up.verification(scene=Scene()))
    assert free.min_clearance is None
    assert free.verdict == "certified"


def test_motion_facts_follow_the_rows() -> None:
    judged = made_up.verification()
    motion = written(judged).motion
    rows = judged.trajectory
    cosines = np.cos(rows.theta) * np.cos(rows.alpha)
    psi = np.arccos(np.clip(cosines, -1.0, 1.0))
    np.testing.assert_allclose(motion.max_link_angle_rad, psi.max(axis=0), atol=1e-7)
    changed = (psi > np.deg2rad(0.05)).sum(axis=1)
    assert motion.changed_angles_max == changed.max()
    drawn = rows.on_path[1:] & rows.on_path[:-1]
    ways = np.abs(np.diff(rows.path_m)) * drawn
    both = (changed[1:] + changed[:-1]) / 2.0
    mean = motion.changed_angles_mean_on_path
    assert mean == pytest.approx(np.average(both, weights=ways))
    assert (motion.x0_min_m, motion.x0_max_m) == (rows.x0.min(), rows.x0.max())


def test_motion_facts_hold_what_lies_between_rows() -> None:
    """Of a cubic piece between equal values a parabola, v h / 4 high: closed form."""
    rates = np.zeros((2, 17))
    rates[:, 0], rates[:, 5] = (0.8, -0.8), (-0.4, 0.4)
    none, flat = np.zeros(2), np.zeros((2, 8))
    times = np.array([0.0, 1.0])
    rows = Trajectory(none, none, none, flat, flat, times=times, rates=rates)
    facts = motion_facts(made_up.problem(), rows)
    assert (facts.x0_min_m, facts.x0_max_m) == pytest.approx((0.0, 0.2))
    expected = 0.1 * np.eye(8)[2]
    np.testing.assert_allclose(facts.max_link_angle_rad, expected, atol=1e-15)


@pytest.mark.parametrize("degree", [3, 5])
def test_motion_facts_are_those_of_the_curve_to_the_last_digit_shown(
    degree: int,
) -> None:
    """Oracle: the curve at 100,001 moments, and its own pieces cut no more."""
    rng = np.random.default_rng(degree)
    rates, changes = rng.uniform(-0.4, 0.4, (2, 4, 17))
    joints, none = rng.uniform(-0.3, 0.3, (4, 17)), np.zeros(4)
    times = np.array([0.0, 0.7, 1.9, 2.4])
    motion = Trajectory(
        none, none, joints[:, 0], joints[:, 1::2], joints[:, 2::2], times=times,
        rates=rates, changes=changes if degree == 5 else None,
    )  # fmt: skip
    facts = motion_facts(made_up.problem(), motion)
    dense = motion.path.at(np.linspace(0.0, 3.0, 100_001))
    cosines = np.cos(dense[:, 1::2]) * np.cos(dense[:, 2::2])
    psi, x0 = np.arccos(cosines).max(axis=0), dense[:, 0]
    shown = np.array([facts.x0_min_m, facts.x0_max_m, *facts.max_link_angle_rad])
    true = np.array([x0.min(), x0.max(), *psi])
    np.testing.assert_allclose(shown, true, rtol=0.0, atol=1e-8)
    assert (shown[1:] >= true[1:] - 1e-15).all() and shown[0] <= true[0]
    low, high = reached(motion.path)
    np.testing.assert_allclose(low, dense.min(axis=0), rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(high, dense.max(axis=0), rtol=0.0, atol=1e-8)


@pytest.mark.parametrize("share", [0.3, 0.7])
def test_long_ways_count_in_the_mean_of_an_open_path(share: float) -> None:
    """One changed angle up to a place, from there to the end up to three."""
    alpha = np.zeros((3, 8))
    alpha[:, 0] = alpha[2, 1:3] = 0.1
    closed, on = made_up.problem(), np.ones(3)
    problem = replace(closed, tip_path=replace(closed.path, closed=False))
    along = problem.path.length * np.array([0.0, share, 1.0])
    rows = Trajectory(on, along, np.zeros(3), alpha, np.zeros((3, 8)))
    mean = motion_facts(problem, rows).changed_angles_mean_on_path
    assert mean == pytest.approx(share * 1 + (1 - share) * 2)


def test_links_near_each_other_do_not_hide_the_obstacles() -> None:
    judged = made_up.verification()
    near = replace(judged.approaches[0], pair=Pair(1, other_link=3), lower=0.001)
    both = written(replace(judged, approaches=(near, *judged.approaches)))
    assert both.min_clearance == written(judged).min_clearance


def test_more_rows_where_joints_move_do_not_change_the_mean() -> None:
    """Two metres with one changed angle, one with three and ten times as many rows."""
    along = np.concatenate([np.linspace(0, 2, 11), np.linspace(2, 3, 101)])
    alpha = np.zeros((len(along), 8))
    alpha[:, 0] = 0.1
    alpha[11:, 1:3] = 0.1
    off = np.zeros(3)
    rows = Trajectory(
        np.concatenate([off, np.ones(len(along)), off]),
        np.concatenate([off, along, off + 3.0]),
        np.zeros(len(along) + 6),
        np.pad(alpha, ((3, 3), (0, 0)), constant_values=0.2),
        np.zeros((len(along) + 6, 8)),
    )
    facts = motion_facts(made_up.problem(), rows)
    assert facts.changed_angles_mean_on_path == pytest.approx((2 * 1 + 1 * 3) / 3)
