"""Planes as they are written down; oracle: gaps along them at many times, in numpy."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from oracles.shortcuts import prove, start_proof
from oracles.tree_queries import at, random_path, random_pieces, random_tree, unit

from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.geometry.convex import FlatCylinder, HalfSpacePiece, Hull, Piece
from vdsm_pin.proof.bodies import Body, Pair, PairTable
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.layouts import CLAIM, FIRST, LAST, PLANE_NORMAL, RECORD
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.recording import LOSS, record
from vdsm_pin.proof.terms import Task
from vdsm_pin.proof.tree import Joint, Kind, Tree
from vdsm_pin.proof.workspace import new_workspace

ROOM = 5_000
INTERVALS = 3


@dataclass(frozen=True)
class Asked:
    """A capsule on the last frame, held off bodies on any other."""

    tree: Tree
    bodies: tuple[Body, ...]
    path: Path
    pairs: tuple[Pair, ...]

    def recorded(
        self, room: int = ROOM, first: int = 0, until: float = np.inf
    ) -> tuple["Written", FloatArray, tuple[int, int, int]]:
        """What it is about, the planes from an interval on, and how it ended."""
        table = PairTable.of(list(self.pairs))
        args = self.tree, list(self.bodies), self.path, table
        made = start_proof(*args, None, Budget(until=until))
        work = new_workspace(made.task, self.tree.n_columns, Budget().slices)
        records = np.full((room, RECORD), np.nan)
        ended = record(made.task, made.motion, work, first, INTERVALS, records)
        return Written(self, made.task, made.plan.swapped), records, ended


@dataclass(frozen=True)
class Written:
    """What planes are about: of a pair that is swapped the other one is the body."""

    asked: Asked
    task: Task
    swapped: BoolArray

    def gaps(self, row: FloatArray) -> FloatArray:
        """How far a plane holds its pieces from the body at times of its slice; [m]."""
        pair, bodies, path = (
            self.asked.pairs[int(row[1])],
            self.asked.bodies,
            self.asked.path,
        )
        one, rests = bodies[pair.one], bodies[pair.other]
        if self.swapped[int(row[1])]:
            one, rests = rests, one
        (body,), pieces = one.pieces, self.task.pieces
        first = int(pieces.first_piece[self.task.pairs.obstacle[int(row[1])]])
        numbers = pieces.order[first + int(row[FIRST]) : first + int(row[LAST])]
        n = row[PLANE_NORMAL:CLAIM] / np.linalg.norm(row[PLANE_NORMAL:CLAIM])
        held = least([rests.pieces[k] for k in numbers], n)
        k = int(row[0])
        part = Path(path.knots[k : k + 2], path.inner[k : k + 1])
        poses = self.asked.tree.poses(at(part, np.linspace(row[2], row[3], 33)))
        seen = np.linalg.inv(poses[:, rests.frame]) @ poses[:, one.frame]
        points = np.einsum("tij,pj->tpi", seen[:, :3, :3], body.points)
        points += seen[:, None, :3, 3]
        return np.asarray(held - (points @ n).max(axis=1) - body.radius)


def random_asked(rng: np.random.Generator) -> Asked:
    """Obstacles of one piece, of some, and of so many that these have an order."""
    tree = random_tree(rng, int(rng.integers(2, 5)))
    last = tree.n_frames - 1
    around = [random_pieces(rng, "capsule") for _ in range(12)]
    many = tuple(Hull(hull.points + 1.5 * unit(rng), hull.radius) for (hull,) in around)
    some = tuple(random_pieces(rng, s)[0] for s in ("box", "cylinder", "triangle"))
    groups: list[tuple[Piece, ...]] = [many, some, (HalfSpacePiece(unit(rng), -2.5),)]
    groups.append(random_pieces(rng, "box"))
    frames = [0, 0, 0, int(rng.integers(last))]
    bodies = [Body(last, random_pieces(rng, "capsule"))]
    bodies += [Body(f, g) for f, g in zip(frames, groups, strict=True)]
    path = random_path(rng, tree, INTERVALS + 1, int(rng.choice([1, 3])))
    pairs = [Pair(0, k) for k in range(1, len(bodies))]
    proof = prove(tree, bodies, path, pairs)
    asked = [
        Pair(pair.one, pair.other, low - float(rng.choice([1e-4, 1e-2, 0.5])))
        for pair, low in zip(pairs, proof.lower, strict=True)
        if low > 1e-3
    ]
    return Asked(tree, tuple(bodies), path, tuple(asked))


def least(pieces: list[Piece], n: FloatArray) -> float:
    """The least n . x of any of them, n of unit length."""
    return min(_least(piece, n) for piece in pieces)


def _least(piece: Piece, n: FloatArray) -> float:
    if isinstance(piece, HalfSpacePiece):
        assert np.allclose(n, -piece.normal, rtol=0.0, atol=1e-12)
        return -piece.offset
    if isinstance(piece, FlatCylinder):
        along, across = piece.axis @ n, np.linalg.norm(np.cross(piece.axis, n))
        away = piece.half_length * abs(along) + piece.radius * across
        return float(piece.centre @ n - away)
    return float((piece.points @ n).min() - piece.radius)


def is_split(edges: FloatArray, low: float, high: float) -> bool:
    """Whether intervals, shape (n, 2), cover [low, high] once and no more."""
    edges = edges[np.argsort(edges[:, 0])]
    inner = np.array_equal(edges[1:, 0], edges[:-1, 1])
    return inner and edges[0, 0] == low and edges[-1, 1] == high


@pytest.mark.parametrize("seed", range(16))
def test_planes_hold_what_they_claim_of_every_piece_at_every_time(seed: int) -> None:
    asked = random_asked(np.random.default_rng([51, seed]))
    written, records, (count, reached, failed) = asked.recorded()
    assert (reached, failed) == (INTERVALS, -1)
    assert np.isnan(records[count:]).all()
    found = records[:count]
    for row in found:
        held, pair = written.gaps(row), asked.pairs[int(row[1])]
        assert row[CLAIM] >= pair.required
        assert held.min() >= row[CLAIM] - 1e-12
    for k in range(INTERVALS):
        for number, pair in enumerate(asked.pairs):
            mine = found[(found[:, 0] == k) & (found[:, 1] == number)]
            slices = np.unique(mine[:, 2:4], axis=0)
            assert is_split(slices, 0.0, 1.0)
            for times in slices:
                same = mine[(mine[:, 2:4] == times).all(axis=1)]
                whole = len(asked.bodies[pair.other].pieces)
                assert is_split(same[:, [FIRST, LAST]], 0, whole)


@pytest.mark.parametrize("seed", range(8))
def test_planes_are_few_and_short(seed: int) -> None:
    """Far obstacles need one plane, of whole numbers of two digits; others more."""
    rng = np.random.default_rng([52, seed])
    asked = random_asked(rng)
    easy = tuple(replace(pair, required=-10.0) for pair in asked.pairs)
    _, records, (count, *_) = replace(asked, pairs=easy).recorded()
    assert count == INTERVALS * len(easy)
    for row in records[:count]:
        n = row[PLANE_NORMAL:CLAIM]
        if isinstance(asked.bodies[easy[int(row[1])].other].pieces[0], HalfSpacePiece):
            continue
        assert np.array_equal(n, np.rint(n))
        assert np.abs(n).max() <= 10.0**6
    ring = tuple(
        Hull(np.array([[np.cos(a), np.sin(a), 0.0]]), 0.05)
        for a in np.arange(6) * np.pi / 3.0
    )
    joints = random_tree(rng, 2)
    still = Path(np.zeros((INTERVALS + 1, joints.n_columns)))
    at_rest = np.linalg.inv(joints.poses(still.knots)[0, -1])
    body = Body(joints.n_frames - 1, (Hull(at_rest[None, :3, 3], 0.01),))
    one = Asked(joints, (body, Body(0, ring)), still, (Pair(0, 1, 0.5),))
    written, records, (count, reached, failed) = one.recorded()
    assert (reached, failed) == (INTERVALS, -1)
    assert count >= 2 * INTERVALS  # no plane holds a ring
    for row in records[:count]:
        best = 0.5 if row[LAST] - row[FIRST] > 1 else 1.0 - 0.05 - 0.01 - LOSS
        assert best <= row[CLAIM] <= 0.94 + 1e-9
        assert written.gaps(row).min() >= row[CLAIM] - 1e-12


def test_a_plane_along_an_axis_is_written_with_two_digits() -> None:
    """A hundredth of a direction is fine enough where that direction is exact."""
    tree = Tree((Joint(0, Kind.REVOLUTE, (0.0, 0.0, 1.0), column=0),))
    still = Path(np.zeros((INTERVALS + 1, 1)))
    for axis in np.eye(3):
        bodies = [Body(k, (Hull(x * axis[None], 0.1),)) for k, x in ((1, 0), (0, 2))]
        one = Asked(tree, tuple(bodies), still, (Pair(0, 1, 0.5),))
        _, records, (count, *_) = one.recorded()
        assert count == INTERVALS
        for row in records[:count]:
            assert np.array_equal(np.abs(row[PLANE_NORMAL:CLAIM]), 100.0 * axis)


@pytest.mark.parametrize("seed", range(6))
def test_without_room_whole_intervals_are_written(seed: int) -> None:
    asked = random_asked(np.random.default_rng([53, seed]))
    _, every, (count, *_) = asked.recorded()
    starts = [int((every[:count, 0] < k).sum()) for k in range(INTERVALS + 1)]
    for room in range(count + 1):
        _, records, (written, reached, failed) = asked.recorded(room)
        assert failed == -1
        assert reached == max(k for k in range(INTERVALS + 1) if starts[k] <= room)
        assert written == starts[reached]
        assert np.array_equal(records[:written], every[:written])
    _, records, (written, reached, _) = asked.recorded(first=1)
    assert reached == INTERVALS
    assert set(records[:written, 0]) == set(range(1, INTERVALS))


def test_without_time_nothing_is_written_and_nothing_has_failed() -> None:
    asked = random_asked(np.random.default_rng(55))
    _, records, ended = asked.recorded(first=1, until=0.0)
    assert ended == (0, 1, -1)
    assert np.isnan(records).all()


def test_what_is_not_proved_is_named() -> None:
    asked = random_asked(np.random.default_rng(54))
    for k in range(len(asked.pairs)):
        pairs = list(asked.pairs)
        pairs[k] = replace(pairs[k], required=5.0)
        _, _, (count, reached, failed) = replace(asked, pairs=tuple(pairs)).recorded()
        assert (count, reached, failed) == (0, 0, k)
