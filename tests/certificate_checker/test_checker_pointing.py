"""A problem that asks where the last link looks is not accepted unseen."""

from pathlib import Path

import numpy as np

from vdsm_pin.certificate_checker.program import check_certificate
from vdsm_pin.io.trajectory_file import write_trajectory
from vdsm_pin.trajectory import Trajectory

PROBLEM = """
vdsm_problem: 1
length_unit: mm
manipulator: hrm8
tip_path:
  start: [3126, 0, 0]
  points: [[3126, 0, 0], [3136, 0, 0]]
  pointing: {direction: [1, 0, 0], cone_deg: 5}
required_clearance: 3.5
"""


def test_no_certificate_is_accepted_that_does_not_state_it(tmp_path: Path) -> None:
    problem, rows = tmp_path / "p.yaml", tmp_path / "t.csv"
    problem.write_text(PROBLEM)
    x0, flat = np.array([0.0, 0.01]), np.zeros((2, 8))
    on = np.ones(2, dtype=np.bool_)
    write_trajectory(rows, Trajectory(on, x0, x0, flat, flat))
    certificate = tmp_path / "c"
    certificate.write_text("{}\n")
    outcome = check_certificate(certificate, problem, rows)
    assert not outcome.accepted
    assert "pointing is not rechecked" in outcome.reason
