"""How time grows with waypoints, obstacles, links and mesh triangles.

    python -m benchmarks.growth [--most 1e5] [--save FILE]

Processor time, the least of a few runs after a warm-up, from the public functions. The
exponent of a row is the slope of its last two decades: 1 is linear.
"""

import argparse
import os
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from benchmarks.certify import ARM, NEAR, beside, certify_growth, problem_of, sway
from benchmarks.common import MILLI, Results, command, timed
from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.cables import angles_from_cables, cable_lengths
from vdsm_pin.arm.kinematics import joint_angles, joint_centres
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.trajectory_file import read_trajectory, write_trajectory
from vdsm_pin.planner.paper.pipeline import plan_paper
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.robust import largest_joint_error

ROWS = 1_000  # where rows are not what grows
NOMINAL = ErrorBox()
Runs = dict[str, Callable[[], object]]


def at_waypoints(n: int, folder: Path) -> Runs:
    """Everything that is done to the rows of a motion."""
    motion = sway(n - 1)
    problem = problem_of(ARM, [beside(motion, NEAR)], 0.5 * NEAR)
    joints = motion.x0, motion.alpha, motion.theta
    centres = joint_centres(ARM, *joints)
    lengths = cable_lengths(ARM, *joints[1:])
    file = folder / f"{n}.csv"

    def back() -> object:
        return joint_centres(ARM, joints[0], *angles_from_cables(ARM, lengths))

    obs1 = read_problem("paper/obs1")
    drawn = replace(obs1, tip_path=replace(obs1.path, spacing=obs1.path.length / n))
    clearance = link_clearance(drawn)
    return {
        "plan paper/obs1": lambda: plan_paper(drawn, clearance, 0.0),
        "cables from centres": lambda: cable_lengths(ARM, *joint_angles(ARM, centres)),
        "centres from cables": back,
        "largest joint error": lambda: largest_joint_error(problem, motion, NOMINAL),
        "write trajectory": lambda: write_trajectory(motion, file),
        "read trajectory": lambda: read_trajectory(file, ARM),
    }


def at_links(n: int, folder: Path) -> Runs:
    """Arms of one length, cut into more and more links, all bent alike."""
    cables = CableLayout(
        ARM.cables.hole_radius, ARM.cables.half_gap, paper_hole_angles(n)
    )
    arm = replace(
        ARM, name=f"links{n}", link_lengths=np.full(n, 3.0 / n), link_radius=0.006,
        cables=cables,
    )  # fmt: skip
    t = np.linspace(0.0, 2.0 * np.pi, ROWS)[:, None] + np.arange(n)
    bend, off = 0.3 / n, np.zeros(ROWS, bool)
    motion = Trajectory(
        off, off, 0.1 * np.sin(t[:, 0]), bend * np.sin(t), bend * np.cos(t)
    )
    centres = joint_centres(arm, motion.x0, motion.alpha, motion.theta)
    return {
        "cables from centres": lambda: cable_lengths(arm, *joint_angles(arm, centres)),
    }


def _decades(first: int, most: int) -> list[int]:
    return [first * 10**k for k in range(8) if first * 10**k <= most]


def measure(most: int) -> Results:
    """Every row of the table, in milliseconds."""
    groups: dict[str, tuple[Callable[[int, Path], Runs], list[int]]] = {
        "waypoints": (at_waypoints, _decades(100, most)),
        "links": (at_links, [2, 5, 10, 20, 40]),
    }
    results: Results = {
        f"clearance proof, {row.table}, {row.size:.0f} [ms]": {
            "median": row.cpu_ms, "p95": row.p95_ms, "least": row.cpu_ms,
        }
        for row in certify_growth(3, quick=most < 1_000_000)
        if row.table != "clearance"
    }  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        for what, (at, sizes) in groups.items():
            for n in sizes:
                for name, run in at(n, Path(folder)).items():
                    warm, repeats = n <= 300_000, 1 if n > 30_000 else 3
                    spans = timed(run, repeats, MILLI, warm)
                    results[f"{name}, {what}, {n} [ms]"] = spans
    return results


def curves(results: Results) -> dict[tuple[str, str], tuple[list[int], list[float]]]:
    """Sizes and times of each curve, by what is done and what grows."""
    found: dict[tuple[str, str], tuple[list[int], list[float]]] = {}
    for name, row in results.items():
        if name.count(", ") == 2:
            done, what, size = name.removesuffix(" [ms]").split(", ")
            sizes, times = found.setdefault((done, what), ([], []))
            sizes.append(int(size))
            times.append(row["least"])
    return found


def exponent(sizes: list[int], times: list[float]) -> float:
    """Slope over the last two decades, or what there is."""
    known = [k for k, size in enumerate(sizes) if 100 * size >= sizes[-1]]
    logs = np.log([sizes[k] for k in known]), np.log([times[k] for k in known])
    return float(np.polyfit(*logs, 1)[0])


def growth_table(results: Results) -> str:
    """Milliseconds by size, and the exponent, as Markdown."""
    lines = [
        "| what | grows with | milliseconds by size | exponent |",
        "|---|---|---|---|",
    ]
    for (done, what), (sizes, times) in curves(results).items():
        steps = ", ".join(
            f"{size:g}: {time:.3g}" for size, time in zip(sizes, times, strict=True)
        )
        slope = exponent(sizes, times)
        lines.append(f"| {done} | {what} | {steps} | {slope:.2f} |")
    return "\n".join(lines) + "\n"


def plot(results: Results, path: Path) -> None:
    """The same, both axes logarithmic, as SVG."""
    import matplotlib as mpl

    mpl.use("svg")
    mpl.rcParams["svg.hashsalt"] = "growth"
    from matplotlib import pyplot

    found = curves(results)
    kinds = list(dict.fromkeys(what for _, what in found))
    figure, axes = pyplot.subplots(
        1, len(kinds), figsize=(4.0 * len(kinds), 3.6), squeeze=False,
        layout="constrained",
    )  # fmt: skip
    for axis, kind in zip(axes[0], kinds, strict=True):
        for (done, what), (sizes, times) in found.items():
            if what == kind:
                slope = exponent(sizes, times)
                axis.loglog(sizes, times, "o-", label=f"{done} ({slope:.2f})")
        axis.set_xlabel(kind)
        axis.set_ylabel("processor time [ms]")
        axis.grid(alpha=0.3)
        axis.legend(fontsize=7)
    figure.savefig(path, metadata={"Date": None})


def _options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--most", type=float, default=1e6, help="largest size")


if __name__ == "__main__":
    command(__doc__, lambda asked: measure(int(asked.most)), _options)
