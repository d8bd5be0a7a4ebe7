"""Messages tell places in the file's frame, lengths in millimetres."""

import re
from pathlib import Path

import numpy as np
import pytest

from vdsm_pin.errors import Infeasible
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.refinement import plan_and_verify
from vdsm_pin.units import at_most_mm, in_mm, proved_mm

PROBLEM = """
vdsm_problem: 1
length_unit: {unit}
manipulator: hrm8
base: {{position: {base}, rpy_deg: [0, 0, 90]}}
obstacles:
  - {{name: shell, shape: sphere, center: {centre}, radius: {radius}}}
tip_path:
  start: {start}
  points: [{goal}]
  blocked: fail
required_clearance: {required}
"""
BASE, START, GOAL = (1000.0, 2000.0, 300.0), (0.0, 3200.0, 0.0), (0.0, 3200.0, 400.0)


def written(folder: Path, unit: str) -> Path:
    """The same scene in millimetres or metres: the goal is inside the ball."""
    scale = 1.0 if unit == "mm" else 1e-3

    def place(point: tuple[float, float, float]) -> list[float]:
        return [scale * (a + b) for a, b in zip(BASE, point, strict=True)]

    text = PROBLEM.format(
        unit=unit,
        base=place((0.0, 0.0, 0.0)),
        centre=place(GOAL),
        radius=150.0 * scale,
        start=place(START),
        goal=place(GOAL),
        required=3.5 * scale,
    )
    file = folder / f"{unit}.yaml"
    file.write_text(text)
    return file


@pytest.mark.parametrize("strategy", ["fewest", "paper"])
def test_the_unit_of_the_file_changes_no_message(tmp_path: Path, strategy: str) -> None:
    said = []
    for unit in ("mm", "m"):
        problem = read_problem(written(tmp_path, unit))
        with pytest.raises(Infeasible) as refused:
            plan_and_verify(problem, strategy)
        said.append(str(refused.value))
    assert said[0] == said[1]
    assert not re.search(r"\d m\b", said[0])


def test_a_place_is_told_where_the_file_has_it(tmp_path: Path) -> None:
    problem = read_problem(written(tmp_path, "m"))
    told = problem.in_file(problem.path.start)
    assert (
        told
        == f"({', '.join(str(a + b) for a, b in zip(BASE, START, strict=True))}) mm"
    )
    assert problem.in_file(np.zeros(3)) == "(1000.0, 2000.0, 300.0) mm"
    assert in_mm(0.0125) == "12.500 mm"
    assert in_mm(-1e-9) == in_mm(-0.0) == "0.000 mm"


@pytest.mark.parametrize(
    ("length", "kept", "found"),
    [(0.0043669, "4.366", "4.367"), (-0.0003172, "−0.318", "−0.317"),
     (0.0035, "3.500", "3.500")],
)  # fmt: skip
def test_no_more_is_said_of_a_bound_than_was_proved(
    length: float, kept: str, found: str
) -> None:
    assert (proved_mm(length), at_most_mm(length)) == (f"{kept} mm", f"{found} mm")
