"""The page about files tells the truth: its examples are read, its defaults hold."""

import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from problem_texts import edited

from vdsm_pin.arm.cable_layout import paper_hole_angles
from vdsm_pin.arm.cables import cable_lengths
from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io import clouds, mesh_file, obstacle_schema
from vdsm_pin.io.problem_file import problem_schema, read_problem
from vdsm_pin.io.trajectory_file import write_trajectory
from vdsm_pin.problem.trajectory import Trajectory

PAGE = Path(__file__).parents[2] / "docs" / "files.md"
EXAMPLE, OTHERS, ARM, ENDS, CURVES = re.findall(
    r"```yaml\n(.*?)```", PAGE.read_text(), re.DOTALL
)


def test_the_example_is_read_with_all_shapes(tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text(EXAMPLE)
    problem = read_problem(tmp_path / "p.yaml")
    assert len(problem.scene.obstacles) == 7
    assert problem.manipulator.name == "hrm8"


@pytest.mark.parametrize(
    ("model", "endings"),
    [("MeshModel", mesh_file._READERS), ("PointsModel", clouds._READERS)],
)
def test_the_schema_names_every_kind_of_file(
    model: str, endings: dict[str, object]
) -> None:
    """A shape's description names all endings that its reader knows, and no other."""
    defined = problem_schema()["$defs"][model.replace("Model", "Obstacle")]
    plain = getattr(obstacle_schema, model).model_json_schema()
    for words in (defined["description"], plain["description"]):
        found = re.findall(r"\b[A-Z]{3,4}\b", words)
        assert {f".{word.lower()}" for word in found} == set(endings)


def test_the_second_arm_shown_is_read(tmp_path: Path) -> None:
    none = np.zeros(2)
    angles, times = np.zeros((2, 2, 8)), np.array([0.0, 1.0])
    mate = Trajectory(none > 0, none, none, *angles, times=times)
    write_trajectory(mate, tmp_path / "mate.csv")
    (tmp_path / "p.yaml").write_text(edited(EXAMPLE, ("others",)) + OTHERS)
    moving = read_problem(tmp_path / "p.yaml").scene.moving
    names = [one.name for one in moving]
    assert names == ["door", *(f"mate: link {k}" for k in range(1, 9))]


def test_the_defaults_shown_are_the_defaults(tmp_path: Path) -> None:
    (tmp_path / "full.yaml").write_text(EXAMPLE)
    text = EXAMPLE
    for location in (
        *(("tip_path", key) for key in ("closed", "spacing", "approach", "retreat")),
        *(("tip_path", key) for key in ("blocked", "required_coverage", "order")),
        ("base",),
        ("others",),
        ("errors",),
        ("required_self_clearance",),
        ("tip_tolerance",),
        ("max_change_per_row_deg",),
    ):
        text = edited(text, location)
    (tmp_path / "short.yaml").write_text(text)
    full, short = (
        read_problem(tmp_path / f"{name}.yaml") for name in ("full", "short")
    )
    for part in fields(full):
        if part.compare:
            values = getattr(full, part.name), getattr(short, part.name)
            assert repr(values[0]) == repr(values[1]), part.name


def test_the_arm_shown_is_read_and_its_defaults_hold(tmp_path: Path) -> None:
    full = EXAMPLE.replace("manipulator: hrm8", ARM.rstrip(), 1)
    full = full.replace("start: [3126,", "start: [1600,")
    short = edited(
        edited(full, ("manipulator", "cables")), ("manipulator", "base_range")
    )
    arms = []
    for name, text in (("full", full), ("short", short)):
        (tmp_path / f"{name}.yaml").write_text(text)
        arms.append(read_problem(tmp_path / f"{name}.yaml").manipulator)
    assert repr(arms[0]) == repr(arms[1])
    assert (arms[0].cables.hole_angles == paper_hole_angles(5)).all()


def test_the_start_and_goal_shown_are_read_without_a_path(tmp_path: Path) -> None:
    text = edited(EXAMPLE.replace("manipulator: hrm8", ARM.rstrip(), 1), ("tip_path",))
    (tmp_path / "p.yaml").write_text(text + ENDS)
    problem = read_problem(tmp_path / "p.yaml")
    assert problem.tip_path is None
    assert problem.start is not None
    assert problem.goal is not None
    assert problem.goal.tip.tolist() == [1.5, 0.3, 0.0]


def test_the_curves_shown_are_read_and_their_default_holds(tmp_path: Path) -> None:
    (tmp_path / "seam.csv").write_text("x,y,z\n3126,10,-100\n")
    given = EXAMPLE.splitlines()
    (line,) = [i for i, text in enumerate(given) if text.startswith("  points:")]
    corners = []
    for curves in (CURVES, "\n".join(CURVES.splitlines()[:-1])):
        text = "\n".join([*given[:line], curves.rstrip(), *given[line + 1 :]])
        (tmp_path / "p.yaml").write_text(text)
        corners.append(read_problem(tmp_path / "p.yaml").path.points)
    assert (corners[0] == corners[1]).all()
    assert len(corners[0]) > 100


def test_angles_turn_and_holes_lie_as_the_page_says() -> None:
    """Oracle: the page's own formulas, held against kinematics and cables."""
    arm, rng = built_in("hrm8"), np.random.default_rng(0)
    for alpha, theta in rng.uniform(-0.6, 0.6, (50, 2)):
        angles = np.zeros((2, 1, 8))
        angles[0, 0, 0], angles[1, 0, 0] = alpha, theta
        x0 = rng.uniform(-1.0, 1.0, 1)
        centres = joint_centres(arm, x0, *angles)[0]
        np.testing.assert_allclose(centres[0], [x0[0], 0.0, 0.0], atol=1e-15)
        points = np.array(
            [
                np.cos(alpha) * np.cos(theta),
                np.sin(alpha) * np.cos(theta),
                -np.sin(theta),
            ]
        )
        link = (centres[1] - centres[0]) / arm.link_lengths[0]
        np.testing.assert_allclose(link, points, rtol=0.0, atol=1e-14)
        assert np.sign(centres[-1, 1:]).tolist() == [np.sign(alpha), -np.sign(theta)]


def test_cables_shorten_on_the_side_the_page_names() -> None:
    quarter = np.tile(np.deg2rad([0.0, 90.0, 180.0]), (8, 1))
    arm = built_in("hrm8")
    arm = replace(arm, cables=replace(arm.cables, hole_angles=quarter))
    d, r = arm.cables.half_gap, arm.cables.hole_radius

    def change(alpha: float, theta: float) -> FloatArray:
        rows = np.zeros((2, 2, 8))
        rows[0, 1, 0], rows[1, 1, 0] = alpha, theta
        lengths = cable_lengths(arm, *rows)
        return np.asarray(lengths[1, 0] - lengths[0, 0])

    # A hole at distance s from the bending axis, on the side turned towards: its span
    # is 2 (d cos(psi / 2) - s sin(psi / 2)).
    turn = 0.3
    spans = [
        2.0 * (d * np.cos(turn / 2.0) - s * np.sin(turn / 2.0)) for s in (-r, 0, r)
    ]
    outer, middle, inner = (span - 2.0 * d for span in spans)
    np.testing.assert_allclose(change(0.0, turn), [outer, middle, inner], atol=1e-12)
    np.testing.assert_allclose(change(turn, 0.0), [middle, inner, middle], atol=1e-12)
    np.testing.assert_allclose(change(0.0, -turn), [inner, middle, outer], atol=1e-12)


def test_the_picture_is_what_its_script_draws() -> None:
    made = PAGE.with_name("conventions.svg").read_text(encoding="utf-8")
    assert "conventions.svg" in PAGE.read_text(encoding="utf-8")
    assert made.startswith("<?xml")
