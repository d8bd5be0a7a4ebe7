"""What every benchmark shares: timing, the machine, saving and comparing.

A benchmark is a function that fills `Results`; `command` makes a program of it.
"""

import argparse
import json
import os
import platform
import time
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from vdsm_pin import __version__

Results = dict[str, dict[str, float]]
"""Figures by name; the unit stands in the name, in brackets."""

LIBRARIES = ("numpy", "numba", "pin", "coal")
MICRO, MILLI = 1e6, 1e3


def cpu_model() -> str:
    """Name of the processor and nothing else about the machine."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.machine()
    names = [line.split(":", 1)[1].strip() for line in lines if "model name" in line]
    return names[0] if names else platform.machine()


def surroundings() -> dict[str, Any]:
    """Processor, cores, load and versions."""
    known = {"vdsm-pin": __version__}  # of the code that runs
    for name in LIBRARIES:
        try:
            known[name] = version(name)
        except PackageNotFoundError:
            known[name] = "not installed"
    return {
        "processor": cpu_model(),
        "cores": os.cpu_count(),
        "load": round(os.getloadavg()[0], 1),
        "python": platform.python_version(),
        "versions": known,
    }


def described(around: dict[str, Any]) -> str:
    """Surroundings as a sentence, but for the load, which changes."""
    versions = ", ".join(f"{k} {v}" for k, v in around["versions"].items())
    return (
        f"{around['processor']}, {around['cores']} cores; "
        f"Python {around['python']}, {versions}."
    )


def saved_on(file: Path) -> dict[str, Any]:
    """The surroundings in which saved results were measured."""
    around: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))[
        "surroundings"
    ]
    return around


def timed(
    run: Callable[[], object],
    repeats: int = 20,
    scale: float = 1.0,
    warm_up: bool = True,
) -> dict[str, float]:
    """Processor time of a run: median, 95th percentile, least.

    Args:
        run: What is timed.
        repeats: How often.
        scale: Seconds are multiplied by it.
        warm_up: Whether to run once before.
    """
    if warm_up:
        run()
    spans = []
    for _ in range(repeats):
        start = time.process_time()
        run()
        spans.append(scale * (time.process_time() - start))
    median, p95, least = np.quantile(spans, [0.5, 0.95, 0.0]).tolist()
    return {"median": median, "p95": p95, "least": least}


def save(path: Path, results: Results) -> None:
    """Write results with what they were measured on."""
    record = {"surroundings": surroundings(), "results": results}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


def load(path: Path) -> Results:
    """The results of a file."""
    results: Results = json.loads(path.read_text(encoding="utf-8"))["results"]
    return results


def compare(old: Path, new: Path) -> dict[str, float]:
    """New median over old median, for every result that both files hold."""
    before, after = load(old), load(new)
    return {
        name: after[name]["median"] / before[name]["median"]
        for name in before
        if name in after and before[name]["median"] > 0.0
    }


def table(results: Results) -> str:
    """The results as a Markdown table."""
    lines = ["| what | median | p95 | note |", "|---|---|---|---|"]
    for name, row in results.items():
        p95 = f"{row['p95']:.3g}" if "p95" in row else "–"
        note = ", ".join(
            f"{key} {value:.4g}"
            for key, value in row.items()
            if key not in ("median", "p95", "least")
        )
        lines.append(f"| {name} | {row['median']:.3g} | {p95} | {note} |")
    return "\n".join(lines) + "\n"


def command(
    description: str | None,
    measure: Callable[[argparse.Namespace], Results],
    options: Callable[[argparse.ArgumentParser], None] = lambda parser: None,
) -> None:
    """Life of a benchmark as a program: measure and save, or compare two files.

    Args:
        description: Its docstring.
        measure: Gives the results.
        options: Adds options of its own.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--save", type=Path, metavar="FILE")
    parser.add_argument("--compare", type=Path, nargs=2, metavar=("OLD", "NEW"))
    options(parser)
    asked = parser.parse_args()
    if asked.compare:
        for name, ratio in compare(*asked.compare).items():
            print(f"{ratio:6.2f} times  {name}")
        return
    results = measure(asked)
    print(table(results))
    if asked.save:
        save(asked.save, results)
