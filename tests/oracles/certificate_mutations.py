"""Seeded damage to a certificate, of each kind a careless or dishonest writer may do.

`raw` changes the file's bytes. `forged` also makes the last line fit again, so that
only the mathematics can object. `other_files` changes what the certificate is about.
"""

import copy
import json
from typing import Any

import numpy as np
from oracles.certificate_oracle import sealed

Rng = np.random.Generator


def numbers_in(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Places of all numbers of a line."""
    if isinstance(value, dict):
        return [p for k, v in value.items() for p in numbers_in(v, (*path, k))]
    if isinstance(value, list):
        return [p for k, v in enumerate(value) for p in numbers_in(v, (*path, k))]
    return [path] if type(value) in (int, float) else []


def place(value: Any, path: tuple[Any, ...]) -> tuple[Any, Any]:
    """The container and the key of a place."""
    for key in path[:-1]:
        value = value[key]
    return value, path[-1]


def nudged(value: float, rng: Rng) -> Any:
    """Another number: by an ulp, a little, a lot, with its sign changed, or absurd."""
    if type(value) is int:
        return int(value + rng.choice([-2, -1, 1, 2, 1000]))
    size = 10.0 ** rng.uniform(-15, 3) * rng.choice([-1.0, 1.0])
    choices = [
        value + size,
        -value - 1e-3,
        value * 2.0 + 1e-6,
        1e300,
        0.5 * value - 1e-8,
    ]
    choices.append(float(np.nextafter(value, np.inf)))
    return float(choices[rng.integers(len(choices))])


def change_number(lines: list[Any], rng: Rng) -> str:
    line = lines[rng.integers(len(lines))]
    places = numbers_in(line)
    holder, key = place(line, places[rng.integers(len(places))])
    old = holder[key]
    holder[key] = nudged(old, rng)
    return f"number {key}: {old!r} -> {holder[key]!r}"


def changes(old: Any, new: Any) -> list[tuple[Any, ...]] | None:
    """Places of the numbers that differ; None where the structure does."""
    places = numbers_in(old)
    if places != numbers_in(new):
        return None
    found = [place(old, p)[0][p[-1]] != place(new, p)[0][p[-1]] for p in places]
    return [p for p, differs in zip(places, found, strict=True) if differs]


def a_list(lines: list[Any], rng: Rng) -> tuple[list[Any], str]:
    """Some list worth damaging: pairs, pieces, proofs, slices, planes, .."""
    found: list[tuple[list[Any], str]] = [(lines[0]["pairs"], "pairs")]
    found += [(loops, "pieces") for loops in lines[0]["pieces"].values()]
    for line in lines[1:]:
        found.append((line["proofs"], "proofs"))
        for proof in line["proofs"]:
            found.append((proof, "slices"))
            found += [(entry[2], "planes") for entry in proof]
            found += [(plane, "plane") for entry in proof for plane in entry[2]]
    return found[rng.integers(len(found))]


def drop(lines: list[Any], rng: Rng) -> str:
    items, name = a_list(lines, rng)
    del items[rng.integers(len(items))]
    return f"drop one of {name}"


def repeat(lines: list[Any], rng: Rng) -> str:
    items, name = a_list(lines, rng)
    k = int(rng.integers(len(items)))
    items.insert(k, copy.deepcopy(items[k]))
    return f"repeat one of {name}"


def swap(lines: list[Any], rng: Rng) -> str:
    items, name = a_list(lines, rng)
    i, j = (int(x) for x in rng.integers(len(items), size=2))
    items[i], items[j] = items[j], items[i]
    return f"swap {i} and {j} of {name}"


def drop_line(lines: list[Any], rng: Rng) -> str:
    k = int(rng.integers(1, len(lines)))
    del lines[k]
    return f"drop line {k}"


def repeat_line(lines: list[Any], rng: Rng) -> str:
    k = int(rng.integers(len(lines)))
    lines.insert(k, copy.deepcopy(lines[k]))
    return f"repeat line {k}"


def drop_obstacle(lines: list[Any], rng: Rng) -> str:
    """One obstacle vanishes from the header and from every interval, consistently."""
    names = [name for _, name in lines[0]["pairs"]]
    name = names[rng.integers(len(names))]
    kept = [k for k, other in enumerate(names) if other != name]
    lines[0]["pairs"] = [lines[0]["pairs"][k] for k in kept]
    for line in lines[1:]:
        line["proofs"] = [line["proofs"][k] for k in kept]
    return f"drop all pairs with {name}"


def drop_key(lines: list[Any], rng: Rng) -> str:
    line = lines[rng.integers(len(lines))]
    key = list(line)[rng.integers(len(line))]
    del line[key]
    return f"drop key {key}"


def raise_lower(lines: list[Any], rng: Rng) -> str:
    """A clearance claimed larger than proved."""
    line = lines[rng.integers(1, len(lines))]
    proof = line["proofs"][rng.integers(len(line["proofs"]))]
    plane = proof[rng.integers(len(proof))][2][0]
    plane[5] += 10.0 ** rng.uniform(-10.7, 0)
    return "raise a lower bound"


def turn_normal(lines: list[Any], rng: Rng) -> str:
    line = lines[rng.integers(1, len(lines))]
    proof = line["proofs"][rng.integers(len(line["proofs"]))]
    plane = proof[rng.integers(len(proof))][2][0]
    plane[2:5] = [float(x) for x in rng.normal(size=3)]
    return "another normal"


MUTATIONS = (
    *[change_number] * 6,
    drop,
    repeat,
    swap,
    drop_line,
    repeat_line,
    drop_obstacle,
    drop_key,
    raise_lower,
    turn_normal,
)


def forged(lines: list[Any], rng: Rng) -> tuple[list[Any], bytes, str]:
    """A damaged certificate whose last line fits: lines, file, what was done."""
    damaged = copy.deepcopy(lines)
    what = MUTATIONS[rng.integers(len(MUTATIONS))](damaged, rng)
    return damaged, sealed(damaged), what


def raw(content: bytes, rng: Rng) -> tuple[bytes, str]:
    """The file with bytes changed and the last line as it was."""
    lines = content.splitlines(keepends=True)
    k, n = int(rng.integers(len(lines))), len(lines)
    match int(rng.integers(7)):
        case 0:  # one number of one line
            k %= n - 1  # the last one has none
            line = json.loads(lines[k])
            places = numbers_in(line)
            holder, key = place(line, places[rng.integers(len(places))])
            holder[key] = nudged(holder[key], rng)
            lines[k] = json.dumps(line).encode() + b"\n"
            return b"".join(lines), f"a number of line {k}"
        case 1:
            return b"".join(lines[:k] + lines[k + 1 :]), f"line {k} dropped"
        case 2:
            return b"".join(lines[: k + 1] + lines[k:]), f"line {k} doubled"
        case 3:
            other = (k + int(rng.integers(1, n))) % n
            lines[k], lines[other] = lines[other], lines[k]
            return b"".join(lines), f"lines {k} and {other} swapped"
        case 4:
            cut = int(rng.integers(len(content)))
            return content[:cut], f"cut at byte {cut}"
        case 5:  # one digit
            digits = [i for i, c in enumerate(content) if chr(c).isdigit()]
            at = digits[rng.integers(len(digits))]
            other = (content[at] - 48 + int(rng.integers(1, 10))) % 10 + 48
            return content[:at] + bytes([other]) + content[at + 1 :], f"digit {at}"
    at = int(rng.integers(len(content)))
    flipped = content[at] ^ (1 << int(rng.integers(8)))
    return content[:at] + bytes([flipped]) + content[at + 1 :], f"byte {at}"


def other_files(data: Any, rows: Any, rng: Rng) -> tuple[Any, Any, str]:
    """Problem data and joint values: less clearance, more of it asked, another row."""
    data, rows = copy.deepcopy(data), rows.copy()
    at = int(rng.integers(len(data["obstacles"])))
    obstacle, much = data["obstacles"][at], 1.0 + 10.0 ** rng.uniform(-6, 0)
    match int(rng.integers(5)):
        case 0:
            data["manipulator"]["link_radius"] *= much
            return data, rows, "wider links"
        case 1:
            data["required_clearance"] *= much
            return data, rows, "more clearance required"
        case 2:
            rows[rng.integers(len(rows)), 0] += rng.choice([-1, 1]) * (much - 1.0)
            return data, rows, "a row with another base position"
        case 3:
            rows[rng.integers(len(rows)), 1] += rng.choice([-0.1, 0.1]) * (much - 1.0)
            return data, rows, "a row with another first angle"
    if "radius" in obstacle:
        obstacle["radius"] *= much
        return data, rows, "a wider obstacle"
    obstacle["name"] += "2"
    return data, rows, "an obstacle of another name"
