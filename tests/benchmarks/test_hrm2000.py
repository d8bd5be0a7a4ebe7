"""Generated problems have a certified witness; a spoiled one is refused."""

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from some_slow import few_of

from benchmarks.hrm2000.arms import NINE, PAPER
from benchmarks.hrm2000.curves import Bend, follow_the_leader, tip_curve
from benchmarks.hrm2000.drafts import Draft
from benchmarks.hrm2000.families import FAMILIES
from benchmarks.hrm2000.generate import generate, verified, witness_of
from benchmarks.hrm2000.motions import DraftRejected, drawn_by_feeding
from benchmarks.hrm2000.sampling import sample
from benchmarks.hrm2000.solids import (
    Opening,
    Ring,
    Tube,
    least_opening,
    plate_with_hole,
)
from benchmarks.hrm2000.sweeps import required_clearance, sweep
from benchmarks.hrm2000.twins import TWINS
from vdsm_pin.geometry.solids import Mesh
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.trajectory_file import read_trajectory
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.verification.records import Verdict
from vdsm_pin.verification.verify import verify

CURVE = tip_curve([Bend(0.2, 0.4, 0.9, 0.3), Bend(0.1, 0.5, 0.8, 2.5)])


def digest(folder: Path) -> dict[str, str]:
    return {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.iterdir())
    }


def test_a_curve_is_run_through_at_unit_speed_without_a_kink() -> None:
    at = np.linspace(-0.5, 2.0, 2001)
    points = CURVE.at(at)
    step = at[1] - at[0]
    ways = np.diff(points, axis=0)
    # A chord of an arc of radius R is shorter by step^3 / 24 R^2.
    np.testing.assert_allclose(np.linalg.norm(ways, axis=1), step, rtol=1e-6)
    turns = np.linalg.norm(np.diff(ways, axis=0), axis=1) / step**2
    assert turns.max() <= 1.0 / 0.8 + 1e-6
    assert (points[at <= 0.2, 1:] == 0.0).all()


@pytest.mark.parametrize("arm", NINE, ids=lambda arm: arm.name)
def test_the_follower_has_its_joints_on_the_tips_curve(arm) -> None:
    curve = tip_curve([Bend(0.3, 0.5, 2.2, 1.0)])
    centres = follow_the_leader(arm, curve, np.linspace(0.0, 1.7, 40))
    lengths = np.linalg.norm(np.diff(centres, axis=1), axis=2)
    np.testing.assert_allclose(
        lengths, np.broadcast_to(arm.link_lengths, lengths.shape), rtol=0, atol=1e-12
    )
    fine = curve.at(np.linspace(-4.0, 1.71, 40_000))
    gaps = np.linalg.norm(centres[-1][:, None] - fine[None], axis=2).min(axis=1)
    assert gaps.max() <= 1e-4


def test_a_curve_too_tight_for_the_arm_has_no_witness() -> None:
    tight = tip_curve([Bend(0.1, 1.0, 0.25, 0.0)])
    with pytest.raises(DraftRejected):
        drawn_by_feeding(PAPER, tight, (-0.2, 0.8, 1.0), 0.01)


def test_the_least_opening_touches_the_room_of_the_sweep() -> None:
    witness = drawn_by_feeding(PAPER, CURVE, (-0.2, 1.4, 1.5), 0.01)
    swept = sweep(witness)
    least = least_opening(swept, 0.6, 0.03)
    assert least is not None
    fine = np.linspace(0.0, 1.0, 2001)[:, None, None, None]
    begins, ends = swept.centres[::5, :-1], swept.centres[::5, 1:]
    points = (begins + fine * (ends - begins)).reshape(-1, 3)
    within = np.abs(points[:, 0] - 0.6) <= 0.015 + swept.room
    off = np.abs(points[within, 1:] - least.centre) + swept.room - least.half
    assert (off <= 1e-9).all()
    assert (off.max(axis=0) >= -2e-3).all()


def volume(mesh: Mesh) -> float:
    first, second, third = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", first, np.cross(second, third)) / 6.0)


@pytest.mark.parametrize("capped", [False, True])
def test_a_tube_is_a_solid_of_the_volume_of_its_wall(capped: bool) -> None:
    tube = Tube(tip_curve([]), (0.0, 2.0), 0.1, 0.05, 96, 5, capped)
    expected = np.pi * (0.15**2 - 0.1**2) * 2.0
    expected += np.pi * 0.15**2 * 0.05 if capped else 0.0
    assert volume(tube.mesh("t")) == pytest.approx(expected, rel=2e-3)


