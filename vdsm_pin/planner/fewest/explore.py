"""From coarse to fine: which searches are run, in which order, and when to stop.

Searches are counted, not timed: without a time limit the same problem gives the same
plan. A limit ends them, and puts proofs off. Within a limit a search that has not drawn
all goes on with insertions of other chance until it ends.
"""

import itertools
import logging
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from vdsm_pin.errors import NoWayOut, OutOfTime
from vdsm_pin.geometry.arrays import BoolArray
from vdsm_pin.planner.broad_phase import BroadPhase
from vdsm_pin.planner.fewest.added_nodes import fill, largest_start_angle, with_start
from vdsm_pin.planner.fewest.insertion import insert
from vdsm_pin.planner.fewest.judge import Judge, link_limit, link_margins
from vdsm_pin.planner.fewest.levels import (
    BESIDE,
    FULL,
    SEED,
    Effort,
    Insert,
    Level,
    Search,
    confined_first,
    later_levels,
)
from vdsm_pin.planner.fewest.roadmap import CostWeights, build_roadmap
from vdsm_pin.planner.fewest.route import tip_route
from vdsm_pin.planner.fewest.search import Found, Searched, search
from vdsm_pin.planner.fewest.shapes import one_knee_shapes
from vdsm_pin.planner.fewest.smoothing import mean_knees, sparser
from vdsm_pin.planner.fewest.stuck import Stuck
from vdsm_pin.planner.fewest.tip_routes import TipSpace
from vdsm_pin.planner.impossible.bounds import TipProof, prove_tips
from vdsm_pin.planner.impossible.cut_off import CutOffProof
from vdsm_pin.planner.impossible.last_link import hemmed_in
from vdsm_pin.planner.path_rows import PathRows, path_rows, rolled
from vdsm_pin.planner.upper_clearance import TIP_ONLY, held_from, last_link
from vdsm_pin.problem.desired_path import Blocked
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.progress import say
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES

SPREAD: Final = 0.381966
"""Part of a closed path by which places to enter it are apart (golden section); [-]."""

DIRECTION_STEP: Final = 0.08
"""Lattice step of the directions of shapes; [-]."""
KNEE_JOINTS: Final = 8
"""Largest number of joints at which a knee is tried."""

FEW_CELLS: Final = 16_000
"""Cells at which a first look for ways of the tip ends, a tenth or two of a second."""

ROOMY: Final = 0.96
"""Part of the tips at which some arm stands where nothing confines it; [-]."""

ONE_KNEE_DRAWS: Final = 0.75
"""Part of the path's tips at which some arm of one knee stands, from which on a roadmap
may draw the path with fewer knees than an insertion; [-]."""
FEW_KNEES: Final = 2.0
"""Mean number of knees of an insertion up to which no roadmap is asked for fewer."""

PROOF_SHARE: Final = 0.1
"""Part of the time left that a proof has after a level; [-]."""

LOG: Final = logging.getLogger(__name__)


@dataclass(frozen=True)
class Explored:
    """What the exploration came to.

    Args:
        judge: The judge of the level that found it.
        found: The best sequence, None if nothing can be drawn.
        rows: The desired path row by row.
        proof: Which of its rows nobody can reach.
        stuck: Where the insertion that came farthest ended, None without one.
    """

    judge: Judge
    found: Found | None
    rows: PathRows
    proof: TipProof
    stuck: Stuck | None = None

    @property
    def missing(self) -> float:
        """Length not drawn and not proved impossible; [m]."""
        return np.inf if self.found is None else self.found.missing

    @property
    def will_do(self) -> bool:
        """Whether what has been found is a plan, though more might be found."""
        whole = self.judge.problem.path.blocked is Blocked.FAIL
        return self.found is not None and not (whole and self.missing > 0.0)

    @property
    def knees(self) -> float:
        """Mean number of changed angles where the tip draws."""
        assert self.found is not None
        return mean_knees(self.judge, self.found.corners)

    def sparser(self) -> "Explored":
        """The same with knees taken away from its motion."""
        assert self.found is not None
        corners = sparser(self.judge, self.found.corners)
        return replace(self, found=replace(self.found, corners=corners))

    def beats(self, other: "Explored") -> bool:
        """Whether it draws more, or all that can be drawn with fewer knees."""
        if self.missing > 0.0 or other.missing > 0.0:
            return self.missing < other.missing
        return self.knees < other.knees

    @property
    def drawn(self) -> BoolArray:
        """Rows of the desired path that are drawn, shape (r,)."""
        drawn = np.full(len(self.rows.tips), self.found is not None)
        if self.found is not None:
            stations = self.found.route.stations
            for k in self.found.skipped:
                first, last = np.searchsorted(
                    self.rows.stations, stations[k - 1 : k + 1]
                )
                drawn[first : last + 1] = False
        return drawn


