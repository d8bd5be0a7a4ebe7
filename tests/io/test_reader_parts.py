"""Parts of readers by themselves; oracle: the rule of each, written out."""

import json
from io import StringIO
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml

from vdsm_pin.errors import InvalidFile
from vdsm_pin.io import trajectory_messages
from vdsm_pin.io.obstacle_schema import SphereModel, with_field
from vdsm_pin.io.places import Place
from vdsm_pin.io.problem_errors import LONGEST_SHOWN, _entries, _location, _shown
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.schema_types import FileModel
from vdsm_pin.io.tables import Table
from vdsm_pin.io.urdf_arm import _Reading

HERE = Path("arm.urdf")


def at(x: float, y: float = 0.0, z: float = 0.0) -> Any:
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


def along_x(x: float, y: float = 0.0, z: float = 0.0) -> Any:
    """A pose whose z axis is the x axis of the link."""
    pose = at(x, y, z)
    pose[:3, :3] = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]
    return pose


def joint(name: str, kind: str, axis: Any, parent: str, child: str, x: float) -> Any:
    limit = SimpleNamespace(lower=-0.5, upper=0.5)
    return SimpleNamespace(
        name=name, type=kind, axis=np.array(axis, float), parent=parent, child=child,
        origin=at(x), limit=limit, mimic=None,
    )  # fmt: skip


def robot(lengths: list[float], joints: int | None = None) -> Any:
    """A rail, a yaw and a pitch for each link, and a tip."""
    found = [joint("x0", "prismatic", [1, 0, 0], "base", "f0", 0.0)]
    found[0].limit = SimpleNamespace(lower=-1.0, upper=2.0)
    for k in range(2 * len(lengths) if joints is None else joints):
        x = lengths[k // 2 - 1] if k and k % 2 == 0 else 0.0
        axis = [0, 1, 0] if k % 2 else [0, 0, 1]
        found.append(joint(f"a{k}", "revolute", axis, f"f{k}", f"f{k + 1}", x))
    last = found[-1].child
    found.append(joint("tip", "fixed", [1, 0, 0], last, "tip", lengths[-1]))
    links = [
        SimpleNamespace(name=n, collisions=[])
        for n in ("base", *(j.child for j in found))
    ]
    for k, length in enumerate(lengths):
        shape = SimpleNamespace(
            sphere=None, cylinder=SimpleNamespace(radius=0.1 + k, length=length)
        )
        if 2 * k + 3 < len(links):
            links[2 * k + 3].collisions.append(
                SimpleNamespace(geometry=shape, origin=along_x(length / 2.0))
            )
    return SimpleNamespace(name="arm", joints=found, links=links)


@pytest.mark.parametrize("lengths", [[1.0, 2.0], [0.5, 0.25, 4.0]])
def test_a_chain_is_an_arm_of_the_shifts_between_its_joints(
    lengths: list[float],
) -> None:
    found = _Reading(HERE, robot(lengths)).arm()
    assert found.name == "arm"
    assert found.link_lengths.tolist() == lengths
    assert found.link_radius == 0.1 + len(lengths) - 1
    assert found.max_joint_angle == 0.5
    assert found.base_range == (-1.0, 2.0)


def shifted_rail(arm: Any) -> None:
    arm.joints[0].origin = at(0.1)


def shifted_yaw(arm: Any) -> None:
    arm.joints[1].origin = at(0.1)


def no_origin(arm: Any) -> None:
    arm.joints[0].origin = arm.joints[1].origin = None


def shifted_pitch(arm: Any) -> None:
    arm.joints[2].origin = at(0.1)


def aside(arm: Any) -> None:
    arm.joints[3].origin = at(1.0, 0.0, 0.1)


def other_limit(arm: Any) -> None:
    arm.joints[4].limit = SimpleNamespace(lower=-0.5, upper=0.4)


def one_sided(arm: Any) -> None:
    arm.joints[1].limit = SimpleNamespace(lower=-0.4, upper=0.5)


def turned(arm: Any) -> None:
    arm.joints[5].axis = np.array([0.0, 1.0, 0.0])


def bare(arm: Any) -> None:
    for link in arm.links:
        link.collisions = []


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (no_origin, None),
        (shifted_rail, "'a0'.*joint 1 at the base's origin"),
        (shifted_yaw, "'a0'.*joint 1 at the base's origin"),
        (shifted_pitch, "'a1'.*expected its origin on that of the yaw"),
        (aside, "'a2'.*x axis"),
        (other_limit, r"'a3'.*has limits \(-0.5, 0.4\), expected \(-0.5, 0.5\)"),
        (one_sided, r"'a0'.*has limits \(-0.4, 0.5\)"),
        (turned, "'a4'.*slides along 0 1 0, expected 0 0 1"),
        (bare, "no collision shape"),
    ],
)  # fmt: skip
def test_what_is_no_such_arm_is_named(change: Any, said: str | None) -> None:
    arm = robot([1.0, 2.0, 3.0] if change is turned else [1.0, 2.0])
    change(arm)
    if said is None:
        assert _Reading(HERE, arm).arm().link_lengths.tolist() == [1.0, 2.0]
        return
    with pytest.raises(InvalidFile, match=said):
        _Reading(HERE, arm).arm()


