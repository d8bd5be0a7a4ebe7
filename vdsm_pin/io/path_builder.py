"""The tip path of a problem file to a `DesiredPath` in the base frame."""

from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Final

import numpy as np

from vdsm_pin.errors import InvalidFile, InvalidInput
from vdsm_pin.geometry import curves
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.io import path_schema as schema
from vdsm_pin.io.frames import Frame
from vdsm_pin.io.obstacle_builder import without_repeats
from vdsm_pin.io.posture_field import PostureBuilder
from vdsm_pin.io.problem_errors import ErrorCollector
from vdsm_pin.io.source import Digest, read_bytes
from vdsm_pin.io.tables import Table, as_text
from vdsm_pin.problem.desired_path import Approach, Blocked, DesiredPath, Order
from vdsm_pin.problem.pointing import Pointing
from vdsm_pin.problem.trajectory import MAX_ROWS
from vdsm_pin.units import UNITS_PER_METRE

CURVE_TOLERANCE: Final = 0.00005
"""How far corners may stray from a curve where the file states nothing; [m]."""

MAX_POINT_BYTES: Final = 1 << 29
"""Some hundred bytes for each of the rows that a motion may have."""

DEFAULT_SPACING: Final = 0.010
"""The paper's spacing of waypoints; [m]."""


def spacing_of(model: schema.TipPathModel, frame: Frame) -> float:
    """The spacing of a path, or the default one; [m]."""
    if model.spacing is None:
        return DEFAULT_SPACING
    return float(frame.metres(model.spacing))


def read_points(path: Path, digest: Digest) -> FloatArray:
    """Points of a path from the CSV of any program, in its order and unit, (n, 3).

    Args:
        path: A file with the columns x, y and z; others are not read.
        digest: Gets the bytes of the file.

    Raises:
        InvalidFile: If the file cannot be read, a column is missing, a value is no
            finite number, or there are no points or too many.
    """
    content = read_bytes(path, limit=MAX_POINT_BYTES)
    digest.update(content)
    table = Table(path, as_text(BytesIO(content)), {*"xyz"}.__contains__)
    table.choose(("x", "y", "z"))
    return table.all_rows()


