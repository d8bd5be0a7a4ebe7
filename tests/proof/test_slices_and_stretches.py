"""Intervals that are subdivided, and the rows that say of each what was found.

Oracles: poses by numpy, distances of points from pieces by closed forms.
"""

from dataclasses import replace
from math import ceil, floor

import numpy as np
import pytest
from oracles.plain import plain
from oracles.shortcuts import prove, start_proof
from oracles.tree_queries import TreeQuery, at, from_piece, make_query, unit

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.convex import Hull
from vdsm_pin.proof import search, stretches
from vdsm_pin.proof.bodies import Body, ErrorBox, Pair, PairTable
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.layouts import (
    AT_LOWER,
    AT_UPPER,
    END,
    KEY,
    LOW,
    OTHER,
    OWN,
    RENEWED,
    SLICE,
    SLICES,
    START,
    TIME,
    UP,
)
from vdsm_pin.proof.packing import with_errors
from vdsm_pin.proof.pair_sweep import LOOSELY, Block, sweep_pair
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.proving import Proving, dense_rows
from vdsm_pin.proof.results import Dense
from vdsm_pin.proof.row_places import fill_rows
from vdsm_pin.proof.rows import BLOCK
from vdsm_pin.proof.terms import CERTIFIED, REFUTED, UNDECIDED
from vdsm_pin.proof.tree import Joint, Kind, Tree


def dense_of(proving: Proving) -> tuple[Dense, int]:
    """What is found of each interval and pair, and the slices that it took."""
    n = proving.n_intervals
    dense = dense_rows(n, proving.n_pairs)
    results = proving.new_results()._replace(dense=dense)
    assert proving.fresh(results).sweep(0, n)
    return dense, int(results.tally[SLICES])


def touches(pose: FloatArray, body: Body, point: FloatArray) -> float:
    """How far a point of the world is from the surface of a body; [m]."""
    local = np.linalg.inv(pose) @ [*point, 1.0]
    found = [from_piece(local[None, :3], piece)[0] for piece in body.pieces]
    return float(min(found))


def subdivided(seed: int, off: float) -> tuple[TreeQuery, Dense, list[Body]]:
    """A motion of which a limit so far below what is met is not seen by one plane."""
    rng = np.random.default_rng([seed, 31])
    while True:
        query = make_query(rng, int(rng.choice([1, 3])), int(rng.integers(2, 8)))
        if not 0.01 < query.share < 0.99 or query.nearest < 0.01:
            continue
        pairs = PairTable.of([Pair(0, 1, query.nearest - off)])
        asked = query.tree, query.bodies, query.path, pairs
        proving = start_proof(*asked)
        dense, slices = dense_of(proving)
        if slices > 1 and len(proving.plan.owner) == 1:
            order = -1 if proving.plan.swapped[0] else 1
            return query, dense, [*query.bodies][::order]


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("off", [1e-5, -1e-5])
def test_witnesses_of_a_subdivided_interval_stand_where_its_time_says(
    seed: int, off: float
) -> None:
    """On both surfaces, as far from each other as the upper bound says."""
    query, dense, bodies = subdivided(seed, off)
    time, upper = dense.time[0, 0], dense.upper[0, 0]
    assert dense.verdict[0, 0] == (CERTIFIED if off > 0.0 else REFUTED)
    assert dense.lower[0, 0] <= query.nearest <= upper + 1e-9
    poses = query.tree.poses(at(query.path, np.array([time])))[0]
    own, other = dense.own[0, 0], dense.other[0, 0]
    for body, point in zip(bodies, (own, other), strict=True):
        assert touches(poses[body.frame], body, point) == pytest.approx(0.0, abs=1e-7)
    assert np.linalg.norm(own - other) == pytest.approx(upper, abs=1e-7)


