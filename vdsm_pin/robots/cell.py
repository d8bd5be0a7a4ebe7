"""A robot among its obstacles: from files named one by one, or from a problem file."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Final

import numpy as np

from vdsm_pin.errors import InvalidInput, UnknownName
from vdsm_pin.geometry.arrays import FloatArray, IntArray, frozen
from vdsm_pin.io.problem_errors import ErrorCollector
from vdsm_pin.io.problem_file import read_document
from vdsm_pin.io.source import check_is_file, path_of
from vdsm_pin.problem.any_problem import AnyProblem, ProblemSource
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.scene import Scene
from vdsm_pin.proof.bodies import PairTable
from vdsm_pin.robots.files import CellFile, Named, RobotFiles, cell_file, source_of
from vdsm_pin.robots.model import Robot, RobotJoint
from vdsm_pin.robots.other_robots import read_other
from vdsm_pin.robots.scene_files import read_scene_with_files
from vdsm_pin.robots.urdf import read_robot
from vdsm_pin.units import in_mm
from vdsm_pin.verification.assembly import Assembly, obstacle_growth
from vdsm_pin.verification.coal_shapes import CoalShapes, Sides, assembly_shapes


def check_errors(robot: Robot, scene: Scene, errors: ErrorBox) -> None:
    """Refuse errors of what there is not.

    Raises:
        UnknownName: If they name a joint that does not move, or no obstacle.
        InvalidInput: If they count joints, are of all joints that turn or slide where
            none does, turn one that slides or the reverse, or turn a half-space.
    """
    if errors.joints:
        message = "joint errors of a robot are one number, or by name: JOINT=DEG"
        raise InvalidInput(message)
    joints = {joint.name: joint for joint in robot.joints}
    kinds = {joint.turns for joint in robot.joints}
    plain = ("joint", errors.joint, True), ("slide", errors.slide, False)
    for what, error, turns in plain:
        if error and turns not in kinds:
            way = "turns" if turns else "slides"
            message = f"a {what} error has no meaning: no joint that moves {way}"
            raise InvalidInput(message)
    for one in errors.named:
        if one.name not in joints:
            raise UnknownName(kind="moving joint", name=one.name, known=tuple(joints))
        wrong = one.shift if joints[one.name].turns else one.turn
        if wrong:
            turns = joints[one.name].turns
            way, unit = ("turns", "degrees") if turns else ("slides", "millimetres")
            message = f"joint {one.name!r} {way}: expected its error in {unit}"
            raise InvalidInput(message)
    for obstacle in errors.obstacles:
        if obstacle.name not in scene.names:
            raise UnknownName(kind="obstacle", name=obstacle.name, known=scene.names)
    obstacle_growth(scene.obstacles, errors)


def joint_errors(joints: Sequence[RobotJoint], errors: ErrorBox) -> FloatArray:
    """Largest error of each joint that a trajectory moves, (n_joints,); [rad], [m]."""
    plain = [errors.joint if joint.turns else errors.slide for joint in joints]
    largest = dict(zip((joint.name for joint in joints), plain, strict=True))
    for one in errors.named:  # of one that turns the shift is 0, and the reverse
        largest[one.name] = max(largest[one.name], one.turn, one.shift)
    return np.array([*largest.values()])


ROOT_FRAME: Final = 1
"""The frame that obstacles stand in: of the root link, where it does not move."""


@dataclass(frozen=True, eq=False, repr=False)
class Cell(AnyProblem):
    """A robot among its obstacles, and what its motions are held to.

    Args:
        robot: The robot.
        scene: Obstacles in its base frame.
        required_clearance: Least clearance from obstacles; [m].
        required_self_clearance: Least clearance between links that are held apart; [m].
        name: Of the problem; empty for the robot's.
        T_world_base: The robot's root link in the frame of the files, (4, 4); [m].
        errors: What every clearance is asked for under; those of the base are of the
            fixed joint that carries the root link, so that bodies on it are moved too.
        source: The files it was read from; None where it was changed since by more than
            its errors.

    Raises:
        InvalidInput: If a clearance is negative or not finite, the pose is no rigid
            motion, or errors are of what there is not.

    Example:
        >>> ball = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
        >>> text = f'<robot name="one"><link name="ball">{ball}</link></robot>'
        >>> _ = Path("one.urdf").write_text(text)
        >>> cell = cell_of(vp.RobotFiles("one.urdf"))
        >>> Cell(cell.robot, cell.scene, required_clearance=0.01).name
        'one'
    """

    robot: Robot
    scene: Scene
    required_clearance: float = 0.0
    required_self_clearance: float = 0.0
    name: str = ""
    T_world_base: FloatArray = field(default_factory=lambda: np.eye(4))
    errors: ErrorBox = field(default_factory=ErrorBox)
    source: ProblemSource | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        """Check clearances, pose and errors."""
        object.__setattr__(self, "name", self.name or self.robot.name)
        self.check_asked()
        self.check_errors(self.errors)

    def check_errors(self, errors: ErrorBox) -> None:
        """Refuse errors of what there is not: see `check_errors`."""
        check_errors(self.robot, self.scene, errors)

    @property
    def slides(self) -> bool:
        """Whether any joint that moves slides, so that its values are lengths."""
        return not all(joint.turns for joint in self.robot.joints)

    @cached_property
    def asked(self) -> Assembly:
        """What of it is held apart."""
        bodies, n = self.robot.bodies, len(self.robot.bodies)
        m, held = len(self.scene.obstacles), self.robot.held
        near, far = np.array(held, np.int64).reshape(-1, 2).T
        required = [self.required_clearance, self.required_self_clearance]
        table = PairTable(
            frozen(np.append(np.repeat(np.arange(n, n + m), n), near), np.int64),
            frozen(np.append(np.tile(np.arange(n), m), far), np.int64),
            frozen(np.repeat(required, [m * n, len(held)])),
        )
        return Assembly(
            own_tree=self.robot.tree,
            own=bodies,
            links=range(1, n + 1),
            names=[body.name for body in bodies],
            balls=[0.0] * n,
            scene=self.scene,
            table=table,
            column_errors=partial(joint_errors, self.robot.joints),
        )

    @cached_property
    def coal(self) -> CoalShapes:
        """The bodies as Coal has them."""
        return assembly_shapes(self.asked)

    def sides(
        self, one: IntArray, other: IntArray, row: IntArray | None = None
    ) -> Sides:
        """Pairs of bodies as Coal is asked about them, each at a row of poses.

        Args:
            one: Their first bodies, shape (m,).
            other: The second ones, shape (m,).
            row: That of each pair, shape (m,); None where each has its own.
        """
        # Seen from the obstacle, the first body of its pairs: a cloud has no pose.
        outer = one >= len(self.robot.bodies)
        rows = np.arange(len(one)) if row is None else row
        return Sides(rows, np.where(outer, other, one), np.where(outer, one, other))

    def distances(
        self,
        one: IntArray,
        other: IntArray,
        poses: FloatArray,
        row: IntArray | None = None,
    ) -> FloatArray:
        """Coal's of pairs of bodies, shape (m,); [m]. NaN for none.

        Args:
            one: As for `sides`.
            other: The same.
            poses: Of all frames at some rows, shape (n_rows, n_frames, 4, 4); [m].
            row: As for `sides`.
        """
        sides = self.sides(one, other, row)
        return self.coal.distances(poses[:, :, :3], sides)

    def summary(self) -> tuple[tuple[str, str], ...]:
        """Robot, scene and what is required."""
        joints = ", ".join(joint.name for joint in self.robot.joints[:8])
        return (
            ("name", self.name),
            ("robot", f"{self.robot.name}, {len(self.robot.bodies)} links with solids"),
            ("moves", joints or "nothing"),
            ("obstacles", ", ".join(self.scene.names[:8]) or "none"),
            ("required clearance", in_mm(self.required_clearance)),
            ("file", str(self.source.path) if self.source else "changed in Python"),
        )


def cell_of(
    robot: RobotFiles,
    scene: str | Path | Scene | None = None,
    required_clearance: float = 0.0,
    required_self_clearance: float = 0.0,
) -> Cell:
    """A robot of files that are named one by one, among obstacles.

    Args:
        robot: Its files.
        scene: The file of the obstacles, or the obstacles, in the frame of the root
            link; None for none.
        required_clearance: Least clearance from obstacles; [m].
        required_self_clearance: Least clearance between links; [m].

    Raises:
        InvalidInput: If a file is bad or a value makes no sense.

    Example:
        >>> ball = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
        >>> text = f'<robot name="one"><link name="ball">{ball}</link></robot>'
        >>> _ = Path("one.urdf").write_text(text)
        >>> post = vp.Sphere("post", np.array([1.0, 0.0, 0.0]), 0.2)
        >>> cell_of(vp.RobotFiles("one.urdf"), vp.Scene((post,))).scene.names
        ('post',)
    """
    if not isinstance(robot, RobotFiles):
        found = type(robot).__name__
        message = f"expected RobotFiles, as of RobotFiles('ur5.urdf'); found {found}"
        raise InvalidInput(message)
    read = read_robot(robot)
    required = required_clearance, required_self_clearance
    named = (*robot.files, *read.more_files)
    of_files: Named = ()
    if scene is None or isinstance(scene, Scene):
        solids = scene or Scene()
    elif not isinstance(scene, str | Path):
        message = f"scene is a {type(scene).__name__}, expected a Scene or its file"
        raise InvalidInput(message)
    else:
        file = Path(scene)
        solids, of_files = read_scene_with_files(file, read.reach, _others(read))
        named = (*named, file)
    source = replace(source_of(named, of_files), is_whole=False)
    return Cell(read, solids, *required).read_from(source)


def read_cell(path: str | Path) -> Cell:
    """The robot of a problem file with `robot` in place of `manipulator`.

    Args:
        path: The file.

    Raises:
        InvalidFile: If the file or one that it names breaks its contract.

    Example:
        >>> ball = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
        >>> text = f'<robot name="one"><link name="ball">{ball}</link></robot>'
        >>> _ = Path("one.urdf").write_text(text)
        >>> asked = "vdsm_problem: 1, length_unit: m, required_clearance: 0.01"
        >>> _ = Path("one.yaml").write_text(f"{{{asked}, robot: {{urdf: one.urdf}}}}")
        >>> read_cell("one.yaml").required_clearance
        0.01
    """
    file = path_of(path)
    check_is_file(file)
    return cell_of_file(cell_file(read_document(file)))


def cell_of_file(file: CellFile) -> Cell:
    """The robot of a problem file that was read already: as `read_cell`."""
    required, required_self = file.required
    errors = ErrorCollector()
    robot = errors.attempt(read_robot, file.robot)
    size, links = (robot.reach, _others(robot)) if robot else (None, [])
    found = errors.attempt(file.scene, size, links, read_other)
    errors.raise_if_any()
    assert robot and found  # what is None was raised
    cell = Cell(
        robot=robot,
        scene=found.scene,
        required_clearance=required,
        required_self_clearance=required_self,
        name=file.model.name or "",
        T_world_base=frozen(file.frame.pose),
    ).read_from(file.source(robot.more_files, found))
    with file.document.naming(("errors",)):
        return cell.under(file.errors(found.scene))


def _others(robot: Robot) -> list[str]:
    """Names of the links besides those that stand as the root link does."""
    return [name for name, frame in robot.frames.items() if frame != ROOT_FRAME]
