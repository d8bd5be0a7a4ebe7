"""The 3D view in Chromium: where it looks from, and what it draws over the picture.

Oracles: a parallel projection worked out here, the size of the pane, pixels.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import made_up
import numpy as np
import pytest
from watched_pages import NEEDS_CHROMIUM, Watched, pixels

from vdsm_pin.kinematics import joint_centres
from vdsm_pin.report.facts import verification_file
from vdsm_pin.report.html import write_report

pytestmark = NEEDS_CHROMIUM

TURNED = np.array([[0.0, -1, 0, 5], [1, 0, 0, -2], [0, 0, 1, 0.5], [0, 0, 0, 1]])
SEEN = "points => points.map((one) => vdsm.view.overlay.seen(one))"


@pytest.fixture(scope="module")
def report(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Watched:
    judged = made_up.verification()
    turned = replace(judged.problem, T_world_base=TURNED)
    path = tmp_path_factory.mktemp("view") / "report.html"
    judged = replace(judged, problem=turned)
    write_report(path, judged, verification_file(judged, made_up.RECORD))
    options = {"viewport": {"width": 900, "height": 700}, "reduced_motion": "reduce"}
    watched = Watched(browser, path.as_uri(), **options)
    watched.page.wait_for_function("window.vdsm && window.vdsm.view")
    return watched


def places() -> np.ndarray:
    """Joint centres along the motion, base frame, shape (n, 3); [m]."""
    arm, rows = made_up.problem().manipulator, made_up.trajectory()
    return joint_centres(arm, rows.x0, rows.alpha, rows.theta)[::7].reshape(-1, 3)


@pytest.mark.parametrize(
    ("name", "across", "up"),
    [("side", [1, 0, 0], [0, 0, 1]), ("top", [1, 0, 0], [0, 1, 0]),
     ("front", [0, 1, 0], [0, 0, 1])],
)  # fmt: skip
def test_a_side_view_is_a_parallel_projection_along_an_axis_of_the_arm(
    report: Watched, name: str, across: list[float], up: list[float]
) -> None:
    page, points = report.page, places()
    page.locator(f"[data-look={name}]").click()
    page.evaluate("vdsm.view.viewer.render()")
    seen = np.array(page.evaluate(SEEN, points.tolist()))
    scale = page.evaluate("vdsm.view.cameras.scale")
    flat = np.column_stack([points @ across, points @ up]) / scale
    expected = flat * [1, -1]
    expected += (seen - expected).mean(axis=0)
    np.testing.assert_allclose(seen, expected, atol=0.02)


@pytest.mark.parametrize("name", ["overview", "side", "top", "front"])
@pytest.mark.parametrize("size", [(900, 700), (420, 800), (1500, 420)])
def test_every_look_shows_the_whole_motion_as_large_as_it_fits(
    report: Watched, name: str, size: tuple[int, int]
) -> None:
    page = report.page
    page.set_viewport_size({"width": size[0], "height": size[1]})
    page.wait_for_timeout(50)
    page.locator(f"[data-look={name}]").click()
    page.evaluate("vdsm.view.viewer.render()")
    box = page.locator("#view").bounding_box()
    seen = np.array(page.evaluate(SEEN, places().tolist()))
    assert (seen > 0).all()
    assert (seen < [box["width"], box["height"]]).all()
    assert (np.ptp(seen, axis=0) / [box["width"], box["height"]]).max() > 0.3
    page.set_viewport_size({"width": 900, "height": 700})


def test_the_view_from_the_tip_looks_along_the_last_link(report: Watched) -> None:
    page = report.page
    page.locator("[data-look=tip]").click()
    for time in (3.0, 60.5, 120.25):
        page.evaluate("time => vdsm.motion.go(time)", time)
        page.evaluate("vdsm.view.viewer.render()")
        joint, tip = np.array(page.evaluate("vdsm.view.centres.slice(-2)"))
        ahead = tip + 0.8 * (tip - joint)
        ((x, y),) = page.evaluate(SEEN, [ahead.tolist()])
        box = page.locator("#view").bounding_box()
        assert (x, y) == pytest.approx((box["width"] / 2, box["height"] / 2), abs=0.5)
    page.locator("[data-look=overview]").click()
    assert page.evaluate("vdsm.view.arm.tip.visible")


def test_the_worst_moment_flies_to_the_gap_and_measures_it(report: Watched) -> None:
    page = report.page
    page.locator("[data-look=overview]").click()
    page.locator("button.worst").click()
    page.evaluate("vdsm.view.viewer.render()")
    box = page.locator("#view").bounding_box()
    nearest = made_up.verification().approaches[0]
    ends = [nearest.link_point.tolist(), nearest.other_point.tolist()]
    seen = np.array(page.evaluate(SEEN, ends))
    middle = [box["width"] / 2, box["height"] / 2]
    np.testing.assert_allclose(seen.mean(axis=0), middle, atol=1.0)
    scale = page.evaluate("vdsm.view.cameras.scale")
    gap = np.linalg.norm(seen[1] - seen[0]) * scale
    assert gap == pytest.approx(0.0041, abs=2e-6), "seen across, in its true length"
    assert page.evaluate("lengthText(vdsm.view.shown.upper)") == "4.200 mm"
    before = pixels(page)
    page.evaluate("vdsm.view.overlay.dimension = () => {}; vdsm.view.viewer.render()")
    assert (before != pixels(page)).any(), "the dimension was drawn"
    assert report.errors == []


@pytest.mark.parametrize(("needed", "colour"), [(0.0035, 0x2F8AE5), (0.005, 0xE03131)])
def test_link_and_obstacle_are_marked_and_red_only_where_it_is_too_near(
    browser: Any, tmp_path: Path, needed: float, colour: int
) -> None:
    judged = made_up.verification()
    asked = replace(judged.problem, required_clearance=needed)
    judged = replace(judged, problem=asked)
    path = tmp_path / "report.html"
    write_report(path, judged, verification_file(judged, made_up.RECORD))
    watched = Watched(browser, path.as_uri())
    page = watched.page
    page.wait_for_function("window.vdsm && window.vdsm.view")
    page.evaluate("vdsm.motion.go(0.25)")
    links = page.evaluate(
        "vdsm.view.arm.links.map((one) => one.material.color.getHex())"
    )
    bodies = page.evaluate("vdsm.view.obstacles.map((o) => o.material.color.getHex())")
    assert [one == colour for one in links] == [True] + [False] * 7
    assert [one == colour for one in bodies] == [True] + [False] * 6
    page.evaluate("vdsm.motion.go(9)")
    assert colour not in page.evaluate(
        "vdsm.view.obstacles.map((one) => one.material.color.getHex())"
    )
    page.close()
