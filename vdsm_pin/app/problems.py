"""Problems of snake arms, with robots of a URDF among their others."""

from pathlib import Path

from vdsm_pin.io import problem_file
from vdsm_pin.io.others import OtherFile, Others
from vdsm_pin.problem.planning_problem import PlanningProblem


def read_problem(name_or_path: str | Path) -> PlanningProblem:
    """The problem of a built-in name or a file.

    Args:
        name_or_path: Such as `paper/obs1` or `problems/mine.yaml`.

    Returns:
        The problem in metres, radians and the base frame (x along the rail).

    Raises:
        InvalidFile: If the file or its content breaks the contract of docs/files.md.

    Example:
        >>> read_problem("paper/obs1").manipulator.n_links
        8
    """
    return problem_file.read_problem(name_or_path, read_robot)


def read_robot(one: OtherFile) -> Others:
    """Another robot of a problem."""
    from vdsm_pin.robots.other_robots import read_other  # few problems have any

    return read_other(one)
