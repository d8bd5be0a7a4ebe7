"""What every benchmark shares: timing, the machine, saving and comparing."""

import json
import os
import platform
import time
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

LIBRARIES = ("vdsm-pin", "numpy", "numba", "pin", "coal")


def cpu_model() -> str:
    """Name of the processor and nothing else about the machine."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.machine()
    names = [line.split(":", 1)[1].strip() for line in lines if "model name" in line]
    return names[0] if names else platform.machine()


def surroundings() -> dict[str, object]:
    """Processor, cores, load and versions."""
    known = {}
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


def timed(run: Callable[[], object], repeats: int = 20) -> dict[str, float]:
    """Seconds of processor time after a warm-up: median, 95th percentile, least."""
    run()
    spans = []
    for _ in range(repeats):
        start = time.process_time()
        run()
        spans.append(time.process_time() - start)
    median, p95, least = np.quantile(spans, [0.5, 0.95, 0.0]).tolist()
    return {"median": median, "p95": p95, "least": least}


def save(path: Path, results: dict[str, dict[str, float]]) -> None:
    """Write results with what they were measured on."""
    record = {"surroundings": surroundings(), "results": results}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


def compare(old: Path, new: Path) -> dict[str, float]:
    """New median over old median, for every result that both files hold."""
    before, after = (
        json.loads(path.read_text(encoding="utf-8"))["results"] for path in (old, new)
    )
    return {
        name: after[name]["median"] / before[name]["median"]
        for name in before
        if name in after
    }
