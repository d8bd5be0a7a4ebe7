"""The verifier against the adversarial corpus: never wrong, and decided 1 um away."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from oracles.adversarial import (
    MOTIONS,
    SHAPES,
    as_data,
    exact_bracket,
    from_data,
    make_batch,
    sample,
)

ROOT = Path(__file__).parents[2]
SAMPLE = ROOT / "tests" / "oracles" / "adversarial_sample.json"
sys.path.insert(0, str(ROOT / "analysis"))

from soundness import CERTIFIED, REFUTED, UNDECIDED_LIMIT, run, verdicts  # noqa: E402


@pytest.mark.parametrize("motion", MOTIONS)
def test_the_corpus_knows_its_truth(motion: str) -> None:
    """Plane and points, in balls, agree with the stated clearance to 1e-13 m."""
    batch = make_batch(np.random.default_rng(3), motion, 4 * len(SHAPES), 1e-12)
    for k in range(len(batch.link)):
        lower, upper = exact_bracket(batch, k)
        assert float(lower) == pytest.approx(batch.excess[k], abs=1e-13)
        assert float(upper) == pytest.approx(batch.excess[k], abs=1e-13)


def test_the_sample_is_the_generators() -> None:
    """Another numpy may draw other numbers; the sample then stands for itself."""
    stored = json.loads(SAMPLE.read_text())
    assert len(stored) == 2 * len(MOTIONS) * len(SHAPES)
    assert as_data(from_data(stored[7]), 0) == stored[7]
    if stored[0] == (again := sample())[0]:
        assert stored == again


def test_no_query_of_the_sample_is_misjudged() -> None:
    for data in json.loads(SAMPLE.read_text()):
        batch = from_data(data)
        lower, upper = exact_bracket(batch, 0)
        verdict = int(verdicts(batch)[0])
        assert verdict != CERTIFIED or bool(lower > 0), data
        assert verdict != REFUTED or bool(upper < 0), data
        if abs(data["excess"]) >= 1e-6:
            assert verdict == (CERTIFIED if data["excess"] > 0.0 else REFUTED), data


def no_errors(queries: int, seed: int) -> None:
    tally = run(queries, seed, 2000)
    assert tally["queries"] == queries
    assert tally["false certified"] == 0
    assert tally["false refuted"] == 0
    assert tally["undecided far"] < UNDECIDED_LIMIT * tally["far"]


def test_random_queries_are_judged_rightly() -> None:
    no_errors(6_000, 11)


@pytest.mark.slow
def test_ten_million_queries_are_judged_rightly() -> None:
    no_errors(10_000_000, 12)
