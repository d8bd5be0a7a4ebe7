"""What the certificate checker says of the motion between rows, by closed forms."""

import json
from collections import Counter
from contextlib import suppress
from dataclasses import replace
from math import comb
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from flint import arb, arb_mat, ctx
from oracles.certificate_cases import Case
from oracles.certificate_oracle import frames_and_centres, sealed
from oracles.tree_certificates import controls

from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.certificate_checker import check_certificate
from vdsm_pin.certificate_checker.balls import Rejected
from vdsm_pin.certificate_checker.motion import Branch, Interval, beside
from vdsm_pin.certificate_checker.program import PRECISION
from vdsm_pin.certificate_checker.rows import Rows
from vdsm_pin.certificate_checker.tree import SLIDES, Joint, Tree
from vdsm_pin.geometry.solids import Sphere
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Carrier, Moving, Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof import paths
from vdsm_pin.proof import tree as trees
from vdsm_pin.proof.tree import Kind
from vdsm_pin.verification.limits import check_limits
from vdsm_pin.verification.records import Verdict

ARM = {
    "link_lengths": [0.4, 0.3, 0.3],
    "link_radius": 0.03,
    "max_link_angle_deg": 60,
    "max_joint_angle_deg": 50,
}


def swing(folder: Path, angle: float, spacing: float = 1.0) -> Case:
    """The stretched arm turns about its base, the tip 1 m away, along the chord."""
    q = np.zeros((2, 7))
    q[:, 1] = -angle, angle
    tips = [frames_and_centres(ARM["link_lengths"], row)[1][-1].tolist() for row in q]
    start = {"x0": 0.0, "alpha_deg": [float(np.rad2deg(-angle)), 0, 0]}
    data: dict[str, Any] = {
        "vdsm_problem": 1,
        "length_unit": "m",
        "manipulator": ARM,
        "obstacles": [],
        "tip_path": {
            "start": {"joints": start | {"theta_deg": [0, 0, 0]}},
            "points": tips,
            "spacing": spacing,
        },
        "required_clearance": 0.0,
    }
    drawn = {"on_path": [1, 1], "path_m": [0.0, 2.0 * np.sin(angle)]}
    return Case(folder, data, q, (0.0, 0.0, 0.0), **drawn)


@pytest.mark.parametrize("angle", [0.002, 0.01])
def test_the_deviation_of_a_swing_is_its_sagitta(angle: float, tmp_path: Path) -> None:
    case = swing(tmp_path, angle)
    outcome = check_certificate(case.certificate, case.problem, case.trajectory)
    assert outcome.accepted, outcome.reason
    sagitta = 1.0 - np.cos(angle)
    for spacing, good in ((1.01 * sagitta, True), (0.99 * sagitta, False)):
        case = swing(tmp_path, angle, spacing)
        found = refusal(case)
        assert found == "" if good else "the tip strays" in found


def along(folder: Path, x0: list[float], **asked: Any) -> Case:
    """The stretched arm moves along x."""
    data = {"vdsm_problem": 1, "length_unit": "m", "manipulator": ARM}
    drawn = {key: asked.pop(key) for key in ("on_path", "path_m") if key in asked}
    q = np.zeros((len(x0), 7))
    q[:, 0] = x0
    data |= {"obstacles": [], "required_clearance": 0.0} | asked
    return Case(folder, data, q, (0.0, 0.0, 0.0), **drawn)


def refusal(case: Case) -> str:
    outcome = check_certificate(case.certificate, case.problem, case.trajectory)
    return outcome.reason


@pytest.mark.parametrize(("share", "good"), [(0.9, True), (1.1, False)])
def test_an_angle_at_the_goal_counts_by_how_far_it_moves_the_tip(
    share: float, good: bool, tmp_path: Path
) -> None:
    """The last of three angles, of an arm of 1 m: held as if it were the first."""
    angle = float(np.rad2deg(1e-6 * share))
    joints = {"x0": 0.1, "alpha_deg": [0, 0, angle], "theta_deg": [0, 0, 0]}
    found = refusal(along(tmp_path, [0.0, 0.1], goal={"joints": joints}))
    assert ("off their goal" in found) is not good
    assert (found == "") is good