@pytest.mark.parametrize(
    ("joints", "said"),
    [(3, "has 5 joints in a row"), (5, "has 5 joints between the rail and the tip")],
)
def test_an_arm_has_two_joints_for_each_of_two_links(joints: int, said: str) -> None:
    arm = robot([1.0, 2.0, 3.0], joints)
    with pytest.raises(InvalidFile, match=said):
        _Reading(HERE, arm).arm()


def test_shapes_lie_on_the_axis_of_their_link() -> None:
    """From its origin to its end, and no part of the axis of a cylinder beside it."""
    rng, seen = np.random.default_rng(1), {True: 0, False: 0}
    for _ in range(400):
        rod, off = bool(rng.integers(2)), rng.choice([0.0, 0.0, 1e-3], 2)
        length, reach = float(rng.choice([0.5, 1.0])), float(rng.choice([0.5, 1.0]))
        x = float(rng.choice([0.0, 0.25, 0.5, 0.75, 1.0]))
        pose = along_x(x, *off) if rng.random() < 0.7 else at(x, *off)
        tilt = rng.integers(4)
        if tilt < 2:  # a little about either axis across
            s, turn = 1e-3, np.eye(4)
            turn[:3, :3] = [[[1, -s, 0], [s, 1, 0], [0, 0, 1]],
                            [[1, 0, s], [0, 1, 0], [-s, 0, 1]]][tilt]  # fmt: skip
            turned_by = pose.copy()
            turned_by[:3, :3] = turn[:3, :3] @ pose[:3, :3]
            pose = turned_by
        solid = SimpleNamespace(radius=0.1, length=length)
        geometry = SimpleNamespace(
            sphere=None if rod else solid, cylinder=solid if rod else None
        )
        half = length / 2.0 if rod else 0.0
        on_axis = not off.any() and 0.0 <= x - half and x + half <= reach
        if rod:
            on_axis &= bool((np.abs(pose[1:3, 2]) < 1e-9).all())
        reading = _Reading(HERE, robot([1.0, 2.0]))
        shape = SimpleNamespace(geometry=geometry, origin=pose)
        seen[on_axis] += 1
        if on_axis:
            assert reading._radius_of("l", shape, reach) == 0.1
        else:
            with pytest.raises(InvalidFile, match="off the link's axis"):
                reading._radius_of("l", shape, reach)
    assert min(seen.values()) > 40
    ball = SimpleNamespace(sphere=SimpleNamespace(radius=0.2), cylinder=None)
    assert (
        reading._radius_of("l", SimpleNamespace(geometry=ball, origin=None), 0.0) == 0.2
    )
    none = SimpleNamespace(geometry=SimpleNamespace(sphere=None, cylinder=None))
    with pytest.raises(InvalidFile, match="neither a sphere nor a cylinder"):
        reading._radius_of("l", none, 1.0)


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (None, "empty"), (True, "true"), (False, "false"), ({"a": 1}, "a mapping"),
        ([1] * 6, "[1, 1, 1, 1, 1, 1]"), ([1] * 7, "a list of 7"),
        ("x" * (LONGEST_SHOWN - 2), repr("x" * (LONGEST_SHOWN - 2))),
        ("x" * (LONGEST_SHOWN - 1), "'" + "x" * (LONGEST_SHOWN - 4) + "..."),
    ],
)  # fmt: skip
def test_values_are_shown_as_short_as_a_message_needs(value: object, said: str) -> None:
    assert _shown(value) == said
    assert len(said) <= LONGEST_SHOWN


def test_one_is_an_entry_and_others_are_entries() -> None:
    assert [_entries(k) for k in range(3)] == ["0 entries", "1 entry", "2 entries"]


