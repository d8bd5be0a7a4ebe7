"""Certificates of robots under errors: nothing within the errors comes nearer.

The oracles are samples of robots within their errors, by kinematics of their own and
Coal, and forgeries whose hashes fit, so that only what is claimed can be wrong.
"""

import copy
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.certificate_cases import write_cube
from oracles.certificate_mutations import change_number
from oracles.random_robots import MESH, random_urdf
from oracles.robot_certificates import BASES, VIRTUAL, Made, cell, text
from oracles.robot_samples import Errors, Sampler
from oracles.shortcuts import read_path

from vdsm_pin.io.problem_file import read_document
from vdsm_pin.problem.scene import Scene
from vdsm_pin.robots.cell import read_cell
from vdsm_pin.robots.files import CellScene, cell_file

Rng = np.random.Generator
NOTHING = CellScene(Scene(), (), ())
ERRORS: dict[str, Any] = {
    "joint_deg": {"bend": 0.4, "turn": 0.2},
    "slide": {"lift": 2},
    "base": 1.5,
    "base_deg": 0.3,
    "obstacle": 1,
    "obstacles": [{"name": "ball", "shift": 2, "turn_deg": 3}],
}


def erring(folder: Path, base: str = "fixed", smooth: int = 1) -> Made:
    made = Made(folder, base, smooth)
    made.cell["errors"] = copy.deepcopy(ERRORS)
    return made


@pytest.mark.parametrize("base", BASES)
def test_what_is_certified_under_errors_is_accepted(tmp_path: Path, base: str) -> None:
    made = erring(tmp_path, base, smooth=len(base) % 3)
    stated = made.certified()[0]["errors"]
    assert stated["joints_rad"]["bend"] == pytest.approx(np.radians(0.4))
    assert stated["joints_m"]["lift"] == 0.002
    assert stated["base"] == [0.0015, pytest.approx(np.radians(0.3))]
    assert stated["obstacles"]["ball"] == [0.002, pytest.approx(np.radians(3.0))]
    assert stated["obstacles"]["floor"] == [0.001, 0.0]


def less(*way: str | int, by: float = 0.999) -> Callable[[Any], None]:
    def change(errors: Any) -> None:
        for step in way[:-1]:
            errors = errors[step]
        errors[way[-1]] *= by

    return change


STATED: dict[str, tuple[Callable[[Any], object], str]] = {
    "a smaller turn": (less("joints_rad", "bend"), "less than"),
    "a smaller stroke": (less("joints_m", "lift"), "less than"),
    "no turn of the base": (less("base", 1, by=0.0), "less than"),
    "a smaller shift of the base": (less("base", 0), "less than"),
    "a smaller shift of an obstacle": (less("obstacles", "floor", 0), "less than"),
    "a smaller turn of an obstacle": (less("obstacles", "ball", 1), "less than"),
    "a negative error": (less("joints_rad", "turn", by=-1.0), "less than"),
    "a joint less": (lambda e: e["joints_rad"].pop("turn"), "of each of"),
    "a joint more": (lambda e: e["joints_rad"].update(elbow=1.0), "of each of"),
    "a follower": (lambda e: e["joints_rad"].update(follow=1.0), "of each of"),
    "an obstacle less": (lambda e: e["obstacles"].pop("notch"), "of each of"),
    "an obstacle more": (lambda e: e["obstacles"].update(x=[1, 1]), "of each of"),
    "another unit": (
        lambda e: e["joints_m"].update(bend=e["joints_rad"].pop("bend")),
        "of each of",
    ),
    "no strokes": (lambda e: e.pop("joints_m"), "of each of"),
    "more kinds": (lambda e: e.update(joints_deg={}), "of each of"),
    "one number of the base": (lambda e: e["base"].pop(), "of each of"),
    "words": (lambda e: e["joints_rad"].update(bend="1"), "not a finite number"),
    "true": (lambda e: e["joints_rad"].update(bend=True), "not a finite number"),
    "larger errors of joints": (less("joints_rad", "bend", by=60.0), "claims"),
    "larger strokes": (less("joints_m", "lift", by=60.0), "claims"),
    "a larger turn of the base": (less("base", 1, by=60.0), "claims"),
    "a larger shift of the base": (less("base", 0, by=60.0), "claims"),
    "larger obstacles": (less("obstacles", "notch", 0, by=200.0), "claims"),
    "a half-space that turns": (
        lambda e: e["obstacles"].update(floor=[0.001, 0.1]),
        "claims",
    ),
}


