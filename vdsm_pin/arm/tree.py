"""A snake arm as a tree of joints: rail, then yaw and pitch of every link."""

from functools import lru_cache

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.proof.tree import Joint, Kind, Tree, X, Y, Z, shifted

RAIL: int = 0
"""The joint that carries the base: its placement is where the base stands."""


def arm_tree(arm: Manipulator) -> Tree:
    """The arm's joints; q = (x0, alpha1, theta1, ..), as `Trajectory.joints`."""
    return _tree_of(tuple(map(float, arm.link_lengths)))


@lru_cache(maxsize=64)
def _tree_of(lengths: tuple[float, ...]) -> Tree:
    """The tree of an arm whose links have these lengths; [m]."""
    joints = [Joint(0, Kind.PRISMATIC, X, column=0, name="x0")]
    before = 0.0
    for link, length in enumerate(lengths):
        at, placed = 2 * link + 1, shifted(before, 0.0, 0.0)
        joints += [
            Joint(at, Kind.REVOLUTE, Z, placed, column=at, name=f"alpha{link + 1}"),
            Joint(at + 1, Kind.REVOLUTE, Y, column=at + 1, name=f"theta{link + 1}"),
        ]
        before = length
    return Tree(tuple(joints))


def link_frame(link: int) -> int:
    """The frame of a link, 1 to N: its origin at O_i, x along the link."""
    return 2 * link + 1