@pytest.mark.parametrize("slices", range(1, 8))
def test_few_slices_end_undecided(slices: int) -> None:
    """A ball comes within 1 um of a limit that takes many slices to prove."""
    turn = Tree((Joint(0, Kind.REVOLUTE, column=0),))
    bodies = [Body(1, (Hull(np.array([[1.0, 0.0, 0.0]]), 0.1),)),
              Body(0, (Hull(np.array([[2.0, 0.0, 0.0]]), 0.1),))]  # fmt: skip
    path, pairs = Path(np.array([[-1.0], [1.1]])), [Pair(0, 1, 0.8 - 1e-6)]
    budget = Budget(slices=slices)
    assert prove(turn, bodies, path, pairs).is_certified
    proving = start_proof(turn, bodies, path, PairTable.of(pairs), budget=budget)
    dense, used = dense_of(proving)
    assert dense.verdict[0, 0] == UNDECIDED
    assert 1 <= used <= slices
    assert dense.lower[0, 0] < 0.8 <= dense.upper[0, 0] + 1e-9


def test_a_new_plane_is_as_good_as_a_part_of_the_slack() -> None:
    """Of solids a thousandth of a metre apart and of those a metre apart alike."""
    rng, tree = np.random.default_rng(5), Tree((Joint(0, Kind.REVOLUTE, column=0),))
    for gap in np.geomspace(1e-3, 1.0, 24):
        toward = unit(rng)
        corners = rng.uniform(-0.2, 0.2, (2, 12, 3))
        corners[0] -= (corners[0] @ toward).max() * toward
        corners[1] += (gap - (corners[1] @ toward).min()) * toward
        bodies = [Body(1, (Hull(corners[0]),)), Body(0, (Hull(corners[1]),))]
        pairs = PairTable.of([Pair(0, 1)])
        proving = start_proof(tree, bodies, Path(np.zeros((1, 1))), pairs)
        dense, _ = dense_of(proving)
        lower, upper = dense.lower[0, 0], dense.upper[0, 0]
        assert gap - 1e-9 <= upper
        rough = 0.1 * Budget().slack * upper
        assert upper - 1.01 * rough - 1e-8 <= lower <= upper


def test_slices_of_a_stretch_end_where_it_ends() -> None:
    for low, high in [(0.25, 0.5), (1.25, 1.5), (0.5, 3.0), (2.0, 2.0), (0.75, 3.25),
                      (4.0, 4.0), (3.5, 4.0), (0.0, 0.0)]:  # fmt: skip
        found = stretches._slices(low, high, 4)
        k, start, end = found.T
        assert (k + start)[0] == low and (k + end)[-1] == high
        assert ((start >= 0.0) & (start <= end) & (end <= 1.0)).all()
        assert np.array_equal((k + end)[:-1], (k + start)[1:])
        assert np.array_equal(k, k[0] + np.arange(len(k))) and (k < 4).all()


@pytest.mark.parametrize("seed", range(4))
def test_a_stretch_has_the_least_of_its_slices(seed: int) -> None:
    """Where, when and between which points, as of each slice by itself."""
    rng = np.random.default_rng([seed, 37])
    turn = Tree((Joint(0, Kind.REVOLUTE, column=0),))
    bodies = [Body(1, (Hull(np.array([[1.0, 0.0, 0.0]]), 0.1),)), *(
        Body(0, (Hull(rng.uniform(-1.0, 1.0, (1, 3)) + 0.5, 0.05),))
        for _ in range(3)
    )]  # fmt: skip
    pairs = [Pair(0, k, 0.02) for k in (1, 2, 3)]
    path = Path(rng.uniform(-3.0, 3.0, (6, 1)))
    proving = start_proof(turn, bodies, path, PairTable.of(pairs))
    asked = proving.task, proving.motion, proving.work, np.arange(3)
    for low, high in [(0.25, 4.5), (1.0, 3.75), (2.25, 2.5), (0.5, 5.0)]:
        slices = stretches._slices(low, high, 5)
        runs = [slices, *np.split(slices, len(slices))]
        made = [proving.new_results() for _ in runs]
        for one, some in zip(made, runs, strict=True):
            stretches._judge_slices(*asked, one.best, one.counts, some)
        whole, best = made[0].best, np.array([one.best for one in made[1:]])
        assert np.array_equal(made[0].counts, sum(one.counts for one in made[1:]))
        np.testing.assert_allclose(whole[:, LOW], best[..., LOW].min(0), atol=1e-9)
        np.testing.assert_allclose(whole[:, UP], best[..., UP].min(0), atol=1e-9)
        for pair, got in enumerate(whole):
            least = int(np.argmin(best[:, pair, LOW]))
            assert got[AT_LOWER] == slices[least, 0]
            k = int(got[AT_UPPER])
            angle = at(Path(path.knots[k : k + 2]), got[TIME : TIME + 1])[0, 0]
            ball = np.array([np.cos(angle), np.sin(angle), 0.0])
            way = bodies[1 + pair].pieces[0].points[0] - ball
            away = np.linalg.norm(way)
            assert got[UP] == pytest.approx(away - 0.15, abs=1e-9)
            own, other = got[OWN:OTHER], got[OTHER:]
            np.testing.assert_allclose(own, ball + 0.1 * way / away, atol=1e-9)
            np.testing.assert_allclose(other, own + got[UP] * way / away, atol=1e-9)


