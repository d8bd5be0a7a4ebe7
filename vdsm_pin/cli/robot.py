"""What commands ask about a robot of a URDF: by options, or in a problem file."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

import typer

from vdsm_pin.cli.options import problems_from
from vdsm_pin.errors import InvalidInput

if TYPE_CHECKING:
    from vdsm_pin.robots.cell import Cell
    from vdsm_pin.robots.files import RobotFiles


ProblemOrNone = Annotated[
    str | None,
    typer.Argument(
        metavar="PROBLEM",
        help="A built-in name or a problem file; none with --urdf.",
        autocompletion=problems_from,
    ),
]
Urdf = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="A robot of any kind, in place of a problem."),
]
Srdf = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE", help="Pairs of its links that need not be held apart."
    ),
]
SceneFile = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Its obstacles; YAML or a PlanningScene."),
]
PackageDirs = Annotated[
    list[Path] | None,
    typer.Option(
        metavar="FOLDER",
        exists=True,
        file_okay=False,
        help="Where package:// is looked for.",
    ),
]
Locks = Annotated[
    list[str] | None,
    typer.Option(metavar="JOINT=VALUE", help="A joint that stands still [rad, m]."),
]
Group = Annotated[
    str | None,
    typer.Option(
        metavar="NAME", help="Group of the SRDF whose joints move; others stand still."
    ),
]
Bodies = Annotated[
    Literal["hull", "parts", "primitives"] | None,
    typer.Option(help="What stands for the mesh of a link; its hull by default."),
]
Parts = Annotated[
    int | None,
    typer.Option(min=1, max=256, metavar="NUMBER", help="Hulls of one mesh [8]."),
]
JointLimits = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE", help="A joint_limits.yaml; the stricter limit counts."
    ),
]
Topic = Annotated[
    str | None,
    typer.Option(
        metavar="NAME[#K]", help="Of a trajectory in a bag, and its message from 0."
    ),
]
RequiredClearance = Annotated[
    float | None,
    typer.Option(
        min=0.0, metavar="MM", help="With --urdf: from obstacles [mm]; 0 by default."
    ),
]
RequiredSelfClearance = Annotated[
    float | None,
    typer.Option(
        min=0.0, metavar="MM", help="With --urdf: between links [mm]; 0 by default."
    ),
]


class RobotOptions(NamedTuple):
    """Options as they were given, see `grouped`; None where they were not."""

    urdf: Urdf = None
    srdf: Srdf = None
    scene: SceneFile = None
    package_dir: PackageDirs = None
    lock: Locks = None
    required_clearance_mm: RequiredClearance = None
    required_self_clearance_mm: RequiredSelfClearance = None
    group: Group = None
    bodies: Bodies = None
    parts: Parts = None
    joint_limits: JointLimits = None

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
        from vdsm_pin.robots.cell import locks
        from vdsm_pin.robots.files import RobotFiles, solids_of

        assert self.urdf is not None
        return RobotFiles(
            urdf=self.urdf,
            srdf=self.srdf,
            package_dirs=tuple(self.package_dir or ()),
            lock=locks(tuple(self.lock or ())),
            group=self.group,
            solids=solids_of(self.bodies, self.parts),
            joint_limits=self.joint_limits,
        )

    def named(self) -> dict[str, object]:
        """By the names of the command line."""
        given = self._asdict().items()
        return {f"--{name.replace('_', '-')}": value for name, value in given}


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
