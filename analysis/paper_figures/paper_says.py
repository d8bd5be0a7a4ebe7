"""Numbers printed in the paper, with the places where they stand."""

from typing import Final

MAX_PSI_DEG: Final = {"obs1": 39.0, "obs2": 42.0, "obs3": 30.0, "free": 32.0}
"""Largest link angle (section 6.2.3); [deg]."""

X0_MIN_MM: Final = dict.fromkeys(("free", "obs1", "obs3"), -98.0)
"""Smallest x0 (section 6.2.3), between A1 and A2, which obs2 has not; [mm]."""

X0_MAX_MM: Final = {"free": 465.0}
"""Largest x0 (section 6.2.3). The paper lists 465, 538 and 591 for the scenes with A1
and A2 and does not say which is whose; 465 is reached without obstacles; [mm]."""

AXIS_DISTANCE_MM: Final = 265.0
"""The distance from the obstacle's axis is always above this (section 6.3); [mm]."""
