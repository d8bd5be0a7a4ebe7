"""Oracle: brute force over every interval."""

import made_up
import numpy as np

from vdsm_pin.report.thinning import MOST_ROWS, thinned

NONE = np.zeros(0, dtype=np.int64)


def test_short_motions_are_shown_whole() -> None:
    assert thinned(made_up.trajectory(50), NONE).complete


def test_remarkable_rows_survive_and_the_least_value_is_never_lost() -> None:
    n = 5 * MOST_ROWS
    shown = thinned(made_up.trajectory(n), np.array([1234, 77, n - 1, n, -3]))
    assert not shown.complete
    assert {0, 77, 1234, n - 1} <= set(shown.rows.tolist())
    assert np.all(np.diff(shown.rows) > 0)
    on_path = made_up.trajectory(n).on_path
    ends = np.flatnonzero(np.diff(on_path.astype(int)))
    assert set(ends) | set(ends + 1) <= set(shown.rows.tolist())


def test_least_values_bound_every_interval_whatever_the_bins() -> None:
    rng = np.random.default_rng(0)
    n = 3 * MOST_ROWS
    values = rng.uniform(-1.0, 1.0, (n - 1, 3))
    shown = thinned(made_up.trajectory(n), NONE)
    for stride in (1, 3, 7):
        first = np.arange(0, n - 1, stride)
        bins = np.minimum.reduceat(values, first, axis=0)
        least = shown.least(bins, first)
        assert least.shape == (len(shown.rows) - 1, 3)
        for j in rng.integers(0, len(least), 200):
            a, b = shown.rows[j], shown.rows[j + 1]
            truth = values[a:b].min(axis=0)
            if stride == 1:
                np.testing.assert_array_equal(least[j], truth)
            assert (least[j] <= truth).all()
    assert least.min() == values.min()


def test_one_row_has_one_value() -> None:
    shown = thinned(made_up.trajectory(1), NONE)
    least = shown.least(np.array([[2.0, 1.0]]), np.array([0]))
    np.testing.assert_array_equal(least, [[2.0, 1.0]])
