"""Pinocchio and Coal alone: the robot and scene as they read them, state by state.

Nothing here calls the proof, its readers or its geometry.
"""

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Final, TypeAlias

import coal
import numpy as np
import pinocchio as pin

from benchmarks.foreign_plans.problems import load, source
from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import FloatArray

SHAPES: Final = {
    "box": coal.Box,
    "sphere": coal.Sphere,
    "cylinder": lambda height, radius: coal.Cylinder(radius, height),
}

LinkHulls: TypeAlias = Mapping[str, Sequence[FloatArray]]
"""By link the corners of each of its hulls in its frame, shape (n, 3); [m]."""


class Sampled:
    """Collisions of one robot in one scene at single configurations.

    Args:
        robot: Name of the robot.
        scene: A PlanningScene of boxes, spheres and cylinders.
        hulls: What stands for links; None for the hull of each mesh.
    """

    def __init__(self, robot: str, scene: Path, hulls: LinkHulls | None = None) -> None:
        folder = source(robot)
        urdf, srdf = str(folder / f"{robot}.urdf"), str(folder / f"{robot}.srdf")
        self.model = pin.buildModelFromUrdf(urdf)
        if hulls is None:
            self.geometry = _meshes_as_hulls(self.model, urdf)
        else:
            self.geometry = _of_hulls(self.model, hulls)
        self.geometry.addAllCollisionPairs()
        pin.removeCollisionPairs(self.model, self.geometry, srdf)
        n = self.geometry.ngeoms
        for name, shape, pose in _things(scene):
            added = pin.GeometryObject(name, 0, 0, pose, shape)
            number = self.geometry.addGeometryObject(added)
            for link in range(n):
                if self.geometry.geometryObjects[link].parentJoint:
                    self.geometry.addCollisionPair(pin.CollisionPair(link, number))
        self.data = self.model.createData()
        self.found = self.geometry.createData()
        for request in self.found.distanceRequests:
            request.enable_signed_distance = True

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, in the order of q."""
        return tuple(self.model.names)[1:]

    @property
    def limits(self) -> FloatArray:
        """Lower and upper values of the joints, shape (2, n); [rad]."""
        model = self.model
        return np.array([model.lowerPositionLimit, model.upperPositionLimit])

    def collides(self, q: FloatArray) -> bool:
        """Whether anything meets at q, shape (n,); [rad]."""
        hit = pin.computeCollisions(
            self.model, self.data, self.geometry, self.found, q, True
        )
        return bool(hit)

    def clearance(self, q: FloatArray) -> float:
        """The least signed distance of all pairs at q; [m]."""
        pin.computeDistances(self.model, self.data, self.geometry, self.found, q)
        return min(one.min_distance for one in self.found.distanceResults)

    def meets(self, a: FloatArray, b: FloatArray, steps: int) -> bool:
        """Whether anything meets at one of the ends of even steps from a to b.

        Those are passed over before which no two bodies can come together:
        each joint carries no point further than by its angle times its lever.
        """
        step = self.levers @ np.abs(b - a) / steps
        at = 0
        while at <= steps:
            q = a + at / steps * (b - a)
            away = self.clearance(q)
            if away <= 0.0 and self.collides(q):
                return True
            at += max(1, int(away / step)) if step > 0.0 else steps
        return False

    @cached_property
    def levers(self) -> FloatArray:
        """How far a body may reach from each joint's axis, shape (n,); [m]."""
        model, far = self.model, np.zeros(self.model.njoints)
        for thing in self.geometry.geometryObjects:
            thing.geometry.computeLocalAABB()
            center = thing.placement.act(thing.geometry.aabb_center)
            reach = np.linalg.norm(center) + thing.geometry.aabb_radius
            far[thing.parentJoint] = max(far[thing.parentJoint], reach)
        for joint in range(model.njoints - 1, 0, -1):
            if not model.joints[joint].shortname().startswith("JointModelR"):
                message = f"joint {model.names[joint]!r} turns about no axis"
                raise InvalidInput(message)
            shift = np.linalg.norm(model.jointPlacements[joint].translation)
            parent = model.parents[joint]
            far[parent] = max(far[parent], shift + far[joint])
        return far[1:]

    def travel(self, a: FloatArray, b: FloatArray) -> float:
        """About how far the fastest link frame moves from a to b; [m]."""
        places = []
        for q in (a, 0.5 * (a + b), b):
            pin.framesForwardKinematics(self.model, self.data, q)
            places.append(np.array([f.translation for f in self.data.oMf]))
        steps = np.linalg.norm(np.diff(places, axis=0), axis=2).sum(axis=0)
        return float(steps.max())


def _meshes_as_hulls(model: pin.Model, urdf: str) -> pin.GeometryModel:
    """The links' solids as Pinocchio reads them, meshes as their hulls."""
    folders = [str(Path(urdf).parent)]
    found = pin.buildGeomFromUrdf(model, urdf, pin.COLLISION, package_dirs=folders)
    for thing in found.geometryObjects:
        if isinstance(thing.geometry, coal.BVHModelBase):
            thing.geometry.buildConvexHull(True, "Qt")
            thing.geometry = thing.geometry.convex
    return found


def _of_hulls(model: pin.Model, hulls: LinkHulls) -> pin.GeometryModel:
    """Hulls of links' corners, in the links' frames as Pinocchio has them."""
    found = pin.GeometryModel()
    for name, each in hulls.items():
        number = model.getBodyId(name)
        frame = model.frames[number]
        for k, points in enumerate(each):
            corners = coal.StdVec_Vec3s()
            corners.extend(list(points))
            solid = coal.Convex.convexHull(corners, True, "Qt")
            place = frame.parentJoint, number, frame.placement
            found.addGeometryObject(pin.GeometryObject(f"{name}_{k}", *place, solid))
    return found


def _things(scene: Path) -> list[tuple[str, Any, pin.SE3]]:
    """Name, shape and place of every solid of a scene."""
    found = []
    for thing in load(scene)["world"]["collision_objects"]:
        base = _pose(thing.get("pose") or {})
        for k, (solid, at) in enumerate(
            zip(thing["primitives"], thing["primitive_poses"], strict=True)
        ):
            shape = SHAPES[solid["type"]](*map(float, solid["dimensions"]))
            found.append((f"{thing['id']}/{k}", shape, base * _pose(at)))
    return found


def _pose(stated: dict[str, list[float]]) -> pin.SE3:
    stated_turn = stated.get("orientation", [0, 0, 0, 1])  # x, y, z, w
    turn = pin.Quaternion(np.array(stated_turn, dtype=float))
    turn.normalize()
    shift = np.array(stated.get("position", [0, 0, 0]), dtype=float)
    return pin.SE3(turn.matrix(), shift)
