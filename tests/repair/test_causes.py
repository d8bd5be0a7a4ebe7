"""What stops a repair: told from slopes that are known, and of real motions."""

import numpy as np
import pytest

from vdsm_pin.repair.causes import Place, cause, end_limits

PAIRS = "hand and post", "hand and wall"
ENDS = np.array([[-1.0, 1.0], [-np.inf, np.inf]])


def place(
    q: tuple[float, float],
    slope: tuple[float, float],
    other: tuple[float, float] = (0.0, 0.0),
    room: tuple[float, float] = (-0.01, 0.5),
    *,
    held: bool = False,
) -> Place:
    """A row of two joints; a tip that is held lets the first one move alone."""
    limits = end_limits(np.array(q), ENDS, ["joint a", "joint b"])
    kept = (lambda s: s * [1.0, 0.0]) if held else None
    return Place(PAIRS, np.array(room), np.array([slope, other]), limits, kept)


@pytest.mark.parametrize(
    ("at", "told"),
    [
        (place((0, 0), (0.0, 0.0)), "no joint moves them apart there"),
        (place((1, 0), (0.4, 0.0)), "only beyond the limit of joint a would they"),
        (place((-1, 0), (-0.4, 0.01)), "only beyond the limit of joint a would they"),
        (place((-1, 0), (0.4, 0.0)), "small changes gain too little there"),
        (place((1, 0), (0.4, 0.3)), "with joint a at the limit small changes gain"),
        (place((0, 0), (0.0, 0.3), held=True), "the tip is held on its path there"),
        (
            place((1, 0), (0.3, 0.3), held=True),
            "with joint a at the limit the tip is held on its path there",
        ),
        (
            place((0, 0), (0.4, 0.3), (-0.4, 0.0), (-0.01, 0.001)),
            "what moves them apart brings hand and wall together",
        ),
        (
            place((0, 0), (0.4, 0.3), (-0.4, 0.0), (-0.01, 0.02)),
            "small changes gain too little there",
        ),
        (
            place((1, 0), (0.4, 0.3), (-0.4, 0.0), (-0.01, 0.001)),
            "with joint a at the limit small changes gain too little there",
        ),
    ],
)
def test_the_cause_is_what_is_left_of_the_slope(at: Place, told: str) -> None:
    assert cause(at, 0).startswith(told)


def test_rows_that_are_pushed_to_different_sides_are_told() -> None:
    between = place((0, 0), (0.1, 0.3))
    before, after = place((0, 0), (0.0, 0.3)), place((0, 0), (0.1, -0.3))
    assert cause(between, 0, [before, after]).endswith("pushed to different sides")
    assert "different" not in cause(between, 0, [before, before])
    # What is beyond a limit is no side.
    ends = place((1, 0), (0.4, 0.1)), place((1, 0), (-0.4, 0.1))
    assert "different" not in cause(between, 0, ends)