@pytest.mark.parametrize(
    ("more", "order", "good"),
    [(0.0, "as_given", True), (0.01, "as_given", False), (0.01, "free", True)],
)
def test_a_closed_path_left_in_between_is_drawn_once(
    more: float, order: str, good: bool, tmp_path: Path
) -> None:
    """There and back along 0.4 m, one row off the path: a lap, or a little more.

    Only where the order is given has it to be once.
    """
    points = [[1.0, 0, 0], [1.2, 0, 0], [1.4, 0, 0]]
    x0 = [0.3, 0.4, 0.4, 0.4, 0.3, 0.1, 0.0, 0.1, 0.3 + more]
    station = [0.3, 0.4, 0.4, 0.4, 0.5, 0.7, 0.8, 0.9, 1.1 + more]
    path = {"start": [1.3, 0, 0], "points": points, "closed": True}
    path |= {"required_coverage": 0.5, "order": order}
    on = [1, 1, 0, 1, 1, 1, 1, 1, 1]
    case = along(tmp_path, x0, tip_path=path, on_path=on, path_m=station)
    found = refusal(case)
    assert (found == "") is good
    past = 1e3 * (more - 1e-6)  # the tolerance of the tip
    assert (
        good or found == f"header: the path is begun again, {past:.12g} mm past its end"
    )


def edited(case: Case, change: Any) -> str:
    """Why the certificate is refused after a change, sealed again."""
    lines = json.loads(json.dumps(case.lines))
    change(lines)
    case.certificate.write_bytes(sealed(lines))
    return refusal(case)


@pytest.mark.parametrize(("past", "good"), [(0.9e-9, True), (2e-9, False)])
@pytest.mark.parametrize("link", [1, 2, 3])
@pytest.mark.parametrize("column", range(5))
def test_a_limit_is_kept_to_a_billionth(
    column: int, link: int, past: float, good: bool, tmp_path: Path
) -> None:
    """Rail, yaw, pitch, and yaw and pitch of which a link turns by their sum."""
    data = {"vdsm_problem": 1, "length_unit": "m", "obstacles": []}
    data |= {"required_clearance": 0.0, "manipulator": ARM | {"base_range": [-1, 1]}}
    q, most, yaw = np.zeros((2, 7)), np.deg2rad(50), np.deg2rad(40)
    both, told = q[1, 2 * link - 1 : 2 * link + 1], 1000.0
    if column == 0:
        q[1, 0] = 1.0 + past
    elif column < 3:
        both[column - 1], told = most + past, 50.0
    else:
        both[:], told = (
            (yaw, np.arccos(np.cos(np.deg2rad(60) + past) / np.cos(yaw))),
            60,
        )
        both[:] = both if column == 3 else -both[::-1]
    found = refusal(Case(tmp_path, data, q, (0.0, 0.0, 0.0)))
    name = ("x0", "alpha", "theta", "psi", "psi")[column] + str(link) * (column > 0)
    if good:
        assert found == ""
    else:
        assert found.startswith(f"interval 0: {name} is ")
        value = found.split(" is ")[1].removesuffix(" mm").removesuffix("°")
        assert float(value) == pytest.approx(told, rel=1e-8)


@pytest.mark.parametrize(("less", "good"), [(0.0, True), (1e-12, False)])
def test_a_clearance_claimed_is_no_less_than_required(
    less: float, good: bool, tmp_path: Path
) -> None:
    """A floor half a billionth farther from the arm than required."""
    floor = {"name": "floor", "shape": "half_space", "normal": [0, 0, 1]}
    floor |= {"point": [0, 0, -(0.03 + 0.002 + 5e-10)]}
    case = along(tmp_path, [0.0, 0.1], obstacles=[floor], required_clearance=0.002)

    def claim(lines: Any) -> None:
        for proof in lines[1]["proofs"][:3]:
            for _, _, planes in proof:
                for plane in planes:
                    plane[-1] = 0.002 - less

    assert (edited(case, claim) == "") is good


