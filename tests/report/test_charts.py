"""What a page is given of a number that single precision cannot hold."""

import base64

import numpy as np

from vdsm_pin.report.charts import packed


def test_numbers_too_large_for_a_plot_are_missing_in_it() -> None:
    found = np.frombuffer(base64.b64decode(packed([0.5, 1e300, np.nan])), "<f4")
    np.testing.assert_array_equal(found, [0.5, np.inf, np.nan])
