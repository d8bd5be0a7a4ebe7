"""Compiled trial of the rules of a side: which brings the tip farthest."""

from typing import NamedTuple

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.planner.paper.region_kernels import Core
from vdsm_pin.planner.paper.sliding_kernels import (
    Slide,
    Standing,
    extent_of,
    slide_chain,
    slide_of,
)


class Wanted(NamedTuple):
    """The tips that a rule is to reach."""

    tips: FloatArray
    """Sequences of projected tips, one after the other, shape (n, 2); [m]."""

    firsts: IntArray
    """Where each sequence begins, and n, shape (m + 1,)."""

    stride: int
    """Rules are compared on every so manieth tip, then confirmed on all."""


class Trials(NamedTuple):
    """The rules that are tried: each a line and a region."""

    lines: FloatArray
    """Directions as in `Slide`, shape (k, 2); [-]."""

    cores: FloatArray
    """Corners of the regions, shape (r, c, 2), filled up with anything; [m]."""

    n_corners: IntArray
    """How many each has, shape (r,)."""

    radii: FloatArray
    """Of the regions, shape (r,); [m]."""

    numbers: IntArray
    """Line and region of each trial, shape (t, 2)."""

    n_cross: int
    """How many of the trials are the cross; they come first."""


@compiled
def _reach(
    tip: FloatArray, stride: int, slide: Slide, able: Standing, most: float
) -> tuple[int, float]:
    """How many tip positions in a row a rule brings the arm to, from the first on.

    Args:
        tip: Projected, shape (n, 2); [m].
        stride: Every so manieth is looked at; the swing counts where all are.
        slide: The rule.
        able: When a configuration can be taken.
        most: Where the arm is shortened by as much or more, the rest is not looked at;
            [m].

    Returns:
        The count, and the largest shortening of the arm along X among them; [m].
    """
    links = able.links
    n_links = links.lengths.shape[0]
    chain = np.zeros((n_links + 1, 2))
    before, here = np.zeros((n_links, 3)), np.zeros((n_links, 3))
    total, shortening = links.lengths.sum(), 0.0
    largest_swing = able.largest_swing if stride == 1 else np.inf
    for k in range(0, tip.shape[0], stride):
        chain[n_links] = tip[k]
        slide_chain(slide, links, chain)
        extent = extent_of(chain, able, here)
        if extent < 0.0:
            return k, shortening
        if k > 0 and not np.abs(here - before).max() <= largest_swing:
            return k, shortening
        shortening = max(shortening, total - extent)
        if shortening >= most:
            return k, shortening
        before, here = here, before
    return tip.shape[0], shortening


@compiled
def _score(
    wanted: Wanted, slide: Slide, able: Standing, best: int, least: float
) -> tuple[int, float]:
    """How many of the wanted tips a rule reaches, and how far it shortens the arm.

    -1 as soon as the rule is seen to reach fewer than `best`, or as many and to shorten
    the arm by no less than `least`.
    """
    tips, firsts, stride = wanted
    reached, shortening = 0, 0.0
    most = least if best == len(tips) else np.inf
    for k in range(len(firsts) - 1):
        tip, rest = tips[firsts[k] : firsts[k + 1]], len(tips) - firsts[k + 1]
        needed = best - reached - rest
        if needed > 0:
            # The last waypoint it must reach is where most rules fail.
            last = (needed - 1) // stride * stride
            if _reach(tip[last : last + 1], 1, slide, able, most)[0] == 0:
                return -1, 0.0
        count, shortened = _reach(tip, stride, slide, able, most)
        if count == len(tip):
            count, shortened = _reach(tip, 1, slide, able, most)
        reached, shortening = reached + count, max(shortening, shortened)
        if reached + rest < best or shortening >= most:
            return -1, 0.0
    return reached, shortening


@compiled
def best_rule(wanted: Wanted, trials: Trials, side: int, able: Standing) -> int:
    """The rule that brings the tip farthest; of several, the one that shortens least.

    The first of the cross that does all that is wanted is taken at once.

    Args:
        wanted: The tips to be reached.
        trials: The rules that are tried.
        side: As in `Slide`.
        able: When a configuration can be taken.

    Returns:
        Number of the trial.
    """
    chosen, best, least = 0, -1, np.inf
    for trial in range(len(trials.numbers)):
        line, r = trials.numbers[trial]
        core = Core(trials.cores[r, : trials.n_corners[r]], trials.radii[r])
        slide = slide_of(core, side, trials.lines[line])
        reached, shortening = _score(wanted, slide, able, best, least)
        if reached > best or (reached == best and shortening < least):
            chosen, best, least = trial, reached, shortening
        if trial < trials.n_cross and reached == len(wanted.tips):
            break
    return chosen
