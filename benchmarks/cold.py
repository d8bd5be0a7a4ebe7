"""Whole processes, as a user waits for them, with their machine code on disk.

    python -m benchmarks.cold [--save FILE]

Processor time of all their threads; on an idle machine the wall clock shows less.
"""

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.common import Results, command


def measure(repeats: int = 21) -> Results:
    """Seconds of processor time; the first run of each is not counted."""
    results: Results = {}
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "trajectory.csv")
        commands = {
            "vdsm --help": ["--help"],
            "vdsm plan paper/obs1": ["plan", "paper/obs1", "--out", folder],
            "vdsm verify paper/obs1": [
                "verify", "paper/obs1", "--trajectory", path, "--out", folder,
            ],
        }  # fmt: skip
        for name, words in commands.items():
            spans = [process_seconds(words) for _ in range(repeats)][1:]
            median, least = float(np.median(spans)), min(spans)
            results[f"{name} [s]"] = {"median": median, "least": least}
    return results


def process_seconds(words: list[str]) -> float:
    """Processor time of one command of the package; [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    line = [sys.executable, "-m", "vdsm_pin", *words]
    # As for a user: what Python compiles stays on disk.
    around = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    subprocess.run(line, check=True, stdout=subprocess.DEVNULL, env=around)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


if __name__ == "__main__":
    command(__doc__, lambda asked: measure())
