"""Problems in another size: every length times a factor."""

from dataclasses import replace

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.solids import (
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    Mesh,
    Prism,
    Sphere,
)
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.pointing import Pointing
from vdsm_pin.problem.scene import Obstacle, Scene

LENGTHS = {
    Sphere: ("centre", "radius"),
    Capsule: ("centre", "half_length", "radius"),
    Cylinder: ("centre", "half_length", "radius"),
    Box: ("centre", "half_size"),
    Prism: ("origin", "polygon", "span"),
    HalfSpace: ("point",),
    Mesh: ("vertices",),
}
"""The fields of each shape that are lengths."""


def longer(value: object, factor: float) -> object:
    """A length, or some, times a factor."""
    return tuple(np.multiply(value, factor)) if isinstance(value, tuple) else (
        np.multiply(value, factor)
    )  # fmt: skip


def scaled_arm(arm: Manipulator, factor: float) -> Manipulator:
    """The arm in another size."""
    low, high = arm.base_range
    return replace(
        arm,
        link_lengths=arm.link_lengths * factor,
        link_radius=arm.link_radius * factor,
        base_range=(low * factor, high * factor),
        cables=replace(
            arm.cables,
            hole_radius=arm.cables.hole_radius * factor,
            half_gap=arm.cables.half_gap * factor,
        ),
    )


def scaled_obstacle(obstacle: Obstacle, factor: float) -> Obstacle:
    """The obstacle in another size."""
    fields = {
        name: longer(getattr(obstacle, name), factor)
        for name in LENGTHS[type(obstacle)]
    }
    return replace(obstacle, **fields)


def scaled_path(path: DesiredPath, factor: float) -> DesiredPath:
    """The path in another size."""
    joints = path.start_joints
    if joints is not None:
        joints = joints.copy()
        joints[0] *= factor
    return replace(
        path,
        start=path.start * factor,
        points=path.points * factor,
        spacing=path.spacing * factor,
        retreat=path.retreat * factor,
        start_joints=joints,
        pointing=path.pointing and scaled_pointing(path.pointing, factor),
    )


def scaled_pointing(pointing: Pointing, factor: float) -> Pointing:
    """What is looked at in another size."""
    target = pointing.target
    return pointing if target is None else replace(pointing, target=target * factor)


def scaled(task: PlanningProblem, factor: float) -> PlanningProblem:
    """The problem in another size."""
    return replace(
        task,
        manipulator=scaled_arm(task.manipulator, factor),
        scene=Scene(tuple(scaled_obstacle(o, factor) for o in task.scene.obstacles)),
        tip_path=scaled_path(task.path, factor),
        required_clearance=task.required_clearance * factor,
    )