def test_forged_errors_are_refused(tmp_path: Path) -> None:
    made = erring(tmp_path)
    lines = made.certified()
    for what, (change, reason) in STATED.items():
        forged = copy.deepcopy(lines)
        change(forged[0]["errors"])
        outcome = made.check(forged)
        assert not outcome.accepted, what
        assert reason in outcome.reason, what


def asked(**more: Any) -> Callable[[Made], None]:
    return cell(errors=ERRORS | more)


ASKED: dict[str, tuple[Callable[[Made], None], str]] = {
    "more of a joint": (asked(joint_deg={"bend": 0.41, "turn": 0.2}), "less than"),
    "more of every joint": (asked(joint_deg=0.3), "less than"),
    "more of a stroke": (asked(slide=2.1), "less than"),
    "more of the base": (asked(base_deg=0.31), "less than"),
    "more of obstacles": (asked(obstacle=1.1), "less than"),
    "a ratio": (text('multiplier="-0.5"', 'multiplier="-90"'), "claims"),
    "unknown": (asked(joint_deg={"elbow": 0.1}), "'elbow', which does not move so"),
    "follower": (asked(joint_deg={"follow": 0.1}), "'follow', which does not"),
    "stroke of a turn": (asked(slide={"turn": 1}), "'turn', which does not move so"),
    "turn of a stroke": (asked(joint_deg={"lift": 1}), "'lift', which does not"),
    "by number": (asked(joint_deg=[0.1, 0.1]), "by name"),
}


def test_larger_errors_than_certified_are_refused(tmp_path: Path) -> None:
    made = erring(tmp_path)
    lines, urdf = made.certified(), made.texts["all.urdf"]
    named = read_cell(made.files[0]).robot.more_files
    for what, (change, reason) in ASKED.items():
        made.texts["all.urdf"], made.cell["errors"] = urdf, ERRORS
        change(made)
        made.write()
        source = cell_file(read_document(made.files[0])).source(named, NOTHING)
        lines[0]["problem_sha256"] = source.sha256
        outcome = made.check(lines, fits=False)
        assert not outcome.accepted, what
        assert reason in outcome.reason, (what, outcome.reason)


LEFT_OUT: dict[str, dict[str, Any]] = {
    "joint_deg": {"bend": 0.4},
    "slide": {"lift": 2},
    "base": 1.5,
    "base_deg": 0.3,
    "obstacle": 1,
    "obstacles": [{"name": "notch", "shift": 0, "turn_deg": 2}],
}


@pytest.mark.parametrize("kind", LEFT_OUT)
def test_planes_of_a_smaller_box_are_refused(tmp_path: Path, kind: str) -> None:
    """Each error counts: the header states it, the planes were made without it."""
    made = Made(tmp_path)
    made.cell["errors"] = {kind: LEFT_OUT[kind]}
    errors = made.certified()[0]["errors"]
    made.cell["errors"] = {}
    lines = made.certified()
    made.cell["errors"] = {kind: LEFT_OUT[kind]}
    assert not (outcome := made.check(copy.deepcopy(lines))).accepted
    assert "less than the problem asks for" in outcome.reason
    lines[0]["errors"] = errors
    assert not (outcome := made.check(lines)).accepted
    assert "claims" in outcome.reason


def test_a_follower_errs_by_its_ratio(tmp_path: Path) -> None:
    """The leader stands at 0, so that a larger ratio moves nothing but by errors."""
    made = Made(tmp_path)
    made.cell["errors"] = {"joint_deg": {"bend": 0.4}}
    for row in made.rows[1:]:
        row[2] = 0.0
    lines = made.certified()
    text('multiplier="-0.5"', 'multiplier="-0.4"')(made)
    assert made.check(copy.deepcopy(lines)).accepted
    text('multiplier="-0.4"', 'multiplier="-3"')(made)
    assert made.is_certified()
    outcome = made.check(lines)
    assert not outcome.accepted
    assert "finger" in outcome.reason


