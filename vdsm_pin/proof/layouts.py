"""How rows of numbers are laid out that compiled code hands on."""

from typing import Final

SUPPORT: Final = 3
OWN_POINT: Final = 4
POINT: Final = 7
WIDTH: Final = 10
VERSION: Final = 11
HELD_CLEARANCE: Final = 12
HELD_AT: Final = 13
"""Layout of what a pair remembers: n (3), support in n, witness on the body in its
link's frame (3) and on the partner (3), width of the bracket when they were found less
what a rough version loses, the row of the pair or rough version that they are of; of a
partner of many pieces the clearance proved at one configuration, else -inf, and the
corners of the body there (3 each)."""

KEY: Final = 0
INTERVAL: Final = 1
PAIR: Final = 2
START: Final = 3
END: Final = 4
SLICE: Final = 5
"""Layout of a slice in a heap: lower bound, interval, pair, start, end."""

MET: Final = 0
MET_AT: Final = 1
INSTANT: Final = 2
KNOWN: Final = 3
"""Layout of a witness: least upper bound, its time, least bound of one instant, least
upper bound known from elsewhere."""

LOW: Final = 0
AT_LOWER: Final = 1
UP: Final = 2
AT_UPPER: Final = 3
TIME: Final = 4
OWN: Final = 5
OTHER: Final = 8
BEST: Final = 11
"""Layout of a pair's best row: lower bound and its interval, upper bound, its interval
and time, witnesses on the body and on the partner in the base frame (3 each). Until
`place_best` they are core points, of the body in its link's frame, of the partner in
its own."""

CANDIDATES: Final = 0
SLICES: Final = 1
RENEWED: Final = 2
LOST: Final = 3
TALLY: Final = 4
"""Layout of what is counted: candidates held, slices tried, planes found, candidates
that found no room."""

OF_INTERVAL: Final = 0
OF_PAIR: Final = 1
SLICE_START: Final = 2
SLICE_END: Final = 3
FIRST: Final = 4
LAST: Final = 5
PLANE_NORMAL: Final = 6
CLAIM: Final = 9
RECORD: Final = 10
"""Layout of a written plane: interval, pair, start and end of the slice, pieces [first,
last) counted from the obstacle's first, n (3) of any length, the clearance it
proves."""