@pytest.mark.parametrize("low", [0.0, 0.25, 1.0, 1.5, 2.0])
@pytest.mark.parametrize("high", [2.0, 2.5, 3.0])
def test_a_stretch_begins_and_ends_where_it_is_asked(low: float, high: float) -> None:
    """Of a ball that leaves and one that comes each is nearest at its own end."""
    slide = Tree((Joint(0, Kind.PRISMATIC, (1.0, 0.0, 0.0), column=0),))
    bodies = [Body(frame, (Hull(np.array([[x, 0.0, 0.0]]), 0.1),))
              for frame, x in ((1, 0.0), (0, -1.0), (0, 5.0))]  # fmt: skip
    pairs = PairTable.of([Pair(0, 1), Pair(0, 2)])
    path = Path(np.arange(4.0)[:, None])
    proving = start_proof(slide, bodies, path, pairs)
    found = stretches.Stretches(proving, np.arange(2)).over(low, high)
    touched = max(1, ceil(high) - floor(low))
    assert found.in_time and found.counts[:, CERTIFIED].tolist() == [touched] * 2
    np.testing.assert_allclose(found.upper, [0.8 + low, 4.8 - high], atol=1e-9)
    np.testing.assert_allclose(found.interval + found.share, [low, high], atol=1e-12)


@pytest.mark.parametrize("parts", [2.0, 0.5])
def test_the_shortest_slices_are_split_no_more(parts: float) -> None:
    """Of a joint that turns so fast that not even the shortest slice proves a thing."""
    turn = Tree((Joint(0, Kind.REVOLUTE, column=0),))
    bodies = [Body(k, (Hull(np.array([[x, 0.0, 0.0]]), 0.1),))
              for k, x in ((1, 1.0), (0, 9.0))]  # fmt: skip
    path, pairs = Path(np.array([[0.0], [1e12]])), PairTable.of([Pair(0, 1)])
    proving = start_proof(turn, bodies, path, pairs)
    work, row = proving.work, np.zeros(SLICE)
    slicing = search.Slicing(proving.task, proving.motion, work.ends, work.space)
    row[START], row[END], row[KEY] = 0.5, 0.5 + parts * search.SHORTEST, -np.inf
    heap = np.zeros((8, SLICE))
    asked, expected = plain(search.new_witness)(), 2 if parts > 1.0 else 1
    found = plain(search.resolve)(slicing, heap, row.copy(), asked)
    assert found == (UNDECIDED, expected)
    heap[0], met = row, plain(search.new_witnesses)(1, 9.0)
    assert plain(search.tighten)(slicing, heap, 1, met) == expected
    rules = proving.task.rules._replace(until=0.0)  # nor any without time
    late = slicing._replace(task=proving.task._replace(rules=rules))
    heap[0, END] = 1.0
    assert plain(search.tighten)(late, heap, 1, met) == 1
    assert plain(search.resolve)(late, heap, heap[0].copy(), asked) == (UNDECIDED, 1)


