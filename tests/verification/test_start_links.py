"""Starts at which bodies of an arm are too near each other; oracle: closed forms."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import vdsm_pin as vp
from vdsm_pin import refinement
from vdsm_pin.errors import StartFolded
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.time_limit import NO_LIMIT
from vdsm_pin.verification.start_links import check_links_at_start

RADIUS, REQUIRED, AWAY = 30.0, 2.0, 20.0
"""Of links and ball, what they keep, and how far back from link 1's end it is; [mm]."""


def problem(folder: Path, apart: float, **more: Any) -> PlanningProblem:
    """A ball that link 3 carries stands beside the axis of link 1 of a straight arm."""
    center = [-400.0 - AWAY, apart, 0.0]
    ball = {"name": "lamp", "link": 3, "shape": "sphere", "center": center}
    arm = {
        "link_lengths": [400.0] * 4,
        "link_radius": RADIUS,
        "max_link_angle_deg": 45,
        "max_joint_angle_deg": 45,
        "bodies": [ball | {"radius": RADIUS}],
        "ignore_pairs": [["lamp", "link 2"]],
    }
    path = {"start": [1600, 0, 0], "points": [[1600, 0, 0], [1700, 0, 0]]}
    data = {"vdsm_problem": 1, "length_unit": "mm", "manipulator": arm}
    data |= {"required_clearance": 1.0, "required_self_clearance": REQUIRED}
    data |= {"tip_path": path} | more
    file = folder / "p.yaml"
    file.write_text(yaml.safe_dump(data), encoding="utf-8")
    return vp.read_problem(file)


@pytest.mark.parametrize("clearance", [1.99, 2.01])
def test_a_start_is_refused_below_the_required_clearance(
    clearance: float, tmp_path: Path
) -> None:
    asked = problem(tmp_path, 2.0 * RADIUS + clearance)
    if clearance >= REQUIRED:
        check_links_at_start(asked, NO_LIMIT)
        return
    with pytest.raises(StartFolded, match="link 1 and lamp") as told:
        check_links_at_start(asked, NO_LIMIT)
    assert told.value.clearance == pytest.approx(1e-3 * clearance, abs=1e-9)


@pytest.mark.parametrize("bend", [0.0, 10.0])
def test_a_bent_start_is_judged_as_it_is_bent(bend: float, tmp_path: Path) -> None:
    """Joint 2 bends towards the ball, which goes round it with links 2 and 3."""
    apart, angle = 2.0 * RADIUS + 5.0, np.deg2rad(bend)
    joints = {"x0": 0.0, "alpha_deg": [0, -bend, 0, 0], "theta_deg": [0, 0, 0, 0]}
    path = {"start": {"joints": joints}, "points": [[1600, 0, 0], [1700, 0, 0]]}
    asked = problem(tmp_path, apart, tip_path=path)
    away = np.array([np.cos(angle), -np.sin(angle)]) * -AWAY
    away += apart * np.array([np.sin(angle), np.cos(angle)])
    clearance = (away[1] if away[0] < 0.0 else np.hypot(*away)) - 2.0 * RADIUS
    if clearance >= REQUIRED:
        check_links_at_start(asked, NO_LIMIT)
        return
    with pytest.raises(StartFolded) as told:
        check_links_at_start(asked, NO_LIMIT)
    assert told.value.clearance == pytest.approx(1e-3 * clearance, abs=1e-9)


def test_no_plan_is_looked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: object) -> None:
        pytest.fail("planned")

    monkeypatch.setattr(refinement, "with_ends", lambda *_, **__: never)
    words = "at its start link 1 and lamp of the arm have a clearance of 1.000 mm"
    with pytest.raises(StartFolded, match=re.escape(words)):
        vp.plan(problem(tmp_path, 2.0 * RADIUS + 1.0))
