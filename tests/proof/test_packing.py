"""What is asked as compiled code reads it; oracle: poses and corners themselves."""

from typing import Any

import numpy as np
import pytest
from oracles.tree_queries import random_box, random_tree, unit

from vdsm_pin.geometry.convex import FlatCylinder, HalfSpacePiece, Hull, ends_of
from vdsm_pin.proof.bodies import Body, ErrorBox, Pair, PairTable
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.moving_sides import FEW
from vdsm_pin.proof.packed_tree import FIXED, PRISMATIC, REVOLUTE, pack_tree
from vdsm_pin.proof.packing import for_motion, pack_task, with_errors
from vdsm_pin.proof.parts import planned_parts
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.proving import new_proving
from vdsm_pin.proof.question import Question
from vdsm_pin.proof.terms import ACROSS, WITHIN, WORLD, Rules
from vdsm_pin.proof.tree import Joint, Kind, Tree

RULES = Rules(True, True, 1e-11, 1e-9, 1e-6, 0.02, np.inf)


def random_bodies(rng: np.random.Generator, tree: Tree, most: int) -> list[Body]:
    """Of few and many corners, some of them in the origin of their frame."""
    bodies: list[Body] = []
    shared = rng.uniform(-0.3, 0.3, 3)
    for frame in rng.integers(0, tree.n_frames, 6).tolist():
        corners = rng.uniform(-0.3, 0.3, (int(rng.integers(1, most + 1)), 3))
        corners[0] = [np.zeros(3), shared, corners[0]][int(rng.integers(3))]
        solid: Any = Hull(corners, float(rng.choice([0.0, 0.05])))
        if rng.integers(4) == 0:
            solid = FlatCylinder(corners[0], unit(rng), 0.2, 0.1)
        bodies.append(Body(frame, (solid,), f"body {len(bodies)}"))
    return bodies


def some_pairs(rng: np.random.Generator, bodies: list[Body]) -> list[Pair]:
    """Half of those that may part, in either order."""
    n = range(len(bodies))
    return [
        Pair(a, b, rng.uniform())
        for a in n
        for b in n
        if bodies[a].frame != bodies[b].frame and rng.random() < 0.5
    ]


@pytest.mark.parametrize("most", [FEW, FEW + 4])
@pytest.mark.parametrize("seed", range(6))
def test_corners_are_seen_where_they_are(seed: int, most: int) -> None:
    rng = np.random.default_rng([seed, most])
    for _ in range(8):
        tree = random_tree(rng, int(rng.integers(2, 8)))
        bodies = random_bodies(rng, tree, most)
        pairs = some_pairs(rng, bodies)
        if not pairs:
            continue
        columns = rng.permutation(6) - 1
        asked = tree, bodies, PairTable.of(pairs)
        task = pack_task(*asked, RULES, np.ones(tree.n_columns), columns)
        poses = tree.poses(rng.normal(size=(1, tree.n_columns)))[0]
        places, ways = task.places, task.ways
        assert places.every.tolist() == list(range(len(places.way)))
        for row, pair in enumerate(pairs):
            body = bodies[pair.one]
            check_body(task, row, pair, body, columns)
            rest, solid = bodies[pair.other].frame, body.pieces[0]
            way = int(task.pairs.way[row])
            assert (ways.rest[way], ways.frame[way]) == (rest, body.frame)
            disc = solid.radius if isinstance(solid, FlatCylinder) else 0.0
            slots = task.pairs.slots[task.pairs.slot[row] :]
            for slot, corner in zip(slots, ends_of(solid), strict=False):
                way, at = int(places.way[slot]), places.at[slot]
                frame = int(ways.frame[way])
                assert ways.rest[way] == rest
                seen, told = (
                    poses[frame] @ [*at, 1.0],
                    poses[body.frame] @ [*corner, 1.0],
                )
                np.testing.assert_allclose(seen, told, atol=1e-12)
                assert places.lever[slot] == pytest.approx(np.linalg.norm(at) + disc)
                if disc or corner.any():
                    assert frame == body.frame
                point = int(places.point[slot])
                assert point < places.n_points
                assert (point == slot) == (rest == WORLD)
                in_world = int(places.way[point])
                assert (ways.rest[in_world], ways.frame[in_world]) == (WORLD, frame)
                assert np.array_equal(places.at[point], at)
                assert places.lever[point] == places.lever[slot]
        if most == FEW:
            told = zip(
                places.way.tolist(), map(bytes, places.at), places.lever, strict=True
            )
            assert len({*told}) == len(places.way)


