"""What a plane proves, and which pairs and lines there must be."""

from collections.abc import Iterator
from itertools import pairwise, product
from pathlib import Path as File
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from oracles.certificate_cases import SHAPES, random_case
from oracles.certificate_oracle import sealed
from oracles.tree_certificates import controls

from vdsm_pin.certificate_checker import check_certificate, claims
from vdsm_pin.certificate_checker.arm import Arm
from vdsm_pin.certificate_checker.balls import UP, Rejected
from vdsm_pin.certificate_checker.claims import Clearances, Plane, clearances, tiled
from vdsm_pin.certificate_checker.errors import reject_less
from vdsm_pin.certificate_checker.motion import Branch, Interval, Path, Slices
from vdsm_pin.certificate_checker.program import _unique
from vdsm_pin.certificate_checker.solids import Body, Pair, Solid
from vdsm_pin.certificate_checker.tree import SLIDES, TURNS, Joint, Tree


def test_a_plane_proves_what_the_formula_of_the_docs_says() -> None:
    """Support less reach, radii, what errors shift and what rounding may lose."""
    rng = np.random.default_rng(6)
    for _ in range(50):
        turn, slide, bent, shift, lost = rng.uniform(0, 0.02, 5)
        joints = [
            Joint(0, SLIDES, (0, 0, 1), np.eye(4), (0, 1.0, 0.0), (0.0, slide, 0.0)),
            Joint(1, TURNS, (0, 0, 1), np.eye(4), (1, 1.0, 0.0), (turn, 0.0, bent)),
        ]
        tree = Tree(joints)
        interval = Interval(tree, controls([0, 0.1], [0, shift]))
        slices = Slices(tree, [(interval, 0.0, 1.0)])
        radius, grown = rng.uniform(0.01, 0.1, 2)
        body = Body(2, Solid("ball", [[[0.5, 0.0, 0.0]]], radius=radius))
        points = np.array([0.0, 2.0, 0.0]) + rng.uniform(-0.5, 0.5, (3, 4, 3))
        rest = Solid("rest", points, origin=[4.0, 0.0, 0.0], radius=grown)
        pair, long = Pair(body, Body(0, rest, lost), 0.0), rng.uniform(0.1, 9.0)
        first, last = sorted(rng.choice(4, 2, replace=False))
        n = np.array([rng.uniform(-0.3, 0.3), 1.0, rng.uniform(-0.3, 0.3)])
        plane = Plane("", slices_of(interval), first, last, tuple(long * n), 0.0)
        (found,) = clearances(pair, [plane], slices)
        n /= np.linalg.norm(n)
        (reached,), (size,) = slices.reach(body, 0, np.zeros(1, np.int64), n[None])
        support = (points[first:last] @ n).min() - grown
        away = radius + lost + slide * UP
        most = size + np.abs(points).max() + 4.0 + grown + away
        expected = support - reached - away
        rounding = (64 + 8 * 2) * 2.0**-53 * most
        assert found == pytest.approx(expected - rounding, rel=0, abs=0.1 * rounding)


def slices_of(interval: Interval) -> tuple[Interval, float, float]:
    return interval, 0.0, 1.0


@pytest.mark.parametrize("length", [0.0, 1e-101, 1e101, np.inf, np.nan])
def test_a_direction_that_is_none_is_refused(length: float) -> None:
    tree = Tree([Joint(0, TURNS, (0, 0, 1), np.eye(4), (0, 1.0, 0.0), (0.0, 0.0, 0.0))])
    interval = Interval(tree, controls([0, 0]))
    pair = Pair(
        Body(1, Solid("a", [[[0.0, 0.0, 0.0]]])),
        Body(0, Solid("b", [[[0, 1.0, 0]]])),
        0.0,
    )
    planes = [
        Plane("", slices_of(interval), 0, 1, (0.0, y, 0.0), 0.0) for y in (1.0, length)
    ]
    with pytest.raises(Rejected, match="a direction has no length"):
        clearances(pair, planes, Slices(tree, [slices_of(interval)]))


@pytest.mark.parametrize(("off", "good"), [(0.9e-9, True), (1.1e-9, False)])
@pytest.mark.parametrize("axis", range(3))
def test_a_half_space_has_one_direction(axis: int, off: float, good: bool) -> None:
    """It may be off by 1e-9 a coordinate; what is proved is of the exact one."""
    tree = Tree([Joint(0, TURNS, (0, 0, 1), np.eye(4), (0, 1.0, 0.0))])
    interval = Interval(tree, controls([0, 0]))
    floor = Solid("floor", [[[0.0, 0.0, -2.0]]])
    floor.normal = np.array([0.48, 0.6, 0.64])
    pair = Pair(Body(1, Solid("a", [[[9.0, 0.0, 0.0]]])), Body(0, floor), 0.0)
    exact = -floor.normal
    n = exact.copy()
    n[axis] += off
    n[axis - 1] -= off * exact[axis] / exact[axis - 1]  # as long to the first order
    if abs(exact[axis]) > abs(exact[axis - 1]):
        n = exact + (n - exact) * exact[axis - 1] / exact[axis]
    planes = [Plane("", slices_of(interval), 0, 1, tuple(x), 0.0) for x in (exact, n)]
    slices = Slices(tree, [slices_of(interval)])
    if good:
        alike = clearances(pair, planes, slices)
        assert alike[0] == alike[1]
    else:
        with pytest.raises(Rejected, match="n is not the half-space's -normal"):
            clearances(pair, planes, slices)


