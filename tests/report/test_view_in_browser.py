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

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.errors import NoPlanFound, Reached
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.report.arm_drawing import ArmDrawing
from vdsm_pin.report.charts import packed
from vdsm_pin.report.facts import verification_file
from vdsm_pin.report.html import view_page, write_no_plan, write_report

pytestmark = NEEDS_CHROMIUM

TURNED = np.array([[0.0, -1, 0, 5], [1, 0, 0, -2], [0, 0, 1, 0.5], [0, 0, 0, 1]])
CART = """vdsm_problem: 1
name: cart
length_unit: mm
manipulator:
  link_lengths: [300, 300, 300, 300]
  link_radius: 40
  max_link_angle_deg: 45
  max_joint_angle_deg: 45
  feed: {length: 800, radius: 40}
obstacles:
  - {name: cart, shape: box, center: [0, 0, 0], size: [200, 200, 200],
     motion: {times_s: [0, 9], positions: [[700, -300, 0], [700, -1500, 0]]}}
required_clearance: 10
"""
SEEN = "points => points.map((one) => vdsm.view.overlay.seen(one))"


@pytest.fixture(scope="module")
def report(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Watched:
    judged = made_up.verification()
    turned = replace(judged.problem, T_world_base=TURNED)
    path = tmp_path_factory.mktemp("view") / "report.html"
    judged = replace(judged, problem=turned)
    write_report(path, judged, verification_file(judged, made_up.RECORD))
    options = {"viewport": {"width": 720, "height": 560}, "reduced_motion": "reduce"}
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


@pytest.mark.parametrize("size", [(720, 560), (360, 680), (1200, 340)])
def test_every_look_shows_the_whole_motion_as_large_as_it_fits(
    report: Watched, size: tuple[int, int]
) -> None:
    page = report.page
    page.set_viewport_size({"width": size[0], "height": size[1]})
    page.wait_for_timeout(50)
    for name in ("overview", "side", "top", "front"):
        page.locator(f"[data-look={name}]").click()
        page.evaluate("vdsm.view.viewer.render()")
        box = page.locator("#view").bounding_box()
        seen = np.array(page.evaluate(SEEN, places().tolist()))
        assert (seen > 0).all(), name
        assert (seen < [box["width"], box["height"]]).all(), name
        shares = np.ptp(seen, axis=0) / [box["width"], box["height"]]
        assert shares.max() > 0.4, name
        spots = page.evaluate(f"({SEEN})(vdsm.view.spots.map((p) => p.toArray()))")
        assert np.all(np.array(spots) > 0), "what stands around is whole"
        if name != "overview":
            shares = np.ptp(spots, axis=0) / [box["width"], box["height"]]
            assert shares.max() > 0.8, name
    page.set_viewport_size({"width": 720, "height": 560})


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


def test_link_and_obstacle_are_marked_where_they_come_near(report: Watched) -> None:
    assert made_up.problem().required_clearance < 0.0042
    check_marked(report.page, 0x2F8AE5)


def test_link_and_obstacle_are_red_where_they_come_too_near(
    browser: Any, tmp_path: Path
) -> None:
    judged = made_up.verification()
    asked = replace(judged.problem, required_clearance=0.005)
    judged = replace(judged, problem=asked)
    path = tmp_path / "report.html"
    write_report(path, judged, verification_file(judged, made_up.RECORD))
    watched = Watched(browser, path.as_uri())
    watched.page.wait_for_function("window.vdsm && window.vdsm.view")
    check_marked(watched.page, 0xE03131)


def check_marked(page: Any, colour: int) -> None:
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


def choose(page: Any, what: str, value: str) -> None:
    page.locator(what).select_option(value)
    page.evaluate("vdsm.view.viewer.render()")


def test_a_section_cuts_the_obstacles_where_it_says(report: Watched) -> None:
    page = report.page
    choose(page, "[data-section=axis]", "2")
    page.locator("[data-section=place]").fill("0.2")  # of the file's frame
    points = page.evaluate(
        "Array.from(vdsm.view.section.outline.geometry.getAttribute('position').array)"
    )
    ends = np.array(points).reshape(-1, 2, 3)
    height = ends[..., 2] + TURNED[2, 3]
    np.testing.assert_allclose(height, 0.2, atol=1e-6)
    crate = ends[(np.abs(ends[..., :2] - [0.6, 0.9]) < 0.2001).all(axis=(1, 2))]
    length = np.linalg.norm(crate[:, 0] - crate[:, 1], axis=1).sum()
    assert length == pytest.approx(4 * 0.4, abs=1e-5), "the crate's outline"
    assert page.locator("[data-section=read]").text_content() == "z = 200 mm"
    clipped = "vdsm.view.obstacles[0].material.clippingPlanes"
    keeps = f"{clipped}[0].distanceToPoint(vdsm.view.cameras.camera.position)"
    assert page.evaluate(keeps) < 0, "the camera looks into what is left"
    page.locator("[data-section=flip]").click()
    assert page.evaluate(keeps) > 0
    choose(page, "[data-section=axis]", "")
    assert page.evaluate(f"{clipped}.length") == 0
    assert page.evaluate("vdsm.view.section.outline.visible") is False


def test_obstacles_are_shown_hidden_and_seen_through_one_by_one(
    report: Watched,
) -> None:
    page = report.page
    page.locator("[data-obstacles] summary").click()
    rows = page.locator("[data-rows] label")
    rows.first.wait_for()
    assert rows.count() == 7
    assert rows.nth(5).locator(".name").text_content() == "part <1>"
    rows.nth(1).locator("select").select_option("hidden")
    rows.nth(2).locator("select").select_option("solid")
    visible = page.evaluate("vdsm.view.obstacles.map((one) => one.visible)")
    assert visible == [True, False, *[True] * 5]
    opacity = page.evaluate("vdsm.view.obstacles.map((one) => one.material.opacity)")
    assert opacity[2] == 1.0
    assert opacity[3] < 1.0
    page.locator("[data-obstacles] > label select").select_option("translucent")
    assert all(page.evaluate("vdsm.view.obstacles.map((one) => one.visible)"))


def test_what_is_marked_as_hidden_is_not_seen(report: Watched) -> None:
    """What only pages of robots offer, among others."""
    assert report.page.locator("[data-solids][hidden]").count() == 1
    hidden = report.page.locator("[hidden]").all()
    assert not any(one.is_visible() for one in hidden)


def test_the_swept_volume_has_the_arm_at_moments_of_the_motion(report: Watched) -> None:
    page = report.page
    page.locator("[data-toggle=swept]").check()
    found = page.evaluate(
        "() => { const body = vdsm.view.swept.children[0];"
        "return Array.from(body.instanceMatrix.array); }"
    )
    bases = np.array(found).reshape(-1, 16)[:, 12:15]
    rows = made_up.trajectory()
    moments = np.linspace(0, rows.n_samples - 1, len(bases))
    expected = np.interp(moments, np.arange(rows.n_samples), rows.x0)
    assert len(bases) > 100
    np.testing.assert_allclose(bases[:, 0], expected, atol=1e-5)
    page.locator("[data-toggle=swept]").uncheck()
    assert page.evaluate("vdsm.view.swept.visible") is False


def test_the_read_out_says_what_is_proved_at_the_slider(report: Watched) -> None:
    page, judged = report.page, made_up.verification()
    for k in (0, 60, 150, 199):
        page.evaluate("time => vdsm.motion.go(time)", k)
        lower = judged.profile.link_lower[min(k, 198)]
        least = f"link {judged.profile.link_upper[min(k, 198)].argmin() + 1}"
        text = page.locator("[data-clearance]").text_content()
        assert text.startswith(least)
        shown = float(text.split("at least ")[1].split(" ")[0])
        assert shown == pytest.approx(max(lower.min(), 0.0041) * 1000, abs=2e-3)
        told = page.locator("[data-slider]").get_attribute("aria-valuetext")
        assert text in told


@pytest.mark.parametrize(
    ("lower", "upper", "words"),
    [
        (-200.0, -150.0, "link 1 meets ball"),
        (0.0, 0.0, "link 1 meets ball"),
        (-45.0, 1e-8, "link 1 meets ball"),
        (-200.0, 1.0, "link 1 may meet ball"),
        (7.0, 8.0, "link 1 from ball: at least 7.000 mm"),
    ],
)
def test_the_read_out_does_not_give_the_depth_of_what_meets(
    report: Watched, lower: float, upper: float, words: str
) -> None:
    charts = [
        {
            "id": f"clearance-{kind}",
            "limits": [{"value": 5.0}],
            "series": [{"name": name, "values": packed(lower), "upper": packed(upper)}],
        }
        for kind, name in (("link", "link 1"), ("obstacle", "ball"))
    ]
    script = "charts => new Clearances(charts, { place: () => [0] }).at(0)"
    told = report.page.evaluate(script, charts)
    assert told["text"] == words
    assert told["short"] is (lower < 5.0)


def test_the_read_out_names_who_comes_nearest_not_who_is_bounded_roughly(
    report: Watched,
) -> None:
    """A far link whose lower bound is no more than the whole motion's."""
    both = {"link": ("link 3", "link 6"), "obstacle": ("tank", "gate")}
    charts = [
        {
            "id": f"clearance-{kind}",
            "limits": [{"value": 5.0}],
            "series": [
                {"name": names[0], "values": packed(7.0), "upper": packed(900.0)},
                {"name": names[1], "values": packed(7.0), "upper": packed(7.5)},
            ],
        }
        for kind, names in both.items()
    ]
    script = "charts => new Clearances(charts, { place: () => [0] }).at(0)"
    told = report.page.evaluate(script, charts)
    assert told["text"] == "link 6 from gate: at least 7.000 mm"


def test_plots_run_over_waypoints_or_the_way_of_the_tip(report: Watched) -> None:
    page = report.page
    choose(page, "[data-along]", "travel")
    tips = joint_centres(
        made_up.problem().manipulator, *(
            getattr(made_up.trajectory(), name) for name in ("x0", "alpha", "theta")
        )
    )[:, -1]  # fmt: skip
    way = np.concatenate(
        [[0.0], np.linalg.norm(np.diff(tips, axis=0), axis=1).cumsum()]
    )
    for k in (20, 77, 140):
        share = page.evaluate("time => vdsm.motion.shareAt(time)", k)
        assert share == pytest.approx(way[k] / way[-1], abs=1e-4)
        back = page.evaluate("share => vdsm.motion.momentAt(share)", share)
        assert back == pytest.approx(k, abs=1e-2)
    plot = page.locator("[data-chart=psi] svg")
    assert "way of the tip" in plot.get_attribute("aria-label")
    box = plot.bounding_box()
    plot.click(position={"x": 0.5 * box["width"], "y": 0.4 * box["height"]})
    share = page.evaluate("vdsm.motion.shareAt(vdsm.motion.time)")
    assert share == pytest.approx((320 - 58) / (640 - 58 - 14), abs=0.01)
    choose(page, "[data-along]", "waypoint")


def test_curved_axes_have_three_ticks_whatever_they_span(report: Watched) -> None:
    rng = np.random.default_rng(5)
    for _ in range(200):
        ends = np.sort(np.sinh(rng.uniform(-9, 9, 2)))
        if np.arcsinh(ends[1]) - np.arcsinh(ends[0]) < 0.05:
            continue
        found = report.page.evaluate(
            """([low, high]) => {
                const height = (v) => (186 * (Math.asinh(v) - Math.asinh(low))) /
                  (Math.asinh(high) - Math.asinh(low));
                const apart = (values) => values.reduce((kept, v) =>
                  kept.every((o) => Math.abs(height(o) - height(v)) >= 13)
                    ? [...kept, v] : kept, []);
                return curvedTicks(low, high, apart);
            }""",
            ends.tolist(),
        )
        assert len(found) >= 3, ends
        assert all(ends[0] - 1e-9 <= value <= ends[1] + 1e-9 for value in found)


def test_the_picture_can_be_saved(report: Watched, tmp_path: Path) -> None:
    report.page.evaluate("vdsm.motion.go(12.5)")
    with report.page.expect_download() as download:
        report.page.locator("[data-save]").click()
    assert download.value.suggested_filename == "made-up-certified-12.5.png"
    download.value.save_as(tmp_path / "saved.png")
    assert (tmp_path / "saved.png").read_bytes().startswith(b"\x89PNG")


def test_the_motion_plays_at_the_speed_chosen(report: Watched) -> None:
    page = report.page
    page.locator("[data-speed]").select_option("4")
    assert page.evaluate("vdsm.motion.speed") == 4
    page.locator("[data-speed]").select_option("1")
    page.evaluate("vdsm.motion.go(10)")
    later = page.evaluate("vdsm.motion.later(2)")
    assert later == pytest.approx(10 + 2 * 199 / 8), "all of it in 8 s"
    # A motion with times plays as they say.
    assert page.evaluate(
        """() => { const timed = Object.create(vdsm.motion);
        timed.times = Float64Array.from(vdsm.motion.rows, (row) => 3 + row * row / 100);
        timed.go(10); return [timed.later(3), timed.later(1e9)]; }"""
    ) == [20.0, 199.0]
    page.evaluate("vdsm.motion.go(0)")
    assert report.errors == []


def test_a_page_without_a_plan_shows_where_the_search_ended(
    browser: Any, tmp_path: Path
) -> None:
    path = tmp_path / "no_plan.html"
    error = NoPlanFound("in vain", Reached("drew 1 m", 1.25, 3, "ball"))
    run = "fewest", made_up.RECORD
    write_no_plan(path, made_up.problem(), error, *run)
    watched = Watched(browser, path.as_uri())
    page = watched.page
    page.wait_for_function("window.vdsm && window.vdsm.view")
    colours = page.evaluate(
        "vdsm.view.obstacles.map((one) => one.material.color.getHex())"
    )
    assert [one == 0xE03131 for one in colours] == [False, True] + [False] * 5
    links = page.evaluate(
        "vdsm.view.arm.links.map((one) => one.material.color.getHex())"
    )
    assert links.index(0xE03131) == 2
    tip = page.evaluate("vdsm.view.tipNow")
    there = made_up.problem().path.at(np.array([1.25]))[0]
    np.testing.assert_allclose(tip, there, atol=1e-5)
    assert page.locator("[data-play]").is_hidden()
    assert len(np.unique((pixels(page) * 255).astype(int), axis=0)) > 300
    watched.shot("no-plan")
    assert watched.errors == []
    assert len(watched.requests) == 1
    page.close()


def test_the_first_look_has_room_for_what_moves_and_for_the_feed(
    browser: Any, tmp_path: Path
) -> None:
    file = tmp_path / "cart.yaml"
    file.write_text(CART, encoding="utf-8")
    problem, still = read_problem(file), np.zeros((3, 4))
    times = np.array([0.0, 5.0, 9.0])
    motion = Trajectory(
        np.zeros(3, dtype=np.bool_), np.zeros(3), np.zeros(3), still, still, times=times
    )
    page = tmp_path / "view.html"
    page.write_text(view_page(ArmDrawing(problem, motion)), encoding="utf-8")
    watched = Watched(browser, page.as_uri())
    watched.page.wait_for_function("window.vdsm && window.vdsm.view")
    ends = [[0.7, -1.5, 0.0], [0.7, -0.3, 0.0], [-0.8, 0.0, 0.0], [1.2, 0.0, 0.0]]
    seen = np.array(watched.page.evaluate(SEEN, ends))
    box = watched.page.locator("#view").bounding_box()
    assert (seen > 0).all()
    assert (seen < [box["width"], box["height"]]).all()
    assert watched.errors == []


def test_a_scene_without_obstacles_and_a_motion_of_one_row_have_a_page(
    browser: Any, tmp_path: Path
) -> None:
    judged = made_up.verification(n=1, scene=Scene())
    judged = replace(judged, approaches=())
    path = tmp_path / "report.html"
    write_report(path, judged, verification_file(judged, made_up.RECORD))
    watched = Watched(browser, path.as_uri())
    page = watched.page
    page.wait_for_function("window.vdsm && window.vdsm.view")
    page.locator("[data-look=side]").click()
    page.locator("[data-toggle=numbers]").check()
    assert page.locator("[data-section=axis]").count() == 0
    assert page.locator("[data-play]").is_hidden()
    assert watched.errors == []