def check_body(task: Any, row: int, pair: Pair, body: Body, columns: Any) -> None:
    """Of a pair the numbers of its body, its group, and what planes lose."""
    packed, number, solid = task.bodies, int(task.pairs.body[row]), body.pieces[0]
    first, last = packed.first[number : number + 2]
    assert packed.number[number] == pair.one
    assert packed.frame[number] == body.frame
    assert np.array_equal(packed.corners[first:last], ends_of(solid))
    disc = np.zeros(4)
    if isinstance(solid, FlatCylinder):
        disc = np.array([*solid.axis, solid.radius])
        ends = solid.centre + np.outer([-1.0, 1.0], solid.half_length * solid.axis)
        np.testing.assert_allclose(ends_of(solid), ends)
    assert np.array_equal(packed.discs[number], disc)
    radius = 0.0 if isinstance(solid, FlatCylinder) else solid.radius
    assert packed.radius[number] == radius
    levers = np.linalg.norm(ends_of(solid), axis=1) + disc[3]
    np.testing.assert_allclose(packed.levers[first:last], levers)
    assert packed.column[number] == columns[pair.one]
    assert task.pairs.obstacle[row] == pair.other
    assert task.pairs.required[row] == pair.required
    assert task.pairs.lost[row] == radius + RULES.pad
    assert task.pairs.rise[row] == RULES.pad - radius


@pytest.mark.parametrize("seed", range(4))
def test_pairs_of_one_branch_are_of_links_and_shifts_cost_both_sides(seed: int) -> None:
    rng = np.random.default_rng([9, seed])
    for _ in range(10):
        tree = random_tree(rng, 6)
        bodies, columns = random_bodies(rng, tree, 3), np.arange(6)
        pairs = some_pairs(rng, bodies)
        if not pairs:
            continue
        n = len(tree.joints)
        task = pack_task(tree, bodies, PairTable.of(pairs), RULES, None, columns)
        box = ErrorBox(
            np.zeros(n), rng.uniform(size=n), np.zeros(n), rng.uniform(size=6)
        )
        erring = with_errors(task, box)
        assert task.rules.nominal and task.rules.steady
        assert erring.rules.steady and not erring.rules.nominal
        for row, pair in enumerate(pairs):
            one, other = bodies[pair.one].frame, bodies[pair.other].frame
            apart = tree.branches[one] != tree.branches[other]
            assert task.pairs.group[row] == (ACROSS if apart else WITHIN)
            assert task.pairs.column[row] == (pair.other if apart else -1)
            way = np.concatenate(tree.way(other, one))
            shift = box.shifts[way].sum() + box.surfaces[[pair.one, pair.other]].sum()
            assert erring.pairs.lost[row] - task.pairs.lost[row] == pytest.approx(shift)
        none = with_errors(task, ErrorBox(*np.zeros((3, n)), np.zeros(6)))
        assert none.rules == task.rules
        turns = np.array([j.kind is Kind.REVOLUTE for j in tree.joints], float)
        turning = with_errors(task, ErrorBox(0.1 * turns, *np.zeros((2, n))))
        assert turning.rules.steady == turning.rules.nominal == (not turns.any())


def test_nothing_is_proved_of_what_no_motion_is_asked_of() -> None:
    """Its bounds would lack the rounding: whoever packs a question is stopped."""
    tree = Tree((Joint(0, Kind.REVOLUTE, column=0),))
    bodies = [Body(frame, (Hull(np.full((1, 3), frame)),)) for frame in (0, 1)]
    asked = Question.of(tree, bodies, PairTable.of([Pair(0, 1)]))
    motion = Path(np.zeros((1, 1))).packed()
    for task in (asked.task, asked.task._replace(rules=RULES)):
        with pytest.raises(AssertionError, match="of no motion"):
            new_proving(asked.plan, task, motion, 1, Budget())


def test_strokes_are_as_long_as_values_get() -> None:
    rng = np.random.default_rng(3)
    kinds = {Kind.FIXED: FIXED, Kind.REVOLUTE: REVOLUTE, Kind.PRISMATIC: PRISMATIC}
    for _ in range(20):
        tree = random_tree(rng, 8)
        reach = rng.uniform(0.1, 2.0, tree.n_columns)
        unknown, known = pack_tree(tree), pack_tree(tree, reach)
        assert unknown.axis is known.axis  # packed once
        bodies = [Body(1, (Hull(np.zeros((1, 3))),)), Body(0, (Hull(np.ones((1, 3))),))]
        task = pack_task(tree, bodies, PairTable.of([Pair(0, 1)]), RULES)
        errors = random_box(rng, tree)
        later = for_motion(task, tree, reach, RULES, errors)
        assert (later.pairs.lost >= later.rules.pad).all() and later.rules.pad > 0.0
        assert np.array_equal(later.tree.stroke, known.stroke)
        for j, joint in enumerate(tree.joints):
            assert known.kind[j] == kinds[joint.kind]
            slides = joint.kind is Kind.PRISMATIC
            most = abs(joint.offset) if slides else 0.0
            assert unknown.stroke[j] == (
                most if joint.column is None or not slides else np.inf
            )
            if slides and joint.column is not None:
                most += abs(joint.ratio) * reach[joint.column]
            assert known.stroke[j] == pytest.approx(most)
            axis = np.asarray(joint.axis)
            along, sense = int(known.along[j]), 1.0
            if np.count_nonzero(axis) == 1:
                sense = float(axis.sum())
                assert along == np.flatnonzero(axis)[0]
            else:
                assert along == 3
            assert np.array_equal(known.axis[j], axis * sense)
            assert known.offset[j] == joint.offset * sense
            ratio = 0.0 if joint.column is None else joint.ratio
            assert known.ratio[j] == ratio * sense
            assert known.column[j] == (-1 if joint.column is None else joint.column)