def test_names_are_ignored_in_either_order_with_all_their_parts() -> None:
    names = ["link 1", "tool", "plate", "plate part 2", "wall", "wall part 1"]
    for a, b, one, other in product(names, repeat=4):
        arm = SimpleNamespace(
            arm=SimpleNamespace(
                bodies=[SimpleNamespace(name="plate")], ignore_pairs=[(a, b)]
            )
        )

        def meant(said: str, name: str) -> bool:
            return said == name or (said, name) == ("plate", "plate part 2")

        expected = (meant(a, one) and meant(b, other)) or (
            meant(b, one) and meant(a, other)
        )
        assert Arm._ignored(arm, one, other) is expected  # type: ignore[arg-type]


def test_a_certificate_without_an_interval_is_refused(tmp_path: File) -> None:
    case = random_case(np.random.default_rng(0), tmp_path, [SHAPES[0]])
    for kept in range(1, len(case.lines)):
        case.certificate.write_bytes(sealed(case.lines[:kept]))
        outcome = check_certificate(case.certificate, case.problem, case.trajectory)
        assert f"interval {kept - 1} is missing" in outcome.reason
        assert outcome.n_intervals == kept - 1


def test_as_much_as_is_proved_may_be_claimed_to_the_last_bit(
    tmp_path: File, monkeypatch: pytest.MonkeyPatch
) -> None:
    case, proved = random_case(np.random.default_rng(4), tmp_path, ["box"]), {}
    kept = claims.clearances

    def seen(pair: Pair, planes: list[Plane], slices: Slices) -> Any:
        found = kept(pair, planes, slices)
        for plane, most in zip(planes, found.tolist(), strict=True):
            proved[plane.place, plane.slice[1], plane.first] = most
        return found

    monkeypatch.setattr(claims, "clearances", seen)
    files = case.certificate, case.problem, case.trajectory
    assert check_certificate(*files).accepted
    every = []
    for line in case.lines[1:]:
        for pair, proof in zip(case.lines[0]["pairs"], line["proofs"], strict=True):
            place = f"interval {line['k']}, {' and '.join(pair)}"
            every += [((place, a, p[0]), p) for a, _, planes in proof for p in planes]
    for key, plane in every:
        plane[-1] = proved[key]
    case.certificate.write_bytes(sealed(case.lines))
    assert check_certificate(*files).accepted
    for key, plane in every[:: len(every) // 3]:
        plane[-1] = float(np.nextafter(proved[key], np.inf))
        case.certificate.write_bytes(sealed(case.lines))
        assert "claims" in check_certificate(*files).reason
        plane[-1] = proved[key]


@pytest.mark.parametrize(
    ("ranges", "reason"),
    [
        ([(0, 5), (5, 12)], ""),
        ([(0, 0), (0, 12)], "the pieces do not tile at 0 of 12"),
        ([(0, 5), (5, 5), (5, 12)], "the pieces do not tile at 5 of 12"),
        ([(0, 5), (4, 12)], "the pieces do not tile at 5 of 12"),
        ([(0, 5), (6, 12)], "the pieces do not tile at 5 of 12"),
        ([(0, 13)], "the pieces do not tile at 0 of 12"),
        ([(0, 11)], "the pieces end at 11 of 12"),
        ([], "the pieces end at 0 of 12"),
    ],
)
def test_pieces_are_tiled(ranges: list[tuple[int, int]], reason: str) -> None:
    interval = Interval(Tree([]), [])
    rest = Solid("rest", np.zeros((12, 3, 3)))
    pair = Pair(Body(0, Solid("body", [[[0.0, 0.0, 0.0]]])), Body(0, rest), 0.0)
    proof = [[0.0, 1.0, [[*both, 0, 0, 1, 0.5] for both in ranges]]]
    if reason:
        with pytest.raises(Rejected, match=reason):
            [*tiled(pair, proof, "", interval)]
    else:
        planes = [*tiled(pair, proof, "", interval)]
        assert [(one.first, one.last) for one in planes] == ranges


@pytest.mark.parametrize(
    ("ends", "reason"),
    [
        ([(0.0, 0.25), (0.25, 1.0)], ""),
        ([(0.0, 1.0)], ""),
        ([(0.0, 0.0), (0.0, 1.0)], "the slices do not tile at 0.0"),
        ([(0.25, 1.0)], "the slices do not tile at 0.0"),
        ([(0.0, 0.5), (0.25, 1.0)], "the slices do not tile at 0.5"),
        ([(0.0, 0.5), (0.75, 1.0)], "the slices do not tile at 0.5"),
        ([(0.0, 0.5)], "the slices end at 0.5"),
        ([(0.0, 1.0), (1.0, 1.5)], "the slices end at 1.5"),
        ([], "the slices end at 0.0"),
    ],
)
def test_slices_are_tiled(ends: list[tuple[float, float]], reason: str) -> None:
    interval, rest = Interval(Tree([]), []), Solid("rest", np.zeros((1, 1, 3)))
    pair = Pair(Body(0, Solid("body", [[[0.0, 0.0, 0.0]]])), Body(0, rest), 0.0)
    proof = [[*both, [[0, 1, 0, 0, 1, 0.5]]] for both in ends]
    if reason:
        with pytest.raises(Rejected, match=reason):
            [*tiled(pair, proof, "", interval)]
    else:
        planes = [*tiled(pair, proof, "", interval)]
        assert [one.slice for one in planes] == [(interval, *both) for both in ends]


def test_pairs_of_planes_for_single_pieces_are_told() -> None:
    """Among three pairs: none, one slice of two, and planes that tile all of it."""
    joint = Joint(0, SLIDES, (1, 0, 0), np.eye(4), (0, 1.0, 0.0))
    path = Path(Branch(np.array([[0.0], [0.1]]), None))
    wall = Solid("wall", [[[1.0, y, z] for y in (-1, 1)] for z in (-1, 1)])
    whole, first, second = [0, 2], [0, 1], [1, 2]
    proofs, pairs = [], []
    for k, slices in enumerate(
        [[[whole]], [[whole], [first, second]], [[first, second]]]
    ):
        body = Body(1, Solid(f"ball {k}", [[[0.0, 0.0, 0.0]]], radius=0.1))
        pairs.append(Pair(body, Body(0, wall), 0.0))
        ends = np.linspace(0.0, 1.0, len(slices) + 1).tolist()
        proofs.append([
            [*both, [[*of, 1, 0, 0, 0.5] for of in planes]]
            for both, planes in zip(pairwise(ends), slices, strict=True)
        ])  # fmt: skip
    clearances = Clearances(Tree([joint]), path, pairs)
    first_pose, by_pieces = clearances.check(iter([{"k": 0, "proofs": proofs}]))
    assert by_pieces == {*pairs[1:]}
    assert first_pose[1].entries()[3::4] == [0, 0, 0, 1]


def test_lines_end_with_the_last_interval_and_not_before() -> None:
    joint = Joint(0, SLIDES, (1, 0, 0), np.eye(4), (0, 1.0, 0.0))
    lines = [{"k": k, "proofs": []} for k in range(3)]
    for count in range(4):
        path = Path(Branch(np.array([[0.0], [0.1], [0.3]]), None))
        clearances = Clearances(Tree([joint]), path, [])
        if count == 2:
            clearances.check(iter(lines[:count]))
            continue
        told = "beyond the last row" if count > 2 else f"interval {count} is missing"
        with pytest.raises(Rejected, match=told):
            clearances.check(iter(lines[:count]))


@pytest.mark.parametrize("at_once", [0, 1, 5])
def test_planes_are_settled_before_more_wait_than_are_looked_at_at_once(
    at_once: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A plane that proves too little is told of before later lines are read."""
    monkeypatch.setattr(claims, "AT_ONCE", at_once)
    tree = Tree([Joint(0, SLIDES, (0, 0, 1), np.eye(4), (0, 1.0, 0.0))])
    rest = Solid("b", [[[0.0, 3.0, 0.0]]])
    pair = Pair(Body(1, Solid("a", [[[0.0, 0.0, 0.0]]])), Body(0, rest), 0.0)
    read = []

    def lines(wrong: int) -> Iterator[dict[str, Any]]:
        for k in range(20):
            read.append(k)
            lower = 3.1 if k == wrong else 2.9
            yield {"k": k, "proofs": [[[0.0, 1.0, [[0, 1, 0.0, 1.0, 0.0, lower]]]]]}

    path = Path(Branch(np.zeros((21, 1)), None))
    good = Clearances(tree, path, [pair])
    good.check(lines(-1))
    assert (good.n_intervals, good.n_claims) == (20, 20)
    for wrong in (0, 7):
        read.clear()
        with pytest.raises(Rejected, match="claims 3100 mm, proves 3000 mm"):
            Clearances(tree, path, [pair]).check(lines(wrong))
        assert wrong <= read[-1] <= wrong + at_once
        assert (read[-1] + 1) % (at_once + 1) == 0


@pytest.mark.parametrize("stated", [{"a": 1.0, "b": 2.0}, {"b": 2.0}, {}, [1.0], 1.0])
def test_errors_are_of_what_is_asked_for_and_of_nothing_else(stated: Any) -> None:
    reject_less({"a": 1.0}, {"a": 1.0})
    with pytest.raises(Rejected, match=r"numbers of each of \['a'\] alone"):
        reject_less(stated, {"a": 1.0})


def test_a_key_that_stands_twice_in_an_object_is_refused() -> None:
    assert _unique([("a", 1), ("b", 1)]) == {"a": 1, "b": 1}
    with pytest.raises(Rejected, match="a key is doubled"):
        _unique([("a", 1), ("b", 1), ("a", 1)])
