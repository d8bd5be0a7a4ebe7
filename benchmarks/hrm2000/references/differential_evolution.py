"""Differential evolution by scipy, waypoint by waypoint: an "intelligent algorithm".

Penalties for the tip's place, limits and clearance; the best of each waypoint is
brought onto the path by the pseudo-inverse, as evolution does not get there exactly.
"""

import numpy as np
from scipy.optimize import differential_evolution

from benchmarks.hrm2000.references.arm import Arm
from benchmarks.hrm2000.references.jacobian import pseudo_inverse
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.tolerances import TOLERANCES

GENERATIONS = 120
MEMBERS = 6  # times 17 unknowns
STRETCH = 0.05  # m, of the base
MISS, TOUCH, CHANGE = 10.0, 10.0, 0.01
"""Weights of a metre off the path, a metre of missing clearance, a radian of change."""


def reach(arm: Arm, q: FloatArray, tip: FloatArray) -> FloatArray | None:
    """Joint values near q whose tip is there and that are valid, or None."""
    near = np.full(arm.nq, 0.8 * TOLERANCES.row_change)
    near[0] = STRETCH
    low, high = np.maximum(arm.low, q - near), np.minimum(arm.high, q + near)

    def cost(members: FloatArray) -> FloatArray:
        rows = np.ascontiguousarray(np.atleast_2d(members.T))
        centres = arm.centres(rows)
        off = np.linalg.norm(centres[:, -1] - tip, axis=1)
        room = arm.clearance(centres).min(axis=1)
        cosine = np.cos(rows[:, 1::2]) * np.cos(rows[:, 2::2])
        over = np.maximum(0.0, np.cos(arm.cone) - cosine).sum(axis=1)
        change = np.abs(rows - q)[:, 1:].sum(axis=1)
        missing = np.maximum(0.0, arm.required - room)
        return np.asarray(MISS * off + TOUCH * missing + over + CHANGE * change)

    found = differential_evolution(
        cost, list(zip(low, high, strict=True)), maxiter=GENERATIONS, popsize=MEMBERS,
        rng=0, polish=False, x0=q, vectorized=True, updating="deferred", tol=0.0,
    )  # fmt: skip
    best = pseudo_inverse(arm, np.asarray(found.x), tip)
    return best if best is not None and arm.valid(best) else None
