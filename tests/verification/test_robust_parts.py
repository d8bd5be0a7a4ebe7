"""What the largest joint error is made of, part by part; oracles: formulas, loops."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.geometry.solids import Box, Sphere
from vdsm_pin.problem.error_boxes import ErrorBox, ObstacleError
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.proof.layouts import BEST, LOW
from vdsm_pin.proof.terms import UNDECIDED
from vdsm_pin.time_limit import NO_LIMIT
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification import robust
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.robust import (
    AROUND,
    FACTORS,
    FEW,
    LARGEST,
    MANY,
    SPARE,
    STRETCH,
    _first_lost,
    _largest,
    _shuffled,
    largest_joint_error,
    refuted_joint_error,
    sturdiest,
    within_reach,
)

ARM, STEP = built_in("hrm8"), TOLERANCES.joint_error


@pytest.mark.parametrize("share", [-1.0, 0.0, 1e-9, 0.3, 0.5, 0.874, 0.876, 0.99, 1.0])
@pytest.mark.parametrize("most", [LARGEST, 2.0 * STEP, 0.5 * STEP])
def test_the_largest_that_holds_is_found_in_few_steps(
    share: float, most: float
) -> None:
    limit, asked = share * most, list[float]()

    def holds(error: float) -> bool:
        asked.append(error)
        assert 0.0 <= error <= most
        return error <= limit

    found = _largest(holds, most)
    if limit < 0.0:
        assert found == 0.0
    else:
        assert max(0.0, limit - STEP) <= found <= limit
    assert len(asked) <= 1 + 4 + np.ceil(np.log2(max(2.0, most / STEP)))
    assert asked[0] == most
    if share < 1.0:
        assert asked[1] == pytest.approx(max(0.0, most - max(STEP, most / 8.0)))


@pytest.mark.parametrize("end", [1, STRETCH, STRETCH + 1, 3 * STRETCH + 17])
def test_the_first_interval_that_is_lost_is_found(end: int) -> None:
    rng = np.random.default_rng(end)
    for lost in [None, 0, end - 1, *rng.integers(0, end, 6).tolist()]:
        asked = list[tuple[int, int]]()

        def holds(first: int, last: int, lost: int | None = lost) -> bool:
            asked.append((first, last))  # noqa: B023
            assert 0 <= first < last <= end
            assert last - first <= STRETCH
            return lost is None or not first <= lost < last

        assert _first_lost(holds, end) == lost
        if lost is None:
            assert asked == [(k, min(k + STRETCH, end)) for k in range(0, end, STRETCH)]
        assert len(asked) <= -(-end // STRETCH) + 9


def test_stretches_are_shuffled_in_one_way() -> None:
    for size in (0, 1, 2, 9, 300):
        firsts = range(0, STRETCH * size, STRETCH)
        assert sorted(_shuffled(firsts)) == list(firsts)
        assert _shuffled(firsts) == _shuffled(firsts)
    assert _shuffled(range(300)) != list(range(300))


def scene(count: int) -> PlanningProblem:
    """Balls that nobody looks at, and a box that may turn."""
    balls = [Sphere(f"ball {k}", np.full(3, 9.0), 0.1) for k in range(count - 1)]
    box = Box("box", np.full(3, 9.0), np.eye(3), np.array([1.0, 2.0, 2.0]))
    return PlanningProblem(ARM, Scene((*balls, box)), None, 0.01, name="p")


def test_what_no_error_brings_near_is_left_out() -> None:
    """Each angle moves what is beyond it by its error times the distance at most."""
    problem, errors = scene(4), ErrorBox(
        joint=0.02, base=0.03, base_turn=0.004, obstacle=0.05,
        obstacles=(ObstacleError("box", 0.05, 0.01),),
    )  # fmt: skip
    arm = replace(ARM, base_range=(-0.5, 4.0))
    problem = replace(problem, manipulator=arm)
    lengths, n = ARM.link_lengths, ARM.n_links
    moved = sum(
        2.0 * errors.joint * (lengths[i:].sum() + ARM.most_radius) for i in range(n)
    )
    moved += (
        errors.base + 0.05 + 0.01 * 3.0
    )  # a corner of the box is 3 m off its middle
    far = 4.0 + lengths.sum() + ARM.most_radius
    moved += errors.base_turn * (far + moved)
    bound = 0.01 + moved + SPARE
    clearances = bound + np.array([-1e-9, 1e-9, np.nan, 5.0])
    found = within_reach(problem, clearances, errors)
    assert [o.name for o in found.scene.obstacles] == ["ball 0", "ball 2"]
    assert within_reach(problem, clearances - 9.0, errors) is problem


@pytest.mark.parametrize("count", [MANY, MANY + 1])
def test_of_many_obstacles_the_near_ones_are_asked_first(
    count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem, motion, asked = scene(count), Any, list[tuple[int, float]]()

    def largest(some: PlanningProblem, *args: Any) -> float:
        asked.append((len(some.scene.obstacles), args[2]))
        return 0.001

    monkeypatch.setattr(robust, "_largest_of_all", largest)
    clearances = np.random.default_rng(1).permutation(np.linspace(0.0, 9.0, count))
    told: Any = problem, motion, ErrorBox()
    assert largest_joint_error(*told, clearances=clearances) == 0.001
    errors = ErrorBox(joint=0.001)
    near = within_reach(problem, clearances, errors)
    several = [(FEW + 1, LARGEST), (len(near.scene.obstacles), 0.001)]
    assert asked == (several if count > MANY else [(count, LARGEST)])
    asked.clear()
    largest_joint_error(*told)
    assert asked == [(count, LARGEST)]


def test_the_sturdiest_is_the_first_of_equals(monkeypatch: pytest.MonkeyPatch) -> None:
    looked = list[float]()

    def error_of(problem: Any, motion: float, *_: Any) -> float:
        looked.append(motion)
        return motion

    def certified(problem: Any, motion: float, errors: ErrorBox, *_: Any) -> bool:
        return errors.joint <= motion

    monkeypatch.setattr(robust, "largest_joint_error", error_of)
    monkeypatch.setattr(robust, "is_certified", certified)
    motions: Any = [0.2, 0.1, 0.3, 0.3, 0.25]
    assert sturdiest(scene(1), motions) == (2, 0.3)
    assert looked == [0.2, 0.3, 0.3]
    motions = [0.2, 0.1]
    assert sturdiest(scene(1), motions) == (0, 0.2)


@pytest.mark.parametrize("met_at", [0, 1, 2, 3])
@pytest.mark.parametrize("lost", [None, 3, AROUND + 5])
def test_counterexamples_are_sought_around_what_is_lost(
    lost: int | None, met_at: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    parts, asked = list[tuple[int, int]](), list[float]()

    class Motion:
        def part(self, first: int, last: int) -> str:
            parts.append((first, last))
            return "weakest"

    def gap(problem: Any, motion: Any, errors: ErrorBox, *_: Any) -> int | None:
        assert errors.joint == 0.01 + STEP
        assert errors.base == 0.5
        return lost

    def smallest(problem: Any, motion: str, errors: ErrorBox, *_: Any) -> list[float]:
        assert motion == "weakest"
        asked.append(errors.joint)
        return [0.4, 0.3, 0.5] if len(asked) > met_at else []

    monkeypatch.setattr(robust, "_first_gap", gap)
    monkeypatch.setattr(robust, "_smallest", smallest)
    motion: Any = Motion()
    found = refuted_joint_error(scene(1), motion, ErrorBox(base=0.5), 0.01)
    if lost is None:
        assert np.isnan(found) and not parts
        return
    assert parts == [(max(0, lost - AROUND), lost + AROUND + 2)]
    factors = [f * (0.01 + STEP) for f in FACTORS]
    assert asked == factors[: met_at + 1]
    assert found == 0.3 if met_at < len(FACTORS) else np.isnan(found)


def test_far_obstacles_are_left_out_where_a_counterexample_is_sought(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen = list[int]()

    def gap(problem: PlanningProblem, *_: Any) -> None:
        seen.append(len(problem.scene.obstacles))

    monkeypatch.setattr(robust, "_first_gap", gap)
    for count in (MANY, MANY + 1):
        clearances = np.where(np.arange(count) < 7, 0.0, 99.0)
        args: Any = scene(count), None, ErrorBox(), 0.01
        assert np.isnan(refuted_joint_error(*args, clearances=clearances))
    assert seen == [MANY, 7]


@pytest.mark.parametrize("seed", range(8))
def test_the_pairs_left_open_that_are_nearest_are_searched(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(seed)
    n, asked, swept = int(rng.integers(0, 9)), list[int](), list[tuple[int, int]]()
    counts, best = rng.integers(0, 2, (n, 3)), rng.normal(size=(n, BEST))
    errors = {k: None if rng.random() < 0.4 else rng.normal(size=17) for k in range(n)}
    held = SimpleNamespace(pair=lambda k: k)
    least = SimpleNamespace(
        lower=best[:, LOW], lower_interval=np.ones(n, int), counts=counts
    )
    proving = SimpleNamespace(
        n_intervals=7, sweep=lambda *interval: swept.append(interval),
        found=lambda _: least,
    )  # fmt: skip
    motion = SimpleNamespace(
        asked=held,
        proving=lambda _: proving,
        knots=SimpleNamespace(interval=lambda inner: inner),
    )

    def search(_: Any, k: int) -> Any:
        asked.append(k)
        found = None if errors[k] is None else SimpleNamespace(offsets=errors[k])
        return SimpleNamespace(smallest=lambda moments: found)

    monkeypatch.setattr(AskedMotion, "of_arm", lambda *_: motion)
    monkeypatch.setattr(robust, "least_clearances", lambda *_: least)
    monkeypatch.setattr(robust, "in_rows", lambda *_: least)
    monkeypatch.setattr(robust, "starts", lambda *_: ())
    monkeypatch.setattr(robust, "Search", search)
    told: Any = None
    found = robust._smallest(told, told, ErrorBox(), NO_LIMIT)
    left = [k for k in range(n) if counts[k, UNDECIDED]]
    assert asked == sorted(left, key=lambda k: best[k, LOW])[:3]
    assert swept == [(0, 7)]
    offsets = [errors[k] for k in asked]
    assert found == [np.abs(one[1:]).max() for one in offsets if one is not None]


@pytest.mark.parametrize("end", [1, STRETCH, 2 * STRETCH + 9])
def test_stretches_are_asked_and_then_the_whole(
    end: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The weakest interval decides, wherever it is."""
    rng, box = np.random.default_rng(end), ErrorBox(base=0.5)
    survived, asked = rng.uniform(0.01, 0.3, end), list[tuple[int, int]]()

    def holds(errors: ErrorBox, first: int, last: int) -> bool:
        assert errors.base == 0.5
        asked.append((first, last))
        return errors.joint <= survived[first:last].min()

    proof = SimpleNamespace(n_intervals=end, holds=holds)
    monkeypatch.setattr(robust, "YesOrNoProof", lambda *_: proof)
    told: Any = None
    found = robust._largest_of_all(told, told, box, LARGEST, NO_LIMIT)
    assert survived.min() - STEP <= found <= survived.min()
    stretches = [(k, min(k + STRETCH, end)) for k in range(0, end, STRETCH)]
    assert {*asked} == {*stretches, (0, end)} and asked[-1] == (0, end)
