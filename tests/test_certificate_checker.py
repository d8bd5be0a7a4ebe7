"""The checker accepts what is proved, over all shapes, and nothing that is not."""

import copy
import io
import json
import runpy
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from flint import arb
from oracles.certificate_cases import (
    CUBE,
    NOTCHED,
    SHAPES,
    Case,
    at_start,
    random_case,
    write_cube,
    write_rows,
)
from oracles.certificate_mutations import (
    changes,
    forged,
    numbers_in,
    other_files,
    raw,
)
from oracles.certificate_oracle import (
    OracleWriter,
    frames_and_centres,
    least,
    nearest,
    sealed,
    sha256,
)

from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.certificate_checker import check_certificate, main, program
from vdsm_pin.certificate_checker.path import Drawing
from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.convex import HalfSpacePiece
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.drawing import check_order
from vdsm_pin.verification.records import Verdict

STRAIGHT = {
    "vdsm_problem": 1,
    "length_unit": "m",
    "manipulator": {
        "link_lengths": [0.4, 0.3, 0.3],
        "link_radius": 0.03,
        "max_link_angle_deg": 60,
        "max_joint_angle_deg": 50,
    },
    "obstacles": [],
    "tip_path": {
        "start": [1, 0, 0],
        "points": [[1, 0, 0], [1.3, 0, 0]],
        "required_coverage": 0,
    },
    "required_clearance": 0.002,
}
NO_ERRORS = (0.0, 0.0, 0.0)


def judge(case: Case, content: bytes | None = None) -> Any:
    if content is not None:
        case.certificate.write_bytes(content)
    return check_certificate(case.certificate, case.problem, case.trajectory)


def refused(case: Case, content: bytes | None = None) -> str:
    """Why a certificate is not accepted."""
    try:
        outcome = judge(case, content)
    except InvalidFile as error:
        return str(error)
    assert not outcome.accepted
    assert outcome.reason
    return str(outcome.reason)


def straight_rows(x0: Any) -> Any:
    return np.column_stack([x0, np.zeros((len(x0), 6))])


def with_obstacles(*obstacles: Any) -> Any:
    return STRAIGHT | {"obstacles": list(obstacles)}


# ---- good certificates ---------------------------------------------------------------


@pytest.mark.parametrize("shape", SHAPES)
def test_every_shape_is_accepted(shape: str, tmp_path: Path) -> None:
    case = random_case(np.random.default_rng(SHAPES.index(shape)), tmp_path, [shape])
    outcome = judge(case)
    assert outcome.accepted, outcome.reason
    planes = sum(
        len(entry[2])
        for line in case.lines[1:]
        for proof in line["proofs"]
        for entry in proof
    )
    assert outcome.n_claims == planes
    assert outcome.n_intervals == len(case.lines) - 1


@pytest.mark.parametrize("seed", range(8))
def test_random_arms_and_scenes_are_accepted(seed: int, tmp_path: Path) -> None:
    outcome = judge(random_case(np.random.default_rng(100 + seed), tmp_path))
    assert outcome.accepted, outcome.reason


def test_slices_and_pieces_are_accepted(tmp_path: Path) -> None:
    """A link that dips into the notch of a prism needs its triangles one by one."""
    corners = [[-0.3, -0.3], [0.3, -0.3], [0.3, 0.2], [0.1, 0.2], [0.1, -0.1]]
    corners += [[-0.1, -0.1], [-0.1, 0.2], [-0.3, 0.2]]
    bar = {"name": "bar", "shape": "prism", "axis": "x", "polygon": corners}
    data = with_obstacles(bar | {"from": 0.5, "to": 2.0})
    q = straight_rows([0.0, 0.5])
    case = Case(tmp_path, data, q, NO_ERRORS)
    assert case.lines[0]["pieces"]["bar"]
    assert judge(case).accepted
    planes = case.lines[1]["proofs"][2][0][2]
    assert len(planes) > 1
    assert "the pieces end" in refused(
        case, sealed(edited(case, lambda ls: planes_of(ls).pop()))
    )


@pytest.mark.parametrize("damage", ["turned", "gone", "another", "no number"])
def test_pieces_that_do_not_cover_a_prism_are_rejected(
    damage: str, tmp_path: Path
) -> None:
    bar = {"name": "bar", "shape": "prism", "axis": "x", "polygon": NOTCHED}
    data = with_obstacles(bar | {"from": 3.0, "to": 4.0})
    case = Case(tmp_path, data, straight_rows([0.0, 0.1]), NO_ERRORS)
    assert judge(case).accepted

    def change(lines: Any) -> None:
        loops = lines[0]["pieces"]["bar"]
        if damage == "turned":
            loops[0] = loops[0][::-1]
        elif damage == "gone":
            loops.pop()
        elif damage == "another":
            loops[0] = [0, 1, 2] if sorted(loops[0]) != [0, 1, 2] else [0, 1, 3]
        else:
            loops[0] = ["a", "b", "c"]

    reason = refused(case, sealed(edited(case, change)))
    assert "make up the whole" in reason or "invalid literal" in reason


