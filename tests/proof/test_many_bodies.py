"""Many bodies, where boxes settle most pairs: oracle, distances at many times."""

from dataclasses import fields

import numpy as np
import pytest
from oracles.shortcuts import prove, start_proof
from oracles.tree_queries import (
    SHAPES,
    at,
    clearances,
    random_path,
    random_pieces,
    random_placement,
    random_tree,
    unit,
    wrong_poses,
)

from vdsm_pin.geometry.arrays import FloatArray, same_arrays
from vdsm_pin.geometry.convex import Hull
from vdsm_pin.proof import rows, workspace
from vdsm_pin.proof.blocks import run_sweep
from vdsm_pin.proof.bodies import Body, ErrorBox, Pair, PairTable
from vdsm_pin.proof.broad_phase import FEW
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.proofs import Proof
from vdsm_pin.proof.proving import dense_rows
from vdsm_pin.proof.row_places import FEW_PLACES
from vdsm_pin.proof.rows import BLOCK
from vdsm_pin.proof.terms import CERTIFIED, REFUTED
from vdsm_pin.proof.tree import Joint, Kind, Tree
from vdsm_pin.tolerances import TOLERANCES


def random_scene(rng: np.random.Generator) -> tuple[Tree, list[Body], Path]:
    """A small arm with two bodies, a third that moves by itself, many at rest."""
    arm = random_tree(rng, int(rng.integers(2, 5)))
    other = Tree((Joint(0, Kind.PRISMATIC, column=0, placement=random_placement(rng)),))
    tree, bodies = arm.joined(other), []
    for frame in (
        arm.n_frames - 1,
        int(rng.integers(1, arm.n_frames)),
        tree.n_frames - 1,
    ):
        bodies.append(Body(frame, random_pieces(rng, str(rng.choice(SHAPES[:2])))))
    for k in range(FEW + 4):
        away = 3.0 * rng.normal(size=3) * rng.choice([0.2, 1.0, 5.0])
        shape = str(rng.choice(SHAPES[:5])) if k else "half-space"
        bodies.append(Body(0, tuple(moved(p, away) for p in random_pieces(rng, shape))))
    path = random_path(rng, tree, int(rng.integers(1, 5)), int(rng.choice([1, 3])))
    return tree, bodies, path


def moved(piece: object, away: FloatArray) -> object:
    """The same piece elsewhere; a half-space farther off."""
    fields = {name: getattr(piece, name) for name in piece.__dataclass_fields__}  # type: ignore[attr-defined]
    if "points" in fields:
        fields["points"] = fields["points"] + away
    elif "centre" in fields:
        fields["centre"] = fields["centre"] + away
    else:
        fields["offset"] = fields["offset"] - 3.0
    return type(piece)(**fields)


def pairs_of(bodies: list[Body]) -> list[Pair]:
    """Each that moves with each at rest, and with the last that moves."""
    found = [Pair(k, m) for k in range(3) for m in range(3, len(bodies))]
    return [*found, Pair(0, 2), Pair(2, 1)]


def sampled(
    tree: Tree, bodies: list[Body], path: Path, pairs: list[Pair]
) -> FloatArray:
    """Least clearances at many times of every interval, shape (n_pairs,)."""
    rows = [path.knots]
    for k in range(len(path.knots) - 1):
        part = Path(path.knots[k : k + 2], path.inner[k : k + 1])
        rows.append(at(part, np.linspace(0.0, 1.0, 101)))
    poses = tree.poses(np.concatenate(rows))
    found = [
        clearances(tree, (bodies[p.one], bodies[p.other]), poses).min() for p in pairs
    ]
    return np.array(found)


def holds(proof: Proof, met: FloatArray) -> None:
    """Brackets hold what was met; witnesses are no farther than the upper bound."""
    apart = met > 0.0
    assert (proof.lower[apart] <= met[apart] + 1e-9).all()
    assert (proof.lower <= proof.upper).all()
    gap = np.linalg.norm(np.diff(proof.points, axis=1)[:, 0], axis=1)[apart]
    assert (gap <= proof.upper[apart] + 1e-7).all()
    assert (gap >= met[apart] - 1e-3).all()


