"""The page of a simulation: its curves, its limits, and the margin of the tensions."""

import re

import numpy as np
import pytest
from lxml import etree

from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.simulation.closed_loop import Simulation
from vdsm_pin.simulation.feed_forward import Statics
from vdsm_pin.simulation.page import assumptions, plots
from vdsm_pin.simulation.plots import MOST_POINTS, Curve, Plot, thin
from vdsm_pin.simulation.settings import Cables, Settings

HRM8 = built_in("hrm8")


def simulation(n: int = 50) -> Simulation:
    rng = np.random.default_rng(0)
    times = np.linspace(0.0, 5.0, n)
    planned = rng.normal(size=(n, 17))
    return Simulation(
        times, planned, planned + 0.001, rng.uniform(0.5, 900.0, (n, 24)),
        np.zeros(n), np.zeros(n), np.array([[0.0, 90.0], [5.0, 60.0]]),
        np.array([[0.0, 500.0], [5.0, 300.0]]),
    )  # fmt: skip


def test_every_plot_draws_all_its_curves_and_limits() -> None:
    for plot in plots(simulation(), Settings()):
        root = etree.fromstring(plot.svg.encode())
        assert len(list(root.iter("polyline"))) == len(plot.curves)
        lines = [one for one in root.iter("line") if one.get("class") == "limit"]
        assert len(lines) == len(plot.limits)
        assert "nan" not in plot.svg
    titles = [plot.title for plot in plots(simulation(), Settings())]
    assert "Least joint stiffness" in titles
    assert len(plots(simulation(), Settings())[0].curves) == 16


def test_a_thinned_curve_keeps_its_extremes() -> None:
    values = np.sin(np.linspace(0.0, 400.0, 20_001))
    values[12_345] = 7.0
    curve = Curve("a", np.linspace(0.0, 1.0, values.size), values, "red")
    kept = thin(curve)
    assert len(kept) <= MOST_POINTS
    assert max(v for _, v in kept) == 7.0
    assert min(v for _, v in kept) == values.min()
    assert [t for t, _ in kept] == sorted(t for t, _ in kept)


def test_a_level_curve_and_odd_words_can_be_drawn() -> None:
    flat = Curve("<a>", np.array([0.0]), np.array([0.0]), "red")
    root = etree.fromstring(Plot("a & b", "N", (flat,)).svg.encode())
    assert "a & b" in root.xpath("string(title)")


def test_every_assumption_stands_on_the_page() -> None:
    names = [name for name, _, _ in assumptions(Settings())]
    assert len(names) == len(set(names))
    for part, fields in Settings().model_dump().items():
        keys = [f"{part}.{key}" for key in fields] if isinstance(fields, dict) else []
        assert set(keys or [part]) <= set(names)


@pytest.mark.parametrize("bent", [0.0, 0.3])
def test_the_margin_is_where_the_stiffness_vanishes(bent: float) -> None:
    """Both sides of it; with hardly any room it is the room."""
    statics = Statics(HRM8, Settings())
    angles = np.zeros(16)
    angles[[3, 8]] = bent
    held = statics.tensions(angles)
    margin = statics.tension_margin(angles, held)
    assert 100.0 < margin < 3000.0
    assert statics.least_stiffness(angles, held + 0.99 * margin) > 0.0
    assert statics.least_stiffness(angles, held + 1.01 * margin) < 0.0
    narrow = Cables(largest_tension_n=float(held.max()) + 5.0)
    close = Statics(HRM8, Settings(cables=narrow))
    assert close.tension_margin(angles, held) == pytest.approx(5.0)
    full = Statics(HRM8, Settings(cables=Cables(largest_tension_n=float(held.max()))))
    assert full.tension_margin(angles, held) == 0.0


def test_the_page_names_no_other_page() -> None:
    text = plots(simulation(), Settings())[0].svg
    assert not re.search(r"https?://", text)