def test_a_half_space_is_known_by_any_of_its_points(tmp_path: Path) -> None:
    """The foot of the plane counts, not where the file has its point."""
    floor = {"name": "floor", "shape": "half_space", "normal": [0, 0, 1]}
    data = with_obstacles(floor | {"point": [3e7, -2e7, -0.2]})
    assert judge(Case(tmp_path, data, straight_rows([0, 0.1]), NO_ERRORS)).accepted


def planes_of(lines: Any) -> Any:
    return lines[1]["proofs"][2][0][2]


def edited(case: Case, change: Any) -> Any:
    lines = json.loads(json.dumps(case.lines))
    change(lines)
    return lines


def test_a_row_that_stands_still_is_accepted(tmp_path: Path) -> None:
    ball = {"name": "ball", "shape": "sphere", "center": [0.5, 0.5, 0], "radius": 0.2}
    case = Case(tmp_path, with_obstacles(ball), straight_rows([0.0]), NO_ERRORS)
    outcome = judge(case)
    assert outcome.accepted, outcome.reason
    assert outcome.n_intervals == 1


@pytest.mark.parametrize("past_the_seam", [True, False])
def test_a_closed_path_is_covered(past_the_seam: bool, tmp_path: Path) -> None:
    """Out and back along x: the path closes, path_m goes on or starts again."""
    points = [[1.0, 0, 0], [1.2, 0, 0], [1.4, 0, 0]]
    path = {"start": [1.3, 0, 0], "points": points, "closed": True}
    x0 = np.array([0.3, 0.4, 0.4, 0.3, 0.1, 0.0, 0.0, 0.1, 0.3])
    station = np.array([0.3, 0.4, 0.4, 0.5, 0.7, 0.8, 0.8, 0.9, 1.1])
    if not past_the_seam:
        station[6:] -= 0.8
    data = STRAIGHT | {"tip_path": path | {"required_coverage": 1.0}}
    case = Case(
        tmp_path,
        data,
        straight_rows(x0),
        NO_ERRORS,
        on_path=np.ones(9),
        path_m=station,
    )
    outcome = judge(case)
    assert outcome.accepted, outcome.reason
    short = {"x0": x0[:-1], "path_m": station[:-1], "on_path": np.ones(8)}
    rows = straight_rows(short.pop("x0"))
    assert "coverage" in refused(Case(tmp_path, data, rows, NO_ERRORS, **short))


def test_too_little_drawn_is_rejected(tmp_path: Path) -> None:
    path = STRAIGHT["tip_path"] | {"required_coverage": 0.5}
    drawn = {"on_path": [1, 1, 0], "path_m": [0.0, 0.1, 0.2]}
    q = straight_rows([0.0, 0.1, 0.2])
    case = Case(tmp_path, STRAIGHT | {"tip_path": path}, q, NO_ERRORS, **drawn)
    assert "coverage" in refused(case)


def test_a_tip_off_the_path_is_rejected(tmp_path: Path) -> None:
    drawn = {"on_path": [1, 1], "path_m": [0.0, 0.1]}
    good = Case(tmp_path, STRAIGHT, straight_rows([0.0, 0.1]), NO_ERRORS, **drawn)
    assert judge(good).accepted
    off = Case(tmp_path, STRAIGHT, straight_rows([0.0, 0.10001]), NO_ERRORS, **drawn)
    assert "off the path" in refused(off)


@pytest.mark.parametrize(("off", "good"), [(0.9e-5, True), (1.1e-5, False)])
def test_the_tip_is_held_to_the_tolerance_of_the_problem(
    off: float, good: bool, tmp_path: Path
) -> None:
    data = STRAIGHT | {"tip_tolerance": 1e-5}
    rows = straight_rows([0.0, 0.1 + off])
    drawn = {"on_path": [1, 1], "path_m": [0.0, 0.1]}
    case = Case(tmp_path, data, rows, NO_ERRORS, **drawn)
    if good:
        assert judge(case).accepted
    else:
        assert "off the path" in refused(case)


