"""Every figure is drawn from a coarse plan and holds what it claims."""

import importlib
import itertools
import json
import re
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("matplotlib")
ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "analysis"))

from matplotlib.figure import Figure  # noqa: E402
from paper_figures import numbers as page_numbers  # noqa: E402
from paper_figures.page import page  # noqa: E402
from paper_figures.runs import SCENES, Run, Runs  # noqa: E402
from paper_figures.scenery import draw_arm  # noqa: E402
from paper_figures.style import (  # noqa: E402
    REPORTS,
    key_colours,
    place,
    save,
    sheet,
    shortened,
)
from paper_figures.views import SIDE  # noqa: E402
from PIL import Image  # noqa: E402
from result_files import at_least, at_most  # noqa: E402

from vdsm_pin.arm.manipulator import built_in  # noqa: E402

COARSE = 0.04
"""Spacing of the waypoints in these tests; [m]."""

PANELS = {
    "fig01_model": {"fig01": 3},
    "fig02_angles": {"fig02": 1},
    "fig03_flow": {"fig03": 1},
    "fig04_fig11_paths": {
        "fig04": 4,
        **{
            f"{name}-{strategy}": 4 if name == "fig13" else 11
            for name in ("fig11", "fig12", "fig12-small", "fig13")
            for strategy in ("paper", "fewest")
        },
    },
    "fig05_collision": {"fig05": 6},
    "fig06_tip_path": {"fig06": 6},
    "fig07_projected_arm": {"fig07": 4},
    "fig08_step5": {"fig08": 6},
    "fig09_moving_on": {"fig09": 6},
    "fig10_holes": {"fig10": 2},
    "fig14_link_angles": {"fig14": 10},
    "fig15_local": {"fig15": 8},
    "fig16_ranges": {"fig16": 5},
    "fig17_clearance": {"fig17-axis": 8, "fig17-surface": 8},
    "fig18_cables": {"fig18": 3},
}
"""Panels that each script promises."""


@pytest.fixture(scope="module")
def runs() -> Runs:
    return Runs(COARSE)


@pytest.fixture(scope="module")
def drawn(runs: Runs) -> Callable[[str], dict[str, Figure]]:
    """Figures by script, each drawn once."""
    return cache(lambda script: importlib.import_module(script).draw(runs))


Drawn = Callable[[str], dict[str, Figure]]


@pytest.mark.parametrize("script", sorted(PANELS))
def test_a_figure_has_its_panels(script: str, drawn: Drawn) -> None:
    figures = drawn(script)
    assert {name: len(figure.axes) for name, figure in figures.items()} == PANELS[
        script
    ]


def test_views_along_axes_are_drawn_to_scale(drawn: Drawn) -> None:
    figure = drawn("fig04_fig11_paths")["fig11-paper"]
    front, side, top = figure.axes[:3]
    for axes in (front, side, top):
        axes.apply_aspect()
    scales = [axes.bbox.width / np.ptp(axes.get_xlim()) for axes in (front, side, top)]
    scales += [
        axes.bbox.height / np.ptp(axes.get_ylim()) for axes in (front, side, top)
    ]
    np.testing.assert_allclose(scales, scales[0], rtol=1e-9)


def test_side_view_draws_every_key_point_where_it_is(runs: Runs, drawn: Drawn) -> None:
    run = runs("obs1", "paper")
    figure = drawn("fig04_fig11_paths")["fig11-paper"]
    colours = key_colours(run.problem.manipulator)
    lines = {line.get_color(): line for line in figure.axes[1].lines}
    for i, colour in enumerate(colours):
        drawn = np.asarray(lines[colour].get_xydata())
        wanted = run.centres[:, i, 1:] * 1e3
        np.testing.assert_allclose(drawn.min(axis=0), wanted.min(axis=0), atol=0.5)
        np.testing.assert_allclose(drawn.max(axis=0), wanted.max(axis=0), atol=0.5)


