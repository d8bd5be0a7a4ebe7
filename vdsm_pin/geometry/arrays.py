"""Array types and the few checked operations everybody needs."""

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields
from math import prod
from mmap import MAP_ANONYMOUS, MAP_PRIVATE, mmap
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from vdsm_pin.errors import InvalidInput
from vdsm_pin.tolerances import TOLERANCES

FloatArray: TypeAlias = npt.NDArray[np.float64]
IntArray: TypeAlias = npt.NDArray[np.int64]
BoolArray: TypeAlias = npt.NDArray[np.bool_]
ByteArray: TypeAlias = npt.NDArray[np.uint8]


PAGES: Final = 1 << 18
"""From so many bytes on zeros are taken page by page."""

MANY_PAGES: Final = 1 << 25
"""From so many bytes on memory that was given back is not given out again."""


def paged_zeros(*shape: int) -> FloatArray:
    """Zeros of which only the pages that something is written to cost time and memory.

    numpy clears what memory it is given a second time, however little is written.

    Raises:
        MemoryError: If there are no such addresses.
    """
    size = prod(shape) * np.dtype(np.float64).itemsize
    if size < PAGES:
        return np.zeros(shape)
    try:
        pages = mmap(-1, size, MAP_PRIVATE | MAP_ANONYMOUS)
        return np.frombuffer(pages, np.float64).reshape(shape)
    except (OSError, OverflowError) as error:
        raise MemoryError(*error.args) from None


def uncleared(*shape: int) -> FloatArray:
    """Room for numbers, which hold anything; much of it costs where it is written to.

    What was given back is given out again: no time goes into new pages.

    Raises:
        MemoryError: If there are no such addresses.
    """
    size = prod(shape) * np.dtype(np.float64).itemsize
    if size < MANY_PAGES:
        return np.empty(shape)  # noqa: TID251 (whoever asks writes before they read)
    return paged_zeros(*shape)


def frozen(value: Any, dtype: type[Any] = np.float64) -> npt.NDArray[Any]:
    """A read-only C-ordered copy of an array-like value; itself where it is one.

    Raises:
        InvalidInput: If that would change it: masked values, complex numbers, text,
            times, nothing, or fractions where whole numbers are meant.
    """
    if type(value) is np.ndarray and value.dtype == dtype:
        flags = value.flags
        if flags.owndata and flags.c_contiguous and not flags.writeable:
            return value
    if type(value) is not np.ndarray or value.dtype != dtype:
        value, kind = _plain(value), np.dtype(dtype).kind
        if value.dtype.kind in _KINDS or not _fits(value, kind):
            lost = _KINDS.get(value.dtype.kind, "other numbers")
            message = f"has {lost}, expected {_EXPECTED[kind]}"
            raise InvalidInput(message)
    array = np.array(value, dtype=dtype, order="C")
    array.setflags(write=False)
    return array


_EXPECTED: Final = {"b": "0 or 1", "i": "whole numbers", "u": "bytes", "f": "numbers"}
_KINDS: Final = {"c": "complex numbers", "U": "text", "S": "text", "M": "times",
                 "m": "times", "V": "records"}  # fmt: skip


def _plain(value: Any) -> npt.NDArray[Any]:
    """An array-like value as an array, of numbers where it is of objects."""
    if _masked(value):
        message = "has masked values, expected all of them"
        raise InvalidInput(message)
    try:
        found = np.asarray(value)
        if found.dtype.kind == "O":
            if any(isinstance(one, str | bytes | None) for one in found.flat):
                message = "has text or nothing among its values, expected numbers"
                raise InvalidInput(message)
            found = found.astype(np.float64)
    except (TypeError, ValueError) as error:
        message = f"is no array of numbers: {error}"
        raise InvalidInput(message) from None
    return found


def _fits(found: npt.NDArray[Any], kind: str) -> bool:
    """Whether numbers may be kept as this kind, none of them changed but rounded."""
    if kind == "b":
        return bool(((found == 0) | (found == 1)).all())
    if kind == "f" or found.dtype.kind != "f":
        return True
    return bool((np.isfinite(found) & (np.floor(found) == found)).all())


