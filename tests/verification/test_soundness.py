"""The verifier against the adversarial corpus: never wrong, and decided 1 um away."""

import json
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.adversarial import (
    LINK_MOTIONS,
    MOTIONS,
    Batch,
    make_batch,
    make_link_batch,
)
from oracles.adversarial_bodies import SHAPES, pack
from oracles.adversarial_boxes import make_boxed
from oracles.adversarial_truth import as_data, exact_bracket, from_data, sample

from vdsm_pin.geometry.pieces import pack_pieces

ROOT = Path(__file__).parents[2]
SAMPLE = ROOT / "tests" / "oracles" / "adversarial_sample.json"
sys.path.insert(0, str(ROOT / "analysis"))

import soundness  # noqa: E402
from soundness import (  # noqa: E402
    CERTIFIED,
    REFUTED,
    SHARES,
    UNDECIDED_LIMIT,
    report,
    run,
    verdicts,
    whole,
)


def batch_of(motion: str, seed: int, size: int) -> Batch:
    rng = np.random.default_rng(seed)
    if motion in MOTIONS:
        return make_batch(rng, motion, size, 1e-12)
    while True:
        batch = make_link_batch(rng, motion, size, 1e-12)
        if batch.size:
            return batch


@pytest.mark.parametrize("motion", [*MOTIONS, *LINK_MOTIONS])
def test_the_corpus_knows_its_truth(motion: str) -> None:
    """Plane and points, in balls, agree with the stated clearance.

    The largest difference in 4,000 queries is 4e-13 m, with large boxes, and depends on
    the processor; no query is nearer to its limit than 1e-12 m.
    """
    batch = batch_of(motion, 3, 3 * len(SHAPES))
    for k in range(batch.size):
        lower, upper = exact_bracket(batch, k)
        assert float(upper) == pytest.approx(batch.excess[k], abs=5e-13)
        if motion != "pierce":
            assert float(lower) == pytest.approx(batch.excess[k], abs=5e-13)


def test_the_sample_is_the_generators() -> None:
    """Another numpy may draw other numbers; the sample then stands for itself.

    Another processor may round them otherwise.
    """
    stored = json.loads(SAMPLE.read_text())
    assert {data["motion"] for data in stored} == (
        set(SHARES) - {soundness.BOXES, *soundness.TREES}
    )
    assert {data["shape"] for data in stored} == {*SHAPES, "links"}
    for k in (0, 7, -1):
        assert as_data(from_data(stored[k]), 0) == stored[k]
    if stored[0] == (again := sample())[0]:
        one, other = ([(d["motion"], d["shape"]) for d in s] for s in (stored, again))
        assert one == other
        same = list(numbers(stored))
        np.testing.assert_allclose(list(numbers(again)), same, rtol=0, atol=1e-9)


def numbers(data: Any) -> Iterator[float]:
    """All numbers of nested lists and dictionaries, in order."""
    if isinstance(data, dict):
        data = list(data.values())
    if isinstance(data, list):
        for part in data:
            yield from numbers(part)
    elif isinstance(data, float | int):
        yield float(data)


def test_queries_are_packed_as_the_products_scenes_are() -> None:
    """Single pieces bit for bit; the triangles of meshes in another order."""
    batch = batch_of("none", 4, 200)
    mine = pack(batch.groups)
    theirs = pack_pieces([batch.pieces(k) for k in range(batch.size)])
    single = np.flatnonzero(np.diff(mine.first_piece) == 1)
    np.testing.assert_array_equal(mine.first_piece, theirs.first_piece)
    np.testing.assert_array_equal(mine.first_point, theirs.first_point)
    np.testing.assert_array_equal(mine.root, theirs.root)
    np.testing.assert_array_equal(mine.node_range, theirs.node_range)
    np.testing.assert_array_equal(mine.node_right, theirs.node_right)
    of_pieces = mine.first_piece[single]
    for name in ("kind", "radius", "centre", "axis", "extent"):
        found, wanted = getattr(mine, name), getattr(theirs, name)
        np.testing.assert_array_equal(found[of_pieces], wanted[of_pieces])
    for name in ("node_low", "node_high"):
        np.testing.assert_array_equal(
            getattr(mine, name)[mine.root], getattr(theirs, name)[mine.root]
        )
    for p in of_pieces:
        part = slice(mine.first_point[p], mine.first_point[p + 1])
        np.testing.assert_array_equal(mine.points[part], theirs.points[part])