def test_the_first_block_is_looked_at_again_when_it_holds_the_least() -> None:
    """Rows of the last block stand there; oracle: the first rows by themselves."""
    rng, turn = np.random.default_rng(41), Tree((Joint(0, Kind.REVOLUTE, column=0),))
    corners = rng.uniform(-0.2, 0.2, (2, 9, 3))
    corners[:, :, 0] += [[1.0], [1.6]]
    bodies = [Body(k, (Hull(c),)) for k, c in zip((1, 0), corners, strict=True)]
    near, far = np.linspace(-0.3, 0.3, 9), np.linspace(0.4, 2.0, BLOCK)
    few, whole = (prove(turn, bodies, Path(row[:, None]), [Pair(0, 1)])
                  for row in (near, np.append(near, far)))  # fmt: skip
    assert whole.lower[0] == pytest.approx(few.lower[0], abs=1.1e-6)
    assert whole.upper[0] == pytest.approx(few.upper[0], abs=1.1e-6)
    assert 0.0 < whole.lower[0] <= whole.upper[0] <= whole.lower[0] + 1.1e-6
    assert whole.interval[0] < 8


def test_a_sweep_that_is_out_of_time_judges_nothing() -> None:
    slide = Tree((Joint(0, Kind.PRISMATIC, (1.0, 0.0, 0.0), column=0),))
    bodies = [Body(k, (Hull(np.array([[2.0 * k, 0.0, 0.0]]), 0.1),)) for k in (0, 1)]
    pairs, path = PairTable.of([Pair(0, 1)]), Path(np.zeros((4, 1)))
    for until in (0.0, np.inf):
        budget = Budget(until=until)
        proving = start_proof(slide, bodies, path, pairs, budget=budget)
        plain(fill_rows)(proving.task, proving.motion, proving.work.rows, 0, 3)
        block = Block(0, 0, 3, LOOSELY)
        assert plain(sweep_pair)(proving.sweeping, 0, block) == (until > 0.0)
        assert proving.results.counts.sum() == (3 if until > 0.0 else 0)


def test_no_intervals_are_told_without_room_or_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    slide = Tree((Joint(0, Kind.PRISMATIC, (1.0, 0.0, 0.0), column=0),))
    bodies = [Body(k, (Hull(np.array([[2.0 * k, 0.0, 0.0]]), 0.1),)) for k in (0, 1)]
    pairs, path = PairTable.of([Pair(0, 1)]), Path(np.zeros((4, 1)))

    def told(until: float) -> bool:
        budget = Budget(until=until)
        proving = start_proof(slide, bodies, path, pairs, budget=budget)
        return stretches.Stretches(proving, np.arange(1)).each() is not None

    assert told(np.inf) and not told(0.0)
    for most in (3, 2):
        monkeypatch.setattr(stretches, "MOST_BRACKETS", most)
        assert told(np.inf) == (most == 3)


def test_what_finds_no_room_for_a_second_look_is_not_said_to_be_clear() -> None:
    """Two balls, passed in the middle of each interval: no row is as near as that."""
    turn = Tree((Joint(0, Kind.REVOLUTE, column=0),))
    bodies = [Body(1, (Hull(np.array([[1.0, 0.0, 0.0]]), 0.1),)), *(
        Body(0, (Hull(np.array([[1.5, 0.0, z]]), 0.1),)) for z in (0.3, -0.3)
    )]  # fmt: skip
    path = Path(np.array([-0.2, 0.2, -0.2, 0.2])[:, None])
    nearest = np.hypot(0.5, 0.3) - 0.2
    for slices, candidates in [(1, 1), (1, 2), (2, 2), (3, 3), (9, 9)]:
        budget = Budget(slices=slices, candidates=candidates)
        asked = [Pair(0, 1), Pair(0, 2)]
        proof = prove(turn, bodies, path, asked, budget=budget)
        assert proof.is_certified
        assert (proof.lower <= nearest + 1e-9).all()
        assert (proof.upper >= nearest - 1e-9).all()


