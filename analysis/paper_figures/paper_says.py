"""Numbers printed in the paper, with the places where they stand."""

from typing import Final

MAX_PSI_DEG: Final = {"obs1": 39.0, "obs2": 42.0, "obs3": 30.0, "free": 32.0}
"""Largest link angle (section 6.2.3); [deg]."""

X0_MIN_MM: Final = -98.0
"""Smallest x0, between A1 and A2 (section 6.2.3); [mm]."""

X0_MAX_MM: Final = {"free": 465.0, "obs3": 538.0, "obs2": 591.0}
"""Largest x0 (section 6.2.3). The paper lists 465, 538 and 591 for four environments;
465 is reached without obstacles, 538 fits obs3 and 591 is left to obs2; [mm]."""

AXIS_DISTANCE_MM: Final = 265.0
"""The distance from the obstacle's axis is always above this (section 6.3); [mm]."""