@pytest.mark.parametrize("motion", [*MOTIONS, *LINK_MOTIONS])
def test_no_query_is_misjudged_within_a_whole_scene(motion: str) -> None:
    """As the product is called, culling and meshes in their own order included."""
    batch = batch_of(motion, 5, 60)
    asked, found = whole(batch)
    excess = batch.excess[asked]
    assert not ((found == CERTIFIED) & (excess < 0.0)).any()
    assert not ((found == REFUTED) & (excess > 0.0)).any()
    decided = found[np.abs(excess) > 1e-6]
    assert np.isin(decided, (CERTIFIED, REFUTED)).all()


def test_no_query_of_the_sample_is_misjudged() -> None:
    for data in json.loads(SAMPLE.read_text()):
        batch = from_data(data)
        lower, upper = exact_bracket(batch, 0)
        verdict = int(verdicts(batch)[0])
        assert verdict != CERTIFIED or bool(lower > 0), data
        assert verdict != REFUTED or bool(upper < 0), data
        if abs(data["excess"]) >= 1e-6:
            assert verdict == (CERTIFIED if data["excess"] > 0.0 else REFUTED), data


def test_an_error_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """A verifier that lies is found out, whichever way it lies."""
    for lie, name in ((CERTIFIED, "false certified"), (REFUTED, "false refuted")):
        monkeypatch.setattr(
            soundness, "verdicts", lambda batch, *_, lie=lie: np.full(batch.size, lie)
        )
        assert run(300, 1, 50)[name] > 100


def boxes_judged(seed: int) -> Counter[str]:
    """The tally of some error boxes."""
    tally: Counter[str] = Counter()
    rng = np.random.default_rng(seed)
    for _ in range(12):
        boxed = make_boxed(rng, 100, 1e-12)
        if boxed.batch.size:
            soundness.judge_boxed(boxed, rng, tally)
    return tally


def test_error_boxes_are_judged_rightly() -> None:
    tally = boxes_judged(3)
    assert tally["false certified"] == tally["false refuted"] == 0
    assert tally["undecided far"] == 0
    assert tally["far"] > 50
    assert tally["certified boxes attacked"] > 100


def test_a_verifier_that_forgets_the_errors_is_found_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    nominal = soundness.verdicts
    monkeypatch.setattr(soundness, "verdicts", lambda batch, errors: nominal(batch))
    assert boxes_judged(3)["false certified"] > 20


def test_attacks_alone_find_that_verifier_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without being told which motion of the box misses the clearance."""
    nominal = soundness.verdicts
    monkeypatch.setattr(soundness, "verdicts", lambda batch, errors: nominal(batch))
    lost = 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        boxed = make_boxed(rng, 100, 1e-12)
        if not boxed.batch.size:
            continue
        blind = replace(boxed, lost=np.zeros(boxed.batch.size, bool))
        tally: Counter[str] = Counter()
        soundness.judge_boxed(blind, rng, tally)
        lost += tally["false certified"]
    assert lost > 20


def no_errors(queries: int, seed: int, processes: int = 1) -> None:
    tally = run(queries, seed, 1000, processes)
    assert tally["queries"] >= queries
    assert tally["rechecked"] > queries / 1000
    assert tally["false certified"] == 0
    assert tally["false refuted"] == 0
    assert tally["undecided far"] < UNDECIDED_LIMIT * tally["far"]
    assert f"{tally['queries']:,} queries" in report(tally, "-")


def test_random_queries_are_judged_rightly() -> None:
    no_errors(5_000, 11)


@pytest.mark.slow
def test_ten_million_queries_are_judged_rightly() -> None:
    no_errors(10_000_000, 12, processes=2)
