"""Certificates with one number changed by its last digit, sealed again, field by field.

What is accepted then claims no more than before: it is proved by other evidence, or it
claims less. Oracle: what a field says (docs/certificate.md), and that verifier and
checker, two programs, prove the same of a plane, so that no claim has room.
"""

import copy
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from oracles.arm_certificates import ERRORS, HELPER, OBSTACLES, MadeArm
from oracles.certificate_cases import CUBE, CUBE_FACES, check_sealed
from oracles.certificate_mutations import numbers_in, place
from oracles.robot_certificates import CELL, Made

from vdsm_pin.certificate_checker import claims
from vdsm_pin.errors import InvalidFile

Rng = np.random.Generator
ROOM = 2
"""Counts of 1e-10 m that a claim may have to spare: one is left for rounding."""

FIXED = {
    *("vdsm_certificate", "k", "slice", "first", "last", "pieces", "order"),
}
"""Fields of which no number can be another one."""

EVIDENCE = {"normal", "joined", "meshes", "origin_m", "edges_m", "radius_m"}
"""Fields that claim nothing: what is accepted is proved by other planes, other seams,
hulls or primitives of the same mesh."""

CLAIMED = {"lower", "errors"}
KINDS = ("one more", "one less", "0.1 % more", "0.1 % less", "other sign")


def field(line: int, path: tuple[Any, ...]) -> str:
    """The field that a number of a line stands in."""
    if line and path[0] == "proofs":
        if len(path) == 4:
            return "slice"
        return ("first", "last", *["normal"] * 3, "lower")[path[5]]
    if path[0] == "links":
        return str([key for key in path if isinstance(key, str)][-1])
    return str(path[0])


def others(value: Any, kind: str) -> Any:
    """The number changed: a count or a unit in the last place, a thousandth, a sign."""
    if kind == "other sign":
        return -value
    up = kind.endswith("more")
    if not kind.startswith("one"):
        more = value * (1.001 if up else 0.999)
        return round(more) if type(value) is int else more
    if type(value) is int:
        return value + (1 if up else -1)
    return float(np.nextafter(value, np.inf if up else -np.inf))


def seamed(path: Path) -> None:
    """A cube of which one edge is split beside, and a corner is off by little."""
    corners = 60.0 * np.array([[CUBE[k] for k in face] for face in CUBE_FACES], float)
    a, b, c = corners[0]
    middle = (a + b) / 2.0 + [0.0, 0.0, 1e-3]
    split = np.array([[a, middle, c], [middle, b, c]])
    corners[5, 1] += [1e-3, 0.0, 0.0]
    every = np.concatenate([split, corners[1:]]).reshape(-1, 3)
    faces = np.arange(len(every)).reshape(-1, 3)
    trimesh.Trimesh(every, faces, process=False).export(path)


def with_gaps(folder: Path) -> MadeArm:
    seamed(folder / "crate.stl")
    crate = {
        "name": "crate",
        "shape": "mesh",
        "file": "crate.stl",
        "rpy_deg": [5, 0, 9],
    }
    crate |= {"center": [700, 0, -500], "length_unit": "mm"}
    return MadeArm(folder, obstacles=[crate])


def beside_all(folder: Path, smooth: bool) -> MadeArm:
    made = MadeArm(folder, smooth, obstacles=OBSTACLES[1:], errors=ERRORS)
    made.most = 3e-8 if smooth else made.most
    return made


def moving(folder: Path) -> MadeArm:
    return MadeArm(folder, True, obstacles=OBSTACLES[:3], others=[HELPER])


def robot(folder: Path, **asked: Any) -> Made:
    made = Made(folder, "planar", 1)
    made.cell["robot"] = CELL["robot"] | asked
    return made


def erring(folder: Path) -> Made:
    made = robot(folder)
    made.cell["errors"] = {
        "joint_deg": {"bend": 0.4, "turn": 0.2},
        "slide": {"lift": 2},
    }
    made.cell["errors"] |= {"base": 1.5, "base_deg": 0.3, "obstacle": 1}
    return made


MADE: dict[str, Callable[[Path], MadeArm | Made]] = {
    "arm beside all": lambda folder: beside_all(folder, False),
    "arm on smooth pieces": lambda folder: beside_all(folder, True),
    "arm beside what moves": moving,
    "arm beside gaps": with_gaps,
    "robot of hulls": robot,
    "robot of parts": lambda folder: robot(folder, bodies="parts", parts=10),
    "robot of primitives": lambda folder: robot(folder, bodies="primitives"),
    "robot that errs": erring,
}


def forgeries(
    lines: list[Any], rng: Rng, each: int
) -> Iterator[tuple[str, str, Any, list[Any]]]:
    """Field, kind of change, number before and after, and lines with one changed."""
    by_field: dict[str, list[tuple[int, tuple[Any, ...]]]] = {}
    for k, line in enumerate(lines):
        for path in numbers_in(line):
            by_field.setdefault(field(k, path), []).append((k, path))
    assert {*by_field} <= FIXED | EVIDENCE | CLAIMED
    for name, places in by_field.items():
        for at in rng.permutation(len(places))[:each].tolist():
            k, path = places[at]
            for kind in KINDS:
                changed = copy.deepcopy(lines)
                holder, key = place(changed[k], path)
                old, holder[key] = holder[key], others(holder[key], kind)
                if holder[key] != old:
                    yield name, kind, (old, holder[key]), changed


def accepted(
    made: MadeArm | Made, lines: list[Any], rng: Rng, each: int
) -> Counter[tuple[str, str]]:
    """How many changes are accepted, by field and kind; all of them are harmless."""
    found, hashes = Counter[tuple[str, str]](), made.hashes()
    for name, kind, (old, new), changed in forgeries(lines, rng, each):
        try:
            good = check_sealed(changed, made.folder, made.files, hashes).accepted
        except InvalidFile:
            good = False
        found[name, kind] += good
        if good:
            assert name not in FIXED, (name, old, new)
            if name == "lower":
                assert new <= old + ROOM, (old, new)
            if name == "errors":  # no smaller box, and no larger one but by rounding
                assert old <= new <= old * (1.0 + 1e-15) + 1e-300, (old, new)
    return found


@pytest.mark.parametrize("which", ["arm beside all", "robot of primitives"])
def test_a_number_changed_by_one_claims_no_more(which: str, tmp_path: Path) -> None:
    made = MADE[which](tmp_path)
    found = accepted(made, made.certified(), np.random.default_rng(3), 1)
    assert found["lower", "one less"] == 1  # less is claimed
    assert found["lower", "0.1 % more"] == found["normal", "other sign"] == 0


@pytest.mark.slow
@pytest.mark.parametrize("which", MADE)
def test_no_number_changed_claims_more(which: str, tmp_path: Path) -> None:
    made = MADE[which](tmp_path)
    found = accepted(made, made.certified(), np.random.default_rng(4), 60)
    assert found["lower", "one less"] > 0, found
    assert found["lower", "0.1 % more"] == found["normal", "other sign"] == 0


def test_a_checker_that_believes_claims_is_noticed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The tally fails where what planes claim is taken for proved."""
    made = MADE["arm beside all"](tmp_path)
    lines = made.certified()

    def believed(_: Any, planes: list[claims.Plane], __: Any) -> Any:
        return np.full(len(planes), np.inf)

    monkeypatch.setattr(claims, "clearances", believed)
    with pytest.raises(AssertionError):
        accepted(made, lines, np.random.default_rng(3), 1)
