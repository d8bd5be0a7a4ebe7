"""Other arms of a problem: obstacles that ride on a tree and move by a trajectory."""

from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.arm.tree import RAIL, arm_tree, link_frame
from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import FloatArray, rotation_from_rpy
from vdsm_pin.io.arm_builder import ArmBuilder
from vdsm_pin.io.frames import Frame, radians
from vdsm_pin.io.problem_schema import OtherModel
from vdsm_pin.io.source import Digest, read_bytes
from vdsm_pin.io.tables import as_text
from vdsm_pin.io.trajectory_file import TIME, read_trajectory_text
from vdsm_pin.io.yaml_reader import Location, YamlDocument
from vdsm_pin.problem.scene import Carrier, Moving
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.tree import Tree

MAX_BYTES = 1 << 30
"""Of a trajectory file."""


@dataclass(frozen=True)
class OtherArms:
    """Converts the other arms of one file.

    Args:
        document: The file, for messages.
        frame: Its unit and base.
        folder: Where relative paths start.
        digest: Gets the bytes of the files of each arm, then of its trajectory.
    """

    document: YamlDocument
    frame: Frame
    folder: Path
    digest: Digest

    def build(self, models: list[OtherModel]) -> tuple[Moving, ...]:
        """The bodies of all arms, as obstacles.

        Raises:
            InvalidFile: If an arm or its trajectory breaks its contract.
        """
        found: list[Moving] = []
        for i, model in enumerate(models):
            at = ("others", i)
            known = self.document, self.frame, self.folder, self.digest
            arm = ArmBuilder(*known, (*at, "manipulator")).build(model.manipulator)
            motion = self._motion(model, arm, at)
            carrier = _carrier(model.name, arm, motion, self._pose(model))
            for link, solid in (*arm.rods, *arm.carried):
                named = replace(solid, name=f"{model.name}: {solid.name}")
                found.append(Moving(named, carrier, link_frame(link)))
        return tuple(found)

    def _motion(self, model: OtherModel, arm: Manipulator, at: Location) -> Trajectory:
        """Its trajectory, with times."""
        at, file = (*at, "trajectory"), self.folder / model.trajectory
        try:
            content = read_bytes(file, limit=MAX_BYTES)
            motion = read_trajectory_text(file, as_text(BytesIO(content)), arm)
        except InvalidFile as error:
            name = model.trajectory
            raise self.document.invalid_file(at, name, error) from None
        self.digest.update(content)
        if motion.times is None:
            problem = f"{model.trajectory!r} has no column {TIME!r}, which it needs"
            raise self.document.invalid(at, problem)
        return motion

    def _pose(self, model: OtherModel) -> FloatArray:
        """T_base_other: the other rail as seen from this base, (4, 4); [m]."""
        pose = np.eye(4)
        turn = rotation_from_rpy(radians(model.base.rpy_deg))
        pose[:3, :3] = self.frame.rotation.T @ turn
        pose[:3, 3] = self.frame.point(model.base.position)
        return pose


def _carrier(
    name: str, arm: Manipulator, motion: Trajectory, pose: FloatArray
) -> Carrier:
    joints = list(arm_tree(arm).joints)
    joints[RAIL] = replace(joints[RAIL], placement=pose)
    return Carrier(Tree(tuple(joints)), motion.path, name)
