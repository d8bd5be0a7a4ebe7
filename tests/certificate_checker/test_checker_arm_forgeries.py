"""Certificates of arms beside all that files know: two programs prove the same of them.

What a plane proves, verifier and checker work out by code of their own, so that neither
may be off by a nanometre. As claims are that tight, whatever is changed for the worse
in a file or in what is stated must be refused, by hashes and a seal that fit.
"""

import copy
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from oracles.arm_certificates import ERRORS, HELPER, MATE, OBSTACLES, MadeArm
from oracles.certificate_cases import write_cube
from oracles.certificate_mutations import numbers_in, place

from vdsm_pin.certificate_checker.solids import Solid

TURNED = {
    "obstacles": [
        {"name": "helper: foot", "shift": 1, "turn_deg": 2},
    ]
}
"""Errors of a link of another robot."""

SCENES: dict[str, dict[str, Any]] = {
    "bodies": {"obstacles": OBSTACLES[1:]},
    "moving": {"obstacles": OBSTACLES},
    "errors": {"obstacles": OBSTACLES[1:], "errors": ERRORS},
    "others": {"obstacles": OBSTACLES[:2], "others": [MATE, HELPER], "errors": TURNED},
}


def made_in(folder: Path, scene: str, smooth: bool = False) -> MadeArm:
    made = MadeArm(folder, smooth, **SCENES[scene])
    if smooth and scene == "errors":  # of which the verifier counts a little more
        made.most = 3e-8
    return made


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("scene", SCENES)
def test_two_programs_prove_the_same(scene: str, smooth: bool, tmp_path: Path) -> None:
    assert made_in(tmp_path, scene, smooth).certified()


def two_cubes(path: Path) -> None:
    """Apart from one another, in one STL file."""
    write_cube(path, 10.0)
    mesh = trimesh.load_mesh(path)
    other = mesh.copy().apply_translation([50.0, 5.0, 0.0])
    trimesh.util.concatenate([mesh, other]).export(path)


@pytest.mark.parametrize(
    ("mesh", "more"),
    [
        (two_cubes, {"parts": 5}),
        (two_cubes, {"parts": 3, "solid": False}),
        (lambda path: write_cube(path, 20.0, skip=1), {"parts": 4}),
        (lambda path: write_cube(path, 20.0, skip=5), {"parts": 1}),
    ],
)
def test_meshes_on_links_are_covered_by_the_same_hulls(
    mesh: Callable[[Path], None], more: dict[str, Any], tmp_path: Path
) -> None:
    made = made_in(tmp_path, "errors")
    made.data["manipulator"]["bodies"][1] |= more
    mesh(tmp_path / "valve.stl")
    assert made.certified()


AROUND: dict[str, dict[str, Any]] = {
    "all that moves": {"center": [0, 0, 0], "half": 3000}
    | {"motion": {"times_s": [0, 2], "positions": [[100, 50, 20], [90, 60, 20]]}},
    "all but link 1": {"center": [1000, 0, 0], "half": 600},
    "the camera": {"center": [650, 200, 10], "half": 60},
}


@pytest.mark.parametrize("what", AROUND)
def test_what_is_inside_of_a_mesh_is_refused(what: str, tmp_path: Path) -> None:
    """A certificate of the surface alone is none of the solid."""
    shell = {"name": "shell", "shape": "mesh", "file": "shell.stl", "solid": False}
    shell |= {"check_size": False, "rpy_deg": [0, 0, 5]} | AROUND[what]
    write_cube(tmp_path / "shell.stl", float(shell.pop("half")))
    made = MadeArm(tmp_path, obstacles=[shell], base={"position": [0, 0, 0]})
    arm, motion = made.data["manipulator"], made.motions["t.csv"]
    arm["bodies"][0]["center"][1] = 200
    if what == "all but link 1":
        arm["ignore_pairs"].append(["link 1", "shell"])
    still = replace(motion, x0=0 * motion.x0, alpha=0 * motion.alpha)
    made.motions["t.csv"] = replace(still, theta=0 * motion.theta)
    lines = made.certified()
    made.data["obstacles"][0]["solid"] = True
    assert "not proved outside shell" in made.check(lines).reason


def test_points_are_outside_farther_than_gaps_by_what_is_thinnest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """O_1 by the thinnest part of the arm, what is carried by what is required."""
    shell = {"name": "shell", "shape": "mesh", "file": "shell.stl", "solid": False}
    shell |= {"check_size": False}
    write_cube(tmp_path / "shell.stl", 3000.0)
    made, asked = MadeArm(tmp_path, obstacles=[shell]), []
    lines = made.certified()

    def check_outside(_: Solid, __: Any, points: Any) -> None:
        asked.extend([off for _, _, off in points])

    monkeypatch.setattr(Solid, "check_outside", check_outside)
    assert made.check(lines).accepted
    assert asked == [0.012, 0.005, 0.005, 0.005]  # tool, camera, valve in two parts


