"""Oracles: closed forms, and distances of two points of the bodies at sampled times."""

import subprocess
import sys
from math import ceil, floor

import numpy as np
import pytest
from oracles.shortcuts import prove, start_proof
from oracles.tree_queries import at, clearances, make_query, wrong_poses
from some_slow import few_of

from vdsm_pin.geometry.convex import HalfSpacePiece, Hull
from vdsm_pin.proof.bodies import Body, ErrorBox, Pair, PairTable
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.paths import Path, together
from vdsm_pin.proof.proofs import Proof
from vdsm_pin.proof.stretches import Stretches
from vdsm_pin.proof.terms import CERTIFIED, REFUTED, UNDECIDED
from vdsm_pin.proof.tree import Joint, Kind, Tree, free_tree, shifted
from vdsm_pin.tolerances import TOLERANCES

MM = 1e-3


def ball(frame: int, x: float, y: float, z: float, radius: float) -> Body:
    return Body(frame, (Hull(np.array([[x, y, z]]), radius),), f"ball {frame}")


def turning_arm() -> Tree:
    """A joint about z and a link of one metre, its end in frame 2."""
    turn = Joint(0, Kind.REVOLUTE, column=0, name="turn")
    return Tree((turn, Joint(1, placement=shifted(1.0, 0.0, 0.0), name="end")))


@pytest.mark.parametrize("degree", [1, 3, 5])
@pytest.mark.parametrize("seed", few_of(20, 6))
def test_brackets_hold_the_nearest_of_many_samples(degree: int, seed: int) -> None:
    """Random trees, all shapes, both sides moving; limits just missed and just kept."""
    rng = np.random.default_rng([degree, seed])
    for _ in range(5):
        query = make_query(rng, degree, int(rng.integers(1, 21)))
        args = query.tree, query.bodies, query.path
        off = float(10.0 ** rng.uniform(-8, -3))
        missed = prove(*args, [Pair(0, 1, query.nearest + off)])
        assert missed.verdict[0] != CERTIFIED
        proof = prove(*args, [Pair(0, 1, query.nearest - off)])
        assert proof.lower[0] <= query.nearest + 1e-9
        held(query, proof)
        held(query, prove(*args, [Pair(1, 0, query.nearest - off)]), swapped=True)


@pytest.mark.parametrize("seed", range(6))
def test_intervals_are_judged_as_each_by_itself(seed: int) -> None:
    """Pairs of several parts, some refuted and some certified in every interval."""
    rng = np.random.default_rng(seed)
    pieces = tuple(Hull(np.array([[x, 0.0, 0.0]]), 0.05) for x in (0.3, 0.6, 0.9))
    bodies = [Body(1, pieces, "arm"), *(
        ball(0, *rng.uniform(-1.0, 1.0, 2), 0.0, 0.1) for _ in range(3)
    )]  # fmt: skip
    pairs = [Pair(k, 0, 0.05) for k in (1, 2, 3)]
    path = Path(rng.uniform(-3.0, 3.0, (7, 1)))
    proving = start_proof(turning_arm(), bodies, path, PairTable.of(pairs))
    stretches = Stretches(proving, np.arange(proving.n_pairs))
    found = stretches.each()
    assert found is not None
    # REFUTED is the largest where nothing is undecided.
    verdicts, upper = (
        fold.reduceat(parts, np.searchsorted(proving.plan.owner, np.arange(3)), axis=1)
        for fold, parts in zip((np.maximum, np.minimum), found, strict=True)
    )
    assert CERTIFIED < REFUTED and (found[0] != UNDECIDED).all()
    assert len({*verdicts.ravel().tolist()}) == 2
    for k in range(6):
        one = prove(turning_arm(), bodies, Path(path.knots[k : k + 2]), pairs)
        np.testing.assert_array_equal(verdicts[k], one.verdict)
        assert (upper[k] >= one.upper - 1e-9).all()
        assert ((upper[k] < 0.05) == (one.verdict == REFUTED)).all()
        halves = [stretches.over(k + low, k + low + 0.5) for low in (0.0, 0.5)]
        worst = np.maximum(*(half.verdict for half in halves))
        np.testing.assert_array_equal(worst, one.verdict)


