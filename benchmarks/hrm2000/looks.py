"""The family `pointing`: the last link looks somewhere while the tip draws.

What a witness of another family does anyway is asked for: a target near the lines along
which its last link looks, the mean of its directions, or one for each corner. The cone
is a little wider than the witness needs.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from benchmarks.hrm2000.drafts import Draft
from benchmarks.hrm2000.motions import DraftRejected, Witness
from benchmarks.hrm2000.sweeps import Rng
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.pointing import Pointing, angles_between

WIDEST: Final = np.deg2rad(15.0)
"""A witness whose last link looks about by more is of no use; [rad]."""
NARROWEST: Final = np.deg2rad(3.0)
"""No cone is narrower; [rad]."""
SPARE: Final = np.deg2rad(1.0)
"""What a cone is wider than the witness needs; [rad]."""


def looking(rng: Rng, draft: Draft) -> Draft:
    """A draft that asks besides where the last link looks.

    Raises:
        DraftRejected: If the witness looks about too much.
    """
    witness = draft.witness
    kind = ("target", "direction", "directions")[int(rng.integers(3))]
    wished = _wished(rng, witness, kind)
    path = DesiredPath(witness.points[0], witness.points, witness.closed)
    on = witness.motion.on_path
    tips, axes = witness.centres[on, -1], _axes(witness)[on]
    asked = replace(path, pointing=wished)
    off = float(angles_between(axes, asked.aims(tips, witness.motion.path_m[on])).max())
    if not off <= WIDEST:
        raise DraftRejected
    cone = max(off + SPARE, NARROWEST)
    note = f"{draft.note}-{kind}" if draft.note else kind
    seen = replace(witness, pointing=replace(wished, cone=float(cone)))
    return replace(draft, witness=seen, note=note)


def _axes(witness: Witness) -> FloatArray:
    """Direction of the last link in every row, shape (n, 3)."""
    links = witness.centres[:, -1] - witness.centres[:, -2]
    return np.asarray(links / np.linalg.norm(links, axis=1, keepdims=True))


def _wished(rng: Rng, witness: Witness, kind: str) -> Pointing:
    arm: Manipulator = witness.arm
    on = witness.motion.on_path
    tips, axes = witness.centres[on, -1], _axes(witness)[on]
    mean = axes.mean(axis=0)
    if kind == "target":
        ahead = rng.uniform(0.1, 0.6) * arm.total_length
        target = tips.mean(axis=0) + ahead * mean / np.linalg.norm(mean)
        return Pointing(1.0, target=target)
    if kind == "direction":
        return Pointing(1.0, directions=mean[None])
    gaps = np.linalg.norm(tips[:, None] - witness.points[None], axis=2)
    each = axes[gaps.argmin(axis=0)]
    if witness.closed:
        each = np.concatenate([each, each[:1]])
    return Pointing(1.0, directions=each)
