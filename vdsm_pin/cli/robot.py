"""What commands ask about a robot of a URDF: by options, or in a problem file."""

from collections.abc import Mapping, Sequence
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

from vdsm_pin.cli.options import by_name, option, problem_argument
from vdsm_pin.errors import InvalidInput

if TYPE_CHECKING:
    from vdsm_pin.problem.error_boxes import ErrorBox
    from vdsm_pin.problem.planning_problem import PlanningProblem
    from vdsm_pin.robots.cell import Cell
    from vdsm_pin.robots.files import RobotFiles


ProblemOrNone = Annotated[
    str | None, problem_argument("A built-in name or a problem file; none with --urdf.")
]


class RobotOptions(NamedTuple):
    """Options as they were given, see `grouped`; None where they were not."""

    urdf: Annotated[
        Path | None, option("FILE", "A robot of any kind, in place of a problem.")
    ] = None
    srdf: Annotated[
        Path | None, option("FILE", "Pairs of its links that need not be held apart.")
    ] = None
    scene: Annotated[
        Path | None, option("FILE", "Its obstacles; YAML or a PlanningScene.")
    ] = None
    package_dir: Annotated[
        list[Path] | None,
        option(
            "FOLDER", "Where package:// is looked for.", exists=True, file_okay=False
        ),
    ] = None
    lock: Annotated[
        list[str] | None, option("JOINT=VALUE", "A joint that stands still [rad, m].")
    ] = None
    required_clearance_mm: Annotated[
        float | None,
        option("MM", "With --urdf: from obstacles [mm]; 0 by default.", min=0.0),
    ] = None
    required_self_clearance_mm: Annotated[
        float | None,
        option("MM", "With --urdf: between links [mm]; 0 by default.", min=0.0),
    ] = None
    group: Annotated[
        str | None,
        option("NAME", "Group of the SRDF whose joints move; others stand still."),
    ] = None
    bodies: Annotated[
        Literal["hull", "parts", "primitives"] | None,
        option(None, "What stands for the mesh of a link; its hull by default."),
    ] = None
    parts: Annotated[
        int | None, option("NUMBER", "Hulls of one mesh [8].", min=1, max=256)
    ] = None
    joint_limits: Annotated[
        Path | None, option("FILE", "A joint_limits.yaml; the stricter limit counts.")
    ] = None
    xacro_arg: Annotated[
        list[str] | None,
        option("NAME=VALUE", "What $(arg NAME) is in a xacro file; again for more."),
    ] = None

    def cell(self) -> "Cell":
        """The robot and what it is held to.

        Raises:
            InvalidInput: If a file is bad.
        """
        from vdsm_pin.robots.cell import cell_of
        from vdsm_pin.units import MM_PER_M

        return cell_of(
            self.files(),
            self.scene,
            (self.required_clearance_mm or 0.0) / MM_PER_M,
            (self.required_self_clearance_mm or 0.0) / MM_PER_M,
        )

    def files(self) -> "RobotFiles":
        """Those of the robot; there is a URDF.

        Raises:
            InvalidInput: If a value makes no sense.
        """
        from vdsm_pin.robots.files import RobotFiles, solids_of

        assert self.urdf is not None
        form = "JOINT=VALUE in radians or metres"
        lock = by_name("--lock", self.lock or (), -inf, form)
        if "" in lock:
            message = f"--lock has no name, expected {form}"
            raise InvalidInput(message)
        return RobotFiles(
            urdf=self.urdf,
            srdf=self.srdf,
            package_dirs=tuple(self.package_dir or ()),
            lock=lock,
            group=self.group,
            solids=solids_of(self.bodies, self.parts),
            joint_limits=self.joint_limits,
            xacro_args=_arguments(self.xacro_arg or ()),
        )

    def named(self) -> dict[str, object]:
        """By the names of the command line."""
        given = self._asdict().items()
        return {f"--{name.replace('_', '-')}": value for name, value in given}


class Asked(NamedTuple):
    """What is asked about, see `grouped`: a problem, or a robot by its files."""

    robot: RobotOptions
    problem: ProblemOrNone = None

    def read(
        self, errors: "ErrorBox", of_arm: dict[str, object], topic: str | None
    ) -> "PlanningProblem | Cell":
        """The problem of an arm or a robot, from a file or from options.

        Args:
            errors: Added to those of its file.
            of_arm: Options that only an arm has, by name.
            topic: An option that only a robot has.

        Raises:
            InvalidInput: If a file is bad, or an option has no meaning for it.
        """
        if self.robot.urdf is not None:
            refuse_beside("--urdf", {"PROBLEM": self.problem, **of_arm})
            return self.robot.cell().under(errors)
        refuse_beside("a problem", self.robot.named())
        if self.problem is None:
            message = "expected a PROBLEM, or --urdf for any other robot"
            raise InvalidInput(message)
        from vdsm_pin.app.subjects import read_problem_or_cell
        from vdsm_pin.problem.planning_problem import PlanningProblem

        asked = read_problem_or_cell(self.problem)
        if isinstance(asked, PlanningProblem):
            refuse_beside("an arm", {"--topic": topic})
        else:
            refuse_beside("a robot", of_arm)
        return asked.under(errors)


def _arguments(given: Sequence[str]) -> dict[str, str]:
    """Arguments of a xacro file by their names.

    Raises:
        InvalidInput: If one has no name or no value, or a name is given twice.
    """
    found = dict[str, str]()
    for word in given:
        name, equals, value = word.partition("=")
        if not name or not equals or name in found:
            message = f"--xacro-arg is {word!r}, expected NAME=VALUE, each name once"
            raise InvalidInput(message)
        found[name] = value
    return found


def refuse_beside(what: str, options: Mapping[str, object]) -> None:
    """Refuse options that mean nothing beside another one.

    Args:
        what: The other one, or what is asked about.
        options: By name; None or False where they were not given.

    Raises:
        InvalidInput: If one is given.
    """
    for name, value in options.items():
        if value is not None and value is not False:
            message = f"{name} has no meaning with {what}"
            raise InvalidInput(message)