NOT_TIGHT = {
    *("max_link_angle_deg", "max_joint_angle_deg", "base_range", "required_clearance"),
    *("required_self_clearance", "link", "parts", "vdsm_problem", "polygon", "to"),
}
"""Counts, limits that the motion does not come near, corners that no plane touches."""


def counted(data: Any, scene: str) -> list[tuple[Any, ...]]:
    """Places of the numbers of a problem on which what a plane proves depends."""
    places = numbers_in(data)
    own = "motion" if scene == "moving" else scene
    if scene != "bodies":  # whose numbers all others have too
        places = [p for p in places if own in p]
    words = [[key for key in p if isinstance(key, str)][-1] for p in places]
    told = zip(places, words, strict=True)
    return [place for place, word in told if word not in NOT_TIGHT]


def assert_numbers_count(made: MadeArm, places: list[tuple[Any, ...]]) -> None:
    """A thousandth of the unit more or less is too much for some plane."""
    lines, data = made.certified(), made.data
    for where in places:
        reasons = []
        for step in (1e-3, -1e-3):
            made.data = copy.deepcopy(data)
            holder, key = place(made.data, where)
            holder[key] += step
            reasons.append(made.check(copy.deepcopy(lines)).reason)
        assert any(reasons), where


@pytest.mark.parametrize("scene", SCENES)
def test_numbers_of_a_problem_cannot_be_exchanged(scene: str, tmp_path: Path) -> None:
    made, rng = made_in(tmp_path, scene), np.random.default_rng(1)
    places = counted(made.data, scene)
    some = rng.choice(len(places), 2, replace=False)
    assert_numbers_count(made, [places[k] for k in some])


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES)
def test_no_number_of_a_problem_can_be_exchanged(scene: str, tmp_path: Path) -> None:
    made = made_in(tmp_path, scene, smooth=True)
    assert_numbers_count(made, counted(made.data, scene))


Change = Callable[[MadeArm], Any]


def at(*way: Any, **more: Any) -> Change:
    """Other fields of what stands at a place of the problem."""

    def change(made: MadeArm) -> None:
        found: Any = made.data
        for step in way:
            found = found[step]
        found.update(more)

    return change


def without(*way: Any) -> Change:
    """Nothing at a place of the problem."""

    def change(made: MadeArm) -> None:
        holder, key = place(made.data, way)
        del holder[key]

    return change


def row_of(name: str, row: int, by: float) -> Change:
    """One row of a trajectory, in which joint 1 turns by more."""

    def change(made: MadeArm) -> None:
        alpha = made.motions[name].alpha.copy()
        alpha[row, 0] += by
        made.motions[name] = replace(made.motions[name], alpha=alpha)

    return change


def untimed(made: MadeArm) -> None:
    made.motions["t.csv"] = replace(made.motions["t.csv"], times=None)


def later(made: MadeArm) -> None:
    mate = made.motions["mate.csv"]
    assert mate.times is not None
    made.motions["mate.csv"] = replace(mate, times=mate.times + 1.0)


def text(old: str, new: str, file: str = "helper.urdf") -> Change:
    def change(made: MadeArm) -> None:
        assert old in made.texts[file]
        made.texts[file] = made.texts[file].replace(old, new)

    return change


ARM, OTHERS = "manipulator", "others"
FILES: dict[str, tuple[Change, str]] = {
    "camera on link 1": (at(ARM, "bodies", 0, link=1), "pairs"),
    "link 1 left out": (at(ARM, ignore_pairs=[["link 1", "crate"]]), "pairs"),
    "no tool": (without(ARM, "tool"), "pairs"),
    "no feed": (without(ARM, "feed"), "pairs"),
    "nothing ignored": (without(ARM, "ignore_pairs"), "pairs"),
    "larger valve": (lambda m: write_cube(m.folder / "valve.stl", 21.0), "claims"),
    "mate elsewhere": (row_of("mate.csv", 1, 1e-5), "claims"),
    "mate there": (row_of("mate.csv", 1, -1e-5), "claims"),
    "mate later": (later, "claims"),
    "rows without times": (untimed, "rows beside what moves have no times"),
    "another mate": (at(OTHERS, 0, name="twin"), "of each of"),
    "no mate": (without(OTHERS, 0), "of each of"),
    "mate without tool": (without(OTHERS, 0, ARM, "tool"), "of each of"),
    "helper elsewhere": (text("2.0,0.2", "2.0,0.3", "helper.csv"), "claims"),
    "helper's axis": (text('"0 1 3"', '"0 1 4"'), "claims"),
    "helper's hand": (text('"0.01 0.02 0.01"', '"0.01 0.03 0.01"'), "claims"),
}  # fmt: skip


