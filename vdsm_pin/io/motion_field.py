"""Obstacles of the problem file that may move, and what carries them about."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, TypeAlias, Union

import numpy as np
from pydantic import Field

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io import obstacle_schema as shapes
from vdsm_pin.io.frames import Frame
from vdsm_pin.io.schema_types import FileModel, Number, Vector
from vdsm_pin.io.yaml_reader import Location, YamlDocument
from vdsm_pin.problem.scene import Carrier
from vdsm_pin.proof.tree import Tree, free_tree

FLOATING = 6
"""The frame of `free_tree` that has all six joints before it."""


class MotionModel(FileModel):
    """How an obstacle moves: its frame stands at the file's origin without."""

    times_s: Annotated[list[Number], Field(min_length=1)] = Field(
        description="When it passes its knots, rising; at rest before the first and "
        "after the last [s]."
    )
    positions: list[Vector] | None = Field(
        default=None,
        description="Of its frame's origin at each time [length_unit]. Default: the "
        "file's origin.",
    )
    rpy_deg: list[Vector] | None = Field(
        default=None,
        description="Roll, pitch, yaw of its frame at each time, R = Rz Ry Rx [deg]. A "
        "point c of the obstacle stands at position + R c; from knot to knot all six "
        "numbers change evenly, whole turns count. Default: not turned.",
    )

    def carrier(self, frame: Frame, document: YamlDocument, at: Location) -> Carrier:
        """A frame that goes straight in (x, y, z, roll, pitch, yaw) from knot to knot.

        Whole turns that an angle has at the first knot are taken off all of them; only
        what is left is rounded.

        Args:
            frame: The file's unit and base.
            document: The file, for messages.
            at: Where the motion stands in it.

        Raises:
            InvalidFile: If lists differ in length, times do not rise, or nothing moves.
        """
        from vdsm_pin.proof.paths import Path  # compiled code, which few need

        times = np.array(self.times_s)
        late = np.flatnonzero(~(np.diff(times) > 0.0))
        if late.size:
            k = int(late[0]) + 1
            fault = f"is {times[k]:g}, expected above {times[k - 1]:g}, the time before"
            raise document.invalid((*at, "times_s", k), fault)
        if self.positions is None and self.rpy_deg is None:
            fault = "has neither positions nor rpy_deg, so nothing moves"
            raise document.invalid(at, fault)
        given = {"positions": self.positions, "rpy_deg": self.rpy_deg}
        for name, rows in given.items():
            if rows is not None and len(rows) != len(times):
                fault = (
                    f"has {len(rows)} rows, expected {len(times)}, one for each time"
                )
                raise document.invalid((*at, name), fault)
        places = _rows(self.positions, len(times)) - frame.origin
        turns = _rows(self.rpy_deg, len(times))
        turns = np.deg2rad(turns - (turns[0] - np.fmod(turns[0], 360.0)))
        knots = np.hstack([frame.metres(places), turns[:, ::-1]])
        return Carrier(placed(free_tree(), frame), Path(knots, times=times))


class _CanMove(FileModel):
    motion: MotionModel | None = Field(
        default=None,
        description="How it moves. Default: at rest. Trajectories then need a column "
        "time_s.",
    )


if TYPE_CHECKING:
    MovableModel: TypeAlias = shapes.NamedModel
else:
    _MODELS = tuple(
        shapes.with_field(shape, _CanMove, "Obstacle") for shape in shapes.SHAPES
    )
    MovableModel = Annotated[Union[_MODELS], Field(discriminator="shape")]  # noqa: UP007


def placed(tree: Tree, frame: Frame) -> Tree:
    """A tree that hangs on the base's origin, its axes turned to those of the file."""
    first, *others = tree.joints
    pose = np.eye(4)
    pose[:3, :3] = frame.rotation.T
    return Tree((replace(first, placement=pose), *others))


def _rows(given: Sequence[Sequence[float]] | None, count: int) -> FloatArray:
    return np.zeros((count, 3)) if given is None else np.array(given)