def test_lines_of_empty_lists_are_refused_before_they_are_read(tmp_path: Path) -> None:
    case = along(tmp_path, [0.0, 0.1])
    for empty in (b"[]", b"{}"):
        line = b'{"a": [' + 5000 * (empty + b",") + empty + b"]}\n"
        case.certificate.write_bytes(line)
        assert refusal(case) == "header: a line is lists and no numbers"
    # Seven bytes a list are enough, for any number of them.
    case.certificate.write_bytes(b'{"a": [' + 5000 * b"[1000]," + b"[]]}\n")
    assert "version" in refusal(case)


def test_the_base_at_its_goal_is_judged_beside_the_tip(tmp_path: Path) -> None:
    """Base and angle are off such that the tip is not: the base is off by too much."""
    goal = {"x0": 0.1, "alpha_deg": [40, 0, 0], "theta_deg": [0, 0, 0]}
    for base, good in ((0.9e-6, True), (1.2e-6, False)):
        q = np.zeros((2, 7))
        q[:, 0], q[:, 1] = 0.1 + base, np.deg2rad(40) + 0.9e-6
        data = {"vdsm_problem": 1, "length_unit": "m", "manipulator": ARM}
        data |= {"obstacles": [], "required_clearance": 0.0, "goal": {"joints": goal}}
        found = refusal(Case(tmp_path, data, q, (0.0, 0.0, 0.0)))
        assert (found == "") is good
        assert good or "the joints are 0.0012" in found


def test_slices_and_intervals_are_no_more_than_asked(tmp_path: Path) -> None:
    case = along(tmp_path, [0.0, 0.1])

    def empty(lines: Any) -> None:
        proof = lines[1]["proofs"][0]
        proof.insert(0, [0.0, 0.0, proof[0][2]])

    assert "the slices do not tile at 0.0" in edited(case, empty)
    more = edited(case, lambda lines: lines.append(lines[-1] | {"k": 1}))
    assert more == "interval 1: lies beyond the last row"


@pytest.mark.parametrize("column", range(7))
def test_a_change_is_counted_from_the_row_before(column: int, tmp_path: Path) -> None:
    """Of every joint that turns; the base may go as far as it likes."""
    q = np.zeros((2, 7))
    q[:, column] = -0.01, 0.01
    data = {"vdsm_problem": 1, "length_unit": "m", "manipulator": ARM}
    data |= {"obstacles": [], "required_clearance": 0.0}
    for limit, good in ((1.2, True), (1.1, column == 0)):
        asked = data | {"max_change_per_row_deg": limit}
        found = refusal(Case(tmp_path, asked, q, (0.0, 0.0, 0.0)))
        assert found == ("" if good else "interval 0: a joint turns by 1.14591559026°")


@pytest.mark.parametrize("first", [0, 1])
def test_joints_at_the_goal_are_judged_one_by_one(first: int, tmp_path: Path) -> None:
    """One is off by too much, and the next the other way: the tip is not."""
    goal = {"x0": 0.1, "alpha_deg": [40, 0, 0], "theta_deg": [0, 0, 0]}
    data = {"vdsm_problem": 1, "length_unit": "m", "manipulator": ARM}
    data |= {"obstacles": [], "required_clearance": 0.0, "goal": {"joints": goal}}
    for off, good in ((0.95e-6, True), (1.05e-6, False)):
        q = np.zeros((2, 7))
        q[:, 0], q[:, 1] = 0.1, np.deg2rad(40)
        q[:, 1 + first] += off
        q[:, 3 + first] -= 0.95e-6
        found = refusal(Case(tmp_path, data, q, (0.0, 0.0, 0.0)))
        assert (found == "") is good
        assert good or "off their goal" in found