def test_certificates_of_other_files_are_refused(tmp_path: Path) -> None:
    made = made_in(tmp_path, "others")
    lines, kept = made.certified(), copy.deepcopy((made.data, made.texts, made.motions))
    for what, (change, reason) in FILES.items():
        made.data, made.texts, made.motions = copy.deepcopy(kept)
        made.write_meshes()
        change(made)
        outcome = made.check(copy.deepcopy(lines))
        assert not outcome.accepted, what
        assert reason in outcome.reason, (what, outcome.reason)


def stated(*way: Any, by: float = 1.0, to: Any = None) -> Callable[[Any], None]:
    """Another number among the errors of a header."""

    def change(lines: Any) -> None:
        holder, key = place(lines[0]["errors"], way)
        holder[key] = holder[key] * by if to is None else to

    return change


def header(key: str, *way: Any, to: Any) -> Callable[[Any], None]:
    """Another value in a header."""

    def change(lines: Any) -> None:
        holder, last = place(lines[0], (key, *way))
        holder[last] = to

    return change


HAND = "helper: hand"
STATED: dict[str, tuple[Callable[[Any], Any], str]] = {
    "less of joint 1": (stated("joints_rad", 0, by=0.999), "less than"),
    "less of pitch 2": (stated("joints_rad", 3, by=0.999), "less than"),
    "less of base": (stated("base", 0, by=0.999), "less than"),
    "less of its turn": (stated("base", 1, by=0.999), "less than"),
    "less of crate": (stated("obstacles", "crate", 0, by=0.999), "less than"),
    "less of its turning": (stated("obstacles", "crate", 1, by=0.999), "less than"),
    "less of mate": (stated("obstacles", "mate: link 1", 0, by=0.999), "less than"),
    "less of hand": (stated("obstacles", HAND, 0, by=0.999), "less than"),
    "more of joint 1": (stated("joints_rad", 0, to=0.4), "claims"),
    "more of pitch 3": (stated("joints_rad", 5, to=4.0), "claims"),
    "more of base": (stated("base", 0, to=0.9), "claims"),
    "more of its turn": (stated("base", 1, to=0.9), "claims"),
    "more of crate": (stated("obstacles", "crate", 0, to=0.9), "claims"),
    "more of its turning": (stated("obstacles", "crate", 1, to=4.0), "claims"),
    "more of mate": (stated("obstacles", "mate: link 1", 0, to=0.9), "claims"),
    "more of hand": (stated("obstacles", HAND, 1, to=9.0), "claims"),
    "a half-space that turns": (stated("obstacles", "floor", 1, to=1e-9), "claims"),
    "a joint less": (lambda x: x[0]["errors"]["joints_rad"].pop(), "of each of"),
    "a joint more": (lambda x: x[0]["errors"]["joints_rad"].append(0), "of each of"),
    "no turn": (lambda x: x[0]["errors"]["obstacles"]["crate"].pop(), "of each of"),
    "no hand": (lambda x: x[0]["errors"]["obstacles"].pop(HAND), "of each of"),
    "no number": (stated("base", 1, to=True), "not a finite number"),
    "negative": (stated("obstacles", "floor", 1, to=-1e-9), "less than"),
    "a triangle of the valve less": (
        lambda x: x[0]["pieces"]["valve"][0].pop(), "do not make up the whole"),
    "a hull of the valve less": (
        lambda x: x[0]["pieces"]["valve"].pop(), "do not make up the whole"),
    "a hull of the valve more": (
        lambda x: x[0]["pieces"]["valve"].append([0, 1]), "pairs"),
    "one hull of the valve": (
        header("pieces", "valve", to=[[*range(12)]]), "pairs"),
    "a triangle of the hand less": (
        lambda x: x[0]["links"][HAND]["meshes"][0].pop(), "a hull of at most 4"),
    "too many hulls of the hand": (
        header("links", HAND, "meshes", 0, 0, to=4), "a hull of at most 4"),
    "a mesh of the hand more": (
        lambda x: x[0]["links"][HAND]["meshes"].append([0] * 12), "fewer meshes"),
    "a piece of the hand twice": (
        header("links", HAND, "order", to=[0, 1, 2, 2]), "do not make up the whole"),
    "a link that there is not": (
        header("links", "nobody", to={"order": [], "meshes": []}), "without solids"),
}  # fmt: skip


def test_forged_headers_are_refused(tmp_path: Path) -> None:
    """Bodies in parts, errors of each joint and obstacle, links of another robot."""
    made = MadeArm(tmp_path, **(SCENES["others"] | {"errors": ERRORS}))
    made.most = 1e-3  # the verifier counts more of errors beside what moves
    made.data["obstacles"] = [OBSTACLES[1], OBSTACLES[3]]
    lines = made.certified()
    for what, (change, reason) in STATED.items():
        forged = copy.deepcopy(lines)
        change(forged)
        outcome = made.check(forged)
        assert not outcome.accepted, what
        assert reason in outcome.reason, (what, outcome.reason)