def test_a_fixed_base_is_certified_where_it_stands(tmp_path: Path) -> None:
    arm = STRAIGHT["manipulator"] | {"base_range": [0.1, 0.1]}
    data = {key: value for key, value in STRAIGHT.items() if key != "tip_path"}
    data["manipulator"] = arm
    for x0, good in ((0.1, True), (0.1 + 2e-9, False)):
        case = Case(tmp_path, data, straight_rows([x0, x0]), NO_ERRORS)
        if good:
            assert judge(case).accepted
        else:
            assert "x0 is" in refused(case)


def test_a_tip_that_strays_between_rows_is_rejected(tmp_path: Path) -> None:
    """The arm swings out and back to the path, farther than one spacing."""
    q = straight_rows([0.0, 0.1])
    q[0, 1], q[1, 1] = -0.4, 0.4
    tips = [frames_and_centres([0.4, 0.3, 0.3], row)[1][-1].tolist() for row in q]
    path = {"start": {"joints": at_start(0.0, q[0, 1:])}, "points": tips}
    length = float(np.linalg.norm(np.subtract(*tips)))
    drawn = {"on_path": [1, 1], "path_m": [0.0, length]}
    case = Case(tmp_path, STRAIGHT | {"tip_path": path}, q, NO_ERRORS, **drawn)
    assert "the tip strays" in refused(case)


def test_a_motion_that_shall_draw_nothing_is_accepted(tmp_path: Path) -> None:
    data = {key: value for key, value in STRAIGHT.items() if key != "tip_path"}
    assert judge(Case(tmp_path, data, straight_rows([0.0, 0.1]), NO_ERRORS)).accepted


def test_what_is_not_known_is_refused(tmp_path: Path) -> None:
    case = Case(tmp_path, STRAIGHT, straight_rows([0.0, 0.1]), NO_ERRORS)
    more = edited(case, lambda lines: lines[0].update(coverage=1.0))
    assert "has other keys" in refused(case, sealed(more))
    outcome = judge(case)
    assert outcome.n_intervals == outcome.n_claims == 0


@pytest.mark.parametrize(("on_path", "good"), [([0, 1], True), ([0, 0], False)])
def test_one_row_draws_a_path_of_one_point(
    on_path: list[int], good: bool, tmp_path: Path
) -> None:
    path = {"start": [1, 0, 0], "points": [[1.1, 0, 0]]}
    data, q = STRAIGHT | {"tip_path": path}, straight_rows([0.0, 0.1])
    case = Case(tmp_path, data, q, NO_ERRORS, on_path=on_path, path_m=[0.0, 0.0])
    if good:
        assert judge(case).accepted
    else:
        assert "coverage" in refused(case)


def refused_or_not(
    folder: Path, data: Any, x0: list[float], path_m: list[float], on_path: Any = None
) -> str:
    """Why a straight arm that moves along x is rejected; empty where it is not."""
    on = [1] * len(x0) if on_path is None else on_path
    drawn = {"on_path": on, "path_m": path_m}
    outcome = judge(Case(folder, data, straight_rows(x0), NO_ERRORS, **drawn))
    return str(outcome.reason)


def test_a_start_and_a_goal_are_judged(tmp_path: Path) -> None:
    data = {key: value for key, value in STRAIGHT.items() if key != "tip_path"}
    joints = {"x0": 0.2, "alpha_deg": [0, 0, 0], "theta_deg": [0, 0, 0]}
    tip = data | {"start": [1, 0, 0], "goal": {"tip": [1.2, 0, 0]}}
    whole = data | {"start": [1, 0, 0], "goal": {"joints": joints}}
    for asked in (tip, whole):
        assert refused_or_not(tmp_path, asked, [0.0, 0.2], [0.0, 0.0]) == ""
        found = refused_or_not(tmp_path, asked, [2e-6, 0.2], [0.0, 0.0])
        assert "0.002 mm off its start" in found
        found = refused_or_not(tmp_path, asked, [0.0, 0.1, 0.2 + 2e-6], [0.0] * 3)
        assert found.startswith("interval 1: the tip is")
        assert "m off its goal" in found
    bent = joints | {"alpha_deg": [1e-4, -2.5e-4, 0]}  # the tip is hardly elsewhere
    found = refused_or_not(
        tmp_path, data | {"goal": {"joints": bent}}, [0, 0.2], [0, 0]
    )
    assert "off its goal" in found or "off their goal" in found