def test_what_errors_added_is_forgotten_with_them() -> None:
    """The same working space is asked with errors and then without."""
    turn = Tree((Joint(0, Kind.REVOLUTE, column=0),))
    bodies = [Body(1, (Hull(np.array([[1.0, 0.0, 0.0]]), 0.1),)),
              Body(0, (Hull(np.array([[2.0, 0.0, 0.0]]), 0.1),))]  # fmt: skip
    pairs, path = PairTable.of([Pair(0, 1)]), Path(np.array([[0.0], [0.1]]))
    proving = start_proof(turn, bodies, path, pairs)

    def least(error: float) -> float:
        box = ErrorBox(np.array([error]), np.zeros(1), np.zeros(1))
        task = with_errors(proving.task, box)
        results = proving.new_results()
        assert replace(proving.fresh(results), task=task).sweep(0, 1)
        return float(results.best[0, LOW])

    without = least(0.0)
    assert least(0.3) < without - 0.01
    assert least(0.0) == pytest.approx(without, abs=1e-9)


def test_of_one_row_a_path_through_it_has_no_pieces() -> None:
    rates = np.zeros((1, 2))
    for given in ((None, None), (np.zeros(1), None), (None, rates)):
        path = Path.through(np.ones((1, 2)), *given)
        assert path.inner.shape == (0, 0, 2) and path.knots.tolist() == [[1.0, 1.0]]


def test_what_one_interval_proves_is_not_said_of_the_next() -> None:
    """Between two walls, which takes two planes, a ball comes nearer row by row."""
    slide = Tree((Joint(0, Kind.PRISMATIC, (1.0, 0.0, 0.0), column=0),))
    face = np.array([[0.0, y, z] for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    walls = tuple(Hull(face + np.array([x, 0.0, 0.0])) for x in (-1.0, 1.0))
    bodies = [Body(1, (Hull(np.zeros((1, 3)), 0.1),)), Body(0, walls)]
    for steps in (np.linspace(0.0, 0.85, 40), np.array([0.0, 0.3, 0.5, 0.6, 0.85])):
        pairs, path = PairTable.of([Pair(0, 1)]), Path(steps[:, None])
        proving = start_proof(slide, bodies, path, pairs)
        dense, _ = dense_of(proving)
        nearest = 0.9 - steps[1:]
        assert (dense.verdict == CERTIFIED).all()
        for column in range(dense.lower.shape[1]):
            np.testing.assert_allclose(dense.upper[:, column], nearest, rtol=0.03)
            assert (dense.lower[:, column] <= nearest + 1e-9).all()
            assert (dense.lower[:, column] >= 0.95 * nearest).all()


def test_a_clearance_held_serves_while_the_body_moves_less_than_the_slack() -> None:
    """Between two walls no plane serves: 60 mm at 0.9 m off take 60 looks or a few."""
    slide = Tree((Joint(0, Kind.PRISMATIC, (0.0, 1.0, 0.0), column=0),))
    face = np.array([[0.0, y, z] for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    walls = tuple(Hull(face + np.array([x, 0.0, 0.0])) for x in (-1.0, 1.0))
    bodies = [Body(1, (Hull(np.zeros((1, 3)), 0.1),)), Body(0, walls)]
    path, moved = Path(np.linspace(0.0, 0.06, 61)[:, None]), 0.06
    proving = start_proof(slide, bodies, path, PairTable.of([Pair(0, 1)]))
    assert proving.sweep(0, 60)
    looks = proving.results.tally[RENEWED]
    assert 1 <= looks <= ceil(moved / (0.9 * Budget().slack * 0.9)) + 1


def test_what_rounding_alone_leaves_open_is_not_subdivided() -> None:
    """A ball slides along a wall at exactly the clearance that is required."""
    slide = Tree((Joint(0, Kind.PRISMATIC, (0.0, 1.0, 0.0), column=0),))
    wall = np.array([[1.0, y, z] for y in (-9.0, 9.0) for z in (-9.0, 9.0)])
    bodies = [Body(1, (Hull(np.zeros((1, 3)), 0.25),)), Body(0, (Hull(wall),))]
    path, pairs = Path(np.array([[0.0], [1.0]])), PairTable.of([Pair(0, 1, 0.75)])
    proving = start_proof(slide, bodies, path, pairs)
    dense, used = dense_of(proving)
    assert dense.verdict[0, 0] == UNDECIDED
    assert used <= 2
    assert dense.lower[0, 0] == pytest.approx(0.75, abs=1e-8)
