"""What carries an obstacle about, from its knots in the problem file."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.frames import Frame
from vdsm_pin.io.motion_schema import MotionModel
from vdsm_pin.io.yaml_reader import Location, YamlDocument
from vdsm_pin.problem.scene import Carrier
from vdsm_pin.proof.tree import Tree, free_tree

FLOATING = 6
"""The frame of `free_tree` that has all six joints before it."""


def placed(tree: Tree, frame: Frame) -> Tree:
    """A tree that hangs on the base's origin, its axes turned to those of the file."""
    first, *others = tree.joints
    pose = np.eye(4)
    pose[:3, :3] = frame.rotation.T
    return Tree((replace(first, placement=pose), *others))


def rigid_carrier(
    model: MotionModel, frame: Frame, document: YamlDocument, at: Location
) -> Carrier:
    """A frame that goes straight in (x, y, z, roll, pitch, yaw) from knot to knot.

    Whole turns that an angle has at the first knot are taken off all of them; only what
    is left is rounded.

    Args:
        model: Its knots.
        frame: The file's unit and base.
        document: The file, for messages.
        at: Where the motion stands in it.

    Raises:
        InvalidFile: If lists differ in length, times do not rise, or nothing moves.
    """
    from vdsm_pin.proof.paths import Path  # compiled code, which few need

    times = np.array(model.times_s)
    late = np.flatnonzero(~(np.diff(times) > 0.0))
    if late.size:
        k = int(late[0]) + 1
        problem = f"is {times[k]:g}, expected above {times[k - 1]:g}, the time before"
        raise document.invalid((*at, "times_s", k), problem)
    if model.positions is None and model.rpy_deg is None:
        problem = "has neither positions nor rpy_deg, so nothing moves"
        raise document.invalid(at, problem)
    given = {"positions": model.positions, "rpy_deg": model.rpy_deg}
    for name, rows in given.items():
        if rows is not None and len(rows) != len(times):
            problem = f"has {len(rows)} rows, expected {len(times)}, one for each time"
            raise document.invalid((*at, name), problem)
    places = _rows(model.positions, len(times)) - frame.origin
    turns = _rows(model.rpy_deg, len(times))
    turns = np.deg2rad(turns - (turns[0] - np.fmod(turns[0], 360.0)))
    knots = np.hstack([frame.metres(places), turns[:, ::-1]])
    return Carrier(placed(free_tree(), frame), Path(knots, times=times))


def _rows(given: Sequence[Sequence[float]] | None, count: int) -> FloatArray:
    return np.zeros((count, 3)) if given is None else np.array(given)