@pytest.mark.parametrize("seed", range(24))
def test_all_at_once_are_judged_as_each_alone(seed: int) -> None:
    rng = np.random.default_rng([31, seed])
    tree, bodies, path = random_scene(rng)
    pairs = pairs_of(bodies)
    met = sampled(tree, bodies, path, pairs)
    proof = prove(tree, bodies, path, pairs)
    holds(proof, met)
    assert ((proof.verdict == REFUTED) == (met < 0.0)).all()
    nearest = int(np.argmin(proof.upper))
    if met.min() > 0.0:
        narrow = TOLERANCES.least_bracket + 2.0 * TOLERANCES.bracket_gap
        assert proof.lower[nearest] >= proof.upper[nearest] - narrow
        assert proof.upper[nearest] <= met.min() + narrow
    limits = np.maximum(met, 0.0) + rng.choice([-2e-3, 1e-5, -0.3, -5.0], len(met))
    asked = [Pair(p.one, p.other, r) for p, r in zip(pairs, limits, strict=True)]
    again = prove(tree, bodies, path, asked)
    assert (again.verdict[limits > np.maximum(met, 0.0)] == REFUTED).all()
    far = (limits < met - 1.9e-3) & (met > 0.0)
    assert (again.verdict[far] == CERTIFIED).all()


@pytest.mark.parametrize("corners", [20, 700])
@pytest.mark.parametrize("seed", range(6))
def test_many_corners_on_its_axis_leave_a_capsule_what_it_is(
    seed: int, corners: int
) -> None:
    """Bodies that both move, few of whose corners are known before they are asked."""
    rng = np.random.default_rng([33, seed])
    tree, bodies, path = random_scene(rng)
    asked = [Pair(0, 2), Pair(2, 1), Pair(0, 4), Pair(2, 5)]
    drawn_out = [*(along(body, corners) for body in bodies[:3]), *bodies[3:]]
    few, many = (prove(tree, b, path, asked) for b in (bodies, drawn_out))
    holds(many, sampled(tree, bodies, path, asked))
    assert (many.verdict == few.verdict).all()
    assert ((many.lower <= few.upper) & (few.lower <= many.upper))[many.lower > 0].all()


def along(body: Body, count: int) -> Body:
    """A ball or capsule whose core has so many corners, evenly spread."""
    (piece,) = body.pieces
    shares = np.linspace(0.0, 1.0, count)[:, None]
    points = piece.points[0] + shares * (piece.points[-1] - piece.points[0])
    return Body(body.frame, (Hull(points, piece.radius),))


@pytest.mark.parametrize("seed", range(8))
def test_each_interval_is_bracketed_by_itself(seed: int) -> None:
    rng = np.random.default_rng([34, seed])
    tree, bodies, path = random_scene(rng)
    pairs, n = pairs_of(bodies), max(1, path.n_intervals)
    made = start_proof(tree, bodies, path, PairTable.of(pairs))
    dense = dense_rows(n, len(made.plan.owner))
    results = made.new_results()._replace(dense=dense)
    assert made.fresh(results).sweep(0, n)
    assert made.plan.owner.tolist() == list(range(len(pairs)))
    for k in range(n):
        part = Path(path.knots[k : k + 2], path.inner[k : k + 1])
        for number, pair in enumerate(pairs):
            two, time = (bodies[pair.one], bodies[pair.other]), dense.time[k, number]
            shares = np.array([*np.linspace(0.0, 1.0, 33), time])
            rows = at(part, shares) if len(path.knots) > 1 else path.knots
            met = clearances(tree, two, tree.poses(rows))
            if met.min() <= 0.0:
                assert dense.verdict[k, number] != CERTIFIED
                continue
            assert dense.verdict[k, number] == CERTIFIED
            assert 0.0 <= dense.lower[k, number] <= met.min() + 1e-9
            assert dense.upper[k, number] >= met[-1] - 1e-9
            way = dense.own[k, number] - dense.other[k, number]
            assert met[-1] - 1e-6 <= np.linalg.norm(way) <= dense.upper[k, number] + 0.6


