"""A million rows from file to report in less than a gibibyte; its own peak."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.trajectory_file import write_trajectory
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.report.files import VerificationFile

PROGRAM = """
import sys
from vdsm_pin.cli import main
try:
    main(sys.argv[1:])
except SystemExit:
    pass
status = open("/proc/self/status").read()
print(status.partition("VmHWM:")[2].split()[0])
"""
# What getrusage tells may be the peak of the process that began it.
GIB = 1 << 20  # of the kibibytes the system counts in


def swaying(rows: int) -> Trajectory:
    """All joints move, the tip nowhere near its path: every check has its work."""
    t = np.linspace(0.0, 60.0, rows)[:, None] + np.arange(8.0)
    x0 = 0.05 * np.sin(t[:, 0])
    on = np.arange(rows) % 3 > 0
    return Trajectory(on, x0 + 1.0, x0, 0.02 * np.sin(t), 0.02 * np.cos(t))


def peak_of_verifying(rows: int, folder: Path) -> float:
    """Resident memory at its most; [KiB]."""
    file = folder / "long.csv"
    write_trajectory(swaying(rows), file)
    words = ["verify", "paper/obs1", "--trajectory", str(file), "--out", str(folder)]
    ended = subprocess.run(
        [sys.executable, "-c", PROGRAM, *words],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    text = (folder / "verification.json").read_text(encoding="utf-8")
    assert VerificationFile.model_validate_json(text).motion.waypoints == rows
    return float(ended.stdout.split()[-1])


@pytest.mark.slow
def test_a_million_rows_fit_into_a_gibibyte(tmp_path: Path) -> None:
    rows = 1_000_000
    assert peak_of_verifying(rows, tmp_path) < GIB
    with (tmp_path / "cables.csv").open("rb") as file:
        assert sum(1 for _ in file) == rows + 1
    # Nothing comes near: one row for each of 8 links and of 21 pairs of links.
    lines = (tmp_path / "clearance.csv").read_text(encoding="utf-8").splitlines()[1:]
    assert len({tuple(line.split(",")[2:5]) for line in lines}) == len(lines) == 29


@pytest.mark.slow
def test_memory_beyond_the_joint_values_hardly_grows(tmp_path: Path) -> None:
    few, many = (peak_of_verifying(n, tmp_path) for n in (100_000, 300_000))
    arm = read_problem("paper/obs1").manipulator
    row = 8 * (2 + 2 * arm.n_links)
    # The values twice while they are frozen, and a few columns of one number a row.
    assert 1024.0 * (many - few) <= 200_000 * (2 * row + 200)
