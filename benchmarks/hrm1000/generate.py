"""Writes the problem files: python -m benchmarks.hrm1000.generate OUT --per-family K.

Problem n of a family depends on the family, n and VERSION alone.
"""

import argparse
import zlib
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml

from benchmarks.hrm1000.families import CLEARANCE, FAMILIES, TIP, Draft
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.verification.link_clearance import link_clearance

VERSION: Final = 2
"""Raised whenever a generated file changes."""

ROOM: Final = 0.0115
"""Clearance of tip and start that a feasible family promises; [m]."""

LENGTH: Final = 3.126
EQUAL_RADIUS: Final = 0.05
"""Body of the arms of equal links; [m]."""
ARMS: Final[tuple[Any, ...]] = ("hrm8", "hrm8", 4, 12, 20)
"""Problem n is for arm n modulo 5: the paper's, or equal links of the same length."""


def _arm(kind: str | int) -> Any:
    if isinstance(kind, str):
        return kind
    return {
        "name": f"equal{kind}",
        "link_lengths": [LENGTH / kind] * kind,
        "link_radius": EQUAL_RADIUS,
        "max_link_angle_deg": 42.5,
        "max_joint_angle_deg": 42.5,
        "base_range": [-5.0, 5.0],
        "cables": {"hole_radius": 0.04, "half_gap": 0.02},
    }


def _plain(value: Any) -> Any:
    """Numbers and lists as YAML has them."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.floating | float):
        return round(float(value), 9)
    return value


def _file(name: str, arm: Any, draft: Draft) -> dict[str, Any]:
    obstacles = [
        {"name": f"o{i}", **obstacle} for i, obstacle in enumerate(draft["obstacles"])
    ]
    path = {
        "start": draft.get("start", [TIP, 0.0, 0.0]),
        "points": draft["points"],
        "closed": draft["closed"],
        "spacing": 0.02,
        "retreat": 0.3,
        "required_coverage": 1.0,
    }
    file = {
        "vdsm_problem": 1,
        "name": name,
        "length_unit": "m",
        "manipulator": _arm(arm),
        "obstacles": obstacles,
        "tip_path": path,
        "required_clearance": CLEARANCE,
    }
    return {key: _plain(value) for key, value in file.items()}


def _straight(problem: PlanningProblem, tips: np.ndarray) -> np.ndarray:
    """Joint centres of the straight arm, NaN where it does not reach."""
    arm = problem.manipulator
    square = arm.total_length**2 - (tips[:, 1:] ** 2).sum(axis=1)
    rise = np.sqrt(np.where(square > 0.0, square, np.nan))
    x = tips[:, :1] - rise[:, None] * (1.0 - arm.ratios)
    return np.concatenate([x[..., None], tips[:, None, 1:] * arm.ratios[:, None]], 2)


def _keeps_its_promise(problem: PlanningProblem, draft: Draft) -> bool:
    """Whether tip and start are clear, and the straight arm is blocked if so said."""
    clearance = link_clearance(problem)
    start = clearance(_straight(problem, problem.path.start[None])).min()
    if not start >= ROOM:
        return False
    if "answer" in draft:
        return True
    tips = problem.path.at(np.arange(0.0, problem.path.length, 0.02))
    if not clearance(np.stack([tips, tips], axis=1)).min() >= ROOM:
        return False
    reach = np.hypot(tips[:, 1], tips[:, 2]).max() / problem.manipulator.total_length
    if not reach <= np.sin(np.deg2rad(42.0)):
        return False
    along = clearance(_straight(problem, tips)).min()
    return not draft.get("hard", False) or bool(along < problem.required_clearance)


def generate(folder: Path, family: str, number: int) -> Path:
    """Write one problem file and return its path.

    Args:
        folder: Where to; made if need be.
        family: A name in `FAMILIES`.
        number: 0, 1, ...
    """
    folder.mkdir(parents=True, exist_ok=True)
    seed = [VERSION, zlib.crc32(family.encode()), number]
    rng = np.random.default_rng(seed)
    arm = ARMS[number % len(ARMS)]
    radius = built_in(arm).link_radius if isinstance(arm, str) else EQUAL_RADIUS
    for _ in range(10_000):
        for old in folder.glob(f"{family}-{number:04d}*.stl"):
            old.unlink()
        draft = FAMILIES[family](rng, folder, radius)
        answer = f"-{draft['answer']}" if "answer" in draft else ""
        name = f"{family}-{number:04d}{answer}"
        path = folder / f"{name}.yaml"
        data = _file(name, arm, draft)
        path.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
        if _keeps_its_promise(read_problem(path), draft):
            return path
        path.unlink()
        for obstacle in draft["obstacles"]:
            if "file" in obstacle:
                (folder / obstacle["file"]).unlink()
    message = f"{family} {number}: no draft keeps its promise"
    raise RuntimeError(message)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--per-family", type=int, default=112)
    parser.add_argument("--family", choices=sorted(FAMILIES), action="append")
    options = parser.parse_args()
    for family in options.family or FAMILIES:
        for number in range(options.per_family):
            print(generate(options.out / family, family, number))


if __name__ == "__main__":
    main()