def test_link_angle_panels_show_limit_and_extremes(runs: Runs, drawn: Drawn) -> None:
    figure = drawn("fig14_link_angles")["fig14"]
    run, axes = runs("obs1", "paper"), figure.axes[0]
    curves = {line.get_color(): np.asarray(line.get_ydata()) for line in axes.lines}
    cone = [y for y in curves.values() if np.allclose(y, 42.5)]
    assert cone, "the limit of psi is drawn"
    colours = key_colours(run.problem.manipulator)
    for i, colour in enumerate(colours[:-1]):
        largest = float(np.rad2deg(run.psi[:, i].max()))
        assert curves[colour].max() == pytest.approx(largest, abs=0.05)


def test_straight_arm_meets_all_three_obstacles(runs: Runs) -> None:
    collision = importlib.import_module("fig05_collision")
    for scene in ("obs1", "obs2", "obs3"):
        assert collision.colliding_links(runs.problem(scene))


def test_axis_distance_agrees_with_a_dense_sampling_of_the_links(runs: Runs) -> None:
    distances = importlib.import_module("paper_figures.distances")
    run = runs("obs3", "fewest")
    share = np.linspace(0.0, 1.0, 2001)[:, None, None]
    rows = slice(0, None, 7)
    begin, end = run.centres[rows, :-1], run.centres[rows, 1:]
    points = begin + share[..., None] * (end - begin)
    sampled = np.linalg.norm(points[..., :2] - [2.126, 0.600], axis=-1).min(axis=(0, 2))
    np.testing.assert_allclose(
        distances.axis_distance(run)[rows], sampled, rtol=0, atol=1e-4
    )


def test_spans_of_the_first_joint_add_up_to_whole_cables(runs: Runs) -> None:
    run = runs("obs1", "paper")
    spans = importlib.import_module("fig18_cables").spans(run)
    arm = run.problem.manipulator
    # The cables of link 1 run through joint 1 only (Eq. 21).
    rest = arm.link_lengths[0] - 2.0 * arm.cables.half_gap
    np.testing.assert_allclose(
        spans[:, 0] + rest, run.plan.cable_lengths[:, 0], rtol=0, atol=1e-12
    )


def test_moments_come_in_order_and_the_corner_is_where_it_is(runs: Runs) -> None:
    marks = importlib.import_module("paper_figures.marks")
    run: Run = runs("obs1", "paper")
    found = marks.marks(run)
    assert [m.name for m in found][:4] == ["A₁", "A₂", "A₃", "A₄"]
    tip = run.centres[marks.row_of(run, "A₆"), -1]
    np.testing.assert_allclose(tip, [3.126, 1.0, 1.3], atol=1e-9)


def test_pictures_are_the_same_bytes_each_time(runs: Runs, tmp_path: Path) -> None:
    run = runs("obs1", "paper")
    for name in ("a", "b"):
        figure = sheet(1.0, 1.0)
        draw_arm(place(figure, 0.1, 0.1, 0.8, 0.8), SIDE, run.problem, run.centres[9])
        save(figure, name, tmp_path)
    for ending in ("png", "svg"):
        first, second = (tmp_path / f"{name}.{ending}" for name in "ab")
        assert first.read_bytes() == second.read_bytes()


def test_the_page_follows_from_its_numbers() -> None:
    kept = page_numbers.read(REPORTS / "numbers.json")
    assert page(kept) == (REPORTS / "README.md").read_text(encoding="utf-8")


def test_numbers_of_the_free_scene_are_those_of_a_fresh_plan() -> None:
    kept = page_numbers.read(REPORTS / "numbers.json")["facts"]["free"]
    fresh = Runs()
    for strategy, facts in kept.items():
        again = json.loads(json.dumps(page_numbers.run_facts(fresh("free", strategy))))
        _close(facts, again)


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES)
def test_numbers_of_every_scene_are_those_of_a_fresh_plan(scene: str) -> None:
    kept = page_numbers.read(REPORTS / "numbers.json")["facts"][scene]
    fresh = Runs()
    for strategy, facts in kept.items():
        again = json.loads(json.dumps(page_numbers.run_facts(fresh(scene, strategy))))
        _close(facts, again)


