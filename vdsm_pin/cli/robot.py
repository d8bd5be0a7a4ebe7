"""What commands ask about a robot of a URDF: by options, or in a problem file."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from vdsm_pin.errors import InvalidInput

if TYPE_CHECKING:
    from vdsm_pin.robots.cell import Cell


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
    typer.Option(metavar="FOLDER", help="Where package:// is looked for."),
]
Locks = Annotated[
    list[str] | None,
    typer.Option(metavar="JOINT=VALUE", help="A joint that stands still [rad, m]."),
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
    """Options as they were given; None or empty where they were not."""

    urdf: Path | None
    srdf: Path | None
    scene: Path | None
    package_dirs: tuple[Path, ...]
    lock: tuple[str, ...]
    required_mm: float | None
    required_self_mm: float | None

    def cell(self, problem: Path | None) -> "Cell":
        """The robot and what it is held to.

        Args:
            problem: A problem file with `robot`, in place of the options.

        Raises:
            InvalidInput: If both or neither are given, or a file is bad.
        """
        from vdsm_pin.robots.cell import cell_of, read_cell
        from vdsm_pin.units import MM_PER_M

        if problem is not None:
            refuse_beside("a problem", self.named())
            return read_cell(problem)
        if self.urdf is None:
            message = "expected a PROBLEM, or --urdf for a robot"
            raise InvalidInput(message)
        return cell_of(
            self.urdf,
            self.srdf,
            self.scene,
            self.package_dirs,
            self.lock,
            (self.required_mm or 0.0) / MM_PER_M,
            (self.required_self_mm or 0.0) / MM_PER_M,
        )

    def named(self) -> dict[str, object]:
        """By the names of the command line."""
        return {
            "--urdf": self.urdf,
            "--srdf": self.srdf,
            "--scene": self.scene,
            "--package-dir": self.package_dirs,
            "--lock": self.lock,
            "--required-clearance-mm": self.required_mm,
            "--required-self-clearance-mm": self.required_self_mm,
        }


def refuse_beside(what: str, options: Mapping[str, object]) -> None:
    """Refuse options that mean nothing beside another one.

    Raises:
        InvalidInput: If one is given.
    """
    for name, value in options.items():
        if value:
            message = f"{name} has no meaning with {what}"
            raise InvalidInput(message)