@pytest.mark.parametrize("error", [0.0, 0.02])
@pytest.mark.parametrize("seed", range(6))
def test_yes_or_no_is_what_the_bounds_say(seed: int, error: float) -> None:
    """All limits just below what is proved, then one just above what is met."""
    rng = np.random.default_rng([38, seed])
    tree, bodies, path = random_scene(rng)
    box = ErrorBox(*(np.full(len(tree.joints), e) for e in (error, 0.0, 0.0)))
    every = pairs_of(bodies)
    proof = prove(tree, bodies, path, every, box)
    apart = [k for k in range(len(every)) if proof.lower[k] > 0.01]

    def answered(limits: dict[int, float]) -> bool:
        asked = [Pair(every[k].one, every[k].other, r) for k, r in limits.items()]
        made = start_proof(tree, bodies, path, PairTable.of(asked), box)
        return bool(run_sweep(made.sweeping, (0, made.n_intervals), True))

    kept = {k: float(proof.lower[k]) - 1e-4 for k in apart}
    assert answered(kept)
    for k in rng.choice(apart, min(3, len(apart)), replace=False).tolist():
        assert not answered(kept | {k: float(proof.upper[k]) + 1e-4})


@pytest.mark.parametrize("error", [0.0, 0.05])
@pytest.mark.parametrize("seed", range(2))
def test_full_blocks_are_bracketed_row_by_row(seed: int, error: float) -> None:
    """Bodies of every kind, over two blocks and one interval more, past balls."""
    rng = np.random.default_rng([36, seed])
    tree = random_tree(rng, 3)
    path = random_path(rng, tree, 2 * BLOCK + 2, 1)
    kinds = ["capsule", "triangle", "box", "cylinder"]
    bodies = [Body(tree.n_frames - 1, random_pieces(rng, kind)) for kind in kinds]
    bodies += [Body(0, (Hull(4.0 * unit(rng)[None], 0.1),)) for _ in range(2)]
    pairs = [
        Pair(i, j) for i in range(len(kinds)) for j in (len(kinds), len(kinds) + 1)
    ]
    box = ErrorBox(*(np.full(len(tree.joints), e) for e in (error, 0.0, 0.0)))
    made = start_proof(tree, bodies, path, PairTable.of(pairs), box)
    dense = dense_rows(path.n_intervals, len(pairs))
    results = made.new_results()._replace(dense=dense)
    assert made.fresh(results).sweep(0, path.n_intervals)
    poses = tree.poses(path.knots)
    for number, pair in enumerate(pairs):
        met = clearances(tree, (bodies[pair.other], bodies[pair.one]), poses)
        assert met.min() > 0.0
        lower, upper = dense.lower[:, number], dense.upper[:, number]
        assert (dense.verdict[:, number] == CERTIFIED).all()
        assert (lower >= 0.0).all()
        assert (lower <= np.minimum(met[1:], met[:-1]) + 1e-9).all()
        at_rows = np.isin(dense.time[:, number], [0.0, 1.0])
        there = np.where(dense.time[:, number] == 0.0, met[:-1], met[1:])
        assert (upper[at_rows] >= there[at_rows] - 1e-9).all()
        assert (upper >= lower).all()
        for row in range(BLOCK - 2, BLOCK + 2) if error else ():
            least = max(lower[row - 1], lower[row])
            for _ in range(16):
                wrong = wrong_poses(tree, path.knots[row], box, rng)[None]
                two = bodies[pair.other], bodies[pair.one]
                assert clearances(tree, two, wrong)[0] >= least - 1e-9


