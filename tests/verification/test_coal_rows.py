"""Coal's distances by key; oracle: a search through all rows."""

import numpy as np

from vdsm_pin.verification.brackets import CoalIndex, CoalRows


def test_of_each_key_the_least_distance_is_found() -> None:
    rng = np.random.default_rng(7)
    for _ in range(100):
        n = int(rng.integers(0, 30))
        keys, waypoint = rng.integers(0, 9, n), rng.permutation(n)
        distance = rng.choice([0.5, -0.25, 1.0, 2.0, np.nan], n) + rng.uniform(
            0, 0.1, n
        )
        rows = CoalRows(waypoint, np.zeros(n, np.int64), distance)
        wanted = rng.integers(0, 12, 20)
        found = CoalIndex(rows, keys).at(wanted)
        assert found.shape == (20, 2)
        for key, row in zip(wanted, found, strict=True):
            among = np.flatnonzero(keys == key)
            if not among.size:
                assert np.isnan(row).all()
                continue
            order = among[np.argsort(distance[among])]  # NaN last
            np.testing.assert_array_equal(row[1], distance[order[0]])
            if not np.isnan(row[1]):
                assert row[0] == waypoint[order[0]]