@pytest.mark.parametrize("degree", [1, 3, 5])
def test_limits_of_smooth_motions_are_those_of_the_curve(degree: int) -> None:
    """A peak a hair below a limit is kept and one above is not, wherever it is.

    Control points lie far outside, both angles of a joint beyond 90 deg among them,
    where the product of the cosines is large again. Oracle: samples.
    """
    rng, said = np.random.default_rng(degree), Counter[tuple[bool, bool]]()
    arm = replace(built_in("hrm8"), max_joint_angle=1.4, max_link_angle=1.5)
    rows = Rows.__new__(Rows)
    rows.problem = PlanningProblem(arm, Scene(), None, 0.0, name="p")
    time = np.linspace(0.0, 1.0, 20_001)
    weights = [comb(degree, i) * time**i * (1 - time) ** (degree - i)
               for i in range(degree + 1)]  # fmt: skip
    for _ in range(20):
        pair = rng.normal(size=(2, degree + 1))
        alpha, theta = pair @ np.array(weights)
        low, high = 0.0, 100.0
        for _ in range(60):  # the largest factor that keeps all limits at the samples
            f = 0.5 * (low + high)
            inside = max(abs(f * alpha).max(), abs(f * theta).max()) <= 1.4
            cone = np.cos(f * alpha) * np.cos(f * theta) >= np.cos(1.5)
            low, high = (f, high) if inside and cone.all() else (low, f)
        for more in (1.0 - 1e-6, 1.0 + 1e-6):
            columns = [[arb(0)] * (degree + 1) for _ in range(17)]
            columns[5:7] = [[arb(more * low * x) for x in row] for row in pair.tolist()]
            motion = SimpleNamespace(controls=controls(*columns), degree=degree)
            with ctx.workprec(PRECISION), suppress(Rejected):
                kept = False
                rows._limits(motion)
                kept = True
            said[more < 1.0, kept] += 1
    assert said == {(True, True): 20, (False, False): 20}


