"""Oracles: the same proof without rough versions, distances at sampled times."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from oracles.shortcuts import prove
from oracles.tree_queries import make_query

from vdsm_pin.arm.bodies import hull_distances
from vdsm_pin.geometry.arrays import FloatArray, distinct_rows
from vdsm_pin.geometry.convex import FewCorners, Hull
from vdsm_pin.proof.bodies import Body, ErrorBox, Pair, PairTable
from vdsm_pin.proof.parts import with_rough
from vdsm_pin.proof.terms import CERTIFIED
from vdsm_pin.proof.tree import Kind
from vdsm_pin.robots import hulls
from vdsm_pin.robots.hulls import FEW_CORNERS, few_corners
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.coal_hulls import hull_planes


def shrunk(body: Body, shares: Sequence[float], told: float = 1.0) -> Body:
    """The body, its one hull also known by some that are smaller by shares.

    Args:
        body: The body.
        shares: How much smaller; [-].
        told: Part of what is missed that is told; [-].
    """
    piece = body.pieces[0]
    if len(body.pieces) > 1 or not isinstance(piece, Hull) or len(piece.points) < 2:
        return body
    away = piece.points - piece.points.mean(axis=0)
    far = np.linalg.norm(away, axis=1).max()
    few = tuple(
        FewCorners(
            piece.points - share * away, told * share * far + TOLERANCES.arithmetic
        )
        for share in shares
    )
    return replace(body, pieces=(replace(piece, few=few),))


@pytest.mark.parametrize("degree", [1, 3, 5])
@pytest.mark.parametrize("seed", range(10))
def test_rough_versions_change_no_verdict(degree: int, seed: int) -> None:
    """Limits just missed and just kept; bodies that miss little and much."""
    rng = np.random.default_rng([degree, seed])
    for _ in range(5):
        query = make_query(rng, degree, int(rng.integers(1, 21)))
        share = float(10.0 ** rng.uniform(-4, -0.5))
        shares = [(share,), (share, 0.2 * share)][int(rng.integers(2))]
        bodies = [shrunk(body, shares) for body in query.bodies]
        off = float(10.0 ** rng.uniform(-8, -3))
        for required in (query.nearest + off, query.nearest - off):
            pairs = [Pair(0, 1, required)]
            rough = prove(query.tree, bodies, query.path, pairs)
            exact = prove(query.tree, query.bodies, query.path, pairs)
            assert rough.verdict[0] == exact.verdict[0]
            assert rough.lower[0] <= query.nearest + 1e-9
            if exact.lower[0] > 0.0:
                narrow = TOLERANCES.least_bracket + 1e-9
                assert rough.upper[0] - rough.lower[0] <= narrow


def test_bodies_that_miss_more_than_is_told_are_found_out() -> None:
    """Were what is missed not taken off, some wrong motions would be certified."""
    rng = np.random.default_rng(4)

    def is_wrong() -> bool:
        query = make_query(rng, 1, int(rng.integers(1, 6)))
        bodies = [shrunk(body, (0.3,), told=0.01) for body in query.bodies]
        pairs = [Pair(0, 1, query.nearest + 1e-4)]
        proof = prove(query.tree, bodies, query.path, pairs)
        return bool(proof.verdict[0] == CERTIFIED)

    assert any(is_wrong() for _ in range(60))


def test_where_errors_turn_all_corners_are_asked() -> None:
    """What a turn adds differs from corner to corner: few of them do not tell."""
    rng = np.random.default_rng(5)
    for _ in range(20):
        query = make_query(rng, 1, 3)
        n = len(query.tree.joints)
        box = ErrorBox(np.full(n, 0.01), np.zeros(n), np.zeros(n))
        bodies = [shrunk(body, (0.3,), told=0.01) for body in query.bodies]
        args = query.path, [Pair(0, 1, 0.0)], box
        rough = prove(query.tree, bodies, *args)
        exact = prove(query.tree, query.bodies, *args)
        assert rough.verdict[0] == exact.verdict[0]
        if any(joint.kind is Kind.REVOLUTE for joint in query.tree.joints):
            np.testing.assert_array_equal(rough.lower, exact.lower)


@pytest.mark.parametrize("n", [32, 600])
def test_few_corners_miss_no_more_than_they_tell(n: int) -> None:
    """A support of all corners exceeds that of few by no more, and by about as much."""
    rng = np.random.default_rng(n)
    ways = rng.normal(size=(20_000, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    for _ in range(3):
        points = 0.1 * ways[rng.integers(len(ways), size=n)]
        found = few_corners(points)
        asked = [few for many, few in FEW_CORNERS.items() if many <= n]
        assert [len(few.points) for few in found] == asked
        for few in found:
            more = (points @ ways.T).max(axis=0) - (few.points @ ways.T).max(axis=0)
            assert 0.8 * few.missed - 1e-6 <= more.max() <= few.missed


def test_what_is_inside_few_corners_is_not_asked_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A hull of many corners holds all points, by the planes of its faces."""
    rng = np.random.default_rng(3)
    ways = rng.normal(size=(3000, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    inner = 0.8 * rng.uniform(0.0, 1.0, (2400, 1)) * ways[:2400]
    on_skin, asked = 1.0 - 1e-12 * rng.uniform(size=(600, 1)), list[int]()

    def counted(points: FloatArray, corners: FloatArray) -> FloatArray:
        asked.append(len(points))
        return hull_distances(points, corners)

    monkeypatch.setattr(hulls, "hull_distances", counted)
    points = 0.1 * np.concatenate([inner, ways[2400:] * on_skin, ways[2400:]])
    hull = hulls.covering_hull(distinct_rows(points))
    planes = hull_planes(hull.points)
    assert planes is not None and 600 <= len(hull.points) <= 1200
    normals, offsets = planes
    assert (normals @ points.T - offsets[:, None]).max() <= hull.radius + 1e-15
    assert hull.radius <= 1e-9
    assert asked[0] <= 1200  # all that are not inner


def test_few_corners_of_few_are_none() -> None:
    """They would cost as much as all."""
    assert few_corners(np.random.default_rng(0).normal(size=(31, 3))) == ()


def test_bodies_of_one_hull_alone_have_rough_versions() -> None:
    """What both miss is missed by the version of a pair; all others have none."""
    rng = np.random.default_rng(7)
    away = [Hull(rng.normal(size=(4, 3))) for _ in range(3)]
    one, other = (shrunk(Body(k, (away[k],)), (0.1, 0.01)[: k + 1]) for k in (0, 1))
    two = Body(2, (one.pieces[0], away[2]))
    pairs = PairTable.of([Pair(0, 2, 0.5), Pair(2, 2, 0.25), Pair(1, 0, 0.125)])
    rough = with_rough([one, other, two], pairs)
    assert rough.original.tolist() == [0, 1, 2, 0, 1, 1]
    assert rough.pairs.rough.tolist() == [[3, -1], [-1, -1], [4, 5]]
    assert rough.pairs.one.tolist() == [0, 2, 1, 3, 4, 5]
    assert rough.pairs.other.tolist() == [2, 2, 0, 2, 3, 0]
    assert rough.pairs.required.tolist() == [0.5, 0.25, 0.125, 0.5, 0.125, 0.125]
    missed = [few.missed for body in (one, other) for few in body.pieces[0].few]
    told = [0.0, 0.0, 0.0, missed[0], missed[0] + missed[1], missed[2]]
    assert rough.pairs.loose.tolist() == told
    for k, few in ((3, one.pieces[0].few[0]), (5, other.pieces[0].few[1])):
        assert np.array_equal(rough.bodies[k].pieces[0].points, few.points)