def test_every_picture_the_page_shows_is_there_and_all_are_small() -> None:
    text = (REPORTS / "README.md").read_text(encoding="utf-8")
    for names in PANELS.values():
        for name in names:
            assert f"{name}.png" in text
            assert (REPORTS / f"{name}.png").stat().st_size > 0
            assert (REPORTS / f"{name}.svg").stat().st_size > 0
    sizes = [
        file.stat().st_size for file in REPORTS.parent.rglob("*") if file.is_file()
    ]
    assert sum(sizes) < 5_000_000


def test_shortened_paths_stay_where_they_are_and_nothing_else_changes() -> None:
    svg = '<path id="a1.234567" d="M 30.160592 -0.001 \nL 1.5 46.08 \nC 7 8.999999 z"/>'
    short = svg.replace("30.160592", "30.16").replace("-0.001", "-0")
    assert shortened(svg) == short.replace("8.999999", "9")
    for file in REPORTS.glob("*.svg"):
        text = file.read_text("utf-8")
        assert shortened(text) == text, file.name


def test_the_moving_picture_moves_and_stays_small() -> None:
    path = REPORTS.parents[1] / "docs" / "gallery" / "pipes.gif"
    assert path.stat().st_size < 1_500_000
    with Image.open(path) as picture:
        frames = []
        for k in range(0, picture.n_frames, 15):
            picture.seek(k)
            frames.append(np.asarray(picture.convert("RGB")))
    assert len(frames) > 4
    for a, b in itertools.pairwise(frames):
        assert 0.01 < (a != b).any(axis=2).mean() < 0.5, "only the arm moves"


def test_table_1_holds_the_papers_lengths() -> None:
    rows = importlib.import_module("table1_parameters").rows(built_in("hrm8"))
    lengths = [int(row[0].split("= ")[1]) for row in rows if "=" in row[0]]
    assert lengths == [486, 486, 486, 486, 486, 206, 206, 284]
    printed = [0.155, 0.311, 0.466, 0.622, 0.777, 0.843, 0.909]
    np.testing.assert_allclose(
        [float(row[4]) for row in rows[2:-1]], printed, atol=1e-3
    )


def _close(kept: Any, again: Any) -> None:
    """Equal but for the last digits of rounded numbers."""
    if isinstance(kept, dict):
        assert kept.keys() == again.keys()
        for key in kept:
            _close(kept[key], again[key])
    elif isinstance(kept, list):
        assert len(kept) == len(again)
        for one, other in zip(kept, again, strict=True):
            _close(one, other)
    elif isinstance(kept, float):
        assert again == pytest.approx(kept, abs=2e-3)
    else:
        assert kept == again


@pytest.mark.parametrize("file", sorted(REPORTS.glob("*.svg")), ids=lambda f: f.stem)
def test_no_letter_is_smaller_than_6_pt_in_print(file: Path) -> None:
    sizes = re.findall(
        r"font(?:-size)?: [^;]*?([0-9.]+)px", file.read_text(encoding="utf-8")
    )
    assert sizes
    assert min(map(float, sizes)) >= 6.0


def test_numbers_that_are_promised_are_rounded_to_the_safe_side() -> None:
    assert (at_least(13.181, 1), at_most(13.181, 1)) == ("13.1", "13.2")
    assert (at_least(-318.61, 1), at_most(-318.61, 1)) == ("-318.7", "-318.6")
    for number in ("0.3", "4.4", "29.1", "265.0"):  # none of these is a binary number
        assert at_least(float(number), 1) == at_most(float(number), 1) == number
    assert (at_least(387.5), at_most(387.5)) == ("387", "388")


def test_the_least_clearance_written_in_a_figure_is_one_that_is_proved(
    runs: Runs, drawn: Drawn
) -> None:
    figures = drawn("fig17_clearance")
    for k, axes in enumerate(figures["fig17-surface"].axes):
        scene = ("obs1", "obs2", "obs2-small", "obs3")[k // 2]
        run = runs(scene, ("paper", "fewest")[k % 2])
        assert run.verification.min_clearance is not None
        proved = 1e3 * run.verification.min_clearance
        (text,) = [t.get_text() for t in axes.texts if "least" in t.get_text()]
        assert proved - 0.1 < float(text.split()[-1]) <= proved