def _masked(value: Any) -> bool:
    """Whether any entry is masked; nothing is where no array with a mask was made."""
    if type(value) is np.ndarray or "numpy.ma" not in sys.modules:
        return False
    if isinstance(value, list | tuple):
        return any(map(_masked, value))
    return isinstance(value, np.ma.MaskedArray) and bool(np.ma.is_masked(value))


def number(value: Any) -> float:
    """A real number.

    Raises:
        InvalidInput: If it is anything else.
    """
    found = frozen(value)
    if found.ndim:
        message = f"has shape {found.shape}, expected one number"
        raise InvalidInput(message)
    return float(found)


@contextmanager
def called(name: str) -> Iterator[None]:
    """Begin what is said of a refused value with its name."""
    try:
        yield
    except InvalidInput as error:
        message = f"{name} {error}"
        raise InvalidInput(message) from None


def freeze(record: Any, *names: str, dtype: type[Any] = np.float64) -> None:
    """Make fields of a frozen record read-only arrays; those that are None stay so.

    Raises:
        InvalidInput: As `frozen`, with the field's name.
    """
    for name in names:
        if (value := getattr(record, name)) is not None:
            with called(f"{type(record).__name__}: {name}"):
                object.__setattr__(record, name, frozen(value, dtype))


def check_numbers(record: Any, *names: str) -> None:
    """Make fields of a frozen record floats.

    Raises:
        InvalidInput: As `number`, with the field's name.
    """
    for name in names:
        value = getattr(record, name)
        if type(value) is not float:
            with called(f"{type(record).__name__}: {name}"):
                object.__setattr__(record, name, number(value))


class ByValue:
    """Dataclasses that are equal where all their fields are, arrays by their values.

    Their decorator says `eq=False`: what it makes itself cannot compare arrays.
    """

    def __eq__(self, other: object) -> bool:
        """Whether both are of one class and have the same values."""
        return type(other) is type(self) and all(
            _same(getattr(self, name), getattr(other, name)) for name in _fields(self)
        )

    def __hash__(self) -> int:
        """Of the fields that are one plain value."""
        values = (getattr(self, name) for name in _fields(self))
        plain = tuple(one for one in values if isinstance(one, str | int | float))
        return hash((type(self).__name__, *plain))


def _fields(record: Any) -> list[str]:
    return [one.name for one in fields(record) if one.compare]


def _same(one: Any, other: Any) -> bool:
    arrays = isinstance(one, np.ndarray), isinstance(other, np.ndarray)
    if one is other or not any(arrays):
        return one is other or bool(one == other)
    return all(arrays) and np.array_equal(one, other)


def same_arrays(one: object, other: object, names: Sequence[str]) -> bool:
    """Whether arrays of two values, by their names, are the same; None is one too."""
    pairs = ((getattr(one, name), getattr(other, name)) for name in names)
    return all(a is b or np.array_equal(a, b) for a, b in pairs)


def is_rotation(turn: FloatArray) -> bool:
    """Whether a matrix is a rotation, shape (3, 3); whatever is not finite is none."""
    if turn.shape != (3, 3):
        return False
    off = np.abs(turn @ turn.T - np.eye(3)).max()
    return bool(off <= TOLERANCES.rotation and np.linalg.det(turn) > 0.0)


def is_rigid(placement: FloatArray) -> bool:
    """Whether a matrix is a finite rigid motion, shape (4, 4)."""
    if placement.shape != (4, 4) or not np.isfinite(placement).all():
        return False
    last = np.array_equal(placement[3], [0.0, 0.0, 0.0, 1.0])
    return last and is_rotation(placement[:3, :3])


def is_unit(vector: FloatArray) -> bool:
    """Whether a vector has length 1, shape (3,)."""
    length = np.linalg.norm(vector)
    return vector.shape == (3,) and bool(abs(length - 1.0) <= TOLERANCES.rotation)


def read_only(values: FloatArray) -> FloatArray:
    """The same values for reading, C-ordered: one kind of array for compiled code."""
    view = np.ascontiguousarray(values, dtype=np.float64).view()
    view.setflags(write=False)
    return view