def test_plates_and_blades_are_solids_of_their_volume() -> None:
    at = Opening(1.0, 0.03, np.array([0.1, 0.2]), np.full(2, 0.3))
    plate = plate_with_hole("p", at, 96, 2.0)
    expected = 0.03 * (4.0**2 - np.pi * 0.3**2)
    assert volume(plate) == pytest.approx(expected, rel=1e-3)
    ring = Ring(np.zeros(3), (0.2, 0.6), 0.1, 0.02, (0.2, -0.3))
    blade = ring.blade("b", 1.0, 9, 64)
    # An ellipse's area along the radius, whatever the twist.
    assert volume(blade) == pytest.approx(np.pi * 0.05 * 0.01 * 0.4, rel=1e-2)


@pytest.mark.parametrize("family", few_of(["short_rail", "windows"], 1))
def test_the_same_number_makes_the_same_files(family: str, tmp_path: Path) -> None:
    for folder in ("a", "b"):
        generate(tmp_path / folder, family, 3)
    assert digest(tmp_path / "a") == digest(tmp_path / "b")


QUICK = ("windows", "hook105", "short_rail", "nine_arms")
"""Families whose witnesses are verified in no time."""


@pytest.mark.parametrize(
    "family",
    [
        pytest.param(name, marks=() if name in QUICK else pytest.mark.slow)
        for name in FAMILIES
        if name != "twins"
    ],
)
def test_a_witness_is_certified_and_one_that_is_spoiled_is_not(
    family: str, tmp_path: Path
) -> None:
    path = generate(tmp_path, family, 1).path
    assert verified(path).verdict is Verdict.CERTIFIED
    problem = read_problem(path)
    assert problem.path.required_coverage == 1.0
    motion = read_trajectory(witness_of(path), problem.manipulator)
    half = motion.part(0, motion.n_samples - 5)
    assert verify(problem, half).verdict is not Verdict.CERTIFIED
    turned = replace(motion, alpha=motion.alpha + np.deg2rad(3.0))
    assert verify(problem, turned).verdict is not Verdict.CERTIFIED


@pytest.mark.parametrize("name", TWINS)
@pytest.mark.parametrize("margin", [1e-3, -2e-3])
def test_a_twin_is_too_tight_by_its_margin(name: str, margin: float) -> None:
    """At the tightest place no axis keeps its room; with a margin below 0 it does."""
    arm, rng = PAPER, np.random.default_rng(0)
    room = arm.link_radius + required_clearance(arm)
    draft = made(name, rng, margin)
    points, obstacle = draft.witness.points, draft.obstacles[0]
    if name == "window":
        halves = [o.half_size for o in draft.obstacles]
        wide = float(halves[2][1])
        low = draft.obstacles[2].centre[2] + halves[2][2]
        high = draft.obstacles[3].centre[2] - halves[3][2]
        gap = min(wide, (high - low) / 2.0)
    elif name == "hole":
        corners = np.unique(obstacle.vertices[:, 1:].round(9), axis=0)
        inner = corners[np.argsort(np.linalg.norm(corners, axis=1))[:48]]
        gap = np.linalg.norm(inner - inner.mean(axis=0), axis=1).min()
        gap *= np.cos(np.pi / 48)
    elif name == "bore":
        gap = float(
            np.linalg.norm(
                obstacle.vertices[:32] - obstacle.vertices[:32].mean(axis=0), axis=1
            ).min()
        )
        gap *= np.cos(np.pi / 32)
    elif name == "solid":
        path = DesiredPath(points[0], points, closed=True)
        places = path.at(np.linspace(0.0, path.length, 4001))
        gap = float(np.linalg.norm(places - obstacle.centre, axis=1).min())
        gap -= obstacle.radius
    else:
        high = draft.witness.arm.base_range[1]
        far = np.linalg.norm(points - [high, 0.0, 0.0], axis=1).max()
        assert far - arm.total_length == pytest.approx(margin, abs=1e-9)
        return
    assert room - gap == pytest.approx(margin, abs=1e-6)


def made(name: str, rng: np.random.Generator, margin: float) -> Draft:
    while True:
        try:
            return TWINS[name](rng, PAPER, margin)
        except DraftRejected:
            continue


def test_the_witness_of_the_feasible_twin_is_refused(tmp_path: Path) -> None:
    for number in range(3):
        path = generate(tmp_path, "twins", number).path
        assert verified(path).verdict is Verdict.REFUTED


def test_a_last_link_that_looks_elsewhere_is_a_fault(tmp_path: Path) -> None:
    path = generate(tmp_path, "pointing", 1).path
    problem = read_problem(path)
    motion = read_trajectory(witness_of(path), problem.manipulator)
    assert sample(problem, motion).faults == ()
    wish = problem.path.pointing
    assert wish is not None
    narrow = replace(wish, cone=wish.cone - np.deg2rad(1.5))
    tighter = replace(problem, tip_path=replace(problem.path, pointing=narrow))
    (fault,) = sample(tighter, motion).faults
    assert "past its aim" in fault
    assert verify(tighter, motion).verdict is Verdict.REFUTED
