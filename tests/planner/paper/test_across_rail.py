"""Arms of straight pieces across the rail, against shapely and against each other."""

import numpy as np
import pytest
import shapely

from vdsm_pin.arm.kinematics import joint_angles, link_angles
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.paper.across_rail import TRIAL_ROWS, AcrossRail, across_rail
from vdsm_pin.planner.paper.lift import lift
from vdsm_pin.planner.paper.project import project
from vdsm_pin.planner.paper.scale import scale
from vdsm_pin.planner.paper.sections import Passed, section_along
from vdsm_pin.planner.paper.tip_path import drawn_rows

OBS3 = read_problem("paper/obs3")
ARM = OBS3.manipulator
POINTS = drawn_rows(OBS3.path, 0.0).points[::9]


def choices() -> list[AcrossRail]:
    section = section_along(OBS3.scene.obstacles[0], "z")
    assert section is not None
    passed = Passed(section, (0,))
    return list(across_rail(OBS3, passed, "z", np.zeros(ARM.n_links)))


def test_single_joints_and_both_ends_of_a_link_are_tried_on_both_sides() -> None:
    found = {(one.side, one.bends) for one in choices()}
    assert len(found) == 2 * (7 + 6 + 5)
    for bends in (5,), (4, 5), (4, 5, 6):
        assert (-1, bends) in found


def test_the_largest_angle_is_that_of_the_lifted_arm() -> None:
    tried = 0
    for one in choices():
        angle, moved = one.costs(POINTS)
        if not np.isfinite(angle):
            continue
        reference = scale(ARM, project(POINTS))
        planar = one.bent(reference, POINTS[:, 0])
        centres = lift(ARM, planar, POINTS[:, 0])
        alpha, theta = joint_angles(ARM, centres)
        psi = link_angles(alpha, theta)
        assert psi.max() == pytest.approx(angle, abs=1e-9)
        moves = np.linalg.norm(planar - reference, axis=-1)
        assert moved == pytest.approx(moves.mean(), abs=1e-12)
        unmoved = np.delete(psi, [0, *(bend - 1 for bend in one.bends)], axis=1)
        assert unmoved.max() < 1e-7, "only psi_1 and the bends change"
        tried += 1
    assert tried >= 6


def test_what_is_called_clear_is_clear_by_shapely() -> None:
    rng = np.random.default_rng(4)
    for one in choices()[::3]:
        core = shapely.MultiPoint(one.region.corners).convex_hull
        reference = scale(ARM, project(POINTS))
        moves = one.side * rng.uniform(0.0, 0.6, (len(POINTS), len(one.bends)))
        planar = one.moved(reference, moves)
        told = one.clear(planar, POINTS[:, 0])
        for row, able in zip(range(len(POINTS)), told, strict=True):
            try:
                arm = lift(ARM, planar[row : row + 1], POINTS[row : row + 1, 0])[0]
            except Exception:  # noqa: BLE001 - a link is too short: not clear either
                assert not able
                continue
            line = shapely.LineString(arm[:, [0, 1 + one.axis]])
            gap = line.distance(core) - one.region.radius
            if abs(gap) > 1e-6:
                assert able == (gap > 0.0)


def test_the_first_choice_has_the_smallest_angle() -> None:
    points = drawn_rows(OBS3.path, 0.0).points
    points = points[:: len(points) // TRIAL_ROWS]
    costs = np.array([one.costs(points) for one in choices() if one.side == -1])
    alike = costs[:, 0] <= costs[:, 0].min() + np.deg2rad(0.1)
    count = int(alike.sum())
    assert 1 < count < len(costs) and alike[:count].all()
    for rising in (costs[:count, 1], costs[count:, 0]):
        assert (rising[1:] >= rising[:-1]).all()


@pytest.mark.parametrize("rows", [150, 200, 300, 601])
def test_the_first_choice_does_not_hang_on_how_many_rows_are_tried(
    rows: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of 150 or more: those of links 4 and 5 are 0.02 deg apart on all of them."""
    monkeypatch.setattr("vdsm_pin.planner.paper.across_rail.TRIAL_ROWS", rows)
    assert choices()[0].bends == (4, 5, 6)


def test_obs3_bends_as_printed_with_smaller_angles() -> None:
    """psi_1 and psi_4 to psi_6 change, psi_4 and psi_6 never at once (6.2.2, 5)."""
    first = choices()[0]
    side = np.linspace([3.126, 1.0, -0.2], [3.126, 1.0, 1.3], 61)  # A_3 to A_6
    changed = np.rad2deg(largest(first, np.vstack([POINTS, side]))) > 1e-4
    assert np.flatnonzero(changed.any(axis=0)).tolist() == [0, 3, 4, 5]
    assert not (changed[:, 3] & changed[:, 5]).any()
    assert np.rad2deg(largest(first, side).max()) < 26.2
    assert np.rad2deg(largest(first, POINTS).max()) < 26.6


def largest(one: AcrossRail, points: FloatArray) -> FloatArray:
    """Link angles with the tip at points, shape (n, N)."""
    planar = one.bent(scale(ARM, project(points)), points[:, 0])
    return link_angles(*joint_angles(ARM, lift(ARM, planar, points[:, 0])))