@pytest.mark.parametrize("seed", range(4))
def test_a_stretch_is_judged_whatever_was_asked_before(seed: int) -> None:
    """Whole intervals and parts of them, in any order: nothing goes on to the next."""
    rng = np.random.default_rng(seed)
    bodies = [Body(1, (Hull(np.array([[0.7, 0.0, 0.0]]), 0.05),), "arm"), *(
        ball(0, *rng.uniform(-1.0, 1.0, 2), 0.0, 0.2) for _ in range(12)
    )]  # fmt: skip
    pairs = [Pair(k, 0, 0.05) for k in range(1, 13)]
    path = Path(np.linspace(-3.0, 3.0, 25)[:, None])
    asked, met = (turning_arm(), bodies, path, PairTable.of(pairs)), 0

    def started() -> Stretches:
        return Stretches(start_proof(*asked), np.arange(12))

    stretches = started()
    for k in range(60):
        low, high = np.sort(rng.uniform(0.0, 24.0, 2))
        low, high = (floor(low), ceil(high)) if k % 2 else (low, high)
        fresh, found = started().over(low, high), stretches.over(low, high)
        np.testing.assert_array_equal(found.verdict, fresh.verdict)
        met += (found.verdict != CERTIFIED).sum()
    assert met


def held(query: object, proof: Proof, swapped: bool = False) -> None:
    """The bracket is narrow or the bodies meet; its witness is where it says."""
    at_witness = query.path.controls[0]  # type: ignore[attr-defined]
    share, t = proof.share[0], proof.share[0]
    while len(at_witness) > 1:
        at_witness = at_witness[:-1] + t * np.diff(at_witness, axis=0)
    poses = query.tree.poses(at_witness)  # type: ignore[attr-defined]
    found = clearances(query.tree, query.bodies, poses)[0]  # type: ignore[attr-defined]
    assert 0.0 <= share <= 1.0
    if proof.upper[0] < 0.0 or found < 0.0:
        return  # below zero the sign alone is meant
    assert proof.upper[0] == pytest.approx(found, abs=1e-7)
    narrow = TOLERANCES.least_bracket + 2.0 * TOLERANCES.bracket_gap
    assert proof.lower[0] >= proof.upper[0] - narrow
    one, other = proof.points[0][::-1] if swapped else proof.points[0]
    assert np.linalg.norm(one - other) == pytest.approx(found, abs=1e-7)
    assert proof.verdict[0] != REFUTED or found < query.nearest + 1e-9  # type: ignore[attr-defined]


def test_a_door_closes_a_tenth_of_a_millimetre_too_early() -> None:
    """An arm leaves a doorway as the door swings shut: a branch of the same tree."""
    arm, door = turning_arm(), free_tree()
    tree = arm.joined(door)
    panel = Hull(np.array([[0.0, y, z] for y in (0.0, 0.8) for z in (-1.0, 1.0)]), 0.02)
    bodies = [ball(2, 0.0, 0.0, 0.0, 0.05), Body(arm.n_frames + 5, (panel,), "door")]
    leaving = Path(np.array([[-0.5], [0.7]]), times=np.array([0.0, 1.0]))

    def closing(start: float) -> Path:
        """Hinged at x = 1.2, y = -0.9: it swings from along -x to along y."""
        q = np.zeros((2, 6))
        q[:, 0], q[:, 1], q[0, 3] = 1.0, -0.9, np.pi / 2.0
        return Path(q, times=np.array([start, start + 1.0]))

    def clearance(start: float) -> Proof:
        path = together(leaving, closing(start))
        return prove(tree, bodies, path, [Pair(0, 1, 0.0)])

    low, high = -0.7, 0.0  # the door that starts early hits the arm, the late one not
    assert clearance(low).verdict[0] == REFUTED
    assert clearance(high).is_certified
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        low, high = (
            (middle, high) if clearance(middle).lower[0] < 0.0 else (low, middle)
        )
    kept = prove(tree, bodies, together(leaving, closing(high)), [Pair(0, 1, 0.0)])
    assert kept.upper[0] < 1e-5
    missed = clearance(high - 2e-4)
    assert missed.verdict[0] == REFUTED
    points = missed.points[0]
    assert np.linalg.norm(points[0, :2]) < 1.06  # on the arm's ball


