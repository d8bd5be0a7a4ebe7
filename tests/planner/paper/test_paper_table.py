"""The committed table "paper says / we get" against fresh plans."""

import json
from pathlib import Path

import numpy as np
import pytest

from vdsm_pin.arm.kinematics import link_angles
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.feasibility import curled_reach, straight_reach
from vdsm_pin.planner.paper.pipeline import plan_paper
from vdsm_pin.verification.link_clearance import link_clearance

ROOT = Path(__file__).parents[3]
ROWS = json.loads((ROOT / "reports/paper/table.json").read_text(encoding="utf-8"))


def ours(scene: str, quantity: str) -> str:
    (row,) = [r for r in ROWS if r["scene"] == scene and quantity in r["quantity"]]
    return str(row["ours"])


@pytest.mark.parametrize("scene", ["free", "obs1", "obs2", "obs2-small"])
def test_table_shows_what_the_planner_does(scene: str) -> None:
    """These four are certified in the first round, so a plain plan is the final one."""
    problem = read_problem(f"paper/{scene}")
    trajectory = plan_paper(problem, link_clearance(problem), 0.0).trajectory
    psi = np.rad2deg(link_angles(trajectory.alpha, trajectory.theta).max())
    assert float(ours(scene, "largest psi")) == pytest.approx(psi, abs=0.01)
    for name, value in (
        ("x0 min", trajectory.x0.min()),
        ("x0 max", trajectory.x0.max()),
    ):
        assert float(ours(scene, name)) == pytest.approx(value * 1e3, abs=0.1)


def test_table_shows_both_reaches() -> None:
    arm = read_problem("paper/free").manipulator
    assert ours("-", "Eq. 4") == f"{curled_reach(arm) * 1e3:.2f}"
    assert ours("-", "straight arm") == f"{straight_reach(arm) * 1e3:.2f}"


@pytest.mark.parametrize("scene", ["obs1", "obs2", "obs2-small", "obs3"])
def test_certified_clearance_in_the_table_is_the_required_one(scene: str) -> None:
    assert float(ours(scene, "smallest proved clearance")) >= 3.5


def test_page_quotes_the_table() -> None:
    page = " ".join((ROOT / "docs/paper.md").read_text(encoding="utf-8").split())
    for scene in ("obs1", "obs2", "obs2-small", "obs3"):
        assert f"{ours(scene, 'without contact')}° in {scene}" in page
    assert ours("-", "Eq. 4") in page
    assert ours("-", "straight arm") in page
    assert f"ψ = {ours('obs2', 'largest psi')}°" in page
    assert f"{ours('obs2', 'coverage')} % drawn" in page
