"""How far the real motion may stray from the nominal one."""

from dataclasses import dataclass

from vdsm_pin.geometry.arrays import FloatArray


@dataclass(frozen=True)
class ErrorBox:
    """The largest errors, each from none to that, in whatever direction, at every time.

    Args:
        joints: Of each joint's value, shape (n_joints,); [rad] or [m].
        shifts: Of the origin of each joint's placement, shape (n_joints,); [m].
        tilts: Turn of each placement about its origin, shape (n_joints,); [rad].
        surfaces: By how much the surface of each body may be off, shape (n_bodies,);
            [m]. None for not at all.
    """

    joints: FloatArray
    shifts: FloatArray
    tilts: FloatArray
    surfaces: FloatArray | None = None
