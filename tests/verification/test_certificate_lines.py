"""How certificates round what planes prove."""

from fractions import Fraction

import numpy as np

from vdsm_pin.verification.certificate_lines import PER_METRE, _counted


def test_claims_leave_the_checker_room_where_they_may() -> None:
    """A ten-billionth of a metre, but never less than what is required."""
    rng = np.random.default_rng(0)
    for _ in range(2000):
        lower = float(rng.uniform(0.0, 10.0))
        required = lower - float(10.0 ** rng.uniform(-12.0, 0.0))
        written = _counted(lower, required)
        claim = (
            Fraction(written, PER_METRE) if type(written) is int else Fraction(written)
        )
        assert Fraction(required) <= claim <= Fraction(lower)
        if lower - required > 2.5 / PER_METRE:
            assert Fraction(lower) - claim >= Fraction(99, 100 * PER_METRE)
    assert _counted(2.2587605964, 0.0) == 22587605963
