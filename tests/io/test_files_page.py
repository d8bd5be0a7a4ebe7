"""The page about files tells the truth: its examples are read, its defaults hold."""

import re
from dataclasses import fields
from pathlib import Path

from problem_texts import edited

from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.manipulator import paper_hole_angles

PAGE = Path(__file__).parents[2] / "docs" / "files.md"
EXAMPLE, ARM, ENDS = re.findall(r"```yaml\n(.*?)```", PAGE.read_text(), re.DOTALL)


def test_the_example_is_read_with_all_shapes(tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text(EXAMPLE)
    problem = read_problem(tmp_path / "p.yaml").problem
    assert len(problem.scene.obstacles) == 6
    assert problem.manipulator.name == "hrm8"


def test_the_defaults_shown_are_the_defaults(tmp_path: Path) -> None:
    (tmp_path / "full.yaml").write_text(EXAMPLE)
    text = EXAMPLE
    for location in (
        *(("tip_path", key) for key in ("closed", "spacing", "approach", "retreat")),
        *(("tip_path", key) for key in ("blocked", "required_coverage", "order")),
        ("base",),
        ("required_self_clearance",),
        ("tip_tolerance",),
        ("max_change_per_row_deg",),
    ):
        text = edited(text, location)
    (tmp_path / "short.yaml").write_text(text)
    full, short = (
        read_problem(tmp_path / f"{name}.yaml").problem for name in ("full", "short")
    )
    for part in fields(full):
        if part.compare:
            values = getattr(full, part.name), getattr(short, part.name)
            assert repr(values[0]) == repr(values[1]), part.name


def test_the_arm_shown_is_read_and_its_defaults_hold(tmp_path: Path) -> None:
    full = EXAMPLE.replace("manipulator: hrm8", ARM.rstrip(), 1)
    full = full.replace("start: [3126,", "start: [1600,")
    short = edited(
        edited(full, ("manipulator", "cables")), ("manipulator", "base_range")
    )
    arms = []
    for name, text in (("full", full), ("short", short)):
        (tmp_path / f"{name}.yaml").write_text(text)
        arms.append(read_problem(tmp_path / f"{name}.yaml").problem.manipulator)
    assert repr(arms[0]) == repr(arms[1])
    assert (arms[0].cables.hole_angles == paper_hole_angles(5)).all()


def test_the_start_and_goal_shown_are_read_without_a_path(tmp_path: Path) -> None:
    text = edited(EXAMPLE.replace("manipulator: hrm8", ARM.rstrip(), 1), ("tip_path",))
    (tmp_path / "p.yaml").write_text(text + ENDS)
    problem = read_problem(tmp_path / "p.yaml").problem
    assert problem.tip_path is None
    assert problem.start is not None
    assert problem.goal is not None
    assert problem.goal.tip.tolist() == [1.5, 0.3, 0.0]
