"""Links as Pinocchio places them, which reads the URDF by itself.

Pinocchio is imported inside the functions, so that commands that do not verify start
without it, and its failures are translated here.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from vdsm_pin.errors import VerificationFailed
from vdsm_pin.geometry.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class PinocchioFrames:
    """Some links of a model.

    Args:
        model: pinocchio.Model.
        numbers: Of the links' frames.
    """

    model: Any
    numbers: tuple[int, ...]

    @classmethod
    def of(cls, model: Any, links: Iterable[str]) -> "PinocchioFrames":
        """The frames of links, by their names.

        Raises:
            VerificationFailed: If there is no such link.
        """
        import pinocchio as pin

        numbers = {name: model.getFrameId(name, pin.BODY) for name in links}
        for name, number in numbers.items():
            if number >= model.nframes:  # Pinocchio has a number for any name
                message = f"Pinocchio has no link {name!r}"
                raise VerificationFailed(message)
        return cls(model, tuple(numbers.values()))

    def poses(self, q: FloatArray) -> FloatArray:
        """T_world_link at each row, shape (n_rows, n_links, 3, 4); [m].

        Args:
            q: As Pinocchio has it, shape (n_rows, model.nq); [rad], [m].
        """
        import pinocchio as pin

        data = self.model.createData()
        # Views of what is overwritten row by row: the columns of each pose.
        live = [
            part
            for place in (data.oMf[number] for number in self.numbers)
            for part in (place.rotation.T.reshape(-1), place.translation)
        ]
        found = np.zeros((len(q), 12 * len(self.numbers)))
        for row, values in zip(found, q, strict=True):
            pin.framesForwardKinematics(self.model, data, values)
            np.concatenate(live, out=row)
        return found.reshape(len(q), -1, 4, 3).swapaxes(2, 3)


def read_model(text: str, *root: Any) -> Any:
    """Pinocchio's model of a URDF.

    Args:
        text: The document.
        root: The joint of its root link and that joint's name; none if it stands.

    Raises:
        VerificationFailed: If Pinocchio refuses it.
    """
    import pinocchio as pin

    try:
        return pin.buildModelFromXML(text, *root)
    except (ValueError, RuntimeError) as error:
        message = f"Pinocchio refuses the URDF: {error}"
        raise VerificationFailed(message) from None