def test_what_is_drawn_backwards_is_rejected(tmp_path: Path) -> None:
    x0, station = [0.0, 0.1, 0.05, 0.3], [0.0, 0.1, 0.05, 0.3]
    found = refused_or_not(tmp_path, STRAIGHT, x0, station)
    assert found == "interval 1: the path is drawn 50 mm backwards"
    free = STRAIGHT | {"tip_path": STRAIGHT["tip_path"] | {"order": "free"}}
    assert refused_or_not(tmp_path, free, x0, station) == ""
    # Left in between and drawn on behind what is drawn.
    x0, station, on = (
        [0.0, 0.3, 0.3, 0.1, 0.2],
        [0, 0.3, 0.3, 0.1, 0.2],
        [1, 1, 0, 1, 1],
    )
    found = refused_or_not(tmp_path, STRAIGHT, x0, station, on)
    assert found == "interval 2: the path is drawn 200 mm backwards"


def test_a_limit_of_the_change_per_row_is_judged(tmp_path: Path) -> None:
    data = {key: value for key, value in STRAIGHT.items() if key != "tip_path"}
    q = straight_rows([0.0, 0.0])
    q[1, 2] = np.deg2rad(3.0)
    for limit, good in ((None, True), (3.0, True), (2.99, False)):
        asked = data if limit is None else data | {"max_change_per_row_deg": limit}
        case = Case(tmp_path, asked, q, NO_ERRORS)
        if good:
            assert judge(case).accepted
        else:
            assert "a joint turns by 3°" in refused(case)


@pytest.mark.parametrize("closed", [False, True])
def test_the_order_is_judged_as_the_verifier_judges_it(closed: bool) -> None:
    """Random walks along a path, off it and on again: two programs, one verdict."""
    corners = np.array([[0.0, 0, 0], [0.5, 0, 0], [0.5, 0.7, 0], [0, 0.7, 0.1]])
    path = DesiredPath(corners[0], corners, closed)
    arm, rng, verdicts = built_in("hrm8"), np.random.default_rng(5), []
    problem = PlanningProblem(arm, Scene(), path, 0.0, name="walk")
    for _ in range(400):
        n = int(rng.integers(2, 9))
        steps = rng.choice([0.05, 0.3, 0.6, -4e-7, -5e-6, -0.1], n,
                           p=[0.4, 0.3, 0.1, 0.1, 0.05, 0.05])  # fmt: skip
        stations = np.maximum(rng.uniform(0, 2) + np.cumsum(steps), 0.0)
        if closed and rng.random() < 0.5:
            stations = np.mod(stations, path.length)
        on = rng.random(n) < 0.8
        joints = np.zeros(n), np.zeros((n, 8)), np.zeros((n, 8))
        motion = Trajectory(on, stations, *joints)
        (row,) = check_order(problem, motion)
        if not on.any():
            continue
        drawing, good, same = Drawing(path), True, arb(problem.tip_tolerance)
        for k in np.flatnonzero(on):
            joined = k > 0 and bool(on[k - 1])
            good &= bool(drawing.visit(arb(stations[k]), joined, same) >= -same - 1e-9)
        past = drawing.farthest - drawing.length - same
        good &= bool(past <= 1e-9) or not (closed and drawing.left)
        assert good == (row.verdict is Verdict.CERTIFIED), (stations, on, row)
        verdicts.append(good)
    assert 0.1 < np.mean(verdicts) < 0.9


@pytest.mark.parametrize("damage", ["hash", "key", "unended", "more", "end"])
def test_the_last_line_seals_all_that_is_before_it(damage: str, tmp_path: Path) -> None:
    """Whatever is written in its place, the rest of the file being as it was."""
    case = Case(tmp_path, STRAIGHT, straight_rows([0.0, 0.0]), NO_ERRORS)
    content = case.certificate.read_bytes()
    assert judge(case).accepted
    *body, last = content.splitlines(keepends=True)
    end = json.loads(last)
    other = {
        "hash": json.dumps(end | {"sha256": sha256(b"")}).encode() + b"\n",
        "key": json.dumps(end | {"more": 1}).encode() + b"\n",
        "unended": last.rstrip(b"\n"),
        "more": last + body[-1],
        "end": json.dumps(end | {"end": False}).encode() + b"\n",
    }[damage]
    assert "the last line does not fit" in refused(case, b"".join([*body, other]))


def test_what_joins_the_rows_is_known_by_name(tmp_path: Path) -> None:
    case = Case(tmp_path, STRAIGHT, straight_rows([0.0, 0.0]), NO_ERRORS)
    lines = edited(case, lambda found: found[0].update(interpolation="septic"))
    assert "interpolation is septic, expected one of" in refused(case, sealed(lines))


# ---- meshes and their inside ---------------------------------------------------------