def test_numbers_changed_at_random(tmp_path: Path) -> None:
    """What is accepted all the same states no less than was asked for."""
    made, rng = erring(tmp_path, "planar"), np.random.default_rng(1)
    lines = made.certified()
    asked, refused = lines[0]["errors"], 0
    for _ in range(30):
        forged = copy.deepcopy(lines[:1])
        change_number(forged, rng)
        outcome = made.check(forged + lines[1:])
        refused += not outcome.accepted
        if outcome.accepted:
            stated = forged[0]["errors"]
            assert stated["joints_rad"]["bend"] >= asked["joints_rad"]["bend"]
            assert stated["base"] >= asked["base"]
    assert refused > 10


def claimed(lines: list[Any]) -> dict[tuple[str, str], float]:
    """The least clearance that is claimed of every two links, or link and obstacle."""
    least: dict[tuple[str, str], float] = {}
    for line in lines[1:]:
        for pair, slices in zip(lines[0]["pairs"], line["proofs"], strict=True):
            one, other = (name.partition(" part ")[0] for name in pair)
            for slice_ in slices:
                for *_, lower in slice_[2]:
                    metres = lower / 1e10 if type(lower) is int else lower
                    known = least.get((one, other), np.inf)
                    least[one, other] = min(known, metres)
    return least


@dataclass
class Near:
    """A random robot and a motion whose certificate says nearly all that is true."""

    made: Made
    urdf: str
    virtual: str

    @property
    def stated(self) -> Errors:
        asked = read_cell(self.made.files[0])
        box, joints = asked.errors, {}
        for joint in asked.robot.joints:
            joints[joint.name] = box.joint if joint.turns else box.slide
        off = {one.name: one for one in map(box.of_obstacle, asked.scene.names)}
        turned = {name: (one.shift, one.turn) for name, one in off.items()}
        return Errors(joints, (box.base, box.base_turn), turned)


def near_limit(folder: Path, seed: int) -> Near | None:
    """Random files that ask for just less than is proved, if they are certified."""
    rng, made = np.random.default_rng(seed), Made(folder)
    made.erring = np.inf  # errors are large: the verifier counts much more of them
    urdf = random_urdf(rng, int(rng.integers(2, 6)))
    (folder / "r.urdf").write_text(urdf)
    write_cube(folder / MESH, 5.0)
    virtual = str(rng.choice([*BASES]))
    made.texts["all.srdf"] = VIRTUAL.format(base=virtual)
    angles = rng.uniform(-90, 90, 3).tolist()
    made.cell |= {
        "length_unit": "m",
        "robot": {"urdf": "r.urdf", "srdf": "all.srdf"},
        "base": {"position": rng.normal(size=3).tolist(), "rpy_deg": angles},
        "required_clearance": 0,
        "required_self_clearance": 0,
        "obstacles": random_obstacles(rng),
        "errors": random_errors(rng),
    }
    made.write()
    joints = read_cell(made.files[0]).robot.joints
    if not joints:
        return None
    q = np.cumsum(rng.uniform(-0.3, 0.3, (3, len(joints))), axis=0)
    made.rows = [[f"{j.name}_{j.unit}" for j in joints], *q.tolist()]
    return Near(made, urdf, virtual) if tightened(made) else None


def random_obstacles(rng: Rng) -> list[Any]:
    places = (rng.normal(size=(3, 3)) * 0.8).tolist()
    size, turn = rng.uniform(0.05, 0.4, 3).tolist(), rng.uniform(-90, 90, 3).tolist()
    return [
        {"name": "ball", "shape": "sphere", "center": places[0], "radius": 0.1},
        {"name": "block", "shape": "box", "center": places[1], "size": size}
        | {"rpy_deg": turn},
        {"name": "wall", "shape": "half_space", "normal": rng.normal(size=3).tolist()}
        | {"point": (np.array(places[2]) - 1.0).tolist()},
    ]