def explore(
    problem: PlanningProblem,
    clearance: BroadPhase,
    margin: float,
    weights: CostWeights,
    effort: Effort = FULL,
    soon: Deadline = NO_LIMIT,
) -> Iterator[Explored]:
    """Search level by level until all that can be drawn is drawn.

    Args:
        problem: What is asked.
        clearance: The clearance function; proofs do not see its margins.
        margin: Kept beyond the required clearance; [m].
        weights: What the strategy prefers.
        effort: How much is done before giving up.
        soon: From when on what has been found will do.

    Yields:
        What is known after each search: the best so far; first what is known before
        any search.

    Raises:
        NoWayOut: If the start is left at no level.
    """
    yield from _Exploration(problem, clearance, margin, weights, effort).run(soon)


class _Exploration:
    """Searches level by level, and what they have come to; see `explore`."""

    def __init__(
        self,
        problem: PlanningProblem,
        clearance: BroadPhase,
        margin: float,
        weights: CostWeights,
        effort: Effort,
    ) -> None:
        self.problem, self.clearance, self.margin = problem, clearance, margin
        self.weights, self.levels = weights, effort.levels
        self.later, self.proves = later_levels(effort.levels), effort.proves
        self.begin = time.monotonic()
        self.spaces: dict[tuple[float, float, int], TipSpace] = {}
        self.rows, self.room = path_rows(problem.path), Room(0.0, 0.0)
        self.bare = clearance.bare  # nothing is impossible for a margin
        self.proof = prove_tips(held_from(problem, TIP_ONLY), self.bare, self.rows.tips)
        first = self._judge(self.levels[0])
        self.best = Explored(first, None, self.rows, self.proof)
        self.proofs: tuple[Proving, ...] = (_CutOff(self.best), _hemmed_in)
        self.proofs = self.proofs if self.proves else ()
        self.no_way_out: NoWayOut | None = None

    def run(self, soon: Deadline) -> Iterator[Explored]:
        """What is known after each search."""
        yield self.best
        first = self.levels[0]
        while self.levels and not self.proof.undrawable.all():
            level = self._next_level()
            now = self._searched(level, soon)
            if now.beats(self.best):
                self.best = now
            self.best = replace(self.best, stuck=now.stuck)
            if isinstance(level, Insert) and self._takes_many_knees():
                self.levels = (BESIDE,)
                yield self.best
                continue
            yield self.best
            if not self.best.missing > 0.0 or (self.best.found and soon.passed):
                return
            if self.proofs and (level is first or isinstance(level, Insert)):
                self._prove(level)
                yield self.best
        if self.levels:
            return
        for prove in reversed(self.proofs):
            self.best = prove(self.bare, self.best, None)
            yield self.best
        if self.no_way_out and self.best.found is None and self.best.stuck is None:
            raise self.no_way_out
        yield from self._until_the_end(soon)

    def _until_the_end(self, soon: Deadline) -> Iterator[Explored]:
        """What is known after each insertion for which there is time besides.

        Which ones there are does not depend on the time, which only ends them.
        """
        deadline = self.clearance.deadline
        if not self.proves or deadline.end == np.inf:
            return
        for level in self.later:
            over = time.monotonic() - self.begin > deadline.patience
            if over or (self.best.found and soon.passed):
                return
            now = self._searched(level, soon)
            self.best = now if now.beats(self.best) else self.best
            self.best = replace(self.best, stuck=now.stuck)
            yield self.best
            if not self.best.missing > 0.0:
                return

    def _next_level(self) -> Level:
        """The next level, off the list of those that are left."""
        if self.best.found is None and self.room.confined:
            self.levels = confined_first(self.levels)
        level, self.levels = self.levels[0], self.levels[1:]
        return level

    def _searched(self, level: Level, soon: Deadline) -> Explored:
        """What one level comes to."""
        judge, stuck = self._judge(level), self.best.stuck
        now = Explored(judge, None, self.rows, self.proof, stuck)
        try:
            if isinstance(level, Insert):
                now = _inserted(now, self._space(level), level, soon)
            elif isinstance(level, Search):
                found, self.room = _look(
                    judge, level, self.rows, self.proof, self.weights
                )
                now = replace(now, found=found)
        except NoWayOut as error:
            self.no_way_out = error
        LOG.debug("%s: %.4f m missing", level, now.missing)
        return now

    def _takes_many_knees(self) -> bool:
        """Whether a roadmap may draw with fewer knees what an insertion draws whole.

        As many as can be are taken away from it first.
        """
        untried = BESIDE in self.levels and self.room.one_knee_draws
        if self.best.missing > 0.0 or not untried:
            return False
        with suppress(OutOfTime):
            self.best = self.best.sparser()
        return self.best.knees > FEW_KNEES

    def _prove(self, level: Level) -> None:
        """Ask whether it can be done at all: seldom needed, so only after a search."""
        inserts = [one for one in (level, *self.levels) if isinstance(one, Insert)]
        space = self._space(inserts[0]) if inserts else None
        with suppress(OutOfTime):  # it goes on after the next level
            clearance = self.bare.hurried(PROOF_SHARE)
            self.best = self.proofs[0](clearance, self.best, space)
            self.proofs = self.proofs[1:]
        self.proof = self.best.proof.take(self.best.rows.as_stated)

    def _judge(self, level: Level) -> Judge:
        """The judge of a level."""
        arm, weights = self.problem.manipulator, self.weights
        margins = link_margins(arm, weights.joint_error)
        # The way out of a start that is bent more than is liked must be allowed.
        bent = largest_start_angle(self.problem) + TOLERANCES.joint_limit
        least_ease = min(1.0, bent / link_limit(self.problem))
        worth = self.problem.required_clearance + self.margin
        worth += (level.slack + weights.clearance) * arm.total_length
        worth += 0.0 if margins is None else float(margins[-1])
        judge = Judge(
            self.problem,
            self.clearance,
            self.margin,
            level.slack * arm.total_length,
            level.finest * arm.total_length,
            max(level.ease, least_ease),
            margins,
        )
        return judge.with_rough(self.clearance.up_to(worth))

    def _space(self, level: Insert) -> TipSpace:
        """Ways of the tip, kept for insertions that look as finely."""
        key = level.slack, level.step, level.cells
        if key not in self.spaces:
            length = self.problem.manipulator.total_length
            required = self.problem.required_clearance + self.margin
            required += level.slack * length
            # Where it is least blocked tells where to look for a hole.
            exact = replace(self.clearance, floor=-np.inf)
            self.spaces[key] = TipSpace(
                self.problem, exact, required, level.step * length, level.cells
            )
        return self.spaces[key]