def cube_around(tmp_path: Path, name: str, **mesh: Any) -> Case:
    obstacle = {"name": "shell", "shape": "mesh", "file": name, "check_size": False}
    return Case(
        tmp_path, with_obstacles(obstacle | mesh), straight_rows([0, 0.1]), NO_ERRORS
    )


@pytest.mark.parametrize("name", ["c.stl", "c.obj"])
@pytest.mark.parametrize("rpy", [[0, 0, 0], [0, 45, 0], [30, 20, 10]])
def test_an_arm_inside_a_closed_mesh_is_rejected(
    name: str, rpy: list[float], tmp_path: Path
) -> None:
    write_cube(tmp_path / name, 4.0)
    assert "outside" in refused(cube_around(tmp_path, name, rpy_deg=rpy))


def test_an_arm_beside_a_closed_mesh_is_accepted(tmp_path: Path) -> None:
    write_cube(tmp_path / "c.stl", 0.5)
    assert judge(cube_around(tmp_path, "c.stl", center=[-1, 0, 0])).accepted


def test_an_arm_inside_two_cubes_of_one_mesh_is_rejected(tmp_path: Path) -> None:
    """Where bodies overlap the number of crossings is even, yet it is an inside."""
    write_cube(tmp_path / "c.stl", 4.0)
    write_cube(tmp_path / "d.stl", 5.0)
    one, two = ((tmp_path / n).read_bytes() for n in ("c.stl", "d.stl"))
    both = bytes(80) + (24).to_bytes(4, "little") + one[84:] + two[84:]
    (tmp_path / "c.stl").write_bytes(both)
    assert "outside" in refused(cube_around(tmp_path, "c.stl"))


def test_a_mesh_with_a_hole_is_accepted_as_a_surface_alone(tmp_path: Path) -> None:
    write_cube(tmp_path / "c.stl", 4.0, skip=1)
    assert "not closed" in refused(cube_around(tmp_path, "c.stl"))
    outcome = judge(cube_around(tmp_path, "c.stl", solid=False))
    assert outcome.accepted
    assert "shell is a surface only" in outcome.notes


def test_pieces_of_a_mesh_are_a_permutation(tmp_path: Path) -> None:
    write_cube(tmp_path / "c.stl", 0.2)
    case = cube_around(tmp_path, "c.stl", center=[0.5, 0, 0.4])
    order = list(range(12))[::-1]

    def reverse(lines: Any) -> None:
        lines[0]["pieces"]["shell"] = order
        for line in lines[1:]:
            for proof in line["proofs"][:3]:
                for entry in proof:
                    flipped = [[12 - p[1], 12 - p[0], *p[2:]] for p in entry[2]]
                    entry[2][:] = flipped[::-1]

    assert judge(case, sealed(edited(case, reverse))).accepted
    order[-2:] = [True, False]  # numbers still, not a mask
    assert judge(case, sealed(edited(case, reverse))).accepted
    order[0] = 3
    assert "pieces of shell" in refused(case, sealed(edited(case, reverse)))


# ---- wrong files ---------------------------------------------------------------------


def rehashed(case: Case) -> bytes:
    """The certificate with the hashes of the files as they are now."""

    def change(lines: Any) -> None:
        lines[0]["problem_sha256"] = sha256(case.problem.read_bytes())
        lines[0]["trajectory_sha256"] = sha256(case.trajectory.read_bytes())

    return sealed(edited(case, change))


@pytest.mark.parametrize(
    "kind", ["radius", "unit", "moved", "gone", "clearance", "arm"]
)
def test_another_problem_is_rejected(kind: str, tmp_path: Path) -> None:
    case = random_case(np.random.default_rng(5), tmp_path, ["sphere", "capsule"])
    data = json.loads(json.dumps(case.data))
    if kind == "radius":
        data["obstacles"][0]["radius"] *= 1.0 + 1e-6
    elif kind == "unit":
        data["length_unit"] = "mm" if data["length_unit"] == "m" else "m"
    elif kind == "moved":
        data["obstacles"][1]["center"][1] *= 1.0 - 1e-6
    elif kind == "gone":
        del data["obstacles"][1]
    elif kind == "clearance":
        proofs = case.lines[1]["proofs"]
        pairs = zip(case.lines[0]["pairs"], proofs, strict=True)
        claims = [p[2][0][5] for names, p in pairs if names[1][:4] != "link" for p in p]
        scale = 1e3 if data["length_unit"] == "mm" else 1.0
        data["required_clearance"] = scale * max(claims)
        data["required_clearance"] += 1e-6
    else:
        data["manipulator"]["link_radius"] *= 1.0 + 1e-6
    case.problem.write_text(json.dumps(data))
    assert "problem" in refused(case)
    assert "another problem" not in refused(case, rehashed(case))


