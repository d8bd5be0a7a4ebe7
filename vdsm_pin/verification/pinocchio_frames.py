"""Links as Pinocchio places them, which reads the URDF by itself.

Pinocchio is imported inside the functions, so that commands that do not verify start
without it, and its failures are translated here.
"""

import threading
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from vdsm_pin.errors import VerificationFailed
from vdsm_pin.geometry.arrays import FloatArray

Parts: TypeAlias = Callable[[Any], list[FloatArray]]
"""Views of a pinocchio.SE3."""


class _Seen(threading.local):
    """What a thread reads poses from: views of what is overwritten row by row."""

    data: Any = None
    live: Sequence[FloatArray] = ()
    parts: "Parts | None" = None


@dataclass(frozen=True, eq=False)
class PinocchioFrames:
    """Some links of a model.

    Args:
        model: pinocchio.Model.
        numbers: Of the links' frames.
    """

    model: Any
    numbers: tuple[int, ...]
    _seen: "_Seen" = field(default_factory=_Seen, init=False, repr=False)

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
        return self._read(q, _pose).reshape(len(q), -1, 4, 3).swapaxes(2, 3)

    def origins(self, q: FloatArray) -> FloatArray:
        """The origins of the links alone, sooner, shape (n_rows, n_links, 3); [m]."""
        return self._read(q, lambda frame: [frame.translation]).reshape(len(q), -1, 3)

    def _read(self, q: FloatArray, parts: Parts) -> FloatArray:
        """Some parts of each pose, one after the other, (n_rows, size of all)."""
        import pinocchio as pin

        if self._seen.parts is not parts:
            data = self.model.createData()
            frames = (data.oMf[number] for number in self.numbers)
            seen = [part for frame in frames for part in parts(frame)]
            self._seen.data, self._seen.live, self._seen.parts = data, seen, parts
        data, live = self._seen.data, self._seen.live
        found = np.zeros((len(q), sum(part.size for part in live)))
        for row, values in zip(found, q, strict=True):
            pin.framesForwardKinematics(self.model, data, values)
            np.concatenate(live, out=row)
        return found


def _pose(frame: Any) -> list[FloatArray]:
    """Rotation, column by column, and origin of a pinocchio.SE3."""
    return [frame.rotation.T.reshape(-1), frame.translation]


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