@pytest.mark.parametrize("degree", [3, 5])
def test_the_change_of_smooth_rows_is_judged_as_the_verifier_judges_it(
    degree: int,
) -> None:
    """Two programs, one verdict; what both allow is. Oracle: samples."""
    rng, said = np.random.default_rng(degree), Counter[bool]()
    rows, arm = Rows.__new__(Rows), built_in("hrm8")
    for _ in range(4):
        q, rates, changes = rng.normal(size=(3, 3, 17)) * 0.02
        more = [rates, changes][: degree // 2]
        branch = Branch(q, np.array([0.0, 0.7, 2.0]), rates=more)
        names = dict(zip(("rates", "changes"), more, strict=False))
        motion = Trajectory(
            *(np.zeros(3) > 0, np.zeros(3), q[:, 0], q[:, 1::2], q[:, 2::2]),
            times=branch.times, **names)  # fmt: skip
        samples = np.array(motion.path.at_moments(np.linspace(0, 2, 4_001)))[:, 1:]
        turn = max(np.ptp(x, axis=0).max() for x in (samples[:2_001], samples[2_000:]))
        for more_than in (-1e-6, 1e-5, 3e-4, 1e-3, 3e-3):
            limit = float(turn * (1.0 + more_than))
            rows.problem = PlanningProblem(
                arm, Scene(), None, 0.0, name="p", max_row_change=limit
            )
            accepted = True
            with ctx.workprec(PRECISION):
                for k in (0, 1):
                    piece = SimpleNamespace(controls=branch.controls(k), degree=degree)
                    try:
                        rows._limits(piece)
                    except Rejected:
                        accepted = False
            verdict = check_limits(rows.problem, motion)[-1].verdict
            assert accepted == (verdict is Verdict.CERTIFIED)
            assert not (accepted and more_than < 0)
            assert accepted or more_than < 3e-3
            said[accepted] += 1
    assert min(said[True], said[False]) > 4


def test_obstacles_on_a_carrier_follow_its_own_frames() -> None:
    """Behind the joints of the arm; what rests is in the world, frame 0."""
    place = np.eye(4)
    joints = (
        trees.Joint(0, Kind.PRISMATIC, trees.X, place, 0),
        trees.Joint(1, Kind.PRISMATIC, trees.Y, place, 1),
    )
    times, knots = np.array([0.0, 2.0]), np.array([[0.0, 0.0], [3.0, 5.0]])
    carrier = Carrier(trees.Tree(joints), paths.Path(knots, times=times))
    ball = Sphere("ball", np.zeros(3), 0.1)
    obstacles = [ball, Moving(ball, carrier, 1), Moving(ball, carrier, 2)]
    own = Branch(np.array([[7.0], [8.0]]), times)
    rail = Joint(0, SLIDES, (0, 0, 1), place, (0, 1.0, 0.0))
    tree, path, frames = beside(own, [rail], obstacles)
    assert frames == [0, 2, 3]
    pose = Interval(tree, path.controls(0)).pose(0.5)
    places = [[*map(float, pose[k].entries()[3:12:4])] for k in (1, *frames[1:])]
    assert places == [[0.0, 0.0, 7.5], [1.5, 0.0, 0.0], [1.5, 2.5, 0.0]]


@pytest.mark.parametrize("own_times", [True, False])
@pytest.mark.parametrize("other_times", [True, False])
def test_rows_beside_what_moves_have_times(own_times: bool, other_times: bool) -> None:
    place, times, knots = np.eye(4), np.arange(2.0), np.zeros((2, 1))
    other: Any = Branch(knots, times if other_times else None)
    joint = trees.Joint(0, Kind.PRISMATIC, trees.X, place, 0)
    carrier = Carrier(trees.Tree((joint,)), other)
    ball = Sphere("ball", np.zeros(3), 0.1)
    own = Branch(knots, times if own_times else None)
    rail = Joint(0, SLIDES, (0, 0, 1), place, (0, 1.0, 0.0))
    beside(own, [rail], [ball])  # nothing moves: rows need no times
    if own_times and other_times:
        beside(own, [rail], [ball, Moving(ball, carrier, 1)])
    else:
        with pytest.raises(Rejected, match="rows beside what moves have no times"):
            beside(own, [rail], [ball, Moving(ball, carrier, 1)])


def test_a_branch_rests_before_its_first_knot_and_after_its_last() -> None:
    """At that knot; in between it is on the straight line."""
    branch = Branch(np.array([[2.0, -1.0], [5.0, 0.0], [4.0, 3.0]]), np.arange(1.0, 4))
    for start, end, ends in (
        (0.0, 1.0, [[2.0, -1.0], [2.0, -1.0]]),
        (1.0, 2.0, [[2.0, -1.0], [5.0, 0.0]]),
        (2.25, 2.5, [[4.75, 0.75], [4.5, 1.5]]),
        (3.0, 4.0, [[4.0, 3.0], [4.0, 3.0]]),
        (7.0, 9.0, [[4.0, 3.0], [4.0, 3.0]]),
    ):
        found = branch.between(start, end)
        assert [[*map(float, row.entries())] for row in found] == ends


@pytest.mark.parametrize("parts", [1, 4])
def test_a_rail_that_gains_speed_takes_the_tip_off_its_chord(parts: int) -> None:
    """By (x'' h^2 / 8) of x0 = t^3 over each of the slices of width h."""
    joint = Joint(0, SLIDES, (1, 0, 0), np.eye(4), (0, 1.0, 0.0))
    motion = Interval(Tree([joint]), controls([0, 0, 0, 1]))
    bends: list[float] = []
    drawing: Any = SimpleNamespace(
        point=lambda station: arb_mat([[station], [0], [0]]),
        visit=lambda *_: arb(0),
        local=lambda station: station,
        step=lambda low, high: high - low,
        draw=lambda *taken: bends.append(float(taken[3])),
    )
    rows = SimpleNamespace(
        rows=SimpleNamespace(path_m=np.array([0.0, 1.0]), on_path=np.ones(2, bool)),
        problem=SimpleNamespace(tip_tolerance=1e-9),
        ordered=True, link=1, last=0.0, _look=lambda *_: None, drawing=drawing,
    )  # fmt: skip
    ends = np.arange(parts + 1) / parts
    tips = [arb_mat([[arb(t) ** 3], [0], [0]]) for t in ends.tolist()]
    Rows._draw(rows, (0, 1), motion, tips)  # type: ignore[arg-type]
    assert bends == pytest.approx(6.0 * ends[1:] / (8.0 * parts**2), rel=1e-9)
