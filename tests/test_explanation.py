"""The page of the seven steps: its numbers against the equations, its refusals."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from vdsm_pin.app.explanation.cross import DIRECTIONS, crosses
from vdsm_pin.app.explanation.folder import explain_to_folder
from vdsm_pin.app.explanation.pictures import Canvas
from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.errors import InvalidInput, NoPlanFound
from vdsm_pin.geometry.solids import Cylinder
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.paper.along_rail import AlongRail
from vdsm_pin.planner.paper.steps import PaperSteps
from vdsm_pin.problem.scene import Scene
from vdsm_pin.refinement import plan_and_verify


def steps_of(name: str) -> PaperSteps:
    problem = read_problem(name)
    found = plan_and_verify(problem, "paper").plan.steps
    assert found is not None
    return found


def test_the_steps_kept_are_those_of_the_plan() -> None:
    made = steps_of("paper/obs1")
    arm = read_problem("paper/obs1").manipulator
    rows = made.trajectory
    centres = joint_centres(arm, rows.x0, rows.alpha, rows.theta)
    np.testing.assert_allclose(made.centres, centres, rtol=0, atol=1e-12)
    np.testing.assert_allclose(made.planar, made.centres[..., 1:], rtol=0, atol=1e-15)
    tips = made.route.tip_path.points
    np.testing.assert_allclose(made.centres[:, -1], tips, rtol=0, atol=1e-15)
    reference = arm.ratios[:, None] * tips[:, None, 1:]
    np.testing.assert_allclose(made.reference, reference, rtol=0, atol=1e-15)


@pytest.mark.parametrize("name", ["paper/obs1", "paper/obs2-small"])
def test_the_four_points_lie_on_the_boundary_and_the_cross(name: str) -> None:
    """A moved joint stands on the boundary too, another one in proportion."""
    made, arm = steps_of(name), read_problem(name).manipulator
    assert isinstance(made.avoidance, AlongRail)
    moved = 0
    for row in range(0, made.trajectory.n_samples, 37):
        side = int(made.route.side[row])
        if not side:
            continue
        rule = made.avoidance.rules[side]
        for one in crosses(arm, rule, made.planar[max(row - 1, 0)], made.planar[row]):
            if not one.moved:
                np.testing.assert_allclose(one.place, one.proportional, atol=1e-12)
                continue
            moved += 1
            points = np.vstack([one.points, one.place])
            on = one.region.core_distance(np.repeat(points[:, None], 2, axis=1))
            np.testing.assert_allclose(on, one.region.radius, rtol=0, atol=1e-9)
            offset = one.points - one.proportional
            along = (offset * DIRECTIONS).sum(axis=1)
            assert (along > 0.0).all()
            np.testing.assert_allclose(offset, along[:, None] * DIRECTIONS, atol=1e-12)
    assert moved > 10


@pytest.mark.parametrize("name", ["paper/free", "paper/obs1", "paper/obs3"])
def test_a_page_has_every_step_and_asks_nobody(name: str, tmp_path: Path) -> None:
    page, row = explain_to_folder(read_problem(name), None, tmp_path)
    text = page.read_text(encoding="utf-8")
    for k in range(1, 8):
        assert f"Step {k}: " in text
    assert f"waypoint {row} of" in text
    assert not re.search(r"(src|href)=\"(?!data:)", text)
    assert "nan" not in re.sub(r"<style>.*?</style>", "", text, flags=re.S)
    pictures = etree.HTML(text).xpath("//section//svg[@role='img']")
    assert len(pictures) >= 6
    assert all(picture.xpath("title/text()") for picture in pictures)


def test_nothing_is_drawn_outside_of_its_picture(tmp_path: Path) -> None:
    """Three rods are gone round together: crossings far off."""
    along, free = np.array([1.0, 0.0, 0.0]), read_problem("paper/free")
    rods = [
        Cylinder(f"rod {y}", np.array([1.5, y, z]), along, 9.0, radius)
        for y, z, radius in (
            (0.36, 0.156, 0.08),
            (0.17, -0.96, 0.11),
            (0.41, -0.23, 0.198),
        )
    ]
    asked = replace(free, scene=Scene(tuple(rods)))
    page, _ = explain_to_folder(asked, None, tmp_path)
    document = etree.HTML(page.read_text(encoding="utf-8"))
    pictures = document.xpath("//section//svg[@role='img'][polyline[@class='path']]")
    assert len(document.xpath("//polyline[@class='cross']")) > 6
    for picture in pictures:
        size = np.array([float(picture.get("width")), float(picture.get("height"))])
        lines = " ".join(picture.xpath("polyline/@points")).split()
        points = np.array([line.split(",") for line in lines], dtype=float)
        dots = picture.xpath("circle/@cx"), picture.xpath("circle/@cy")
        points = np.vstack([points, np.array(dots, dtype=float).T])
        assert ((points >= 0.0) & (points <= size)).all(), picture.get("aria-label")


def test_what_cannot_be_explained_is_refused(tmp_path: Path) -> None:
    problem = read_problem("paper/obs1")
    with pytest.raises(InvalidInput, match="waypoint is 99999, expected 0 to "):
        explain_to_folder(problem, 99999, tmp_path)
    bent = replace(problem.path, start_joints=np.array([0.0, *[0.1] * 16]))
    asked = replace(problem, tip_path=bent)
    with pytest.raises(NoPlanFound, match="starts bent"):
        explain_to_folder(asked, 3, tmp_path)
    assert not (tmp_path / "explain.html").exists()


def test_a_problem_without_a_path_has_nothing_to_explain(tmp_path: Path) -> None:
    file = tmp_path / "reach.yaml"
    goal = "start: [5000, 0, 0]\ngoal: {tip: [5000, 300, 200]}\n"
    arm = "length_unit: mm\nmanipulator: hrm8\nrequired_clearance: 5\n"
    file.write_text(f"vdsm_problem: 1\n{arm}{goal}", encoding="utf-8")
    with pytest.raises(InvalidInput, match="has no tip_path"):
        explain_to_folder(read_problem(str(file)), None, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_drawing_keeps_its_scale_and_escapes_its_words() -> None:
    made = Canvas(np.array([[0.0, 0.0], [2.0, 1.0]]), "y", "z")
    made.dot(np.zeros(2), "joint", "a<b")
    made.dot(np.array([2.0, 0.0]), "joint")
    made.dot(np.array([0.0, 1.0]), "joint")
    root = etree.fromstring(made.svg("a & b").encode())
    assert root.xpath("string(title)") == "a & b"
    assert "a<b" in root.xpath("//text()")
    at = [(float(c.get("cx")), float(c.get("cy"))) for c in root.iter("circle")]
    assert at[1][0] - at[0][0] == pytest.approx(2.0 * (at[0][1] - at[2][1]), abs=0.2)


def test_the_page_says_no_more_of_the_clearance_than_is_proved(tmp_path: Path) -> None:
    problem = read_problem("paper/obs1")
    page, _ = explain_to_folder(problem, 458, tmp_path / "out")
    text = page.read_text(encoding="utf-8")
    proved = plan_and_verify(problem, "paper").verification.min_clearance
    (told,) = re.findall(r"([0-9.]+) mm proved between the surfaces", text)
    assert 1e3 * proved - 1e-3 < float(told) <= 1e3 * proved
    rows = re.findall(r">link \d</td>(.*?)</tr>", text)
    cells = [re.findall(r">([0-9.]+)(?: mm)?<", row) for row in rows]
    assert len(cells) == 8
    for _, lower, upper in cells:
        assert float(lower) < float(upper)  # rounded apart


def test_the_start_and_a_waypoint_beside_it_can_both_be_read(tmp_path: Path) -> None:
    page, _ = explain_to_folder(read_problem("paper/obs3"), 1, tmp_path / "out")
    text = page.read_text(encoding="utf-8")
    words = {
        word: (float(x), anchor)
        for x, anchor, word in re.findall(
            r'<text x="([-0-9.]+)"[^>]*text-anchor="(\w+)"[^>]*>(start|waypoint 1)<',
            text,
        )
    }
    (before, ends), (after, begins) = words["start"], words["waypoint 1"]
    assert (ends, begins) == ("end", "start") and before < after