@dataclass(frozen=True)
class PathBuilder(PostureBuilder):
    """Converts the tip path and refuses spacings that make no sense."""

    def build(self, model: schema.TipPathModel) -> DesiredPath:
        """The desired path in the base frame.

        Raises:
            InvalidFile: If the arm cannot stand at the start, the path leaves the
                extent for which distances are proved, or would need too many rows.
        """
        errors = ErrorCollector()
        start = errors.attempt(self.start, model.start, ("tip_path", "start"))
        insertion = errors.attempt(self._insertion, model)
        points = errors.attempt(self._points, model)
        pointing = None
        if points is not None:
            pointing = errors.attempt(self._pointing, model, points)
        errors.raise_if_any()
        assert start and points is not None and insertion is not None  # else raised
        home = model.retreat == "home"
        path = DesiredPath(
            start=start.tip,
            points=without_repeats(points, closed=model.closed),
            closed=model.closed,
            spacing=spacing_of(model, self.frame),
            approach=Approach(model.approach),
            retreat=0.0 if home else float(self.frame.metres(model.retreat)),
            blocked=Blocked(model.blocked),
            required_coverage=model.required_coverage,
            start_joints=start.joints,
            order=Order(model.order),
            pointing=pointing,
            home=home,
            insertion=insertion,
        )
        self._check_rows(path)
        return path

    def _points(self, model: schema.TipPathModel) -> FloatArray:
        """All corners in the base frame, shape (n, 3); [m]."""
        corners, parts = self._corners(model)
        points = self.frame.point(corners)
        self._check_points(points, "points", parts)
        return points

    def _insertion(self, model: schema.TipPathModel) -> FloatArray:
        """Places on the way to the path, in the base frame, shape (n, 3); [m]."""
        places = self.frame.point(np.array(model.insertion).reshape(-1, 3))
        self._check_points(places, "insertion", np.arange(len(places)))
        return places

    def _pointing(
        self, model: schema.TipPathModel, points: FloatArray
    ) -> Pointing | None:
        """Where the last link looks, in the base frame.

        Args:
            model: What the file says.
            points: The corners as read, repeats included, shape (n, 3); [m].
        """
        asked, at = model.pointing, ("tip_path", "pointing")
        if asked is None:
            return None
        given = [asked.target, asked.direction, asked.directions]
        if sum(one is not None for one in given) != 1:
            fault = "expected one of target, direction and directions"
            raise self.invalid(at, fault)
        cone = float(np.deg2rad(asked.cone_deg))
        with self.document.naming(at):
            if asked.direction is not None:
                one = self.frame.direction(np.array([asked.direction]))
                return Pointing(cone, directions=one)
            if asked.target is not None:
                made = Pointing(cone, target=self.frame.point(asked.target))
            else:
                made = Pointing(cone, directions=self._directions(model, points))
            made.check_aims(np.concatenate([points, points[:1]][: 1 + model.closed]))
            return made

    def _directions(self, model: schema.TipPathModel, points: FloatArray) -> FloatArray:
        """A direction for each corner, the closing one included, shape (m, 3)."""
        assert model.pointing is not None
        given = model.pointing.directions or []
        if len(given) != len(points) or len(model.points) != len(points):
            message = (
                f"{len(given)} directions for {len(model.points)} points, expected as "
                "many, and no curves and files among the points"
            )
            raise InvalidInput(message)
        if len(without_repeats(points, closed=model.closed)) != len(points):
            message = "directions need points without repeats"
            raise InvalidInput(message)
        turned = self.frame.direction(np.array(given))
        if model.closed and len(points) > 1:
            turned = np.concatenate([turned, turned[:1]])
        return turned

    def _corners(self, model: schema.TipPathModel) -> tuple[FloatArray, IntArray]:
        """All corners, shape (n, 3) in the file's frame, and whose part each is."""
        tolerance = model.curve_tolerance
        if tolerance is None:
            tolerance = CURVE_TOLERANCE * UNITS_PER_METRE[self.frame.unit]
        made: list[FloatArray] = []
        for i, part in enumerate(model.points):
            before, at = made[-1][-1] if made else None, ("tip_path", "points", i)
            try:
                with self.document.naming(at):
                    made.append(self._part(part, before, tolerance))
            except InvalidFile as error:
                if not isinstance(part, schema.FilePart):
                    raise
                raise self.document.invalid_file(at, part.file, error) from None
        counts = [len(corners) for corners in made]
        return np.concatenate(made), np.repeat(np.arange(len(made)), counts)

    def _part(
        self, part: schema.PathPart, before: FloatArray | None, tolerance: float
    ) -> FloatArray:
        """Corners of a point or of a curve after the point before, shape (n, 3)."""
        if isinstance(part, list):
            return np.array([part])
        if isinstance(part, schema.FilePart):
            return self.reading.read(part.file, read_points)
        if before is None:
            message = "has no point before it, expected one to begin at"
            raise InvalidInput(message)
        match part:
            case schema.ArcPart(arc=arc):
                through, end = np.array(arc.through), np.array(arc.to)
                return curves.arc_through(before, through, end, tolerance)
            case schema.CirclePart(circle=circle):
                centre, normal = np.array(circle.center), np.array(circle.normal)
                turn = float(np.deg2rad(circle.turn_deg))
                return curves.circle_from(before, centre, normal, turn, tolerance)
            case schema.SplinePart(spline=points):
                through = np.vstack([before[None], np.array(points)])
                return curves.spline_through(through, tolerance)

    def _check_points(self, points: FloatArray, field: str, parts: IntArray) -> None:
        reach = np.linalg.norm(points, axis=1)
        if len(reach):
            worst = int(np.argmax(reach))
            at = ("tip_path", field, int(parts[worst]))
            self.check_extent(at, float(reach[worst]), "lies", "the base")

    def _check_rows(self, path: DesiredPath) -> None:
        way = np.vstack([path.start, path.insertion, path.points[:1]])
        approach = float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
        rows = (path.length + approach) / path.spacing
        if not rows <= MAX_ROWS:
            fault = (
                f"is {self.frame.shown(path.spacing)}, which cuts "
                f"{self.frame.shown(path.length + approach)} of path into more than "
                f"{MAX_ROWS} rows"
            )
            raise self.invalid(("tip_path", "spacing"), fault)
