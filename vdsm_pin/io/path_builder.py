"""The tip path of a problem file to a `DesiredPath` in the base frame."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io import problem_schema as schema
from vdsm_pin.io.frames import Frame
from vdsm_pin.io.obstacle_builder import without_repeats
from vdsm_pin.io.posture_builder import PostureBuilder
from vdsm_pin.io.yaml_reader import YamlDocument
from vdsm_pin.manipulator import Manipulator
from vdsm_pin.problem import Approach, Blocked, DesiredPath, Order
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.trajectory import MAX_ROWS

DEFAULT_SPACING: Final = 0.010
"""The paper's spacing of waypoints; [m]."""


def spacing_of(model: schema.TipPathModel, frame: Frame) -> float:
    """The spacing of a path, or the default one; [m]."""
    if model.spacing is None:
        return DEFAULT_SPACING
    return float(frame.metres(model.spacing))


@dataclass(frozen=True)
class PathBuilder:
    """Converts the tip path and refuses spacings that make no sense."""

    document: YamlDocument
    frame: Frame
    arm: Manipulator

    def build(self, model: schema.TipPathModel) -> DesiredPath:
        """The desired path in the base frame.

        Raises:
            InvalidFile: If the arm cannot stand at the start, the path leaves the
                extent for which distances are proved, or would need too many rows.
        """
        postures = PostureBuilder(self.document, self.frame, self.arm)
        start = postures.start(model.start, ("tip_path", "start"))
        points = self.frame.point(model.points)
        self._check_extent(points)
        path = DesiredPath(
            start.tip,
            without_repeats(points, closed=model.closed),
            model.closed,
            spacing_of(model, self.frame),
            Approach(model.approach),
            float(self.frame.metres(model.retreat)),
            Blocked(model.blocked),
            model.required_coverage,
            start.joints,
            Order(model.order),
        )
        self._check_rows(path)
        return path

    def _check_extent(self, points: FloatArray) -> None:
        reach, limit = np.linalg.norm(points, axis=1), TOLERANCES.scene_extent
        if not (reach <= limit).all():
            worst = int(np.argmax(reach))
            problem = (
                f"lies {self.frame.shown(float(reach[worst]))} from the base, expected "
                f"at most {self.frame.shown(limit)}"
            )
            raise self.document.invalid(("tip_path", "points", worst), problem)

    def _check_rows(self, path: DesiredPath) -> None:
        approach = float(np.linalg.norm(path.points[0] - path.start))
        rows = (path.length + approach) / path.spacing
        if not rows <= MAX_ROWS:
            problem = (
                f"is {self.frame.shown(path.spacing)}, which cuts "
                f"{self.frame.shown(path.length + approach)} of path into more than "
                f"{MAX_ROWS} rows"
            )
            raise self.document.invalid(("tip_path", "spacing"), problem)
