"""The arm in Pinocchio and the bodies in Coal; the only reader of the URDF.

Nothing below this module knows either library. Both are imported inside the functions,
so that commands that do not verify start without them, and their failures are
translated here.
"""

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.arm.urdf_validator import validate_urdf
from vdsm_pin.arm.urdf_writer import urdf_text
from vdsm_pin.errors import InvalidInput, UnknownName, VerificationFailed
from vdsm_pin.geometry.arrays import FloatArray, frozen
from vdsm_pin.io.source import sha256_of

POSE_SIZE: Final = 12
"""Numbers in a pose as Pinocchio stores it: the rotation's columns, then the origin."""

FLOAT_BYTES: Final = 8
"""Size of a double."""


_last: list["RobotModel | None"] = [None]
"""The last arm that was loaded: most problems of a batch have one arm. Nobody changes
its model."""


@dataclass(frozen=True, eq=False)
class LinkPoses:
    """Poses of the link frames: origin at O_i, x axis along link i.

    Args:
        rotations: Rs_base_link, shape (n_samples, N, 3, 3); [-].
        origins: ps_base_link, shape (n_samples, N, 3); [m].
    """

    rotations: FloatArray
    origins: FloatArray


@dataclass(frozen=True, eq=False)
class RobotModel:
    """One arm, parsed from its URDF.

    Args:
        manipulator: The arm it was written from.
        urdf_sha256: Hash of the URDF's bytes.
        model: pinocchio.Model.
        data: pinocchio.Data, overwritten by every call of `link_poses`.
        capsules: One coal.Capsule per link and one for the tool, along its own z axis.
        T_link_capsule: Pose of each capsule in its link frame, shape (n_axes, 4, 4);
            [m] in its last column.
        p_link_tip: The tip in the frame of link N, shape (3,); [m].
    """

    manipulator: Manipulator
    urdf_sha256: str
    model: Any
    data: Any
    capsules: tuple[Any, ...]
    T_link_capsule: FloatArray
    p_link_tip: FloatArray

    def link_poses(
        self, x0: FloatArray, alpha: FloatArray, theta: FloatArray
    ) -> LinkPoses:
        """Link frames by Pinocchio's forward kinematics.

        Args:
            x0: Base positions on the rail, shape (n_samples,); [m].
            alpha: Yaw angles, shape (n_samples, N); [rad].
            theta: Pitch angles, shape (n_samples, N); [rad].

        Returns:
            The poses of all links at all rows.

        Raises:
            InvalidInput: If the arrays do not fit this arm.
        """
        import pinocchio as pin

        n_samples, n_links = x0.size, self.manipulator.n_links
        if alpha.shape != (n_samples, n_links) or theta.shape != alpha.shape:
            message = (
                f"angles have shapes {alpha.shape} and {theta.shape}, "
                f"expected {(n_samples, n_links)}"
            )
            raise InvalidInput(message)
        q = np.zeros((n_samples, self.model.nq))
        q[:, 0], q[:, 1::2], q[:, 2::2] = x0, alpha, theta
        poses = np.zeros((n_samples, n_links, POSE_SIZE))
        live = _live_poses(self.model, self.data, n_links)
        forward, model, data = pin.forwardKinematics, self.model, self.data
        for k in range(n_samples):
            forward(model, data, q[k])
            poses[k] = live
        rotations = poses[..., :9].reshape(n_samples, n_links, 3, 3)
        return LinkPoses(rotations.swapaxes(2, 3), poses[..., 9:])

    def joint_centres(
        self, x0: FloatArray, alpha: FloatArray, theta: FloatArray
    ) -> FloatArray:
        """Joint centres O_1..O_{N+1} by Pinocchio, shape (n_samples, N + 1, 3); [m].

        Args:
            x0: Base positions on the rail, shape (n_samples,); [m].
            alpha: Yaw angles, shape (n_samples, N); [rad].
            theta: Pitch angles, shape (n_samples, N); [rad].
        """
        poses = self.link_poses(x0, alpha, theta)
        tip = poses.origins[:, -1] + poses.rotations[:, -1] @ self.p_link_tip
        return np.concatenate([poses.origins, tip[:, None]], axis=1)


def load_robot(manipulator: Manipulator) -> RobotModel:
    """Write the arm's URDF, read it back, and check that nothing got lost.

    Args:
        manipulator: The arm.

    Returns:
        The model, with exact Coal capsules for the links.

    Raises:
        VerificationFailed: If Pinocchio does not find in the URDF what was written.
    """
    # Read once and written once: other threads may load other arms meanwhile.
    robot = _last[0]
    if robot is None or robot.manipulator is not manipulator:
        bare = replace(manipulator, feed=None, bodies=(), ignore_pairs=())
        text = urdf_text(bare)  # Coal has the shapes of what is carried as they are
        if robot is None or robot.urdf_sha256 != sha256_of([text.encode()]):
            robot = read_robot(manipulator, text)
        robot = replace(robot, manipulator=manipulator)
        _last[0] = robot
    return replace(robot, data=robot.model.createData())