def test_what_moves_in_a_pair_is_one_bounded_piece() -> None:
    tree = random_tree(np.random.default_rng(0), 2)
    ball, half = Hull(np.zeros((1, 3))), HalfSpacePiece(np.eye(3)[0], -1.0)
    for pieces in ((ball, ball), (half,), ()):
        bodies = [Body(1, pieces, "odd"), Body(0, (ball,))]
        with pytest.raises(ValueError, match="body 'odd' moves in a pair"):
            pack_task(tree, bodies, PairTable.of([Pair(0, 1)]), RULES)


@pytest.mark.parametrize("seed", range(6))
def test_of_two_sides_the_one_at_rest_or_of_more_pieces_is_the_partner(
    seed: int,
) -> None:
    rng = np.random.default_rng([4, seed])
    for _ in range(20):
        tree, half = random_tree(rng, 5), HalfSpacePiece(np.eye(3)[0], -1.0)
        bodies = []
        for k in range(5):
            points = rng.normal(size=(int(rng.integers(1, 4)), 1, 3))
            frame = int(rng.integers(0, tree.n_frames))
            bodies.append(Body(frame, tuple(map(Hull, points)), str(k)))
        bodies.append(Body(int(rng.integers(0, tree.n_frames)), (half,), "half"))
        pairs = some_pairs(rng, bodies)
        plan = planned_parts(tree, bodies, PairTable.of(pairs))
        resting = [k for k in range(6) if bodies[k].frame == WORLD]
        assert plan.n_obstacles == len(resting)
        assert plan.number[: len(resting)].tolist() == resting
        assert sorted(plan.number[:6].tolist()) == list(range(6))
        at = 0
        for row, pair in enumerate(pairs):
            one, other = bodies[pair.one], bodies[pair.other]
            branches = tree.branches[[one.frame, other.frame]]
            swapped = pair.one == 5 or (pair.other != 5 and (
                one.frame == WORLD if WORLD in (one.frame, other.frame)
                else branches[0] != branches[1] or len(other.pieces) <= len(one.pieces)
            ))  # fmt: skip
            mover, partner = (
                (pair.other, pair.one) if swapped else (pair.one, pair.other)
            )
            for piece in bodies[mover].pieces:
                number = int(plan.pairs.one[at])
                assert plan.number[number] == mover
                assert plan.bodies[number].pieces == (piece,)
                assert plan.bodies[number].frame == bodies[mover].frame
                assert plan.number[plan.pairs.other[at]] == partner
                assert plan.pairs.other[at] < 6
                told = plan.owner[at], plan.swapped[at], plan.pairs.required[at]
                assert told == (row, swapped, pair.required)
                at += 1
        assert at == plan.pairs.size
        both = PairTable.of([Pair(5, 6)])
        with pytest.raises(ValueError, match="'half' and 'other' are both unbounded"):
            planned_parts(tree, [*bodies, Body(0, (half,), "other")], both)


def test_bodies_are_found_among_the_packed_ones() -> None:
    """Those that move in a pair are packed last, and parts and versions after them."""
    rng, tree = np.random.default_rng(5), Tree((Joint(0, Kind.REVOLUTE, column=0),))
    many = Hull(rng.normal(size=(200, 3)))
    balls = tuple(Hull(rng.normal(size=(1, 3)), 0.1) for _ in range(3))
    bodies = [
        Body(1, (many,), "many"),
        Body(0, balls[:1], "ball"),
        Body(1, balls, "balls"),
        Body(0, balls[1:], "both"),
    ]
    asked = Question.of(tree, bodies, PairTable.of([Pair(0, 1), Pair(2, 3)]))
    assert sorted(asked.places) == [*range(len(bodies))]
    assert asked.number[asked.places].tolist() == [*range(len(bodies))]
    names = [asked.plan.bodies[place].name for place in asked.places]
    assert names == ["many", "ball", "balls", "both"]


def test_a_body_with_a_half_space_is_not_bounded() -> None:
    ball, floor = Hull(np.zeros((1, 3)), 0.1), HalfSpacePiece(np.eye(3)[2], -2.0)
    for pieces in ((floor,), (ball, floor), (floor, ball)):
        assert not Body(0, pieces).is_bounded
    assert Body(0, (ball, ball)).is_bounded
