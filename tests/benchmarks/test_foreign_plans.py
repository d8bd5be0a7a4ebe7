"""The benchmark of foreign plans on a robot of two boxes and one scene."""

import io
import json
import tarfile
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import trimesh

from benchmarks.foreign_plans.judges import Plan, _fault, judge
from benchmarks.foreign_plans.problems import FOLDER, problems
from benchmarks.foreign_plans.run import PARTS, outcomes
from benchmarks.foreign_plans.sampled import Sampled
from benchmarks.foreign_plans.summary import document
from vdsm_pin.errors import InvalidInput
from vdsm_pin.robots.cell import read_cell
from vdsm_pin.verification.records import Verdict

URDF = """<robot name="two"><link name="foot"/>
<link name="upper"><collision><origin xyz="0.2 0 0"/>
<geometry><box size="0.4 0.04 0.04"/></geometry></collision></link>
<link name="fore"><collision><origin xyz="0.2 0 0"/>
<geometry><box size="0.4 0.04 0.04"/></geometry></collision></link>
<joint name="a" type="revolute"><parent link="foot"/><child link="upper"/>
<axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
<joint name="b" type="revolute"><parent link="upper"/><child link="fore"/>
<origin xyz="0.4 0 0.1"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" velocity="1" effort="1"/></joint></robot>"""
SRDF = """<robot name="two"><virtual_joint name="stand" type="floating"
parent_frame="world" child_link="foot"/>
<group name="panda_arm"><joint name="a"/><joint name="b"/></group>
<disable_collisions link1="upper" link2="fore" reason="Adjacent"/></robot>"""
SCENE = {
    "world": {
        "collision_objects": [
            {
                "id": "post",
                "primitives": [{"type": "cylinder", "dimensions": [1.0, 0.001]}],
                "primitive_poses": [
                    {"position": [0.6, 0.1, 0], "orientation": [0, 0, 0, 1]}
                ],
            }
        ]
    }
}
REQUEST = {
    "start_state": {"joint_state": {"name": ["a", "b"], "position": [0, 0]}},
    "goal_constraints": [{"joint_constraints": [{"joint_name": "a", "position": 0.5}]}],
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder as the environment names it, with one problem of a robot 'panda'."""
    place = tmp_path / "panda"
    place.mkdir()
    (place / "panda.urdf").write_text(URDF)
    (place / "panda.srdf").write_text(SRDF)
    with tarfile.open(place / "problems.tar.bz2", "w:bz2") as archive:
        for name, content in (("scene", SCENE), ("request", REQUEST)):
            data = json.dumps(content).encode()
            member = tarfile.TarInfo(f"problems/post_panda/{name}0001.yaml")
            member.size = len(data)
            archive.addfile(member, io.BytesIO(data))
    monkeypatch.setenv(FOLDER, str(tmp_path))
    return tmp_path


def test_plan_through_a_thin_post_is_refuted_and_missed_by_its_own_samples(
    folder: Path,
) -> None:
    """Two waypoints on either side of a post; at 0.01 no sample is in it."""
    plans = {
        ("panda", "post", 1): [
            Plan("panda", "post", 1, 0.01, [[0.0, 0.0], [0.5, 0.0]]),
            Plan("panda", "post", 1, 0.005, [[0.0, 0.0], [-0.5, 0.0]]),
        ]
    }
    ((_, found),) = outcomes("panda", 1, plans)
    through, away = found
    assert through.verdict == "refuted"
    assert through.depth > 0.0
    assert through.caught[-1]
    assert away.verdict == "certified"
    assert away.depth == 0.0
    assert not any(away.caught)
    assert not through.fault
    assert not away.fault
    # The box that turns stays clear of the post; its certificate says so.
    assert through.proof is None
    assert away.proof is not None and away.proof.accepted and away.proof.grazing
    page = document(found, [])
    assert "| panda | 0.005 | 1 | 1 |" in page
    assert "Of 1 plans that OMPL's RRTConnect returns" in page
    assert "| panda | 0.01 | 1 | 1 (100 %)" in page


def test_ends_that_collide_as_one_hull_are_asked_of_several(folder: Path) -> None:
    """The post stands between the prongs of a fork, inside of its hull."""
    prongs = [
        ((0.4, 0.04), 0.2, 0.0),
        ((0.04, 0.2), 0.02, 0.1),
        ((0.04, 0.2), 0.38, 0.1),
    ]
    boxes = []
    for size, x, y in prongs:
        box = trimesh.creation.box((*size, 0.04))
        box.apply_translation((x, y - 0.05, 0.0))
        boxes.append(box.subdivide().subdivide())
    trimesh.util.concatenate(boxes).export(folder / "panda" / "fork.stl")
    box = '<box size="0.4 0.04 0.04"/></geometry></collision></link>\n<joint'
    mesh = '<mesh filename="fork.stl"/></geometry></collision></link>\n<joint'
    text = URDF.replace(box, mesh)
    before, after = text.rsplit('<origin xyz="0.2 0 0"/>', 1)
    (folder / "panda" / "panda.urdf").write_text(before + after)
    plans = {
        ("panda", "post", 1): [
            Plan("panda", "post", 1, 0.01, [[0.0, 0.0], [0.5, 0.0]]),
            Plan("panda", "post", 1, 0.01, [[0.0, 0.0], [0.05, 0.0]], PARTS),
            Plan("panda", "post", 1, 0.01, [[0.0, 0.0], [0.5, 0.0]], PARTS),
        ]
    }
    ((_, found),) = outcomes("panda", 1, plans)
    assert [one.verdict for one in found] == ["certified", "refuted"]
    assert not any(one.fault for one in found)
    assert f"| panda, {PARTS} hulls a mesh | 0.01 | 2 | 1 (50 %)" in document(found, [])


def test_false_verdicts_are_faults(folder: Path, tmp_path: Path) -> None:
    """A judge that says the contrary is caught, whichever way it errs."""
    (problem,) = problems("panda", 1, tmp_path / "aside")
    sampled = Sampled("panda", problem.scene)
    through = np.array([[0.0, 0.0], [0.5, 0.0]])
    assert "a sample collides" in _fault(
        sampled, through, Verdict.CERTIFIED, hit=False, near=0.1
    )
    assert "0.1" in _fault(sampled, through, Verdict.REFUTED, hit=False, near=1e-4)
    files = folder / "panda/panda.urdf", folder / "panda/panda.srdf"
    cell = tmp_path / "cell.yaml"
    cell.write_text(
        "vdsm_problem: 1\nlength_unit: m\nrequired_clearance: 0\n"
        f"robot: {{urdf: {files[0]}, srdf: {files[1]}, group: panda_arm}}\n"
        f"scene: {problem.scene}\n",
        encoding="utf-8",
    )
    plan = Plan("panda", "post", 1, 0.01, through.tolist())
    found = judge(plan, sampled, read_cell(cell))
    assert not found.fault and found.proof is None


def test_folder_that_is_none_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the environment variable one sentence says what it should be."""
    monkeypatch.delenv(FOLDER, raising=False)
    with pytest.raises(InvalidInput, match="expected a folder with panda/"):
        list(outcomes("panda", 1, {}))


def test_planned_by_ompl(folder: Path) -> None:
    """OMPL's own plan is judged without a contradiction."""
    if find_spec("ompl") is None:
        pytest.skip("needs the extra ompl")
    ((_, found),) = outcomes("panda", 1, {})
    assert len(found) == 2
    assert not any(one.fault for one in found)
    assert all(one.plan.waypoints[0] == [0.0, 0.0] for one in found)


def test_states_passed_over_are_clear(folder: Path, tmp_path: Path) -> None:
    """Of random motions the same is said as by asking about every state."""
    (problem,) = problems("panda", 1, tmp_path / "aside")
    sampled, rng = Sampled("panda", problem.scene), np.random.default_rng(5)
    reach = 0.2 + np.sqrt(0.2**2 + 2.0 * 0.02**2)  # a ball about each box
    np.testing.assert_allclose(sampled.levers, [np.hypot(0.4, 0.1) + reach, reach])
    found = []
    for _ in range(60):
        a, b = rng.uniform(-0.4, 0.9, (2, 2))
        states = a + np.linspace(0.0, 1.0, 401)[:, None] * (b - a)
        each = any(sampled.collides(q) for q in states)
        assert sampled.meets(a, b, 400) == each
        found.append(each)
    assert 10 < sum(found) < 50
