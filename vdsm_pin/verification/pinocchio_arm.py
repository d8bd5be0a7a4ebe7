"""An arm as Pinocchio reads it from its URDF."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.arm.urdf_validator import validate_urdf
from vdsm_pin.arm.urdf_writer import urdf_text
from vdsm_pin.errors import InvalidInput, VerificationFailed
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.source import sha256_of
from vdsm_pin.verification.pinocchio_frames import PinocchioFrames, read_model

_last: list["PinocchioArm | None"] = [None]
"""The last arm that was loaded: most problems of a batch have one arm. Nobody changes
its model."""


@dataclass(frozen=True, eq=False)
class PinocchioArm:
    """One arm, parsed from its URDF.

    Args:
        manipulator: The arm it was written from.
        urdf_sha256: Hash of the URDF's bytes.
        frames: Of links 1 to N (origin at O_i, x axis along link i) and of the tip.
    """

    manipulator: Manipulator
    urdf_sha256: str
    frames: PinocchioFrames

    @property
    def model(self) -> Any:
        """Its pinocchio.Model."""
        return self.frames.model

    def poses(self, x0: FloatArray, alpha: FloatArray, theta: FloatArray) -> FloatArray:
        """T_base_link and T_base_tip by Pinocchio, shape (n_samples, N + 1, 3, 4); [m].

        Args:
            x0: Base positions on the rail, shape (n_samples,); [m].
            alpha: Yaw angles, shape (n_samples, N); [rad].
            theta: Pitch angles, shape (n_samples, N); [rad].

        Raises:
            InvalidInput: If the arrays do not fit this arm.
        """
        return self.frames.poses(self._rows(x0, alpha, theta))

    def joint_centres(
        self, x0: FloatArray, alpha: FloatArray, theta: FloatArray
    ) -> FloatArray:
        """Joint centres O_1..O_{N+1} by Pinocchio, shape (n_samples, N + 1, 3); [m].

        Arguments and errors are those of `poses`.
        """
        return self.frames.origins(self._rows(x0, alpha, theta))

    def _rows(self, x0: FloatArray, alpha: FloatArray, theta: FloatArray) -> FloatArray:
        """Rows of q as Pinocchio has it."""
        expected = x0.size, self.manipulator.n_links
        if alpha.shape != expected or theta.shape != expected:
            message = (
                f"angles have shapes {alpha.shape} and {theta.shape}, "
                f"expected {expected}"
            )
            raise InvalidInput(message)
        q = np.zeros((x0.size, self.model.nq))
        q[:, 0], q[:, 1::2], q[:, 2::2] = x0, alpha, theta
        return q


def load_arm(manipulator: Manipulator) -> PinocchioArm:
    """Write the arm's URDF and have Pinocchio read it.

    Args:
        manipulator: The arm.

    Returns:
        The model.

    Raises:
        VerificationFailed: If Pinocchio does not find the arm's joints in the URDF.
    """
    # Read once and written once: other threads may load other arms meanwhile.
    model = _last[0]
    if model is None or model.manipulator is not manipulator:
        bare = replace(manipulator, feed=None, bodies=(), ignore_pairs=())
        text = urdf_text(bare)  # Coal has the shapes of what is carried as they are
        if model is None or model.urdf_sha256 != sha256_of([text.encode()]):
            model = read_arm(manipulator, text)
        _last[0] = model = replace(model, manipulator=manipulator)
    return model


def read_arm(manipulator: Manipulator, text: str) -> PinocchioArm:
    """The model of an arm from URDF text.

    Lengths, axes and shapes in it are not looked at: `fk` holds the joint centres of
    every row against the closed form.

    Args:
        manipulator: The arm.
        text: A URDF document as `urdf_writer.urdf_text` writes them.

    Raises:
        InvalidInput: If the document is not sound.
        VerificationFailed: If it does not have the arm's joints and links.
    """
    validate_urdf(text)
    model, links = read_model(text), range(1, manipulator.n_links + 1)
    angles = [f"{kind}{i}" for i in links for kind in ("alpha", "theta")]
    expected = ["universe", "x0", *angles]
    if list(model.names) != expected:
        message = f"Pinocchio's joints are {list(model.names)}, expected {expected}"
        raise VerificationFailed(message)
    return PinocchioArm(
        manipulator=manipulator,
        urdf_sha256=sha256_of([text.encode()]),
        frames=PinocchioFrames.of(model, [*(f"link{i}" for i in links), "tip"]),
    )