@pytest.mark.parametrize("seed", range(6))
def test_boxes_settle_all_that_is_far(seed: int) -> None:
    """Beside one ball that is near others 20 m off need no look of their own."""
    rng = np.random.default_rng([35, seed])
    tree = random_tree(rng, 3)
    path = random_path(rng, tree, 6, int(rng.choice([1, 3])))
    bodies = [Body(k, random_pieces(rng, "capsule")) for k in range(1, tree.n_frames)]
    n_bodies, near = len(bodies), int(rng.integers(FEW + 2))
    for k in range(FEW + 2):
        away = unit(rng) * (6.0 if k == near else rng.uniform(25.0, 40.0))
        bodies.append(Body(0, (Hull(away[None], 0.1),)))
    pairs = [Pair(i, j) for i in range(n_bodies) for j in range(n_bodies, len(bodies))]
    made = start_proof(tree, bodies, path, PairTable.of(pairs))
    assert made.prove().in_time
    settled = np.full((n_bodies, FEW + 2), path.n_intervals)
    settled[:, near] = 0
    assert np.array_equal(np.sort(made.broad.settled), np.sort(settled))
    assert (made.results.counts[:, CERTIFIED] == path.n_intervals).all()


@pytest.mark.parametrize("seed", range(8))
def test_no_wrong_pose_comes_nearer_than_is_proved(seed: int) -> None:
    rng = np.random.default_rng([32, seed])
    tree, bodies, path = random_scene(rng)
    pairs, n = pairs_of(bodies), len(tree.joints)
    box = ErrorBox(*(rng.choice([0.0, 0.02], n) for _ in range(3)))
    proof = prove(tree, bodies, path, pairs, box)
    for k in range(len(path.knots)):
        poses = wrong_poses(tree, path.knots[k], box, rng)
        for pair, lower in zip(pairs, proof.lower, strict=True):
            two = bodies[pair.one], bodies[pair.other]
            assert clearances(tree, two, poses[None])[0] >= lower - 1e-9 or lower < 0.0


@pytest.mark.parametrize("seed", range(3))
def test_nothing_is_read_that_was_not_written(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Places of corners and slices are used that were found: the rest may be NaN."""
    rng = np.random.default_rng([seed, 29])
    tree, bodies, path = random_scene(rng)
    for k in range(3):
        corners = np.array([0.2 * unit(rng) for _ in range(FEW_PLACES // 2)])
        bodies[k] = Body(bodies[k].frame, (Hull(corners),))
    pairs, shapes = pairs_of(bodies), list[tuple[int, ...]]()

    def filled(*shape: int) -> FloatArray:
        shapes.append(shape)
        return np.full(shape, np.nan)

    usual = prove(tree, bodies, path, pairs)
    for module in (rows, workspace):
        monkeypatch.setattr(module, "uncleared", filled)
    found = prove(tree, bodies, path, pairs)
    assert same_arrays(found, usual, [one.name for one in fields(Proof)])
    assert max(shape[0] for shape in shapes) > FEW_PLACES


@pytest.mark.parametrize("seed", range(4))
def test_generators_that_no_error_wrote_are_not_read(seed: int) -> None:
    """Room for them holds anything at first, whatever numbers or none."""
    rng = np.random.default_rng([seed, 39])
    tree, bodies, path = random_scene(rng)
    n, found = len(tree.joints), []
    box = ErrorBox(rng.choice([0.0, 0.02], n), np.zeros(n), rng.choice([0.0, 0.02], n))
    for filling in (0.0, np.nan, 1e9):
        made = start_proof(tree, bodies, path, PairTable.of(pairs_of(bodies)), box)
        made.work.space.body.swings[:] = filling
        assert made.work.space.body.swings.size and made.prove().in_time
        found.append(made.results)
    for one in found[1:]:
        assert same_arrays(one, found[0], ["best", "counts", "limit", "tally"])