@pytest.mark.parametrize(
    ("kind", "loc", "found"),
    [
        ("int_type", ("a", "UnionModel", 1, "b"), ("a", 1, "b")),
        ("int_type", ("a", 0, "function", "c"), ("a", 0)),
        ("missing", ("a", 1, "z"), ("a", 1, "z")),
        ("union_tag_invalid", ("a", 0), ("a", 0, "shape")),
        ("int_type", ("other", 1), ()),
    ],
)
def test_errors_are_where_the_data_has_them(
    kind: str, loc: tuple[Any, ...], found: tuple[Any, ...]
) -> None:
    """Steps into members of unions lead nowhere in the data."""
    details: Any = {"type": kind, "loc": loc}
    assert _location(details, {"a": [{"x": 1}, {"b": 2}]}) == found


@pytest.mark.parametrize(("radius", "metres"), [(None, 0.04), (25, 0.025)])
def test_the_feed_is_as_thick_as_it_says_or_as_link_1(
    radius: float | None, metres: float, tmp_path: Path
) -> None:
    feed = {"length": 700} | ({} if radius is None else {"radius": radius})
    arm = {"link_lengths": [500, 400], "link_radius": [40, 30], "feed": feed}
    data = {
        "vdsm_problem": 1, "length_unit": "mm", "required_clearance": 1,
        "manipulator": arm | {"max_link_angle_deg": 40, "max_joint_angle_deg": 40},
    }  # fmt: skip
    file = tmp_path / "p.yaml"
    file.write_text(yaml.safe_dump(data))
    found = read_problem(file).manipulator.feed
    assert found is not None
    assert (found.length, found.radius) == pytest.approx((0.7, metres))


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ('1, "2"', ""),
        (' "1" ,2', ""),
        ('1,"2', "y is '\"2', expected a number"),
        ('1,"2"3', "y is '\"2\"3', expected a number"),
        ('"1,2', "x is '\"1', expected a number"),
    ],
)
def test_a_number_ends_where_its_quotes_do(row: str, said: str) -> None:
    table = Table(Path("a.csv"), StringIO(f"x,y\n{row}\n"), {*"xy"}.__contains__)
    table.choose(("x", "y"))
    if said:
        with pytest.raises(InvalidFile) as caught:
            table.all_rows()
        assert said in str(caught.value)
    else:
        assert table.all_rows().tolist() == [[1.0, 2.0]]


ARM = {"link_lengths": [0.3, 0.2], "link_radius": 0.03}
ARM |= {"max_link_angle_deg": 60, "max_joint_angle_deg": 50}
MATE = "waypoint,on_path,path_m,x0_m,alpha1_rad,theta1_rad,alpha2_rad,theta2_rad,time_s"
MATE += "\n0,0,0,0,0,0,0,0,0\n1,0,0,0,0,0,0,0,1\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (MATE, ""),
        (MATE.replace("0,0,0\n", "0,x,0\n"), "mate.csv"),
        (MATE.replace("alpha2_rad", "alpha3_rad"), "mate.csv"),
        ("", "mate.csv"),
    ],
)
def test_a_damaged_trajectory_of_another_arm_is_told_by_its_place(
    text: str, said: str, tmp_path: Path
) -> None:
    mate = {"name": "mate", "manipulator": ARM, "trajectory": "mate.csv"}
    problem = {"vdsm_problem": 1, "length_unit": "m", "manipulator": ARM}
    problem |= {"required_clearance": 0, "others": [mate | {"base": {}}]}
    file = tmp_path / "p.yaml"
    file.write_text(json.dumps(problem))
    (tmp_path / "mate.csv").write_text(text)
    if not said:
        assert len(read_problem(file).scene.obstacles) == 2
        return
    with pytest.raises(InvalidFile) as caught:
        read_problem(file)
    assert str(caught.value).startswith(f"{file}: others[0].trajectory")
    assert said in str(caught.value)


def test_a_shape_with_more_fields_is_named_and_described_as_it_is() -> None:
    class More(FileModel):
        link: int

    made = with_field(SphereModel, More, "Body")
    assert made.__name__ == "SphereBody"
    assert made.__doc__ == SphereModel.__doc__
    assert {*made.model_fields} == {*SphereModel.model_fields, "link"}


def test_more_points_than_a_motion_may_have_are_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(trajectory_messages, "MAX_ROWS", 3)
    for count in (3, 4):
        points = [{"positions": [0.0], "time_from_start": float(k)}
                  for k in range(1, count + 1)]  # fmt: skip
        message = Place.of("f", {"joint_names": ["a"], "points": points})
        if count == 3:
            assert len(trajectory_messages.of_message(message).q) == 3
        else:
            with pytest.raises(InvalidFile, match="has more than 3 points"):
                trajectory_messages.of_message(message)
