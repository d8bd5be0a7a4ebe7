"""What Python hands in is taken as it is or refused: nothing of it is lost silently.

Every array and every number of the records that people build is replaced by values that
numpy would turn into numbers at a loss: masked, complex, text, times, nothing, ragged.
"""

from collections.abc import Callable
from dataclasses import fields, replace
from fractions import Fraction
from typing import Any, Final

import numpy as np
import pytest

import vdsm_pin as vp
from vdsm_pin.arm.mounted import Feed, Tool
from vdsm_pin.geometry.arrays import frozen
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.pointing import Pointing
from vdsm_pin.problem.scaling import OtherRatios, ScalingCentre
from vdsm_pin.proof.paths import Path

ORIGIN: Final = np.zeros(3)
ALONG: Final = np.array([1.0, 0.0, 0.0])


def masked(value: Any) -> Any:
    """All as it was, the first number masked."""
    first = np.arange(np.size(value)).reshape(np.shape(value)) == 0
    return np.ma.array(value, mask=first)


LOSSY: Final[dict[str, Callable[[Any], Any]]] = {
    "masked": masked,
    "rows, one of them masked": lambda v: [masked(v), v] if v.ndim else None,
    "complex": lambda v: v + 1j,
    "complex without imaginary part": lambda v: v + 0j,
    "complex objects": lambda v: (v + 1j).astype(object),
    "text": lambda v: v.astype(str),
    "nothing": lambda v: np.full(v.shape, None),
    "times": lambda v: v.astype("timedelta64[s]"),
    "ragged": lambda _: [[1.0], [1.0, 2.0]],
    "a mapping": lambda _: {"x": 1.0},
}

RECORDS: Final = {
    "sphere": lambda: vp.Sphere("s", ORIGIN, 1.0),
    "cylinder": lambda: vp.Cylinder("c", ORIGIN, ALONG, 1.0, 2.0),
    "capsule": lambda: vp.Capsule("c", ORIGIN, ALONG, 1.0, 2.0),
    "box": lambda: vp.Box(
        "b", centre=ORIGIN, half_size=ORIGIN + 1.0, rotation=np.eye(3)
    ),
    "half-space": lambda: vp.HalfSpace("h", ORIGIN, ALONG),
    "mesh": lambda: vp.Mesh("m", np.eye(4, 3), np.array([[0, 1, 2], [0, 2, 3]])),
    "arm": lambda: vp.built_in("hrm8"),
    "cables": lambda: vp.built_in("hrm8").cables,
    "tool": lambda: Tool(0.1, 0.02),
    "feed": lambda: Feed(0.1, 0.02),
    "path": lambda: vp.DesiredPath(ALONG, np.eye(3), start_joints=np.zeros(17)),
    "target": lambda: Pointing(0.1, target=ORIGIN),
    "direction": lambda: Pointing(0.1, directions=np.ones((1, 3))),
    "ratios": lambda: OtherRatios(np.ones(7)),
    "centre": lambda: ScalingCentre(np.zeros(2), 3),
    "problem": lambda: vp.read_problem("paper/free"),
    "errors": ErrorBox,
    "trajectory": lambda: vp.Trajectory(
        np.array([True, False]), np.zeros(2), np.zeros(2), np.zeros((2, 8)),
        np.zeros((2, 8)), (), np.arange(2.0), np.zeros((2, 17)), np.zeros((2, 17)),
    ),
    "rows of a robot": lambda: Path(
        np.zeros((3, 2)), np.ones((2, 2, 2)), np.arange(3.0)
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", RECORDS)
def test_no_field_loses_anything(name: str) -> None:
    record: Any = RECORDS[name]()
    tried = 0
    for field in fields(record):
        value = getattr(record, field.name)
        if not isinstance(value, np.ndarray | float) or not np.size(value):
            continue
        for kind, change in LOSSY.items():
            with pytest.raises(vp.InvalidInput, match=field.name):
                replace(record, **{field.name: change(np.asarray(value))})
                pytest.fail(f"{field.name}: {kind} is taken")
            tried += 1
    assert tried >= len(LOSSY)


@pytest.mark.parametrize("kind", LOSSY)
def test_no_argument_loses_anything(kind: str) -> None:
    for name in ("joint_deg", "base_mm", "base_deg", "obstacle_mm", "slide_mm"):
        if (lossy := LOSSY[kind](np.array(1.0))) == {"x": 1.0}:
            continue  # errors by name
        with pytest.raises(vp.InvalidInput, match=name):
            vp.ErrorBox(**{name: lossy})
    for name in ("obstacles_mm", "obstacles_deg"):
        with pytest.raises(vp.InvalidInput, match=name):
            vp.ErrorBox(**{name: {"wall": LOSSY[kind](np.array(1.0))}})
    q, times = np.zeros((2, 3)), np.arange(2.0)
    lossy = LOSSY[kind](q)
    for make in (
        lambda: Path.through(lossy, times, q),
        lambda: Path.through(q, times, lossy),
        lambda: Path.through(q, LOSSY[kind](times), q),
        lambda: Path.through(q, times, q, lossy),
        lambda: vp.Trajectory.of_joints(lossy),
    ):
        with pytest.raises(vp.InvalidInput):
            make()


def test_numbers_of_every_exact_kind_are_taken() -> None:
    given = [1, np.float32(0.5), Fraction(1, 4), True, np.int8(-3), np.array(2.0)]
    assert frozen(given).tolist() == [1.0, 0.5, 0.25, 1.0, -3.0, 2.0]
    assert frozen(np.ma.array([1.0, 2.0], mask=[False, False])).tolist() == [1.0, 2.0]
    assert frozen([0, 1.0, True], np.bool_).tolist() == [False, True, True]
    assert frozen([2.0, -3], np.int64).tolist() == [2, -3]
    box = vp.ErrorBox(joint_deg=np.float32(0.5), base_mm=np.int8(2), base_deg=True)
    assert (box.joint, box.base) == (np.deg2rad(0.5), 0.002)
    assert box.base_turn == np.deg2rad(1.0)


@pytest.mark.parametrize("value", [0.5, 2, -1, np.nan, np.inf])
def test_only_0_and_1_say_whether_a_row_is_on_the_path(value: float) -> None:
    zero, joints = np.zeros(1), np.zeros((1, 8))
    with pytest.raises(vp.InvalidInput, match="on_path"):
        vp.Trajectory(np.array([value]), zero, zero, joints, joints)
    with pytest.raises(vp.InvalidInput, match="whole"):
        frozen([value if value not in (2, -1) else 0.25], np.int64)
