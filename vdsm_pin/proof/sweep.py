"""A sweep over the intervals of a motion: what is asked, and where answers go."""

from typing import NamedTuple

from vdsm_pin.proof.far_pairs import BroadPhase
from vdsm_pin.proof.motions import Motion
from vdsm_pin.proof.results import Results
from vdsm_pin.proof.terms import Task
from vdsm_pin.proof.workspace import Workspace


class Sweep(NamedTuple):
    """What compiled code judges intervals with.

    Args:
        task: The scene, pairs and rules.
        motion: Rows of joint values.
        work: Working space; what the pairs remember is carried on.
        results: Where to write.
        broad: For the pairs that are far.
    """

    task: Task
    motion: Motion
    work: Workspace
    results: Results
    broad: BroadPhase