def read_robot(manipulator: Manipulator, text: str) -> RobotModel:
    """The model of an arm from URDF text, which must describe that arm.

    Args:
        manipulator: The arm.
        text: A URDF document as `urdf_writer.urdf_text` writes them.

    Returns:
        The model.

    Raises:
        InvalidInput: If the document is not sound.
        VerificationFailed: If it does not have the arm's joints and bodies.
    """
    import coal
    import pinocchio as pin

    validate_urdf(text)
    try:
        model = pin.buildModelFromXML(text)
        bodies = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.COLLISION)
    except (ValueError, RuntimeError) as error:
        message = f"Pinocchio refuses the URDF: {error}"
        raise VerificationFailed(message) from error
    _check_joints(manipulator, model)
    _check_bodies(manipulator, model, bodies)
    starts, ends = manipulator.axis_spans.T
    radii = manipulator.axis_radii
    capsules = tuple(map(coal.Capsule, radii.tolist(), (ends - starts).tolist()))
    T_link_capsule = np.tile(np.eye(4), (radii.size, 1, 1))
    T_link_capsule[:, :3, :3] = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]
    T_link_capsule[:, 0, 3] = (starts + ends) / 2.0
    tip = model.frames[frame_id(model, "tip")].placement
    return RobotModel(
        manipulator=manipulator,
        urdf_sha256=sha256_of([text.encode()]),
        model=model,
        data=model.createData(),
        capsules=capsules,
        T_link_capsule=frozen(T_link_capsule),
        p_link_tip=frozen(tip.translation),
    )


def frame_id(model: Any, name: str) -> int:
    """Pinocchio's number of a frame; it returns a number for any name.

    Raises:
        UnknownName: If there is no such frame.
    """
    if not model.existFrame(name):
        known = tuple(frame.name for frame in model.frames)
        raise UnknownName(kind="frame", name=name, known=known)
    return int(model.getFrameId(name))


def _check_joints(manipulator: Manipulator, model: Any) -> None:
    """Hold Pinocchio's joints against x0, alpha1, theta1, .., places and limits."""
    n_links = manipulator.n_links
    angles = [f"{kind}{i + 1}" for i in range(n_links) for kind in ("alpha", "theta")]
    expected = ["universe", "x0", *angles]
    if list(model.names) != expected:
        message = f"Pinocchio's joints are {list(model.names)}, expected {expected}"
        raise VerificationFailed(message)
    box = np.full(2 * n_links, manipulator.max_joint_angle)
    low, high = manipulator.base_range
    if not (
        np.array_equal(model.lowerPositionLimit, [low, *-box])
        and np.array_equal(model.upperPositionLimit, [high, *box])
    ):
        message = "Pinocchio's joint limits are not those of the arm"
        raise VerificationFailed(message)
    offsets = [0.0, *manipulator.link_lengths]
    yaws = [model.jointPlacements[model.getJointId(name)] for name in angles[::2]]
    tip = model.frames[frame_id(model, "tip")].placement
    for i, placement in enumerate([*yaws, tip]):
        if list(placement.translation) != [offsets[i], 0.0, 0.0]:
            message = (
                f"Pinocchio puts joint centre O{i + 1} at {placement.translation} in "
                f"its parent frame, expected ({offsets[i]}, 0, 0) m"
            )
            raise VerificationFailed(message)


def _check_bodies(manipulator: Manipulator, model: Any, bodies: Any) -> None:
    """Hold the shapes Pinocchio loaded against one rod and two balls per link."""
    found = sorted(_described(body) for body in bodies.geometryObjects)
    n_links = manipulator.n_links
    expected, radii = [], manipulator.axis_radii.tolist()
    for k, (start, end) in enumerate(manipulator.axis_spans.tolist()):
        joint, size = model.getJointId(f"theta{min(k + 1, n_links)}"), end - start
        expected += [(joint, start + x, radii[k], 0.0) for x in (0.0, size)]
        expected.append((joint, start + size / 2.0, radii[k], size))
    if found != sorted(expected):
        message = (
            f"Pinocchio loaded {len(found)} collision shapes, expected a cylinder and "
            f"two spheres for each of {len(radii)} links and tools in the arm's sizes"
        )
        raise VerificationFailed(message)


def _described(body: Any) -> tuple[int, float, float, float]:
    """Joint, place along the link, radius and length of a ball or rod; NaN if neither.

    A rod's axis must lie along the link.
    """
    import coal

    shape, placement = body.geometry, body.placement
    upright = abs(placement.rotation[0, 2]) == 1.0
    place = float(placement.translation[0])
    if type(shape) is coal.Sphere:
        return body.parentJoint, place, shape.radius, 0.0
    if type(shape) is coal.Cylinder and upright:
        return body.parentJoint, place, shape.radius, 2.0 * shape.halfLength
    return body.parentJoint, place, float("nan"), float("nan")


def _live_poses(model: Any, data: Any, n_links: int) -> FloatArray:
    """A view of the poses of joints theta1..thetaN inside Pinocchio's data.

    Reading oMi joint by joint from Python costs more than the kinematics. The poses lie
    in one std::vector; the view is made only if their addresses prove it.

    Returns:
        Rotation columns and origin of each link, shape (N, 12), memory of `data`.
    """
    joints = [model.getJointId(f"theta{i + 1}") for i in range(n_links)]
    rotations = [data.oMi[joint].rotation for joint in joints]
    starts = np.array([_address(rotation) for rotation in rotations])
    origins = np.array([_address(data.oMi[joint].translation) for joint in joints])
    stride = int(starts[1] - starts[0])
    if not (
        (np.diff(starts) == stride).all()
        and (origins - starts == 9 * FLOAT_BYTES).all()
        and all(r.strides == (FLOAT_BYTES, 3 * FLOAT_BYTES) for r in rotations)
    ):
        message = "Pinocchio does not store joint poses as 12 doubles at a fixed stride"
        raise VerificationFailed(message)
    return np.lib.stride_tricks.as_strided(
        rotations[0].T.reshape(-1),
        shape=(n_links, POSE_SIZE),
        strides=(stride, FLOAT_BYTES),
        writeable=False,
    )


def _address(array: FloatArray) -> int:
    return int(array.__array_interface__["data"][0])
