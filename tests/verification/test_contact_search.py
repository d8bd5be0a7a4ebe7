"""The search for contacts; oracle: a judge that knows when every pair is in contact."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.proof.terms import CERTIFIED, REFUTED, UNDECIDED
from vdsm_pin.verification.first_contact import (
    FINE_SHARE,
    LEAST_SHARE,
    FirstContact,
    first_contacts,
)
from vdsm_pin.verification.records import Pair

PAIRS = (Pair(1, "a"), Pair(1, other_link=3), Pair(2, "a"), Pair(2, other_link=4))
OF_OBSTACLES = np.array([True, False, True, False])
REQUIRED = {True: 0.5, False: 0.25}


@dataclass
class Truth:
    """When pairs are too close, and when nothing is known of them.

    Args:
        n: Intervals of the motion; 0 for a single row.
        contacts: First and last moment, by pair.
        unknown: The same of what cannot be decided.
        upper: Bound of each pair's clearance where it is too close; [m].
        times: Of the rows; None for none; [s].
    """

    n: int
    contacts: list[tuple[int, float, float]]
    unknown: list[tuple[int, float, float]] = field(default_factory=list)
    upper: FloatArray = field(default_factory=lambda: np.zeros(4))
    times: FloatArray | None = None
    asked: list[tuple[float, float]] = field(default_factory=list)

    @property
    def n_samples(self) -> int:
        return self.n + 1

    def times_at(self, moments: FloatArray) -> FloatArray | None:
        if self.times is None:
            return None
        return np.interp(moments, np.arange(self.n + 1), self.times)

    def judge(self, low: float, high: float) -> Any:
        """Stretches are of rows, or lie within one interval."""
        assert 0 <= low <= high <= max(1, self.n)
        assert (low == int(low) and high == int(high)) or high <= np.floor(low) + 1
        self.asked.append((low, high))
        verdict = np.full(4, CERTIFIED)
        for told, spans in ((UNDECIDED, self.unknown), (REFUTED, self.contacts)):
            for pair, begin, end in spans:
                if begin <= high and low <= end:
                    verdict[pair] = told
        upper = np.where(verdict == REFUTED, self.upper, 9.0)
        return SimpleNamespace(verdict=verdict, upper=upper)

    def noted(self) -> dict[bool, Any]:
        """In which intervals some pair of each kind is too close."""
        found = {kind: np.zeros(max(1, self.n), bool) for kind in (True, False)}
        for pair, begin, end in self.contacts:
            k = np.arange(max(1, self.n))
            found[bool(OF_OBSTACLES[pair])] |= (begin <= k + 1) & (k <= end)
        return found

    def found(self, noted: bool, shallow: float = 0.0) -> tuple[FirstContact, ...]:
        problem: Any = SimpleNamespace(
            required_clearance=REQUIRED[True], required_self_clearance=REQUIRED[False]
        )
        told = self.noted() if noted else None
        motion: Any = self
        whole = self.judge(0, self.n)
        self.asked.clear()
        return first_contacts(problem, PAIRS, whole, motion, self.judge, told, shallow)


def random_truth(rng: np.random.Generator) -> Truth:
    n = int(rng.choice([1, 3, 40, 700]))
    spans = []
    for _ in range(int(rng.integers(1, 4))):
        begin = float(rng.choice([0.0, rng.uniform(0, n), int(rng.integers(0, n))]))
        end = float(rng.choice([n, min(n, begin + rng.uniform(0.1, 3.0))]))
        spans.append((int(rng.integers(4)), begin, end))
    unknown = [(int(rng.integers(4)), *np.sort(rng.uniform(0, n, 2)).tolist())]
    return Truth(n, spans, unknown if rng.integers(2) else [], rng.uniform(-1, 1, 4))


@pytest.mark.parametrize("noted", [True, False])
@pytest.mark.parametrize("seed", range(60))
def test_contacts_begin_and_end_where_the_judge_says(seed: int, noted: bool) -> None:
    rng = np.random.default_rng([1, seed])
    truth, shallow = random_truth(rng), float(rng.choice([0.0, 0.3]))
    found = truth.found(noted, shallow)
    kinds = [kind for kind in (True, False)
             if any(OF_OBSTACLES[p] == kind for p, *_ in truth.contacts)]  # fmt: skip
    assert [bool(one.pair.obstacle) for one in found] == kinds
    for one, kind in zip(found, kinds, strict=True):
        mine = [c for c in truth.contacts if OF_OBSTACLES[c[0]] == kind]
        begin = min(first for _, first, _ in mine)
        # Two contacts that begin in one stretch of the last size may both be named.
        deep = all(truth.upper[p] < REQUIRED[kind] - shallow for p, *_ in mine)
        width = LEAST_SHARE if deep else FINE_SHARE
        assert begin - 5.1e-7 <= one.moment <= begin + width + 5.1e-7
        assert one.moment == round(one.moment, 6)
        at = [p for p, first, last in mine if first <= one.moment + 1e-6 and
              last >= begin]  # fmt: skip
        assert one.pair in [PAIRS[p] for p in at]
        doubt = [u for u in truth.unknown if OF_OBSTACLES[u[0]] == kind]
        if not any(first < one.moment + 1.0 for _, first, _ in doubt):
            assert one.clear_before
        if any(first <= begin - 1.0 for _, first, _ in doubt) and begin > 1.0:
            refuted = {c[0] for c in mine}
            if not refuted & {u[0] for u in doubt}:
                assert not one.clear_before
        assert np.isnan(one.time) and np.isnan(one.last_time)
        if not noted:
            assert np.isnan(one.last) and (one.intervals, one.stretches) == (0, 0)
            continue
        where, end = truth.noted()[kind], max(last for _, _, last in mine)
        assert end - FINE_SHARE - 5.1e-7 <= one.last <= end + 5.1e-7
        assert one.intervals == where.sum()
        padded = np.append(False, where)
        assert one.stretches == (padded[1:] & ~padded[:-1]).sum()


def test_the_nearest_of_the_pairs_in_contact_is_named() -> None:
    for upper, pair in (([0.1, 0, 0.2, 0], 0), ([0.2, 0, 0.1, 0], 2)):
        spans = [(0, 2.5, 3.0), (2, 2.5, 3.0)]
        truth = Truth(5, spans, upper=np.array(upper, float))
        (found,) = truth.found(noted=True)
        assert found.pair == PAIRS[pair]
        at_once = Truth(5, [(p, 0.0, 1.0) for p, *_ in spans], upper=truth.upper)
        (found,) = at_once.found(noted=True)
        assert (found.pair, found.moment, found.clear_before) == (
            PAIRS[pair],
            0.0,
            True,
        )


def test_at_the_first_row_the_pair_is_named_that_is_in_contact_there() -> None:
    """Another one that is nearer a moment later is not."""
    upper = np.array([0.2, 0.0, 0.1, 0.0])
    truth = Truth(5, [(0, 0.0, 1.0), (2, 1e-8, 1.0)], upper=upper)
    (found,) = truth.found(noted=True)
    assert (found.pair, found.moment) == (PAIRS[0], 0.0)


@pytest.mark.parametrize(
    ("pair", "span", "clear"),
    [(2, (1.2, 1.4), False), (1, (1.2, 1.4), True), (2, (4.5, 4.7), True)],
)
def test_doubt_before_a_contact_is_told_of_its_own_kind(
    pair: int, span: tuple[float, float], clear: bool
) -> None:
    for noted in (True, False):
        truth = Truth(9, [(0, 4.2, 5.0)], [(pair, *span)])
        (found,) = truth.found(noted)
        assert found.clear_before is clear


def test_an_end_just_past_a_row_is_told_as_finely() -> None:
    (found,) = Truth(5, [(0, 1.5, 2.00002)], upper=np.full(4, -1.0)).found(noted=True)
    assert found.last == pytest.approx(2.00002, abs=1.1e-6)


def test_a_contact_in_no_interval_that_was_noted_ends_where_it_begins() -> None:
    truth, problem = Truth(5, [(0, 1.50002, 2.5)]), SimpleNamespace(
        required_clearance=0.5, required_self_clearance=0.5
    )  # fmt: skip
    nothing = {kind: np.zeros(5, bool) for kind in (True, False)}
    asked: Any = problem, PAIRS, truth.judge(0, 5), truth, truth.judge, nothing
    (found,) = first_contacts(*asked)
    assert found.last == found.moment == pytest.approx(1.50002, abs=1.1e-6)
    assert (found.intervals, found.stretches) == (1, 1)


@pytest.mark.parametrize(
    ("pair", "upper", "width"),
    [(0, 0.2, LEAST_SHARE), (0, 0.4, FINE_SHARE), (0, 0.45, FINE_SHARE),
     (1, 0.1, LEAST_SHARE), (1, 0.2, FINE_SHARE)],
)  # fmt: skip
def test_a_shallow_contact_is_told_less_finely(
    pair: int, upper: float, width: float
) -> None:
    """What misses no more than 0.1 m of what is asked for is shallow."""
    truth = Truth(1, [(pair, 0.3, 0.7)], upper=np.full(4, upper))
    truth.found(noted=True, shallow=0.1)
    sizes = [high - low for low, high in truth.asked if high > low]
    assert min(sizes) == width


def test_intervals_with_one_between_them_are_two_stretches() -> None:
    (found,) = Truth(5, [(0, 0.5, 0.6), (0, 2.5, 2.6)]).found(noted=True)
    assert (found.intervals, found.stretches) == (2, 2)


def test_time_that_stands_still_is_not_halved() -> None:
    truth = Truth(2, [(0, 0.3, 1.7)], times=np.array([5.0, 5.0, 6.0]))
    (found,) = truth.found(noted=True)
    assert (found.moment, found.time) == (1.0, 5.0)
    assert found.last == pytest.approx(1.7, abs=1e-6)
    assert found.last_time == pytest.approx(5.7, abs=1e-6)


def test_stretches_grow_until_one_is_not_clear() -> None:
    truth = Truth(1000, [(0, 500.2, 501.0)])
    truth.found(noted=False)
    assert truth.asked[:3] == [(0, 64), (64, 192), (192, 448)]
    assert truth.asked[3] == (448, 960)
    assert truth.asked[4] == (448, 704)
    truth.found(noted=True)
    assert truth.asked[:2] == [(0, 500), (500, 501)]
    begun = Truth(1000, [(0, 0.2, 1.0)])
    begun.found(noted=True)
    assert begun.asked[0] == (0, 1)


def test_what_no_stretch_refutes_is_no_contact() -> None:
    truth, problem = Truth(300, []), SimpleNamespace(
        required_clearance=0.5, required_self_clearance=0.5
    )  # fmt: skip
    whole: Any = SimpleNamespace(
        verdict=np.array([REFUTED, 0, 0, 0]), upper=np.zeros(4)
    )
    asked: Any = problem, PAIRS, whole, truth, truth.judge
    assert first_contacts(*asked) == ()
    assert truth.asked == [(0, 64), (64, 192), (192, 300)]
    whole.verdict[0] = UNDECIDED
    truth.asked.clear()
    assert first_contacts(*asked) == () and not truth.asked


def test_a_single_row_is_one_interval() -> None:
    (found,) = Truth(0, [(1, 0.0, 0.0)]).found(noted=True)
    assert (found.moment, found.last, found.intervals, found.stretches) == (0, 0, 1, 1)