class Room(NamedTuple):
    """Parts of a roadmap's tips at which some arm stands."""

    everywhere: float
    """Of all tips; [-]."""

    on_path: float
    """Of those along the path; [-]."""

    @property
    def confined(self) -> bool:
        """Whether there are many tips at which no arm stands."""
        return self.everywhere < ROOMY

    @property
    def one_knee_draws(self) -> bool:
        """Whether arms with one knee stand along most of the path."""
        return self.on_path >= ONE_KNEE_DRAWS


def _leads_there(space: TipSpace, outcome: Explored) -> bool:
    """Whether ways of the tip lead to all stretches that are not drawn."""
    open_, tips = ~outcome.proof.undrawable, outcome.rows.tips
    # From one row to the next the path itself leads, unless a wall is between them.
    room = space.room._replace(required=outcome.judge.problem.required_clearance)
    led = open_[:-1] & (room.spare(tips[:-1], tips[1:]) >= 0.0)
    first = open_ & ~outcome.drawn & ~np.append(False, led)
    return all(space.leads_to(tip, FEW_CELLS) for tip in tips[first])


def _inserted(
    before: Explored, space: TipSpace, level: Insert, soon: Deadline
) -> Explored:
    """What an insertion comes to; into a closed path from another place too.

    Where it is entered farther on and drawn to its end, that place is the one to begin
    at. Where it is not entered at all, one far from the first is tried.

    Args:
        before: Judge, rows and what is proved of them.
        space: Has the ways of the tip.
        level: How thoroughly to look.
        soon: From when on what is not drawn yet is skipped.
    """
    path = before.judge.problem.path
    best = _once_inserted(before, space, level, soon)
    count = len(before.rows.tips) - 1
    if not path.closed or count < 2 or not best.missing > 0.0:
        return best
    first = 0
    if best.found is None:
        first = int(count * (SPREAD * (1 + level.seed) % 1.0))
    elif best.found.skipped[0] == 1:
        left = next(k for k in itertools.count(1) if k not in best.found.skipped) - 1
        station = best.found.route.stations[left]
        first = int(np.searchsorted(before.rows.stations, station)) % count
    if first == 0 or (best.found is not None and soon.passed):
        return best
    rows = before.rows.begun_at(first, path.length)
    proof = before.proof.take(rolled(count + 1, first))
    again = replace(before, rows=rows, proof=proof, stuck=best.stuck)
    other = _once_inserted(again, space, level, soon)
    return other if other.missing < best.missing else best