@pytest.mark.parametrize("deep", [1.1e-6, 1e-4, 1e-2])
@pytest.mark.parametrize("at", [0.0, 0.375, 0.5])
def test_a_contact_is_found_beside_an_instant_that_just_touches(
    at: float, deep: float
) -> None:
    """Two balls pass each other on a line: at one instant they touch but for rounding.

    With radii r and s, and p = r + s - deep off the line, they touch where the way to
    the nearest place is sqrt((r + s)^2 - p^2).
    """
    both, p = 0.3, 0.3 - deep
    half = np.sqrt((both - p) * (both + p))
    slide = Joint(0, Kind.PRISMATIC, column=0, axis=(1.0, 0.0, 0.0), name="slide")
    path = Path(np.array([[0.0], [0.09]]))
    for sense in (1.0, -1.0):
        x = 0.09 * at + sense * half
        bodies = [ball(0, x, p, 0.0, 0.1), ball(1, 0.0, 0.0, 0.0, 0.2)]
        proof = prove(Tree((slide,)), bodies, path, [Pair(0, 1, 0.0)])
        nearest = np.hypot(x - np.clip(x, 0.0, 0.09), p) - both
        assert (proof.verdict[0] == REFUTED) == (nearest < -1e-12)
        assert proof.lower[0] <= nearest + 1e-12


def test_a_spline_overshoots_between_clear_knots() -> None:
    tree, times = turning_arm(), np.array([0.0, 1.0, 2.0])
    q = np.array([[0.0], [0.5], [0.5]])
    rates = np.array([[0.0], [1.0], [0.0]])
    wall = Body(0, (HalfSpacePiece(np.array([0.0, -1.0, 0.0]), -0.56),), "wall")
    bodies, pairs = [ball(2, 0.0, 0.0, 0.0, 0.05), wall], [Pair(0, 1, 0.0)]
    assert prove(tree, bodies, Path(q), pairs).is_certified
    proof = prove(tree, bodies, Path.through(q, times, rates), pairs)
    assert proof.verdict[0] == REFUTED
    assert proof.interval[0] == 1
    assert 0.1 < proof.share[0] < 0.6


def test_errors_of_joints_placements_and_surfaces_count_as_stated() -> None:
    """A ball at the end of 1 m beside another: every error costs what it moves."""
    tree, path = turning_arm(), Path(np.zeros((1, 1)))
    bodies = [ball(2, 0.0, 0.0, 0.0, 0.1), ball(0, 1.0, 0.5, 0.0, 0.1)]

    def lower(**box: object) -> float:
        fields = {name: np.zeros(2) for name in ("joints", "shifts", "tilts")} | box
        return float(
            prove(tree, bodies, path, [Pair(0, 1)], ErrorBox(**fields)).lower[0]
        )

    assert lower() == pytest.approx(0.3, abs=1e-8)
    one, other = np.array([MM, 0.0]), np.array([0.0, MM])
    assert lower(joints=one) == pytest.approx(0.299, abs=2e-6)
    assert lower(tilts=one) == pytest.approx(0.299, abs=2e-6)
    assert lower(tilts=other) == pytest.approx(0.3, abs=1e-8)
    assert lower(shifts=other) == pytest.approx(0.299, abs=1e-8)
    assert lower(surfaces=one) == pytest.approx(0.299, abs=1e-8)
    assert lower(surfaces=one + other) == pytest.approx(0.298, abs=1e-8)


@pytest.mark.parametrize("seed", few_of(6, 3))
def test_no_motion_of_an_error_box_is_certified_wrongly(seed: int) -> None:
    rng = np.random.default_rng([3, seed])
    for _ in range(12):
        query = make_query(rng, int(rng.choice([1, 3])), int(rng.integers(1, 13)))
        tree, n = query.tree, len(query.tree.joints)
        box = ErrorBox(*(rng.choice([0.0, 0.01], n) for _ in range(3)))
        proof = prove(tree, query.bodies, query.path, [Pair(0, 1)], box)
        for t in rng.uniform(size=15):
            q = at(query.path, np.array([t]))[0]
            poses = wrong_poses(tree, q, box, rng)
            found = clearances(tree, query.bodies, poses[None])[0]
            assert found >= proof.lower[0] - 1e-9 or proof.lower[0] < 0.0


