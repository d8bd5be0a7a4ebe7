"""What planners are told of clearances, against what is proved of the same arms."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
import yaml

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.arm.mounted import LinkBody
from vdsm_pin.geometry.solids import Box, Mesh, Sphere
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.broad_phase import broad_phase
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.held import TIP
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.clearance import prove_clearance
from vdsm_pin.verification.link_clearance import arithmetic_pad, link_clearance

BODY = {"name": "camera", "link": 2, "shape": "box", "center": [0.2, 0.1, 0]}
ARMS: dict[str, dict[str, Any]] = {
    "alike": {"link_radius": 0.05},
    "thinner": {"link_radius": [0.08, 0.05, 0.02]},
    "tool": {"link_radius": 0.04, "tool": {"length": 0.3, "radius": 0.01}},
    "thick tool": {"link_radius": 0.02, "tool": {"length": 0.1, "radius": 0.08}},
    "body": {"link_radius": 0.05, "bodies": [BODY | {"size": [0.05, 0.05, 0.05]}]},
    "body beyond both ends": {
        "link_radius": 0.05,
        "bodies": [BODY | {"center": [0.15, 0.04, 0.0], "size": [0.9, 0.05, 0.05]}],
    },
    "body behind a tool": {
        "link_radius": 0.05,
        "tool": {"length": 0.1, "radius": 0.02},
        "bodies": [
            BODY | {"link": 3, "center": [-0.1, 0.0, 0.05], "size": [0.3, 0.05, 0.05]}
        ],
    },
}
OBSTACLES = [
    {"name": "ball", "shape": "sphere", "center": [0.8, 0.3, 0.2], "radius": 0.05},
    {"name": "box", "shape": "box", "center": [0.3, -0.4, 0], "size": [0.2, 0.2, 0.3]},
]


@pytest.mark.parametrize("name", ARMS)
def test_each_link_is_as_near_as_is_proved(name: str, tmp_path: Path) -> None:
    path = tmp_path / "p.yaml"
    arm = {"link_lengths": [0.5, 0.4, 0.3], "max_link_angle_deg": 89}
    data = {
        "vdsm_problem": 1,
        "length_unit": "m",
        "manipulator": arm | {"max_joint_angle_deg": 89} | ARMS[name],
        "obstacles": OBSTACLES,
        "required_clearance": 0.0,
    }
    path.write_text(yaml.safe_dump(json.loads(json.dumps(data))))
    problem, rng, none = read_problem(path), np.random.default_rng(3), [0.0]
    told = link_clearance(problem)
    for _ in range(20):
        alpha, theta = rng.uniform(-0.5, 0.5, (2, 1, 3))
        row = Trajectory(np.zeros(1, bool), none, none, alpha, theta)
        proof = prove_clearance(problem, row, ErrorBox())
        centres = joint_centres(problem.manipulator, row.x0, alpha, theta)
        each = [told(centres[:, k : k + 2], k)[0, 0] for k in range(3)]
        count = 2 if "tool" in name else 3  # which the last link includes
        twice = told(np.repeat(centres, 2, axis=0), np.arange(3))
        assert twice.shape == (2, 3)
        for pieces in (each, *twice):
            same = pytest.approx(told(centres)[0, :count], abs=TOLERANCES.bracket_gap)
            assert pieces[:count] == same
        for link, nearest in enumerate(told(centres)[0], start=1):
            alone = told(centres[:, link - 1 : link + 1], link - 1)[0, 0]
            assert alone == pytest.approx(nearest, abs=TOLERANCES.bracket_gap)
            mine = [k for k, pair in enumerate(proof.pairs)
                    if pair.obstacle and pair.link == link]  # fmt: skip
            found = proof.least
            low, high = (float(x[mine].min()) for x in (found.lower, found.upper))
            if high <= 0.0:
                assert nearest <= 0.0
                continue
            assert nearest <= high + TOLERANCES.bracket_gap
            if "body" not in name:  # which counts as round about its link
                assert nearest >= low - TOLERANCES.bracket_gap


def test_what_reaches_behind_its_joint_is_no_thicker_for_it() -> None:
    """A bar of half diagonal 50 mm, 300 mm behind the last joint, beside a ball."""
    box = Box("bar", np.array([-0.2, 0.0, 0.0]), np.eye(3), np.array([0.1, 0.03, 0.04]))
    arm = built_in("hrm8")
    arm = replace(arm, link_radius=0.02, bodies=(LinkBody(arm.n_links, box),))
    joint = float(arm.stations[-2])
    for x, expected in (
        (joint - 0.2, 0.3 - 0.1 - 0.05),
        (joint + 0.1, 0.3 - 0.1 - 0.05),
        # The capsule ends 50 mm behind the bar, a link of 20 mm goes on.
        (joint - 0.3 - 0.4, np.hypot(0.4, 0.3) - 0.1 - 0.05),
    ):
        ball = Sphere("ball", np.array([x, 0.3, 0.0]), 0.1)
        problem = PlanningProblem(arm, Scene((ball,)), None, 0.0, name="p")
        centres = np.zeros((1, arm.n_links + 1, 3))
        centres[0, :, 0] = arm.stations
        for told in (
            link_clearance(problem),
            broad_phase(problem, link_clearance(problem)).up_to(1.0),
        ):
            last = float(told(centres)[0, -1])
            assert last == pytest.approx(expected, abs=TOLERANCES.bracket_gap)
        tip = centres[:, -1:].repeat(2, axis=1)
        alone = np.linalg.norm(tip[0, 0] - ball.centre) - 0.1 - 0.05
        assert link_clearance(problem)(tip, TIP)[0, 0] == pytest.approx(alone)


@pytest.mark.parametrize(
    "name", ["points", "centre", "radius", "extent", "base", "arm"]
)
@pytest.mark.parametrize("largest", [90.0, 110.0, 3000.0])
def test_rounding_grows_with_the_largest_length_there_is(
    name: str, largest: float
) -> None:
    """Of the arm, of its rail, or of whatever pieces have."""
    arm, none = built_in("hrm8"), np.zeros(0)
    if name == "base":
        arm = replace(arm, base_range=(-largest, 1.0))
    elif name == "arm":
        arm = replace(arm, link_lengths=np.full(8, largest / 8.0))
    sizes = {"points": np.zeros((0, 3)), "centre": none, "radius": none, "extent": none}
    if name in sizes:
        sizes[name] = np.array([1.0, -largest, 2.0])
    pieces: Any = SimpleNamespace(**sizes)
    problem = PlanningProblem(arm, Scene(()), None, 0.0, name="p")
    share = max(1.0, largest / TOLERANCES.scene_extent)
    assert arithmetic_pad(problem, pieces) == share * TOLERANCES.arithmetic


@pytest.mark.parametrize("mesh", [False, True])
@pytest.mark.parametrize("ignored", [False, True])
def test_margins_are_kept_by_single_links_from_single_obstacles(
    mesh: bool, ignored: bool
) -> None:
    """Against scenes of one obstacle each, the margin taken off link by link."""
    rng, arm = np.random.default_rng([3, mesh, ignored]), built_in("hrm8")
    if ignored:
        arm = replace(arm, ignore_pairs=(("link 3", "one"),))
    three: list[Any] = [
        Sphere("one", np.array([1.5, 0.6, 0.1]), 0.2),
        Box("two", np.array([2.0, -0.5, 0.3]), np.eye(3), np.full(3, 0.15)),
        Sphere("three", np.array([0.8, 0.1, -0.6]), 0.1),
    ]
    if mesh:
        made = trimesh.creation.box(np.full(3, 0.3))
        corners = np.asarray(made.vertices) + np.array([2.0, -0.5, 0.3])
        three[1] = Mesh("two", corners, np.asarray(made.faces))
    problem = PlanningProblem(arm, Scene(tuple(three)), None, 0.0, name="p")
    table = np.where(rng.random((8, 3)) < 0.4, rng.uniform(0.0, 0.05, (8, 3)), 0.0)
    alone = [link_clearance(replace(problem, scene=Scene((one,)))) for one in three]
    near = np.zeros((200, 9, 3))
    slopes = rng.uniform(-0.3, 0.3, (200, 8, 2))
    near[:, 1:, 1:] = np.cumsum(slopes * arm.link_lengths[:, None], axis=1)
    along = arm.link_lengths * np.sqrt(1.0 - (slopes**2).sum(axis=2))
    near[:, 1:, 0] = np.cumsum(along, axis=1)
    expected = np.min(
        [told(near) - table[:, o] for o, told in enumerate(alone)], axis=0
    )
    kept = broad_phase(problem, link_clearance(problem), table).up_to(10.0)
    told = replace(kept, floor=-np.inf)(near)
    apart = expected > 1e-3
    assert apart.mean() > 0.5
    np.testing.assert_allclose(told[apart], expected[apart], atol=5e-6)
    assert (told[~apart] < 2e-3).all()
    bare = kept.bare(near)
    clear = np.min([told(near) for told in alone], axis=0)
    np.testing.assert_allclose(bare[apart], clear[apart], atol=5e-6)
    # Of a tip, the margin of the last link counts.
    tips = near[:, -1:].repeat(2, axis=1)
    last = [told(tips, TIP)[:, 0] - table[-1, o] for o, told in enumerate(alone)]
    found = replace(kept, floor=-np.inf)(tips, TIP)[:, 0]
    far = np.min(last, axis=0) > 1e-3
    np.testing.assert_allclose(found[far], np.min(last, axis=0)[far], atol=5e-6)