def _once_inserted(
    before: Explored, space: TipSpace, level: Insert, soon: Deadline
) -> Explored:
    undrawable = before.proof.undrawable
    found, stuck = insert(before.judge, space, before.rows, undrawable, level, soon)
    if stuck is None or (before.stuck and before.stuck.part >= stuck.part):
        return replace(before, found=found)
    say("an arm came %.0f %% of a way in", 100.0 * stuck.part)
    return replace(before, found=found, stuck=stuck)


Proving: TypeAlias = Callable[[BroadPhase, Explored, TipSpace | None], Explored]
"""Proves that rows cannot be drawn, in the time of a clearance function.

The ways of the tip that are known may show that there is nothing to prove.
"""


class _CutOff:
    """Rows of a path that no way of the tip is proved to lead to.

    Where ways of the tip to all of them are soon found, there are none.
    """

    def __init__(self, before: Explored) -> None:
        there = held_from(before.judge.problem, TIP_ONLY)
        self._proof = CutOffProof(there, before.rows.tips)

    def __call__(
        self, clearance: BroadPhase, outcome: Explored, space: TipSpace | None
    ) -> Explored:
        if space and _leads_there(space, outcome):
            return outcome
        found = self._proof.proved(clearance.deadline)
        return replace(outcome, proof=replace(outcome.proof, cut_off=found))


def _hemmed_in(
    clearance: BroadPhase, outcome: Explored, _: TipSpace | None
) -> Explored:
    """The outcome with rows not drawn where the last link is proved to have no room."""
    problem = outcome.judge.problem
    tips, proof = outcome.rows.tips, outcome.proof
    open_ = np.flatnonzero(~(outcome.drawn | proof.undrawable))
    hemmed = np.zeros(len(tips), dtype=np.bool_)
    enough = clearance.up_to(problem.required_clearance)
    there = held_from(problem, last_link(problem))
    hemmed[open_] = hemmed_in(there, enough, tips[open_])
    return replace(outcome, proof=replace(proof, hemmed_in=hemmed))


def _look(
    judge: Judge, level: Search, rows: PathRows, proof: TipProof, weights: CostWeights
) -> tuple[Searched | None, Room]:
    """One level: a roadmap, a search, and growth where it falls short.

    Returns:
        What it found, and at how many tips some arm of it stands.
    """
    problem = judge.problem
    arm = problem.manipulator
    length = arm.total_length
    coarse, back = level.coarse * length, level.back * length
    shapes = one_knee_shapes(arm, judge.limit, DIRECTION_STEP, KNEE_JOINTS)
    route = tip_route(problem, rows, proof.undrawable, coarse, back)
    roadmap = build_roadmap(judge, weights, route, shapes, level.around)
    roadmap, start_node = with_start(judge, roadmap, weights)
    rng, standing = np.random.default_rng(SEED), np.diff(roadmap.tip_nodes) > 0
    room = Room(float(standing.mean()), float(standing[route.layers].mean()))
    found = search(judge, roadmap, start_node, level.rounds)
    for _ in range(level.grow):
        if found is None or not found.missing > 0.0:
            break
        skipped = tuple(k for k in found.skipped if not route.undrawable[k])
        if back == 0.0 and found.bars_ways:
            break
        more = fill(judge, found.roadmap, found.lengths, skipped, rng, weights)
        if more is None:
            break
        again = search(judge, more, found.start_in(more), level.rounds)
        if again is None or not again.missing < found.missing:
            break
        found = again
    return found, room
