"""What the certificate checker says of the motion between rows, by closed forms."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.certificate_cases import Case
from oracles.certificate_oracle import frames_and_centres

from vdsm_pin.certificate_checker import check_certificate

ARM = {
    "link_lengths": [0.4, 0.3, 0.3],
    "link_radius": 0.03,
    "max_link_angle_deg": 60,
    "max_joint_angle_deg": 50,
}


def swing(folder: Path, angle: float) -> Case:
    """The stretched arm turns about its base, the tip 1 m away, along the chord."""
    q = np.zeros((2, 7))
    q[:, 1] = -angle, angle
    tips = [frames_and_centres(ARM["link_lengths"], row)[1][-1].tolist() for row in q]
    start = {"x0": 0.0, "alpha_deg": [float(np.rad2deg(-angle)), 0, 0]}
    data: dict[str, Any] = {
        "vdsm_problem": 1,
        "length_unit": "m",
        "manipulator": ARM,
        "obstacles": [],
        "tip_path": {
            "start": {"joints": start | {"theta_deg": [0, 0, 0]}},
            "points": tips,
        },
        "required_clearance": 0.0,
    }
    drawn = {"on_path": [1, 1], "path_m": [0.0, 2.0 * np.sin(angle)]}
    return Case(folder, data, q, (0.0, 0.0, 0.0), **drawn)


@pytest.mark.parametrize("angle", [0.002, 0.01])
def test_the_deviation_of_a_swing_is_its_sagitta(angle: float, tmp_path: Path) -> None:
    case = swing(tmp_path, angle)
    outcome = check_certificate(case.certificate, case.problem, case.trajectory)
    assert outcome.accepted, outcome.reason
    sagitta = 1.0 - np.cos(angle)
    assert case.lines[0]["tip_deviation_m"] == pytest.approx(sagitta, rel=1e-2)
