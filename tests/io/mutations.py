"""Random damage to problem files, trajectories and meshes."""

import math
from copy import deepcopy
from typing import Any

import numpy as np
import yaml

GARBAGE: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2, 7.5, 1e-300, 5e-324, 1e300, -1e12, 10**400,
    math.nan, math.inf, -math.inf, "", "x", "mm", "0", "1e3", "../..", "a\nb", "\u00e9",
    "/etc/passwd", ".", "part.stl", [], {}, [[]], [None], [0, 0, 0], [1, 2], [1, "a"],
    [0.0] * 100, 10**30, {"x0": 1}, {"joints": []},
    "cylinder", "mesh", "prism", "half_space",
)  # fmt: skip
"""Values that are wrong almost everywhere, and right here and there."""

Location = tuple[str | int, ...]


def locations(data: Any, at: Location = ()) -> list[Location]:
    """Every place in nested data, the root excluded."""
    steps: list[Any] = []
    if isinstance(data, dict):
        steps = list(data)
    elif isinstance(data, list):
        steps = list(range(len(data)))
    inner = [locations(data[step], (*at, step)) for step in steps]
    return [(*at, step) for step in steps] + [place for part in inner for place in part]


def changed_data(text: str, rng: np.random.Generator) -> str:
    """One to three values deleted, replaced, doubled, renamed, scaled or swapped."""
    data = yaml.load(text, Loader=yaml.CSafeLoader)
    for _ in range(int(rng.integers(1, 4))):
        places = locations(data)
        if not places:
            break
        place = places[int(rng.integers(len(places)))]
        holder = data
        for step in place[:-1]:
            holder = holder[step]
        _change(holder, place[-1], rng)
    return str(
        yaml.dump(data, Dumper=yaml.CSafeDumper, sort_keys=False, allow_unicode=True)
    )


def _change(holder: Any, step: Any, rng: np.random.Generator) -> None:
    value = holder[step]
    match int(rng.integers(6)):
        case 0:
            del holder[step]
        case 1 | 2:
            # A copy: what is changed next may be inside, and others get it too.
            holder[step] = deepcopy(GARBAGE[int(rng.integers(len(GARBAGE)))])
        case 3 if isinstance(holder, list):
            holder.insert(int(rng.integers(len(holder) + 1)), value)
        case 3:
            holder[f"{step}_"] = value
        case 4 if isinstance(value, int | float):
            # Whole numbers may be larger than any float.
            value = value if abs(value) < 10**300 else 1.0
            holder[step] = value * 10.0 ** int(rng.integers(-9, 10))
        case _:
            others = list(holder) if isinstance(holder, dict) else range(len(holder))
            other = list(others)[int(rng.integers(len(holder)))]
            holder[step], holder[other] = holder[other], value


def changed_bytes(content: bytes, rng: np.random.Generator) -> bytes:
    """Cut, flipped, overwritten, or with a stretch doubled, dropped or inserted."""
    data = bytearray(content)
    for _ in range(int(rng.integers(1, 4))):
        if not data:
            break
        first, last = sorted(int(i) for i in rng.integers(0, len(data) + 1, 2))
        match int(rng.integers(7)):
            case 0:
                del data[first:]
            case 1:
                data[first - 1] ^= 1 << int(rng.integers(8))
            case 2:
                data[first - 1] = int(rng.integers(256))
            case 3:
                data[first:first] = data[first : min(last, first + 200)]
            case 4:
                del data[first : min(last, first + 20)]
            case 5:
                data[first:first] = rng.bytes(int(rng.integers(1, 9)))
            case _:
                words = (
                    b"nan",
                    b"-",
                    b",",
                    b"\n",
                    b"\r\n",
                    b"[",
                    b"}",
                    b"&a ",
                    b"*a",
                    b"!!python/object:os.system ",
                    b"\0",
                    b"#",
                    b"1e999",
                    b": ",
                    b"\xff",
                    b"---\n",
                    b"  ",
                    b"\t",
                    b"|",
                    b">",
                    b"%",
                    b"? ",
                )
                data[first:first] = words[int(rng.integers(len(words)))]
    return bytes(data)
