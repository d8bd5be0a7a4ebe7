"""The page of a simulation: its curves, its limits, and the margin of the tensions."""

import base64

import numpy as np
import pytest

from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.simulation.closed_loop import Simulation
from vdsm_pin.simulation.feed_forward import Statics
from vdsm_pin.simulation.page import assumptions, charts, thinned_run
from vdsm_pin.simulation.settings import Cables, Settings

HRM8 = built_in("hrm8")


def simulation(n: int = 50) -> Simulation:
    rng = np.random.default_rng(0)
    times = np.linspace(0.0, 5.0, n)
    planned = rng.normal(size=(n, 17))
    return Simulation(
        times, planned, planned + 0.001, rng.uniform(0.5, 900.0, (n, 24)),
        np.zeros(n), np.array([[0.0, 90.0], [5.0, 60.0]]),
        np.array([[0.0, 500.0], [5.0, 300.0]]), np.full(17, 0.001), 900.0,
    )  # fmt: skip


def drawn(text: str) -> FloatArray:
    return np.frombuffer(base64.b64decode(text), "<f4")


def test_every_plot_has_all_its_curves_and_limits() -> None:
    found = simulation()
    errors, *angles, tensions, slack, stiffness, margin = charts(found, Settings())
    names = [f"{letter}{i}" for i in range(1, 9) for letter in "αθ"]
    assert [one["name"] for one in errors["series"]] == names
    for one, column in zip(errors["series"], found.errors.T, strict=True):
        np.testing.assert_allclose(drawn(one["values"]), np.rad2deg(column), atol=1e-4)
    for k, chart in enumerate(angles):
        for i, one in enumerate(chart["series"]):
            column = np.rad2deg(found.planned[:, 1 + k + 2 * i])
            np.testing.assert_allclose(drawn(one["upper"]), column, rtol=1e-6)
    limits = {one["label"]: one["value"] for one in tensions["limits"]}
    assert limits == {"largest allowed": 4000.0, "least held": 30.0}
    assert drawn(tensions["series"][0]["values"]).max() == found.tensions.max().astype(
        "f"
    )
    assert drawn(slack["series"][0]["values"]).max() <= 100.0
    for chart, values in ((stiffness, [90.0, 60.0]), (margin, [500.0, 300.0])):
        assert [one["value"] for one in chart["limits"]] == [0.0]
        np.testing.assert_allclose(drawn(chart["series"][0]["values"])[[0, -1]], values)


def test_a_thinned_run_keeps_its_extremes_and_the_times_of_its_stiffness() -> None:
    found = simulation(20_001)
    found.tensions[12_345, 3] = 7000.0
    found.executed[1_111, 4] += 9.0
    few = thinned_run(found)
    assert few.times.size < 3000
    assert (np.diff(few.times) > 0.0).all()
    assert few.tensions.max() == 7000.0
    np.testing.assert_array_equal(few.errors.max(axis=0), found.errors.max(axis=0))
    np.testing.assert_array_equal(few.errors.min(axis=0), found.errors.min(axis=0))
    np.testing.assert_array_equal(few.least_stiffness[[0, -1]], found.least_stiffness)


def test_every_assumption_stands_on_the_page() -> None:
    names = [name for name, _, _ in assumptions(Settings())]
    assert ("kicks", "0") in [
        (name, value) for name, value, _ in assumptions(Settings())
    ]
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
