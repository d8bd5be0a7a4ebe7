"""The pages in Chromium: no request leaves them, and what moves moves.

Oracles: the pixels of a screenshot, the page's own state, Python's forward kinematics.
Screenshots stay in test-output/.
"""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import made_up
import numpy as np
import pytest
from watched_pages import NEEDS_CHROMIUM, Watched, pixels

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.report.facts import batch_row, verification_file
from vdsm_pin.report.html import write_index, write_report
from vdsm_pin.report.picture import picture
from vdsm_pin.report.words import OUTCOMES
from vdsm_pin.simulation.closed_loop import Simulation
from vdsm_pin.simulation.folder import Cleared, SimulationFile
from vdsm_pin.simulation.page import page
from vdsm_pin.simulation.settings import Settings
from vdsm_pin.verification.records import (
    Check,
    Counterexample,
    ErrorBox,
    Verdict,
)

pytestmark = NEEDS_CHROMIUM


@pytest.fixture(scope="module")
def report(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Watched:
    path = tmp_path_factory.mktemp("report") / "report.html"
    judged = made_up.verification()
    write_report(path, judged, verification_file(judged, made_up.RECORD))
    watched = Watched(browser, path.as_uri(), viewport={"width": 800, "height": 600})
    watched.page.wait_for_function("window.vdsm && window.vdsm.view")
    return watched


REACHABLE = """() =>
  [...document.querySelectorAll("button, a, input")]
    .filter((node) => node.getClientRects().length > 0).length"""
FOCUS = """() => {
  const node = document.activeElement;
  if (!node || node === document.body) return null;
  const place = [...document.querySelectorAll("*")].indexOf(node);
  const { outlineStyle, outlineWidth } = getComputedStyle(node);
  const ring = outlineStyle !== "none" && parseFloat(outlineWidth) >= 2;
  return { place, ring, what: node.outerHTML.slice(0, 80) };
}"""
GROUND = "getComputedStyle(document.body).backgroundColor"
CONTRASTS = """() => {
  function parts(colour) {
    const [r, g, b, a = 1] = colour.match(/[\\d.]+/g).map(Number);
    return [r, g, b, a];
  }
  function over([r, g, b, a], [R, G, B]) {
    return [r * a + R * (1 - a), g * a + G * (1 - a), b * a + B * (1 - a)];
  }
  function ground(node) {
    if (!node) return [255, 255, 255];
    const own = parts(getComputedStyle(node).backgroundColor);
    return own[3] === 1 ? own : over(own, ground(node.parentElement));
  }
  function light(colour) {
    const [r, g, b] = colour.slice(0, 3).map((v) => {
      const c = v / 255;
      return c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
    });
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  }
  const found = [];
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const node = walk.currentNode.parentElement;
    const text = walk.currentNode.textContent.trim();
    if (!text || node.closest("script, style, .hover") || !node.getClientRects().length)
      continue;
    const style = getComputedStyle(node);
    const behind = ground(node.closest("svg") ? node.closest("figure") : node);
    const ink = over(parts(node.closest("svg") ? style.fill : style.color), behind);
    const [low, high] = [light(ink), light(behind)].sort((a, b) => a - b);
    found.push({ text, ratio: (high + 0.05) / (low + 0.05) });
  }
  return found;
}"""


def time_of(watched: Watched) -> float:
    return float(watched.page.evaluate("vdsm.motion.time"))


def test_nothing_is_requested_and_nothing_fails(report: Watched) -> None:
    report.shot("report")
    assert len(report.requests) == 1
    assert report.requests[0].startswith("file:")
    assert report.errors == []


def test_no_name_of_a_curve_is_cut(report: Watched) -> None:
    cut = """[...document.querySelectorAll(".legend .name")].filter((name) =>
      name.scrollWidth > name.clientWidth || name.scrollHeight > name.clientHeight)
      .map((name) => name.textContent)"""
    assert report.page.locator(".legend .name").count() > 40
    assert report.page.evaluate(cut) == []


def test_below_zero_a_legend_tells_both_bounds(report: Watched) -> None:
    told = """([lower, upper]) => {
      const plot = vdsm.plots.find((one) => one.chart.unit === " mm");
      const values = (value) => new Float32Array(200).fill(value);
      const one = { values: values(lower), upper: values(upper), step: true };
      return plot.told(one, 3); }"""
    page = report.page
    assert page.evaluate(told, [-45.181, -7.8151]) == "−45.19 to −7.81 mm"
    assert page.evaluate(told, [4.1, 5.0]) == "4.10 mm"


def test_the_arm_is_seen_in_its_colours(report: Watched) -> None:
    seen = pixels(report.page)
    assert len(np.unique((seen * 255).astype(int), axis=0)) > 500
    blue = (seen[:, 2] > seen[:, 0] + 0.3) & (seen[:, 2] > 0.5)
    assert blue.mean() > 1e-3, "the first link is blue"


def test_the_page_moves_the_arm_as_the_kinematics_say(report: Watched) -> None:
    judged = made_up.verification()
    rows, arm = judged.trajectory, judged.problem.manipulator
    for time in (0.0, 10.5, 93.25, 199.0):
        report.page.evaluate("time => vdsm.motion.go(time)", time)
        k, share = int(time), time - int(time)
        nxt = min(k + 1, rows.n_samples - 1)
        mixed = [
            (one[[k]] * (1.0 - share) + one[[nxt]] * share)
            for one in (rows.x0, rows.alpha, rows.theta)
        ]
        tip = joint_centres(arm, *mixed)[0, -1]
        shown = report.page.evaluate("vdsm.view.tipNow")
        np.testing.assert_allclose(shown, tip, atol=1e-5)


def test_slider_plot_and_play_move_one_moment(report: Watched) -> None:
    page = report.page
    page.locator("[data-slider]").fill("50")
    assert time_of(report) == 50.0
    before = pixels(page)
    plot = page.locator("[data-chart=psi] svg")
    box = plot.bounding_box()
    plot.click(position={"x": 0.6 * box["width"], "y": 0.4 * box["height"]})
    clicked = time_of(report)
    inner = (0.6 * 640 - 58) / (640 - 58 - 14) * 199
    assert clicked == pytest.approx(inner, abs=1.0)
    assert float(page.locator("[data-slider]").input_value()) == pytest.approx(clicked)
    assert not np.array_equal(before, pixels(page)), "the arm did not move"
    page.locator("[data-speed]").select_option(
        "0.1"
    )  # it shall not end before it stops
    page.locator("[data-play]").click()
    page.wait_for_function(f"vdsm.motion.time > {clicked + 0.1}")
    page.locator("[data-play]").click()
    page.locator("[data-speed]").select_option("1")
    stopped = time_of(report)
    page.wait_for_timeout(100)
    assert time_of(report) == stopped
    report.shot("report-played")


def test_the_worst_moment_is_one_click_away(report: Watched) -> None:
    report.page.evaluate("vdsm.motion.go(120)")
    report.page.locator("button.worst").click()
    assert time_of(report) == 0.25
    assert report.page.evaluate("vdsm.view.due")


def test_keys_play_and_step(report: Watched) -> None:
    page = report.page
    page.evaluate("document.activeElement.blur(); vdsm.motion.go(7)")
    page.keyboard.press("ArrowRight")
    assert time_of(report) == 8.0
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("ArrowLeft")
    assert time_of(report) == 6.0
    page.keyboard.press(" ")
    page.wait_for_function("vdsm.motion.time > 6.5")
    page.keyboard.press(" ")
    assert page.evaluate("vdsm.motion.playing") is False


def test_the_keyboard_reaches_everything_and_shows_where_it_is(report: Watched) -> None:
    page = report.page
    page.evaluate("document.activeElement.blur(); window.scrollTo(0, 0)")
    reached = set()
    for _ in range(400):
        page.keyboard.press("Tab")
        one = page.evaluate(FOCUS)
        if one is None:  # past the last one, it begins anew
            continue
        if one["place"] in reached:
            break
        assert one["ring"], f"no ring around {one['what']}"
        reached.add(one["place"])
    assert len(reached) >= page.evaluate(REACHABLE)
    page.locator("[data-slider]").focus()
    page.evaluate("vdsm.motion.go(20.25)")
    page.keyboard.press("ArrowRight")
    assert time_of(report) == 21.0
    page.locator("[data-look=top]").focus()
    before = page.evaluate("vdsm.view.eye()")
    page.keyboard.press(" ")
    assert page.evaluate("vdsm.view.eye()") != before
    assert page.evaluate("vdsm.motion.playing") is False


def test_keys_turn_the_scene_and_come_nearer(report: Watched) -> None:
    """Oracle: a turn keeps the distance from what is looked at, a step scales it."""
    page = report.page
    page.evaluate("vdsm.motion.go(7); vdsm.view.look('overview')")
    seen = """() => { const { camera, target } = vdsm.view.cameras;
      return [...camera.position.clone().sub(target).toArray(), camera.zoom]; }"""
    page.locator("#view canvas[role=img]").focus()
    away = {}
    for key in ("Shift", "ArrowRight", "ArrowUp", "ArrowLeft", "ArrowDown", "+", "-"):
        page.keyboard.press(key)
        away[key] = np.array(page.evaluate(seen)[:3])
    far = {key: np.linalg.norm(place) for key, place in away.items()}
    assert np.linalg.norm(away["ArrowRight"] - away["Shift"]) > 0.1 * far["Shift"]
    assert away["ArrowUp"][1] > away["ArrowRight"][1] == pytest.approx(away["Shift"][1])
    assert away["ArrowDown"] == pytest.approx(away["Shift"])
    assert list(far.values()) == pytest.approx(
        [far["Shift"]] * 5 + [0.9 * far["-"], far["-"]]
    )
    assert time_of(report) == 7.0
    page.locator("[data-look=side]").click()
    page.locator("#view canvas[role=img]").focus()
    page.keyboard.press("+")
    assert page.evaluate(seen)[3] == pytest.approx(1.0 / 0.9)
    page.locator("[data-look=overview]").click()
    assert report.errors == []


def test_a_question_mark_lists_the_keys(report: Watched) -> None:
    page = report.page
    page.evaluate("document.activeElement.blur()")
    assert not page.locator("#keys").is_visible()
    page.keyboard.press("?")
    told = page.locator("#keys").inner_text()
    assert {"Space", "?"} < set(told.split())
    page.locator("[data-keys]").click()
    assert not page.locator("#keys").is_visible()
    page.locator("[data-look=top]").focus()  # a button has keys of its own
    page.keyboard.press("?")
    assert page.locator("#keys").is_visible()
    page.keyboard.press("?")
    page.locator("[data-look=overview]").click()


def test_words_about_a_transparent_arm_fit_a_narrow_picture(report: Watched) -> None:
    """Oracle: the canvas measures each line."""
    words = "transparent: with joint errors within the error box"
    page, fits = (
        report.page,
        "([words, most]) => vdsm.view.overlay.wrapped(words, most)",
    )
    for most in (900, 150, 60):
        lines = page.evaluate(fits, [words, most])
        assert " ".join(lines) == words
        measure = "one => vdsm.view.overlay.pen.measureText(one).width"
        wide = [one for one in lines if page.evaluate(measure, one) > most]
        assert all(" " not in one for one in wide)
    assert page.evaluate(fits, [words, 900]) == [words]


def test_every_text_keeps_its_contrast(browser: Any, tmp_path: Path) -> None:
    judged = made_up.verification(Verdict.REFUTED, n=40, joint_error=math.nan)
    late = Check("late", Verdict.UNDECIDED, 1, 2.0, 1.0, "m", moment=30.0)
    judged = replace(judged, checks=(*judged.checks, late))
    file = verification_file(judged, made_up.RECORD)
    write_report(tmp_path / "report.html", judged, file)
    rows = [
        batch_row("x", "paper", file).model_copy(update={"outcome": word})
        for word in OUTCOMES
    ]
    write_index(tmp_path / "index.html", rows, pages={})
    for name in ("report", "index"):
        address = (tmp_path / f"{name}.html").as_uri()
        watched = Watched(browser, address)
        watched.page.wait_for_function(f"'{name}' === 'index' || window.vdsm")
        grounds = set()
        for scheme in ("light", "dark"):
            watched.page.emulate_media(color_scheme=scheme)
            grounds.add(watched.page.evaluate(GROUND))
            measured = watched.page.evaluate(CONTRASTS)
            assert len(measured) > 50
            assert not [one for one in measured if one["ratio"] < 4.5]
            watched.shot(f"{name}-{scheme}")
        assert len(grounds) == 2


def test_hovering_names_a_value(report: Watched) -> None:
    page = report.page
    plot = page.locator("[data-chart=x0] svg")
    box = plot.bounding_box()
    plot.hover(position={"x": 0.5 * box["width"], "y": 0.5 * box["height"]})
    text = page.locator("[data-chart=x0] svg .hover text").text_content()
    assert text.startswith("x₀: ")
    assert "mm at" in text


def test_dark_and_narrow_pages_work_and_show_what_failed(
    browser: Any, tmp_path: Path
) -> None:
    judged = made_up.verification(n=40)
    late = Check("late", Verdict.UNDECIDED, 1, 2.0, 1.0, "m", moment=30.0)
    bad = Check("bad", Verdict.REFUTED, 1, 2.0, 1.0, "m", "x", 17.25)
    judged = replace(judged, checks=(*judged.checks, late, bad))
    path = tmp_path / "report.html"
    write_report(path, judged, verification_file(judged, made_up.RECORD))
    size = {"width": 420, "height": 800}
    watched = Watched(browser, path.as_uri(), viewport=size, color_scheme="dark")
    watched.page.wait_for_function("window.vdsm && window.vdsm.view")
    watched.shot("report-dark-narrow")
    width = watched.page.evaluate("document.documentElement.scrollWidth")
    assert width <= 420, "the page scrolls sideways"
    tall = """() => [...document.querySelectorAll(".legend .name")].filter((one) =>
      one.getBoundingClientRect().height > 60).length"""
    assert watched.page.evaluate(tall) == 0, "a name is broken letter by letter"
    spill = """() => [...document.querySelectorAll(".legend button")].filter((one) =>
      one.lastChild.getBoundingClientRect().right > one.getBoundingClientRect().right)
      .length"""
    assert watched.page.evaluate(spill) == 0, "a value stands outside of its frame"
    cut = """name => { const told = document.querySelector("[data-clearance]");
      told.textContent = name;
      return told.getBoundingClientRect().right > window.innerWidth; }"""
    assert not watched.page.evaluate(cut, "x" * 200), "a long name is cut"
    assert time_of(watched) == 17.25, "the page opens where the verdict was decided"
    flags = watched.page.locator("[data-chart=psi] .flag")
    assert flags.count() == 2
    assert watched.page.locator("[data-chart=psi] .flag.refuted").count() == 1
    watched.page.evaluate("vdsm.motion.go(3)")
    watched.page.locator(".banner button").click()
    assert time_of(watched) == 17.25
    assert watched.page.evaluate("vdsm.view.due"), "the pair that comes near then"
    watched.page.locator("tr.undecided button").click()
    assert time_of(watched) == 30.0
    assert watched.errors == []


def test_an_index_of_a_thousand_problems_sorts_at_once(
    browser: Any, tmp_path: Path
) -> None:
    judged = made_up.verification(n=5)
    row = batch_row("x", "paper", verification_file(judged, made_up.RECORD))
    rows = [
        row.model_copy(
            update={
                "folder": f"p{i:04}",
                "problem": f"problem {i}",
                "min_clearance_lower_m": (i * 37 % 1000) / 1e4 if i % 5 else None,
                "outcome": "certified" if i % 3 else "refuted",
            }
        )
        for i in range(1000)
    ]
    for i in range(12):
        (tmp_path / f"p{i:04}").mkdir()
        (tmp_path / f"p{i:04}" / "picture.svg").write_text(picture(judged))
    (tmp_path / "timing.js").write_text('window.vdsmTiming = {"p0003": 1.5};')
    pages = {row.folder: "report.html" for row in rows}
    write_index(tmp_path / "index.html", rows, pages)
    watched = Watched(browser, (tmp_path / "index.html").as_uri())
    page = watched.page
    assert "1.50 s" in page.locator("tr[data-folder=p0003]").text_content()
    took = page.evaluate(
        "() => { const t = performance.now();"
        "document.querySelector('[data-sort=\"3\"]').click();"
        "document.body.offsetHeight; return performance.now() - t; }"
    )
    keys = page.evaluate(
        "[...document.querySelectorAll('#problems tbody tr')]"
        ".map(row => row.cells[3].dataset.key)"
    )
    filled = [float(key) for key in keys if key]
    assert filled == sorted(filled)
    assert keys[-200:] == [""] * 200, "missing values stand last"
    assert took < 10_000.0, "a loaded machine needs a fraction of it"
    page.locator("[data-only=refuted]").click()
    shown = page.locator("#problems tbody tr:visible").count()
    assert shown == sum(row.outcome == "refuted" for row in rows)
    watched.shot("index")
    assert watched.errors == []


def test_the_arm_of_a_counterexample_is_a_ghost_at_its_moment(
    browser: Any, tmp_path: Path
) -> None:
    judged = made_up.verification(Verdict.REFUTED)
    rows, arm = judged.trajectory, judged.problem.manipulator
    joints = rows.joints[100].copy()
    joints[1:] += 0.05
    found = Counterexample(
        interval=100, share=0.0, pair=judged.pairs[7], joints=joints,
        offsets=joints - rows.joints[100], clearance=-0.01, required=0.0035,
        link_point=np.zeros(3), other_point=np.zeros(3),
    )  # fmt: skip
    judged = replace(
        judged,
        problem=judged.problem.under(ErrorBox(joint=0.05, base=0.001)),
        counterexamples=(found,),
        nominal_clear=True,
    )
    path = tmp_path / "report.html"
    write_report(path, judged, verification_file(judged, made_up.RECORD))
    watched = Watched(browser, path.as_uri(), viewport={"width": 800, "height": 600})
    watched.page.wait_for_function("window.vdsm && window.vdsm.view")
    seen = "vdsm.view.ghosts.map((one) => one.arm.group.visible)"
    watched.page.evaluate("vdsm.motion.go(20)")
    assert watched.page.evaluate(seen) == [False]
    watched.page.evaluate("vdsm.motion.go(100)")
    assert watched.page.evaluate(seen) == [True]
    (ghost,) = watched.page.evaluate(
        "vdsm.view.ghosts.map((one) => [one.centres, one.words])"
    )
    values = joints[:1], joints[None, 1::2], joints[None, 2::2]
    np.testing.assert_allclose(ghost[0], joint_centres(arm, *values)[0], atol=1e-12)
    assert "link 8 comes too near pillar" in ghost[1][0]
    assert ghost[1][1:] == [
        "errors of base and obstacles are not drawn", "the nominal motion is clear"
    ]  # fmt: skip
    with_ghost = pixels(watched.page)
    watched.page.evaluate(
        "vdsm.view.ghosts[0].arm.group.visible = false, vdsm.view.viewer.set_dirty()"
    )
    watched.page.wait_for_timeout(200)
    less_green = pixels(watched.page)[:, 1] - with_ghost[:, 1]
    assert (less_green > 0.1).sum() > 200, "no ghost is drawn"
    assert watched.errors == []


def test_the_plots_of_a_simulation_share_one_moment(
    browser: Any, tmp_path: Path
) -> None:
    n, times = 30, np.linspace(0.0, 5.0, 30)
    planned = np.random.default_rng(0).normal(size=(n, 17))
    beside = np.column_stack([times[[0, -1]], [90.0, 60.0]])
    none, tensions = np.zeros(n), np.full((n, 24), 50.0)
    run = Simulation(
        *(times, planned, planned + 0.001, tensions, none, beside, beside),
        largest_errors=np.full(17, 0.001),
        largest_tension=50.0,
    )
    clear = Cleared(verdict="certified", min_clearance_m=0.01)
    facts = dict.fromkeys(SimulationFile.model_fields, 0.0)
    facts |= dict.fromkeys(("planned", "executed", "within_error_box"), clear)
    file = SimulationFile.model_construct(**facts)
    path = tmp_path / "simulation.html"
    path.write_text(page(file, run, Settings(), 0.0), encoding="utf-8")
    watched = Watched(browser, path.as_uri(), viewport={"width": 1300, "height": 900})
    assert watched.errors == []
    assert watched.requests == [path.as_uri()]
    plots = watched.page.locator("svg.plot")
    assert plots.count() == 7
    assert plots.nth(0).locator("g.series").count() == 16
    assert plots.nth(1).locator("path.upper").count() == 8
    watched.page.evaluate("clock.go(29)")
    places = plots.locator("line.cursor").evaluate_all(
        "all => all.map((one) => one.getAttribute('x1'))"
    )
    assert len(set(places)) == 1
    assert "60.00 Nm/rad" in watched.page.inner_text("figure:nth-of-type(6)")
    plots.nth(5).hover()
    assert " s" in plots.nth(5).locator("g.hover").text_content()
    watched.shot("simulation")
    watched.page.close()
