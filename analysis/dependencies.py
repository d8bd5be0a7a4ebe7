"""docs/dependencies.md: what the package needs, for what, under which licence.

python analysis/dependencies.py
"""

import importlib.metadata
import re
import tomllib
from pathlib import Path
from typing import Any, Final

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT: Final = Path(__file__).parents[1]
TARGET: Final = ROOT / "docs" / "dependencies.md"

USES: Final = {
    "pin": "Pinocchio: the arm from its URDF, kinematics as a second opinion",
    "coal": "distances that steer planning, and a second opinion on clearances",
    "yourdfpy": "reads URDF",
    "numpy": "arrays",
    "meshcat": "the live 3D view",
    "numba": "compiles what runs fast, once",
    "llvmlite": "loads what was compiled",
    "pydantic": "checks problem files and result files",
    "pyyaml": "reads YAML",
    "shapely": "polygons of prisms",
    "python-flint": "ball arithmetic of the certificate checker",
    "typer": "the command line",
    "rich": "progress on a terminal",
    "jinja2": "report pages",
    "distributed": "`vdsm batch --scheduler`",
    "pyarrow": "`rows.parquet` of a batch",
    "mujoco": "`vdsm simulate`, worlds in MJCF",
    "scipy": "feed-forward of `vdsm simulate`",
    "xacrodoc": "robots as xacro files",
    "rosbags": "trajectories in ROS 1, ROS 2 and MCAP files",
    "pin-pink": "a planner that benchmarks compare with",
    "daqp": "its solver",
    "ompl": "planners that benchmarks compare with",
}
LONGEST: Final = 60
"""A licence field that is longer holds the whole text; then the classifier counts."""


def licence(metadata: Any) -> str:
    """The licence that a distribution states, in a few words."""
    stated = metadata.get("License-Expression") or metadata.get("License") or ""
    short = len(stated) <= LONGEST and "\n" not in stated
    if short and stated not in ("", "UNKNOWN"):
        return str(stated)
    for line in metadata.get_all("Classifier", []):
        if line.startswith("License ::"):
            return str(line.rsplit(" :: ", 1)[1])
    return "stated in its files"


def rows(requirements: list[str]) -> list[str]:
    """A line of a table for each requirement."""
    lines = []
    for requirement in requirements:
        name = re.split(r"[^\w.-]", requirement)[0]
        try:
            metadata = importlib.metadata.metadata(name)
        except importlib.metadata.PackageNotFoundError:
            lines.append(f"| {name} | {USES[name]} | not installed here | |")
            continue
        version = metadata["Version"]
        lines.append(f"| {name} | {USES[name]} | {version} | {licence(metadata)} |")
    return lines


def brought(requirements: list[str]) -> list[str]:
    """Names of what distributions bring along on this machine, without themselves."""
    asked = [Requirement(line) for line in requirements]
    named = {canonicalize_name(one.name) for one in asked}
    seen: dict[str, set[str]] = {}  # with which extras each was looked at
    while asked:
        one = asked.pop()
        name = canonicalize_name(one.name)
        new = {"", *one.extras} - seen.get(name, set())
        seen.setdefault(name, set()).update(new)
        for extra in new:
            for line in importlib.metadata.requires(name) or []:
                more = Requirement(line)
                if more.marker is None or more.marker.evaluate({"extra": extra}):
                    asked.append(more)
    return sorted(seen.keys() - named)


def main() -> None:
    """Write the page."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    found = project["project"]
    head = ["| distribution | used for | tested with | licence |", "|---|---|---|---|"]
    lines = [
        "# Dependencies",
        "",
        "What `pip install vdsm-pin` installs, for what, and under which licence.",
        "Written by `analysis/dependencies.py` from what is installed. The package is",
        "under BSD-2-Clause; `constraints.txt` pins every version the tests ran with.",
        "",
        *head,
        *rows(found["dependencies"]),
    ]
    lines += [
        "",
        "## What these bring along",
        "",
        "| distribution | tested with | licence |",
        "|---|---|---|",
    ]
    for name in brought(found["dependencies"]):
        metadata = importlib.metadata.metadata(name)
        lines.append(f"| {name} | {metadata['Version']} | {licence(metadata)} |")
    for extra, requirements in found["optional-dependencies"].items():
        if extra not in ("dev", "docs"):
            command = f"pip install 'vdsm-pin[{extra}]'"
            lines += ["", f"## {extra}", "", f"`{command}`", "", *head]
            lines += rows(requirements)
    TARGET.write_text("\n".join([*lines, ""]), encoding="utf-8")


if __name__ == "__main__":
    main()