def test_another_trajectory_is_rejected(tmp_path: Path) -> None:
    case = random_case(np.random.default_rng(6), tmp_path, ["box"])
    q = case.writer.q[: case.writer.trajectory.n_samples].copy()
    reasons = []
    for change in (1e-6, -1e-6):  # one of them brings some link nearer
        q[-1, 2] += change
        write_rows(case.trajectory, q)
        assert "another trajectory" in refused(case)
        reasons.append(judge(case, rehashed(case)).reason)
        q[-1, 2] -= change
    assert any("claims" in reason for reason in reasons)


def test_a_limit_that_is_passed_is_rejected(tmp_path: Path) -> None:
    q = straight_rows([0.0, 0.0])
    q[1, 1] = np.deg2rad(50.0) + 1e-8
    assert "alpha1" in refused(Case(tmp_path, STRAIGHT, q, NO_ERRORS))
    q[1, 1:3] = np.deg2rad(45.1)
    assert "psi1" in refused(Case(tmp_path, STRAIGHT, q, NO_ERRORS))
    q[1] = [2.1, 0, 0, 0, 0, 0, 0]
    assert "x0 is 2100" in refused(Case(tmp_path, STRAIGHT, q, NO_ERRORS))


@pytest.mark.parametrize("version", [8, 10, "9", None])
def test_a_certificate_of_another_version_is_refused_by_name(
    version: Any, tmp_path: Path
) -> None:
    case = Case(tmp_path, STRAIGHT, straight_rows([0.0, 0.0]), NO_ERRORS)
    assert judge(case).accepted
    lines = edited(case, lambda found: found[0].update(vdsm_certificate=version))
    told = f"is of version {version}, as vdsm-pin"
    assert told in refused(case, sealed(lines))


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\n",
        b"[]\n",
        b"{}\n",
        b"{",
        b"\xff\xfe\n",
        b'{"a": 1, "a": 2}\n',
        b"[" * 9999,
    ],
)
def test_damaged_certificates_end_in_one_line(
    content: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = Case(tmp_path, STRAIGHT, straight_rows([0.0, 0.1]), NO_ERRORS)
    case.certificate.write_bytes(content)
    files = [str(x) for x in (case.certificate, case.problem, case.trajectory)]
    assert main(files) in (1, 2)
    output = capsys.readouterr()
    assert len((output.out + output.err).splitlines()) == 1


@pytest.mark.parametrize("damaged", ["problem", "trajectory"])
@pytest.mark.parametrize(
    "content",
    ["", "[", "a: *b", "a: 1\na: 2", "x,y\n1,2\n", "!!python/none", "\0", "[" * 9999],
)
def test_damaged_inputs_end_in_one_line(
    damaged: str, content: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = Case(tmp_path, STRAIGHT, straight_rows([0.0, 0.1]), NO_ERRORS)
    getattr(case, damaged).write_text(content)
    files = [str(x) for x in (case.certificate, case.problem, case.trajectory)]
    assert main(files) in (1, 2)
    output = capsys.readouterr()
    assert len((output.out + output.err).splitlines()) == 1


def test_exit_status(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case = Case(tmp_path, STRAIGHT, straight_rows([0.0, 0.1]), NO_ERRORS)
    files = [str(x) for x in (case.certificate, case.problem, case.trajectory)]
    assert main(files) == 0
    assert capsys.readouterr().out.startswith("accepted")
    assert main([*files[:2], str(tmp_path / "none.csv")]) == 2
    assert "none.csv" in capsys.readouterr().err
    assert main(files[:2]) == 2
    assert main([*files[:2], str(tmp_path)]) == 2
    assert f"{tmp_path}: is a folder, expected a file" in capsys.readouterr().err


def test_a_trajectory_that_changes_while_it_is_checked_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is read by name more than once: what is judged is what the hash is of."""
    case = Case(tmp_path, STRAIGHT, straight_rows([0.0, 0.1]), NO_ERRORS)

    def read(*given: Any) -> Any:
        found = program_arm(*given)
        case.trajectory.write_text(case.trajectory.read_text() + "\n")
        return found

    program_arm = program.Arm
    monkeypatch.setattr(program, "Arm", read)
    with pytest.raises(InvalidFile, match="changed while it was worked on"):
        judge(case)


def test_a_terminal_that_cannot_write_a_name_is_told_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = Case(tmp_path, STRAIGHT, straight_rows([0.0, 0.1]), NO_ERRORS)
    files = [str(x) for x in (case.certificate, case.problem, case.trajectory)]
    streams = [io.TextIOWrapper(io.BytesIO(), encoding="ascii") for _ in "12"]
    for name, stream in zip(("stdout", "stderr"), streams, strict=True):
        monkeypatch.setattr(sys, name, stream)
    assert main([*files[:2], str(tmp_path / "\xe5.csv")]) == 2
    streams[1].seek(0)
    assert "/\\xe5.csv: does not exist" in streams[1].read()


@pytest.mark.parametrize(("more", "status"), [([], 0), (["one"], 2)])
def test_the_module_runs_as_a_program(
    more: list[str], status: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = Case(tmp_path, STRAIGHT, straight_rows([0.0, 0.1]), NO_ERRORS)
    files = [str(x) for x in (case.certificate, case.problem, case.trajectory)]
    monkeypatch.setattr(sys, "argv", ["checker", *files, *more])
    with pytest.raises(SystemExit) as ended:
        runpy.run_module("vdsm_pin.certificate_checker", run_name="__main__")
    assert ended.value.code == status


@pytest.mark.parametrize("said", ["", "Unable to allocate 2 GiB"])
def test_memory_that_runs_out_is_one_sentence(
    said: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def full(*_: object, **__: object) -> None:
        raise MemoryError(said)

    case = Case(tmp_path, STRAIGHT, straight_rows([0.0, 0.1]), NO_ERRORS)
    monkeypatch.setattr(program.json, "loads", full)
    files = [str(x) for x in (case.certificate, case.problem, case.trajectory)]
    assert main(files) == 2
    told = f"there is too little memory; {said}".rstrip("; ")
    assert capsys.readouterr().err == f"vdsm: {told}\n"


# ---- mutations -----------------------------------------------------------------------

STATED = 1e-9
"""How far a half-space's direction may be off (docs/certificate.md)."""


def assert_still_true(
    case: Case, lines: Any, rng: np.random.Generator, *, every: bool = False
) -> None:
    """A certificate accepted after a change claims nothing but what is true.

    The clearances are proved again by the writer's own formulas, and held against
    samples.
    """
    every |= lines[0]["pieces"] != case.lines[0]["pieces"]
    if lines[0]["errors"] != case.lines[0]["errors"]:  # proved for those as well
        box = lines[0]["errors"]
        off = np.array([box["base"], *box["obstacles"].values()])
        assert (off[:, 1] <= 1e-8).all()  # what rounding of claims leaves
        errors = box["joints_rad"], off[0, 0], off[1:, 0].max(initial=0.0)
        case, every = beside(case, errors), True
    for number, (old, new) in enumerate(zip(case.lines, lines, strict=True)):
        places = changes(old, new)
        assert places is not None, "another structure"
        for where in places if number == 0 else ():
            assert where[0] in ("errors", "pieces"), where
        if number and every:
            places = [p for p in numbers_in(new) if len(p) == 6]
        for where in places if number else ():
            kind, pair, at, two, plane, entry = where
            assert (kind, two) == ("proofs", 2)
            assert every or entry in (2, 3, 4, 5), where
            assert_proved(case, lines, number, pair, at, plane)
    assert_samples_hold(case, lines, rng)


def pieces_of(case: Case, lines: Any, obstacle: Any) -> Any:
    """An obstacle's pieces in the order of the certificate."""
    name = obstacle.name
    old, new = (header["pieces"].get(name, []) for header in (case.lines[0], lines[0]))
    corners = [sorted(loop) for loop in old]
    assert sorted(corners) == sorted(sorted(loop) for loop in new), "other pieces"
    order = [corners.index(sorted(loop)) for loop in new]
    return [obstacle.pieces[k] for k in order] if order else obstacle.pieces


def assert_proved(
    case: Case, lines: Any, number: int, pair: int, at: int, plane: int
) -> None:
    """One plane proves what it claims, in doubles."""
    writer, line = case.writer, lines[number]
    k = line["k"]
    link, other = writer.partners()[pair]
    a, b, planes = line["proofs"][pair][at]
    first, last, x, y, z, lower = planes[plane]
    n = np.array([x, y, z]) / np.linalg.norm([x, y, z])
    if isinstance(other, int):
        proved = writer.proved_of_link(k, a, b, link, other, n)
    else:
        pieces = pieces_of(case, lines, other)[first:last]
        if isinstance(pieces[0], HalfSpacePiece):
            assert np.abs(n + pieces[0].normal).max() <= STATED
            n = -pieces[0].normal
        proved = writer.proved_of_pieces(k, a, b, link, pieces, n)
    assert proved - lower >= -1e-12


def gap(writer: Any, link: int, pieces: Any, q: Any) -> float:
    """Clearance at one configuration by nearest points: an estimate from above."""
    ends = frames_and_centres(writer.lengths, q)[1][link : link + 2]
    radius = float(writer.arm.link_radius)
    if isinstance(pieces[0], HalfSpacePiece):
        return float((ends @ pieces[0].normal).min() - pieces[0].offset) - radius

    def difference(d: Any) -> Any:
        low = min((least(piece, d) for piece in pieces), key=lambda x: x[0])
        return low[1] - ends[np.argmax(ends @ d)]

    start = least(pieces[0], np.ones(3))[1] - ends[0]
    return float(np.linalg.norm(nearest(difference, start))) - radius


def assert_samples_hold(case: Case, lines: Any, rng: np.random.Generator) -> None:
    """Sampled clearances under sampled errors are nowhere below what is claimed."""
    writer, errors = case.writer, lines[0]["errors"]
    k = int(rng.integers(1, len(lines)))
    line = lines[k]
    for (link, other), proof in zip(writer.partners(), line["proofs"], strict=True):
        for a, b, planes in proof:
            time = rng.choice([a, b, rng.uniform(a, b)])
            q = writer.q[k - 1] + time * (writer.q[k] - writer.q[k - 1])
            joints = np.ravel(errors["joints_rad"])
            q[1:] += joints * rng.choice([-1, 0, 1], joints.size)
            q[0] += errors["base"][0] * rng.choice([-1, 0, 1])
            for first, last, *_, lower in planes:
                if not isinstance(other, int):
                    pieces = pieces_of(case, lines, other)[first:last]
                    near = gap(writer, link, pieces, q)
                    assert lower <= near - errors["obstacles"][other.name][0] + 1e-7


class Counts(NamedTuple):
    """Mutations tried; of the forged ones, how many only changed what is still true."""

    raw: int
    forged: int
    still_true: int
    of_files: int


def run_mutations(folder: Path, seed: int, n_cases: int, n_each: int) -> Counts:
    """Damage certificates at random; every one accepted must still be true."""
    rng, counts = np.random.default_rng(seed), np.zeros(4, int)
    for number in range(n_cases):
        (home := folder / str(number)).mkdir()
        case = random_case(rng, home)
        content = case.certificate.read_bytes()
        for _ in range(n_each):
            damaged, what = raw(content, rng)
            if damaged != content:
                assert refused(case, damaged), what
                counts[0] += 1
            lines, damaged, what = forged(case.lines, rng)
            if lines != case.lines:
                counts[1] += 1
                if accepts(case, damaged):
                    assert_still_true(case, lines, rng)
                    counts[2] += 1
        for _ in range(n_each // 4):
            what = with_other_files(case, rng)
            assert not accepts(case, content), what
            if accepts(case, rehashed(case)):
                assert what.startswith(("a row", "more clearance")), what
                assert_still_true(beside(case), case.lines, rng, every=True)
            counts[3] += 1
    return Counts(*map(int, counts))


def accepts(case: Case, content: bytes) -> bool:
    try:
        return bool(judge(case, content).accepted)
    except InvalidFile:
        return False


def with_other_files(case: Case, rng: np.random.Generator) -> str:
    """Put another problem or trajectory in the place of a case's own."""
    rows = case.writer.q[: case.writer.trajectory.n_samples]
    data, rows, what = other_files(case.data, rows, rng)
    case.problem.write_text(json.dumps(data))
    write_rows(case.trajectory, rows)
    return what


def beside(case: Case, errors: Any = None) -> Case:
    """A case as its writer sees its files now, or under other errors."""
    changed = copy.copy(case)
    errors = case.writer.errors if errors is None else errors
    changed.writer = OracleWriter(case.problem, case.trajectory, errors)
    return changed


def test_mutations_are_rejected(tmp_path: Path) -> None:
    counts = run_mutations(tmp_path, 1, 7, 20)
    assert counts.raw > 100
    assert counts.forged > 100
    assert counts.of_files == 35
    assert counts.still_true < 0.1 * counts.forged


@pytest.mark.slow
def test_many_mutations_are_rejected(tmp_path: Path) -> None:
    counts = run_mutations(tmp_path, 2, 80, 140)
    print(counts)  # noqa: T201  (shown by pytest -s)
    assert counts.raw > 10_000
    assert counts.forged > 10_000
    assert counts.of_files > 2_500
    assert counts.still_true < 0.1 * counts.forged


def test_cube_corners_are_those_of_the_faces() -> None:
    assert len(set(CUBE)) == 8