def test_bodies_of_many_parts_and_half_spaces_are_told_apart() -> None:
    tree = turning_arm()
    parts = tuple(Hull(np.array([[x, 0.0, 0.0]]), 0.05) for x in (-0.5, 0.0))
    floor = Body(0, (HalfSpacePiece(np.array([0.0, 1.0, 0.0]), -0.3),), "floor")
    many = Body(0, tuple(Hull(np.array([[x, 0.4, 0.0]]), 0.1) for x in (-1.0, 1.0)))
    path = Path(np.array([[0.0], [0.2]]))
    pairs = [Pair(0, 1), Pair(1, 0), Pair(0, 2), Pair(2, 0)]
    proof = prove(tree, [Body(2, parts, "arm"), floor, many], path, pairs)
    assert proof.lower[0] == proof.lower[1]
    assert 0.24 <= proof.lower[0] <= 0.25  # not the least of all: as wide as it may be
    end = np.array([np.cos(0.2), np.sin(0.2)])
    nearest = np.linalg.norm(end - [1.0, 0.4]) - 0.15
    assert proof.lower[2:] == pytest.approx(nearest, abs=1e-5)
    np.testing.assert_array_equal(proof.points[0], proof.points[1][::-1])


def test_a_joint_that_nobody_counts_would_be_caught() -> None:
    """The door's branch left out of the way: its motion is not seen, wrongly green."""
    arm, door = turning_arm(), free_tree()
    tree = arm.joined(door)
    bodies = [ball(2, 0.0, 0.0, 0.0, 0.05), ball(arm.n_frames + 5, 0.0, 0.0, 0.0, 0.05)]
    q = np.zeros((2, 7))
    q[:, 1] = 1.0
    q[:, 2] = 1.0, -1.0  # it passes the arm's end
    pair = PairTable.of([Pair(0, 1, 0.01)])
    assert prove(tree, bodies, Path(q), pair).verdict[0] == REFUTED
    blind = q.copy()
    blind[:, 2] = 1.0
    assert prove(tree, bodies, Path(blind), pair).is_certified


def test_what_is_not_judged_in_time_is_undecided() -> None:
    tree, path = turning_arm(), Path(np.array([[0.0], [0.2]]))
    bodies = [ball(2, 0.0, 0.0, 0.0, 0.05), ball(0, 0.0, 3.0, 0.0, 0.05)]
    proof = prove(tree, bodies, path, [Pair(0, 1)], budget=Budget(until=0.0))
    assert proof.verdict[0] == UNDECIDED and not proof.in_time
    assert prove(tree, bodies, path, [Pair(0, 1)]).is_certified
    assert not prove(tree, bodies, path, []).is_certified


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"bodies": [ball(5, 0, 0, 0, 1), ball(0, 0, 0, 0, 1)]}, "frame below 3"),
        ({"bodies": [ball(3, 0, 0, 0, 1), ball(0, 0, 0, 0, 1)]}, "frame below 3"),
        ({"bodies": [ball(2, 0, 0, 0, 1), ball(-1, 0, 0, 0, 1)]}, "frame below 3"),
        ({"bodies": [Body(2, ()), ball(0, 0, 0, 0, 1)]}, "0 pieces"),
        ({"bodies": [ball(2, 0, 0, 0, 1), ball(2, 1, 0, 0, 1)]}, "ride on one frame"),
        ({"path": Path(np.zeros((2, 2)))}, "the path has 2 columns, the tree 1"),
    ],
)
def test_what_does_not_fit_together_is_refused(
    change: dict[str, object], words: str
) -> None:
    asked: dict[str, object] = {
        "tree": turning_arm(),
        "bodies": [ball(2, 0, 0, 0, 0.1), ball(0, 0, 3, 0, 0.1)],
        "path": Path(np.zeros((2, 1))),
        "pairs": [Pair(0, 1)],
    }
    with pytest.raises(ValueError, match=words):
        prove(**(asked | change))  # type: ignore[arg-type]


def test_the_proof_is_importable_alone() -> None:
    script = (
        "import sys, vdsm_pin.proof.question; "
        "own = {n.split('.')[1] for n in sys.modules if n.startswith('vdsm_pin.')}; "
        "assert own <= {'proof', 'geometry', 'compiled', 'tolerances', 'kept', "
        "'startup', 'errors', 'text', 'units'}, own"
    )
    subprocess.run([sys.executable, "-c", script], check=True)
