"""Bad problem files: one sentence with file, field, line, value and expectation."""

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from problem_texts import EVERYTHING, TETRAHEDRON, binary_stl, edited

from vdsm_pin.cli import main
from vdsm_pin.errors import InvalidFile
from vdsm_pin.io import problem_file, source, yaml_reader
from vdsm_pin.io.problem_file import built_in_text, read_problem
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.robots.cell import read_cell

OBS1 = built_in_text("paper/obs1")
PILLAR = {
    "name": "pillar",
    "shape": "cylinder",
    "axis": "x",
    "center": [1563, 700, 600],
    "radius": 200,
    "length": 9000,
}
BAR = {"name": "bar", "shape": "prism", "axis": "x", "from": 0, "to": 10}
ARM = {
    "link_lengths": [500, 500, 500, 500, 500, 500],
    "link_radius": 60,
    "max_link_angle_deg": 40,
    "max_joint_angle_deg": 40,
}
BALL = {"name": "b", "shape": "sphere", "radius": 9, "link": 1, "center": [0, 0, 0]}
STRAIGHT = {"x0": 0, "alpha_deg": [0] * 8, "theta_deg": [0] * 8}
NAN, INF = float("nan"), float("inf")


def refusal(path: Path) -> str:
    """What reading the file says; names the file once and fits on one line."""
    with pytest.raises(InvalidFile) as caught:
        read_problem(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    assert len(message) - len(str(path)) < 400
    return message.removeprefix(f"{path}: ")


def refused_text(folder: Path, text: str | bytes) -> str:
    path = folder / "p.yaml"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return refusal(path)


ONE_VALUE: list[tuple[tuple[Any, ...], Any, str]] = [
    (("length_unit",), ..., "length_unit (line 1): is missing; expected: Unit of"),
    (("length_unit",), "cm", "length_unit (line 3): is 'cm', expected 'mm' or 'm'"),
    (("length_unit",), 1, "length_unit (line 3): is 1, expected 'mm' or 'm'"),
    (("vdsm_problem",), 2, "vdsm_problem (line 1): is 2, expected 1"),
    (("vdsm_problem",), True, "vdsm_problem (line 1): is 'true', expected 1"),
    (("name",), "a\nb", "name (line 2): is 'a\\nb', expected signs that can be seen"),
    (("name",), "\u202eb", "name (line 2): is '\\u202eb', expected signs that can be"),
    (("name",), "=1+2", "name (line 2): is '=1+2', expected signs that can be seen, "),
    *(
        (("errors",), {key: value}, said)
        for key, value, said in (
            (
                "joint_deg",
                [1, -1],
                "errors.joint_deg[1] (line 46): is -1, expected 0 ",
            ),
            (
                "joint_deg",
                "1",
                "is '1', expected a number, one for each joint, or some",
            ),
            ("slide", {"x": -1}, "errors.slide.x (line 45): is -1, expected 0 or more"),
            ("slide", [1], "errors.slide (line 44): is [1], expected a number, or som"),
        )
    ),
    (("colour",), "red", "colour (line 43): is not a known key; known: vdsm_problem"),
    (("manipulator",), "hrm9", "manipulator (line 4): is 'hrm9'; known: hrm8"),
    (
        ("manipulator",),
        8,
        "manipulator (line 4): is 8, expected the name of a built-in",
    ),
    (("obstacles",), None, "obstacles (line 5): is empty, expected a list"),
    (("obstacles",), {}, "obstacles (line 5): is a mapping, expected a list"),
    (("obstacles", 0), 7, "obstacles[0] (line 6): is 7, expected a mapping"),
    (("obstacles", 0, "name"), ..., "obstacles[0].name (line 6): is missing"),
    (("obstacles", 0, "name"), "", "obstacles[0].name (line 6): is '', expected"),
    (("obstacles", 0, "shape"), "cone", "obstacles[0].shape (line 7): is 'cone'"),
    (("obstacles", 0, "shape"), ..., "obstacles[0].shape (line 6): is missing"),
    (("obstacles", 0, "radius"), -200, "obstacles[0].radius (line 13): is -200, expec"),
    (("obstacles", 0, "radius"), 0, "radius (line 13): is 0, expected above 0"),
    (("obstacles", 0, "radius"), NAN, "radius (line 13): is nan, expected a finite"),
    (("obstacles", 0, "radius"), INF, "radius (line 13): is inf, expected a finite"),
    (
        ("obstacles", 0, "radius"),
        "200",
        "radius (line 13): is '200', expected a number",
    ),
    (("obstacles", 0, "radius"), True, "radius (line 13): is true, expected a number"),
    (("obstacles", 0, "radius"), None, "radius (line 13): is empty, expected a number"),
    (
        ("obstacles", 0, "radius"),
        [200],
        "radius (line 13): is [200], expected a number",
    ),
    (("obstacles", 0, "radius"), 1e13, "is 10000000000000.0, expected 1e+12 or less"),
    (("obstacles", 0, "radius"), 1e-321, "is 1e-321, expected 1e-12 or more"),
    (("obstacles", 0, "length"), 9e6, "'pillar' reaches 4.50176e+06 mm from the base"),
    (
        ("obstacles", 0, "center", 1),
        NAN,
        "center[1] (line 11): is nan, expected a finit",
    ),
    (("obstacles", 0, "axis"), "w", "axis (line 8): is 'w', expected 'x', 'y' or 'z'"),
    (("obstacles", 0, "axis"), 3, "axis (line 8): is 3, expected x, y, z or a list"),
    (("obstacles", 0, "axis"), [0, 0, 0], "which has no direction"),
    (("obstacles", 0, "axis"), [1, 0], "axis (line 8): is [1, 0], expected exactly 3"),
    (("obstacles", 0, "name"), "Link 5", "name (line 6): is 'Link 5', which is how li"),
    (("obstacles", 0, "name"), "x" * 101, "xxx..., expected at most 100 characters"),
    (("obstacles", 0, "colour"), 1, "is not a known key; known: name, axis, center"),
    (
        ("obstacles",),
        [PILLAR, PILLAR | {"center": [0, 0, 900]}],
        "obstacles[1].name (line 15): is 'pillar', which obstac",
    ),
    (("tip_tolerance",), 0, "tip_tolerance (line 43): is 0, expected above 0"),
    (("tip_tolerance",), 11, "is 11 mm, expected at most the spacing of the path, 10"),
    (
        ("max_change_per_row_deg",),
        0,
        "max_change_per_row_deg (line 43): is 0, expected",
    ),
    (("tip_path",), 3, "tip_path (line 15): is 3, expected a mapping"),
    (
        ("start",),
        [3126, 0, 0],
        "start (line 43): stands beside tip_path, which has its",
    ),
    (("goal",), {"tip": [3126, 0, 0]}, "goal (line 43): stands beside tip_path, which"),
    (("tip_path", "points"), [], "tip_path.points (line 20): is [], expected at least"),
    (("tip_path", "points"), ..., "tip_path.points (line 15): is missing"),
    (
        ("tip_path", "points", 1),
        [1, 2],
        "points[1] (line 24): is [1, 2], expected exactly 3",
    ),
    (("tip_path", "points", 1, 2), "a", "points[1][2] (line 26): is 'a', expected a n"),
    (("tip_path", "points", 1, 2), 2e5, "points[1] (line 24): lies 200027 mm from the"),
    (("tip_path", "spacing"), 0, "tip_path.spacing (line 37): is 0, expected above 0"),
    (
        ("tip_path", "spacing"),
        0.001,
        "cuts 6200 mm of path into more than 5000000 rows",
    ),
    (("tip_path", "spacing"), 1e-300, "is 1e-300, expected 1e-12 or more"),
    (("tip_path", "spacing"), 1e-9, "more than 5000000 rows"),
    (("tip_path", "retreat"), -1, "retreat (line 39): is -1, expected 0 or more"),
    (("tip_path", "approach"), "no", "expected 'shortest', 'equidistant' or 'nearest_"),
    (("tip_path", "blocked"), True, "blocked (line 40): is true, expected 'detour' or"),
    (
        ("tip_path", "closed"),
        "yes",
        "closed (line 36): is 'yes', expected true or fals",
    ),
    (("tip_path", "required_coverage"), 1.5, "is 1.5, expected 1 or less"),
    (("tip_path", "order"), "any", "is 'any', expected 'as_given' or 'free'"),
    (("required_clearance",), -1, "required_clearance (line 42): is -1, expected 0 or"),
    (("required_clearance",), ..., "required_clearance (line 1): is missing"),
    (("base",), {"rpy": [0, 0, 0]}, "base.rpy (line 44): is not a known key; known: p"),
    (("tip_path", "start"), 3126, "is 3126, expected 3 numbers or a mapping with joi"),
    (
        ("tip_path", "start"),
        {"joints": STRAIGHT, "tip": [0, 0, 0]},
        "tip_path.start.tip (line 37): is not a known key; known: joints",
    ),
    (
        ("manipulator",),
        {"urdf": "a.urdf"},
        "manipulator.max_link_angle_deg (line 4): is missing; expected: Largest link",
    ),
    (
        ("manipulator",),
        {"urdf": "a.urdf", "max_link_angle_deg": 40, "tool": {}},
        "manipulator.tool (line 7): is not a known key; known: urdf, max_link_angle_",
    ),
    (
        ("tip_path", "start"),
        [3126, 4000, 0],
        "lies 4000 mm from the rail, the arm is 3",
    ),
    (("tip_path", "start"), [3126, 2200, 0], "needs a link angle psi of 44.73°"),
    (("tip_path", "start"), [9126, 0, 0], "base of the straight arm at x0 = 6000 mm"),
    (("tip_path", "start"), {"joints": STRAIGHT | {"x0": 5001}}, "joints.x0 (line 18)"),
    (
        ("tip_path", "start"),
        {"joints": STRAIGHT | {"alpha_deg": [0] * 7}},
        "joints.alpha_deg (line 19): has 7 values, expected 8, one per joint",
    ),
    (
        ("tip_path", "start"),
        {"joints": STRAIGHT | {"theta_deg": [0] * 7 + [43]}},
        "theta_deg[7] (line 36): is 43°, the joint's limit is 42.5°",
    ),
    (
        ("tip_path", "start"),
        {
            "joints": STRAIGHT
            | {"alpha_deg": [0, 0, 40] + [0] * 5, "theta_deg": [40] * 8}
        },
        "joints (line 17): has a link angle psi of 54.07° at joint 3, the limit",
    ),
    (("manipulator",), ARM | {"link_lengths": [500]}, "expected at least 2 entries"),
    (
        ("manipulator",),
        ARM | {"bodies": [BALL | {"link": 7}]},
        "manipulator.bodies[0].link (line 19): is 7, expected 1 to 6",
    ),
    (
        ("manipulator",),
        ARM | {"bodies": [BALL | {"name": "tool"}]},
        "bodies[0].name (line 16): is 'tool', which the arm's own is called",
    ),
    (
        ("errors",),
        {"obstacles": [{"name": "wall", "shift": 1}]},
        "errors.obstacles[0].name (line 45): is 'wall', expected one of pillar",
    ),
    (("manipulator",), ARM | {"link_lengths": [9] * 41}, "expected at most 40 entries"),
    (
        ("manipulator",),
        ARM | {"link_lengths": [500, 0]},
        "link_lengths[1] (line 7): is",
    ),
    (("manipulator",), ARM | {"max_link_angle_deg": 90}, "is 90, expected below 90"),
    (
        ("manipulator",),
        ARM | {"base_range": [5, -5]},
        "is [5.0, -5.0], expected the sm",
    ),
    (
        ("manipulator",),
        ARM | {"base_range": [-98000, 0]},
        "manipulator (line 4): is an arm of 3000 mm on a rail that goes 98000 mm out",
    ),
    (
        ("manipulator",),
        ARM | {"link_lengths": [500, 120, 500]},
        "link_lengths[1] (line 7): is 120 mm, expected above 120 mm",
    ),
    (
        ("manipulator",),
        ARM | {"cables": {"hole_radius": 60, "half_gap": 10}},
        "cables.hole_radius (line 16): is 60, expected below the body radius 60",
    ),
    (
        ("manipulator",),
        ARM | {"cables": {"hole_radius": 50, "half_gap": 250}},
        "cables.half_gap (line 17): is 250, expected below half the shortest link 500",
    ),
    (
        ("manipulator",),
        ARM
        | {"cables": {"hole_radius": 5, "half_gap": 5, "hole_angles_deg": [[0, 1, 2]]}},
        "hole_angles_deg (line 18): has 1 rows, expected 6, one per link",
    ),
    (
        ("obstacles",),
        [BAR | {"polygon": [[0, 0], [10, 10], [10, 0], [0, 10]]}],
        "polygon (line 11): crosses or touches itself (Self-intersection[5 5])",
    ),
    (
        ("obstacles",),
        [BAR | {"polygon": [[0, 0], [10, 10], [5, 5]]}],
        "obstacles[0].polygon (line 11): encloses no area",
    ),
    (
        ("obstacles",),
        [BAR | {"polygon": [[0, 0], [10, 10]]}],
        "expected at least 3 entries",
    ),
    (
        ("obstacles",),
        [BAR | {"polygon": [[0, 0], [10, 0], [0, 10]], "to": -1}],
        "obstacles[0].to (line 10): is -1, expected above from = 0",
    ),
]


@pytest.mark.parametrize(("location", "value", "expected"), ONE_VALUE)
def test_one_wrong_value_is_refused_in_one_sentence(
    tmp_path: Path, location: tuple[Any, ...], value: Any, expected: str
) -> None:
    assert expected in refused_text(tmp_path, edited(OBS1, location, value))


def test_a_wrong_version_is_told_before_all_else(tmp_path: Path) -> None:
    """A file of another version has keys of its own, wherever it says which it is."""
    body = edited(OBS1, ("vdsm_problem",))
    text = f"colour: red\n{body}\nvdsm_problem: 2\n"
    assert refused_text(tmp_path, text).startswith("vdsm_problem (line ")


NO_PATH = edited(OBS1, ("tip_path",))
ENDS: list[tuple[tuple[Any, ...], Any, str]] = [
    (("goal",), {}, "goal (line 16): has neither of tip and joints, expected one"),
    (
        ("goal",),
        {"tip": [3126, 0, 0], "joints": STRAIGHT},
        "goal (line 16): has both of tip and joints, expected one of them",
    ),
    (
        ("goal",),
        {"tip": [0, 3126, 0]},
        "goal.tip (line 17): lies 3126 mm from the rail",
    ),
    (
        ("goal",),
        {"tips": [0, 0, 0]},
        "goal.tips (line 17): is not a known key; known: t",
    ),
    (
        ("goal",),
        {"joints": STRAIGHT | {"x0": 5001}},
        "goal.joints.x0 (line 18): is 5001",
    ),
    (("goal",), [3126, 0, 0], "goal (line 16): is [3126, 0, 0], expected a mapping"),
    (("start",), [3126, 2200, 0], "start (line 16): needs a link angle psi of 44.73"),
    (("start",), {"joints": STRAIGHT | {"x0": -5001}}, "start.joints.x0 (line 18): is"),
]


@pytest.mark.parametrize(("location", "value", "expected"), ENDS)
def test_a_wrong_start_or_goal_without_path_is_refused_in_one_sentence(
    tmp_path: Path, location: tuple[Any, ...], value: Any, expected: str
) -> None:
    assert expected in refused_text(tmp_path, edited(NO_PATH, location, value))


NOT_PLAIN_YAML = [
    (b"", "is empty"),
    (b"\n", "holds no data"),
    (b"# nothing\n", "holds no data"),
    (b"- 1\n", "line 1: is [1], expected a mapping"),
    (b'<?xml version="1.0"?>\n<robot name="a"/>\n', "which may name a URDF"),
    (b"vdsm_problem: 1\nname: \xff\n", "line 2: is not UTF-8 text (byte 0xff)"),
    ("vdsm_problem: 1\n".encode("utf-16"), "line 1: is not UTF-8 text (byte 0xff)"),
    (b"a: \x01\n", "is not YAML: unacceptable character"),
    (b"a:\n\tb: 1\n", "line 2: is not YAML: has a tab, expected spaces"),
    (b"a: [1, 2\n", "is not YAML: did not find expected ',' or ']'"),
    (b"a: 1\n---\nb: 2\n", "line 2: a second document starts here"),
    (b"a: 1\n---\n---\nb: 2\n", "line 3: a second document starts here"),
    (b"a: 1\n---\n~\n", "line 2: a second document starts here"),
    (b"a: 1\n---\n''\n", "line 2: a second document starts here"),
    (b"a: 1\n---\n&b\n", "line 2: a second document starts here"),
    (b"a: 1\n---\n!!null\n", "line 2: a second document starts here"),
    (b"a: 1\nb: 1\na: 2\n", "line 3: the key 'a' appears twice"),
    (b"{a: 1}: 2\n", "line 1: a key is not plain text"),
    (b"a: !!python/object/apply:os.system [date]\n", "line 1: has the tag"),
    (b"a: !!binary R0lG\n", "line 1: has the tag"),
    (b"a: &b 1\nc: *b\n", "line 2: is an alias (*b); write the value out"),
    (b"a: &a [*a]\n", "line 1: is an alias (*a)"),
    (b"<<: {vdsm_problem: 1}\n", "is not a known key"),
    (b"a: " + b"[" * 100_000, "line 1: nests deeper than 32 levels"),
    (b"a: " + b"{b: " * 100_000, "line 1: nests deeper than 32 levels"),
    (b"x: " + b"9" * 5_000 + b"\n", "is not a known key"),
]


def test_a_prism_whose_ends_meet_in_the_frame_of_the_base_is_refused(
    tmp_path: Path,
) -> None:
    sides = {"polygon": [[0, 0], [10, 0], [0, 10]], "from": 1.0}
    bar = BAR | sides | {"to": 1.0 + 2.0**-52}
    text = edited(OBS1, ("obstacles",), [bar])
    (tmp_path / "p.yaml").write_text(text)
    assert len(read_problem(tmp_path / "p.yaml").scene.obstacles) == 1
    text = edited(text, ("base",), {"position": [1e5, 0, 0]})
    said = "obstacles[0].to (line 10): is 1.0000000000000002, too near to from = 1.0"
    assert said in refused_text(tmp_path, text)


def test_what_is_not_stated_of_errors_is_none(tmp_path: Path) -> None:
    for stated, expected in (
        ({}, ErrorBox()),
        ({"joint_deg": 0.5}, ErrorBox(joint=np.deg2rad(0.5))),
        ({"base_deg": 0.5}, ErrorBox(base_turn=np.deg2rad(0.5))),
        ({"base": 2}, ErrorBox(base=0.002)),
        ({"obstacle": 2}, ErrorBox(obstacle=0.002)),
    ):
        (tmp_path / "p.yaml").write_text(edited(OBS1, ("errors",), stated))
        assert read_problem(tmp_path / "p.yaml").errors == expected


@pytest.mark.parametrize("stated", [{"slide": 5}, {"joint_deg": {"elbow": 0.5}}])
def test_errors_that_other_robots_have_are_refused(
    tmp_path: Path, stated: dict[str, object]
) -> None:
    said = "joints of a snake arm are numbered and slide by the base alone"
    assert said in refused_text(tmp_path, edited(OBS1, ("errors",), stated))


@pytest.mark.parametrize("count", [0, 7, 9])
def test_errors_of_joints_are_as_many_as_joints(tmp_path: Path, count: int) -> None:
    text = edited(OBS1, ("errors",), {"joint_deg": [0.1] * count})
    said = f"has {count} values, expected 8: one per joint"
    assert said in refused_text(tmp_path, text)
    (tmp_path / "p.yaml").write_text(text.replace("joint_deg: []", "joint_deg: 0"))
    text = edited(OBS1, ("errors",), {"joint_deg": [0.1] * 8})
    (tmp_path / "p.yaml").write_text(text)
    assert len(read_problem(tmp_path / "p.yaml").errors.joints) == 8


def test_an_obstacle_has_another_name_than_what_a_link_carries(tmp_path: Path) -> None:
    arm = ARM | {"bodies": [BALL]}
    for name, good in (("b", False), ("b part 1", False), ("c part 1", True)):
        text = edited(OBS1, ("obstacles",), [PILLAR | {"name": name}])
        text = edited(text, ("manipulator",), arm)
        if good:
            (tmp_path / "p.yaml").write_text(text)
            assert read_problem(tmp_path / "p.yaml").scene.names == (name,)
        else:
            said = f"is {name!r}, which a body of the arm is called"
            assert said in refused_text(tmp_path, text)


def test_what_is_told_to_be_solid_is_closed(tmp_path: Path) -> None:
    for corners, solid, good in (
        (TETRAHEDRON, True, True),
        (TETRAHEDRON[1:], True, False),
        (TETRAHEDRON[1:], False, True),
    ):
        path = mesh_problem(tmp_path, binary_stl(corners), solid=solid, scale=500.0)
        if good:
            (mesh,) = read_problem(path).scene.obstacles
            assert getattr(mesh, "solid") is solid  # noqa: B009
        else:
            assert ".solid (line 9): is true, but 'part.stl' " in refusal(path)


def test_a_half_space_has_no_middle_that_an_error_could_turn_it_about(
    tmp_path: Path,
) -> None:
    wall = {"shape": "half_space", "point": [0, -9000, 0], "normal": [0, 1, 0]}
    text = edited(OBS1, ("obstacles",), [{"name": "wall", **wall}])
    for turn, said in ((0, None), (1, "errors.obstacles[0].turn_deg (line 48): is of")):
        errors = {"obstacles": [{"name": "wall", "shift": 1, "turn_deg": turn}]}
        changed = edited(text, ("errors",), errors)
        if said is None:
            (tmp_path / "p.yaml").write_text(changed)
            assert read_problem(tmp_path / "p.yaml").errors.obstacles
        else:
            assert said in refused_text(tmp_path, changed)


@pytest.mark.parametrize(("content", "expected"), NOT_PLAIN_YAML)
def test_what_is_not_one_plain_document_is_refused(
    tmp_path: Path, content: bytes, expected: str
) -> None:
    assert expected in refused_text(tmp_path, content)


def test_laughter_does_not_multiply(tmp_path: Path) -> None:
    lines = ["a0: &a0 [lol, lol]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 12)]
    assert "is an alias (*a0)" in refused_text(tmp_path, "\n".join(lines))


def test_values_without_end_are_not_read_to_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(yaml_reader, "MAX_VALUES", 1000)
    message = refused_text(tmp_path, b"a:\n" + b"- 1\n" * 1001)
    assert message == "line 998: holds more than 1000 values"


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    assert refusal(tmp_path).startswith("is a folder, expected a file")
    assert refusal(tmp_path / "none.yaml").startswith("does not exist; built-in prob")
    with pytest.raises(InvalidFile, match=r"^a{2000}\.\.\.a+: .*File name too long"):
        read_problem("a" * 5000)
    os.mkfifo(tmp_path / "pipe")
    assert refusal(tmp_path / "pipe").startswith("is not a regular file")


def test_a_file_of_any_size_does_not_fill_the_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(problem_file, "MAX_PROBLEM_BYTES", 1000)
    assert "is larger than" in refused_text(tmp_path, b"#" * 1001)
    huge = tmp_path / "huge.yaml"
    with huge.open("wb") as stream:
        stream.truncate(1 << 40)  # sparse: takes no room on the disk
    assert "is larger than" in refusal(huge)
    with pytest.raises(InvalidFile, match="is larger than"):
        source.read_bytes(huge, limit=10)


def mesh_problem(folder: Path, mesh: bytes | None, **fields: Any) -> Path:
    part = {"name": "part", "shape": "mesh", "file": "part.stl"} | fields
    if mesh is not None:
        (folder / "part.stl").write_bytes(mesh)
    path = folder / "p.yaml"
    path.write_text(edited(OBS1, ("obstacles",), [part]))
    return path


def test_missing_and_damaged_meshes_name_file_and_field(tmp_path: Path) -> None:
    message = refusal(mesh_problem(tmp_path, None))
    assert message == "obstacles[0].file (line 8): 'part.stl': does not exist"
    good = binary_stl(TETRAHEDRON)
    message = refusal(mesh_problem(tmp_path, good[:-1]))
    assert "'part.stl': is damaged: its header promises 4 triangles" in message
    message = refusal(mesh_problem(tmp_path, good, file="."))
    assert "'.': has no ending, expected .stl, .obj, " in message


@pytest.mark.parametrize(("unit", "size"), [("mm", 500.0), ("m", 0.5)])
@pytest.mark.parametrize(("off", "suggested"), [(1e3, "0.001"), (1e-3, "1000")])
def test_a_mesh_in_the_wrong_unit_is_refused_with_the_right_scale(
    tmp_path: Path, unit: str, size: float, off: float, suggested: str
) -> None:
    path = mesh_problem(tmp_path, binary_stl(TETRAHEDRON * size * off))
    text = path.read_text()
    if unit == "m":
        text = edited(text, ("length_unit",), "m")
        text = edited(text, ("tip_path", "start"), [3.126, 0, 0])
        text = edited(text, ("tip_path", "points"), [[3.126, 0, 0]])
    path.write_text(text)
    message = refusal(path)
    assert f"try scale: {suggested}, else" in message
    path.write_text(edited(text, ("obstacles", 0, "scale"), float(suggested)))
    (mesh,) = read_problem(path).scene.obstacles
    (size_found,) = {float(np.ptp(mesh.vertices[:, i])) for i in range(3)}
    assert size_found == pytest.approx(0.5, rel=1e-6)


def test_the_mesh_size_check_can_be_switched_off(tmp_path: Path) -> None:
    path = mesh_problem(tmp_path, binary_stl(TETRAHEDRON), check_size=False)
    (mesh,) = read_problem(path).scene.obstacles
    assert mesh.vertices.max() == 0.001


def test_the_first_of_several_errors_is_told_and_the_others_counted(
    tmp_path: Path,
) -> None:
    text = edited(edited(OBS1, ("length_unit",), "cm"), ("obstacles", 0, "radius"), 0)
    message = refused_text(tmp_path, text)
    assert message.startswith("length_unit (line 3)")
    assert message.endswith("(and 1 more)")


def test_a_command_tells_every_error_of_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = yaml.safe_load(OBS1)
    data |= {"length_unit": "cm", "required_clearance": -1}
    data["obstacles"][0]["radius"] = 0
    data["tip_path"]["points"] = [[0, 1] for _ in range(30)]
    path = tmp_path / "wrong.yaml"
    path.write_text(yaml.safe_dump(data), encoding="utf-8")
    with pytest.raises(SystemExit) as ended:
        main(["plan", str(path), "--out", str(tmp_path / "out")])
    lines = capsys.readouterr().err.splitlines()
    places = [line.split(": ")[2].split(" (line")[0] for line in lines]
    assert ended.value.code == 2
    assert not [line for line in lines if line.endswith("more)")]
    points = [f"tip_path.points[{k}]" for k in range(30)]
    others = {"length_unit", "obstacles[0].radius", "required_clearance"}
    assert sorted(places) == sorted([*points, *others])


WITHOUT_A_SHAPE = """\
vdsm_problem: 1
length_unit: mm
manipulator: hrm8
obstacles:
  - {name: =a, shape: tube, axis: w, center: [1, 2], radius: -1, colour: red, size: 1,
     motion: {times_s: []}}
  - {name: b, normal: [1, 0, 0], solid: maybe, scale: 0}
  - {shape: tube, radius: 2}
required_clearance: 5
"""

NO_SENSE = """\
vdsm_problem: 1
length_unit: mm
manipulator: {link_lengths: [400, 400, 400], link_radius: [50, 50],
  max_link_angle_deg: 40, max_joint_angle_deg: 40, base_range: [2, 1],
  cables: {hole_radius: 90, half_gap: 20}}
obstacles:
  - {name: a, shape: cylinder, axis: [0, 0, 0], center: [0, 0, 0], radius: 1, length: 2}
  - {name: a, shape: box, center: [0, 0, 0], size: [1, 1, 1]}
  - {name: link 3, shape: mesh, file: none.stl}
others:
  - {name: left, manipulator: hrm8, trajectory: none.csv}
  - {name: right, trajectory: none.csv}
tip_path: {start: [1200, 0, 0], points: [[1200, 0, 0]]}
goal: {tip: [1, 2, 3]}
tip_tolerance: 50
required_clearance: 5
"""

OF_THE_ARM = """\
vdsm_problem: 1
length_unit: mm
manipulator: hrm8
obstacles:
  - {name: floor, shape: half_space, point: [0, 0, -900], normal: [0, 0, 1]}
tip_path:
  start: [9000, 0, 0]
  points: [{arc: {through: [1, 2, 3], to: [1, 2, 4]}}]
  insertion: [[1.0e+9, 0, 0]]
ratios: {cylinder_radius: 3, joint: 2}
errors:
  joint_deg: [1, 2]
  obstacles: [{name: none, shift: 1}, {name: floor, turn_deg: 1}]
required_clearance: 5
"""

OF_A_ROBOT = """\
vdsm_problem: 1
length_unit: m
robot: {urdf: none.urdf}
obstacles:
  - {name: a, shape: mesh, file: none.stl}
  - {name: a, shape: sphere, center: [0, 0, 0], radius: 1}
others:
  - {name: left, robot: {urdf: none.urdf}, trajectory: none.csv}
required_clearance: 0
"""


@pytest.mark.parametrize(
    ("text", "read", "places"),
    [
        (
            WITHOUT_A_SHAPE,
            read_problem,
            "0.name 0.shape 0.axis 0.center 0.radius 0.colour 0.motion.times_s 0.size "
            "1.shape 1.solid 1.scale 2.shape 2.name",
        ),
        (
            NO_SENSE,
            read_problem,
            "manipulator.link_radius manipulator.base_range "
            "manipulator.cables.hole_radius 0.axis 1.name 2.name 2.file "
            "others[0].trajectory others[1].trajectory goal tip_tolerance",
        ),
        (
            OF_THE_ARM,
            read_problem,
            "tip_path.start tip_path.points[0] tip_path.insertion[0] ratios "
            "errors.joint_deg errors.obstacles[0].name errors.obstacles[1].turn_deg",
        ),
        (OF_A_ROBOT, read_cell, "none.urdf 0.file 1.name others[0].trajectory"),
    ],
)
def test_what_makes_no_sense_is_told_whole(
    tmp_path: Path, text: str, read: Callable[[Path], object], places: str
) -> None:
    """A shape that nobody knows, or a part that fails, hides nothing else."""
    path = tmp_path / "wrong.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InvalidFile) as refused:
        read(path)
    errors = refused.value, *refused.value.others
    found = [one.where.split(" (")[0] or Path(one.file).name for one in errors]
    expected = [re.sub(r"^(\d)", r"obstacles[\1]", place) for place in places.split()]
    assert sorted(found) == sorted(expected)
    assert str(refused.value).endswith(f"(and {len(expected) - 1} more)")
    assert not any(one.others for one in refused.value.others)


def test_lines_are_those_of_the_file_not_of_the_data(tmp_path: Path) -> None:
    text = EVERYTHING.replace("radius: 200", "radius: -200")
    lines = text.splitlines()
    (line,) = [i for i, content in enumerate(lines, 1) if "-200," in content]
    assert f"radius (line {line})" in refused_text(tmp_path, text)
