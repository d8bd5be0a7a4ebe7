"""Files of measured points, and of the occupied cells of a grid."""

import io
import re
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.meshes.ply import read_ply_points
from vdsm_pin.io.meshes.raw import MeshStream, doubles
from vdsm_pin.io.pcd import read_pcd
from vdsm_pin.io.source import Digest, check_ending, opened

MAX_BYTES: Final = 1 << 30
MAX_POINTS: Final = 5_000_000

_NPY: Final = b"\x93NUMPY"
_REMARK: Final = ("#", "//")
_DECIMAL_COMMA: Final = re.compile(rb"\d[ \t;]+[-+.\d]")
"""Numbers apart by other signs: commas in the same file are then decimal ones."""

_BETWEEN: Final = re.compile(r"[\s,;]+")
_QUOTED: Final = re.compile(r'^"([^"]+)"$')


@dataclass(frozen=True)
class RawCloud:
    """Points as a file has them.

    Args:
        points: Shape (n, 3), n >= 1, in the unit of the file.
        notes: What was left out.
        grid: Whether the file is an array of cells, and the points are the middles of
            those occupied, in cells from its corner.
    """

    points: FloatArray
    notes: tuple[str, ...] = ()
    grid: bool = False


def read_cloud(path: Path, digest: Digest) -> RawCloud:
    """The points of a PLY, PCD, XYZ, TXT, CSV or NPY file.

    Args:
        path: The file; its ending tells the format.
        digest: Gets every byte of the file.

    Returns:
        Its points; those without a measurement, which are NaN, are left out and a
        note says how many.

    Raises:
        InvalidFile: If the file cannot be read, is of another kind, is damaged, has no
            point or too many, or one that is infinite.
    """
    kind = check_ending(path, _READERS)
    with opened(path, limit=MAX_BYTES, digest=digest) as (size, content):
        stream = MeshStream(path, size, content)
        points = _READERS[kind](stream)
    grid = points.ndim == 3
    if grid:
        points = doubles(np.argwhere(points)) + 0.5
    lost = np.isnan(points).any(axis=1)
    count = int(lost.sum())
    points = points[~lost] if count else points
    if not len(points):
        raise InvalidFile(file=path, fault="has no point")
    if len(points) > MAX_POINTS:
        fault = f"has {len(points)} points, the most is {MAX_POINTS}"
        raise InvalidFile(file=path, fault=fault)
    stream.check_numbers(points, "point")
    note = f"points without a measurement (NaN) left out: {count}"
    return RawCloud(points, (note,) if count else (), grid)


def _npy(stream: MeshStream) -> FloatArray:
    """Points, shape (n, 3), or the cells of a grid, 0 or 1 each, shape (a, b, c)."""
    data = io.BytesIO(stream.content.read())
    if not data.getvalue().startswith(_NPY):  # load reads other files too
        raise stream.invalid(fault="is no array of numbers: it is no NPY file")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # headers that Python 2 wrote
            array = np.load(data, allow_pickle=False)
    except Exception as error:  # noqa: BLE001 (of a damaged header, whatever it meets)
        said = " ".join(str(error).split())[:120] or type(error).__name__
        raise stream.invalid(fault=f"is no array of numbers: {said}") from None
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "fiub":
        raise stream.invalid(fault="is no array of numbers")
    stream.check_end(data.read(), f"an array of shape {array.shape}")
    if array.ndim == 3:
        if not ((array == 0) | (array == 1)).all():
            fault = "has values besides 0 and 1, expected one of them for each cell"
            raise stream.invalid(fault)
        return np.asarray(array)
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind == "b":
        fault = f"has an array of {array.dtype} of shape {array.shape}, "
        fault += "expected points (n, 3), or cells in three dimensions"
        raise stream.invalid(fault)
    return doubles(array)


def _text(stream: MeshStream) -> FloatArray:
    """Lines that begin with x y z; others stand behind # or // or are blank."""
    data = stream.content.read()
    if b"\r" in data:  # which ends no remark for numpy
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    odd = b"," in data and (
        _DECIMAL_COMMA.search(data) is not None
        or len({line.count(b",") for line in io.BytesIO(data)} - {0}) > 1
    )
    if not odd:
        plain = data.replace(b",", b" ").replace(b";", b" ")
        with suppress(ValueError, UserWarning), warnings.catch_warnings():
            warnings.simplefilter("error")  # where there is no line of numbers
            columns: dict[str, Any] = {
                "usecols": (0, 1, 2),
                "comments": list(_REMARK),
                "ndmin": 2,
            }
            return np.asarray(np.loadtxt(io.BytesIO(plain), **columns))
    return _line_by_line(stream, data)


def _line_by_line(stream: MeshStream, data: bytes) -> FloatArray:
    """The same where a line is odd: the first may be the number of points, or names."""
    rows, commas, announced = [], set[int](), ""
    for number, whole in enumerate(data.decode("latin-1").split("\n"), 1):
        line = whole.partition("#")[0].partition("//")[0].strip()
        words = [_QUOTED.sub(r"\1", word) for word in _BETWEEN.split(line)]
        mixed = "," in line and _DECIMAL_COMMA.search(line.encode())
        if mixed:
            fault = "has commas inside numbers, expected decimal points"
            raise stream.invalid(fault, line=number)
        title = number == 1 and (words[0].isdecimal() or not _is_number(words[0]))
        title = title and (len(words) == 1 or words[0][:1].isalpha())
        commas |= {line.count(",")} - {0}
        if len(commas) > 1:
            fault = "has another number of commas than lines before it"
            raise stream.invalid(fault, line=number)
        if title:
            announced = words[0] if words[0].isdecimal() else ""
            _check_title(stream, [word.lower() for word in words])
        elif words != [""]:
            rows.append(stream.numbers(words[:3], 3, number))
    if announced and announced.lstrip("0") != str(len(rows)).lstrip("0"):
        fault = f"announces {announced} points, {len(rows)} follow"
        raise stream.invalid(fault, line=1)
    return np.array(rows).reshape(-1, 3)


def _is_number(word: str) -> bool:
    try:
        return float(word) is not None
    except ValueError:
        return False


def _check_title(stream: MeshStream, names: list[str]) -> None:
    """Refuse columns of which x, y and z are not the first."""
    for place, name in enumerate("xyz"):
        if name in names and names.index(name) != place:
            fault = f"has the columns {' '.join(names)}, expected x, y and z first"
            raise stream.invalid(fault, line=1)


_READERS: Final[dict[str, Callable[[MeshStream], FloatArray]]] = {
    ".ply": read_ply_points,
    ".pcd": read_pcd,
    ".xyz": _text,
    ".txt": _text,
    ".csv": _text,
    ".npy": _npy,
}