def random_errors(rng: Rng) -> dict[str, Any]:
    """Some of the kinds, none of them often."""
    sizes = rng.uniform(0.0, [2.0, 0.01, 0.01, 2.0, 0.01]) * (rng.random(5) < 0.8)
    keys = "joint_deg", "slide", "base", "base_deg", "obstacle"
    single = {"name": "block", "shift": 0.003, "turn_deg": float(rng.uniform(0, 5))}
    return dict(zip(keys, sizes.tolist(), strict=True)) | {"obstacles": [single]}


def tightened(made: Made) -> bool:
    """Drop what collides, and ask for nearly as much as is proved of the rest."""
    found = made.verified()
    clear = {"": np.inf, "links": np.inf}
    meeting, disabled = set(), []
    for pair, lower in zip(found.pairs, found.least.lower.tolist(), strict=True):
        if lower > 0.01:
            kind = "" if pair.obstacle else "links"
            clear[kind] = min(clear[kind], lower)
        elif pair.obstacle:
            meeting.add(pair.obstacle)
        else:
            ends = f'link1="{pair.own}" link2="{pair.other_body}"'
            disabled.append(f'<disable_collisions {ends} reason="x"/>')
    srdf = made.texts["all.srdf"]
    made.texts["all.srdf"] = srdf.replace("</robot>", "".join(disabled) + "</robot>")
    stay = [o for o in made.cell["obstacles"] if o["name"] not in meeting]
    asked = [o for o in made.cell["errors"]["obstacles"] if o["name"] not in meeting]
    made.cell["obstacles"], made.cell["errors"]["obstacles"] = stay, asked
    least = [x if np.isfinite(x) else 0.0 for x in clear.values()]
    made.cell["required_clearance"] = least[0] * 0.9999
    made.cell["required_self_clearance"] = least[1] * 0.9999
    return bool(stay and least[0])


def slack_of_samples(near: Near, seed: int, samples: int) -> float:
    """How much farther apart samples are than certified, at least; [m].

    Half of the samples are about the moment and the corner that were nearest so far.
    """
    lines, rng = near.made.certified(), np.random.default_rng(seed)
    promised = claimed(lines)
    sampler = Sampler(near.urdf, near.virtual, near.made.cell)
    robot = read_cell(near.made.files[0]).robot
    path, errors = read_path(near.made.files[1], robot), near.stated
    least, best = np.inf, (0.5 * path.n_intervals, 0)
    for k in range(samples):
        corner, moment = int(rng.integers(2**32)), rng.uniform(0, path.n_intervals)
        if k % 2:
            moment = float(np.clip(best[0] + rng.normal() * 0.1, 0, path.n_intervals))
        if k % 4 == 1:
            corner = best[1]
        at = min(int(moment), path.n_intervals - 1)
        row = path.within(np.array([at]), np.array([moment - at]))[0].tolist()
        q = {joint.name: x for joint, x in zip(robot.joints, row, strict=True)}
        gaps = sampler.gaps(q, errors, np.random.default_rng(corner))
        found = min(gaps[pair] - lower for pair, lower in promised.items())
        if found < least:
            least, best = found, (moment, corner)
    return least


def slacks(folder: Path, seeds: range, samples: int) -> list[float]:
    found = []
    for seed in seeds:
        inner = folder / str(seed)
        inner.mkdir()
        near = near_limit(inner, seed)
        if near is not None:
            found.append(slack_of_samples(near, seed, samples))
    return found


def test_no_sample_is_nearer_than_certified(tmp_path: Path) -> None:
    found = slacks(tmp_path, range(6), 60)
    assert len(found) >= 3
    assert min(found) >= -2e-6  # what Coal is off by


@pytest.mark.slow
def test_no_sample_of_a_hundred_robots_is_nearer_than_certified(tmp_path: Path) -> None:
    found = slacks(tmp_path, range(100, 240), 1000)
    assert len(found) >= 90
    assert min(found) >= -2e-6
    assert np.median(found) < 0.01  # samples come near what is certified