def distinct(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Every value once, sorted.

    As `np.unique`, which asks for masked arrays first unless it is asked for more: the
    module for them takes longer to import than it takes to plan a simple motion.
    """
    return np.unique(values, return_index=True)[0]


def distinct_rows(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Every row of (n, k) values once, sorted; several times faster than numpy's."""
    rows = values[np.lexsort(values.T[::-1])]
    first = np.ones(len(rows), np.bool_)
    first[1:] = (rows[1:] != rows[:-1]).any(axis=1)
    return rows[first]


def first_equal(points: FloatArray) -> tuple[IntArray, IntArray]:
    """Which points (n, 3) differ, by their first ones, and which of these each is."""
    index = first = np.zeros(len(points), dtype=np.int64)
    for column in points.T:  # several times faster than numpy's unique rows
        _, rank = np.unique(column, return_inverse=True)
        key = index * (int(rank.max(initial=0)) + 1) + rank
        _, first, index = np.unique(key, return_index=True, return_inverse=True)
    return first, index


def running_sums(values: FloatArray) -> FloatArray:
    """Sums of the first value, the first two and so on, shape (n,).

    What each addition loses is summed too and given back (Knuth's two-sum), so that an
    entry is off by one rounding of itself, however many values it has.
    """
    sums = np.cumsum(values)
    before = np.concatenate([np.zeros(1), sums[:-1]])
    added = sums - before
    lost = (before - (sums - added)) + (values - added)
    return np.asarray(sums + np.cumsum(lost))


def rotation_from_rpy(rpy: FloatArray) -> FloatArray:
    """Rotation matrix Rz(yaw) @ Ry(pitch) @ Rx(roll), the URDF order.

    Args:
        rpy: Roll, pitch, yaw, shape (3,); [rad].

    Returns:
        Rotation, shape (3, 3); [-].
    """
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rpy_from_rotation(rotation: FloatArray) -> FloatArray:
    """Roll, pitch and yaw of a rotation, shape (3,), as above; [rad].

    Where pitch is 90 deg roll and yaw turn about the same axis: what one of them is
    short of the other one has.

    Args:
        rotation: Shape (3, 3); [-].
    """
    (xx, xy, xz), (yx, yy, yz), (zx, _, _) = rotation
    yaw = np.arctan2(yx, xx)
    c, s = np.cos(yaw), np.sin(yaw)
    roll = np.arctan2(s * xz - c * yz, c * yy - s * xy)
    return np.array([roll, np.arctan2(-zx, c * xx + s * yx), yaw])


def turn_z_to(axis: FloatArray) -> FloatArray:
    """A rotation whose third column is the axis, shape (3, 3); [-]."""
    start = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = _cross(start, axis)
    x /= np.linalg.norm(x)
    return np.stack([x, _cross(axis, x), axis], axis=1)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """As np.cross of two vectors to the last bit, many times faster."""
    (x, y, z), (u, v, w) = a.tolist(), b.tolist()
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


def rotation_from_quaternion(quaternion: FloatArray) -> FloatArray:
    """Rotation matrix of a quaternion (x, y, z, w) of length 1, shape (3, 3); [-]."""
    x, y, z, w = quaternion
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + 2.0 * (w * cross + cross @ cross))


def quaternions(rotations: FloatArray) -> FloatArray:
    """Quaternions (x, y, z, w) of rotation matrices, of either sign; [-].

    Args:
        rotations: Shape (..., 3, 3); [-].

    Returns:
        Shape (..., 4).
    """
    R, Rt = rotations, np.swapaxes(rotations, -1, -2)
    products = np.zeros((*R.shape[:-2], 4, 4))  # 4 q q^T, of which any row will do
    products[..., :3, :3] = R + Rt
    turn = (R - Rt)[..., (2, 0, 1), (1, 2, 0)]
    products[..., :3, 3] = products[..., 3, :3] = turn
    trace = np.trace(R, axis1=-2, axis2=-1)
    each = np.arange(3)
    products[..., each, each] += (1.0 - trace)[..., None]
    products[..., 3, 3] = 1.0 + trace
    largest = np.argmax(np.diagonal(products, axis1=-2, axis2=-1), axis=-1)
    rows = np.take_along_axis(products, largest[..., None, None], axis=-2)[..., 0, :]
    return np.asarray(rows / np.linalg.norm(rows, axis=-1, keepdims=True))
