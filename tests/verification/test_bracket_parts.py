"""How brackets are cut, merged, corrected and written; oracle: loops over intervals."""

import json
from dataclasses import fields, replace
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from vdsm_pin import margins
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.arm.mounted import Feed
from vdsm_pin.certificate_writer import lines as certificate_lines
from vdsm_pin.errors import CertificateTooLarge
from vdsm_pin.geometry.solids import Sphere
from vdsm_pin.geometry.winding import Location, Side
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.layouts import (
    CLAIM,
    FIRST,
    LAST,
    PLANE_NORMAL,
    RECORD,
)
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.proofs import RANK
from vdsm_pin.proof.rows import BLOCK
from vdsm_pin.proof.terms import CERTIFIED, REFUTED, UNDECIDED
from vdsm_pin.time_limit import Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification import (
    clearance,
    clearances,
    coal_check,
    counterexample,
)
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.brackets import (
    ClearanceChunk,
    ClearanceProfile,
    LeastClearances,
)
from vdsm_pin.verification.clearance import (
    _merged,
    _steps,
    prove_clearance,
    prove_motion,
)
from vdsm_pin.verification.clearance_check import (
    Evidence,
    clearance_checks,
)
from vdsm_pin.verification.clearances import in_rows, profile_of
from vdsm_pin.verification.coal_arm import CoalDistances, _Moved
from vdsm_pin.verification.coal_check import CoalEvidence, LowersSink, ProvedLowers
from vdsm_pin.verification.coal_shapes import CoalPairs
from vdsm_pin.verification.enclosed import (
    EnclosedSink,
    Inside,
    enclosed_checks,
    enclosed_least,
    enclosed_profile,
)
from vdsm_pin.verification.first_contact import FirstContact
from vdsm_pin.verification.inside import Place
from vdsm_pin.verification.judgement import nearest_pairs
from vdsm_pin.verification.moving import (
    MOST_PARTS,
    PART,
    Knots,
    in_short_parts,
    whole_rows,
)
from vdsm_pin.verification.records import (
    Check,
    CheckKind,
    Counterexample,
    Pair,
    Verdict,
)
from vdsm_pin.verification.task import arm_assembly

ARM = built_in("hrm8")
NAMES = ("a", "b", "c")


def problem() -> PlanningProblem:
    balls = tuple(Sphere(name, np.full(3, 9.0), 0.1) for name in NAMES)
    return PlanningProblem(ARM, Scene(balls), None, 0.0, name="p")


def random_knots(rng: np.random.Generator, n: int) -> Knots:
    """Of n intervals, each with some knots of what moves beside within it."""
    times = np.arange(n + 1.0)
    more = rng.uniform(0.0, n, int(rng.integers(1, 9)))
    path = Path(np.zeros((n + 1, 1)), times=times)
    return Knots.of(path, np.unique(np.append(times, more)))


def random_chunk(
    rng: np.random.Generator, first: int, n: int, pairs: int
) -> ClearanceChunk:
    """Upper bounds are alike often."""
    shape = (n, pairs)
    return ClearanceChunk(
        first, rng.normal(size=shape), rng.integers(0, 3, shape).astype(float),
        rng.uniform(size=shape), rng.integers(0, 3, shape),
        rng.normal(size=(*shape, 3)), rng.normal(size=(*shape, 3)), np.arange(pairs),
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(10))
def test_knots_lie_in_the_intervals_of_their_motion(seed: int) -> None:
    rng = np.random.default_rng([1, seed])
    n = int(rng.integers(1, 6))
    knots = random_knots(rng, n)
    moments = knots.moment
    counts = rng.integers(1, 4, len(moments) - 1)
    for _ in range(2):
        assert moments[0] == 0.0 and moments[-1] == n
        assert moments[knots.first] == pytest.approx(np.arange(n + 1.0))
        assert knots.are_rows == (len(moments) == n + 1)
        for k in range(len(moments) - 1):
            within = int(np.floor(moments[k] + 1e-9))
            assert knots.interval(np.array([k])) == [within]
            for share in (0.0, 0.25, 1.0):
                told = np.array([k]), np.array([share])
                at = moments[k] + share * (moments[k + 1] - moments[k])
                assert knots.moments(*told) == pytest.approx([at])
                assert knots.share(*told) == pytest.approx([np.clip(at - within, 0, 1)])
                assert knots.inner(np.array([at])) == pytest.approx([k + share])
        parts = [np.linspace(a, b, c + 1)[:-1] for a, b, c in zip(
            moments[:-1], moments[1:], counts, strict=True)]  # fmt: skip
        finer = knots.cut(counts)
        assert finer.moment == pytest.approx(np.append(np.concatenate(parts), n))
        knots, moments = finer, finer.moment
        counts = rng.integers(1, 3, len(moments) - 1)
    inner, share = rng.integers(0, len(moments) - 1, 5), rng.uniform(size=5)
    rest = [rng.normal(size=5) for _ in range(5)]
    given = LeastClearances(inner, share, *rest)  # type: ignore[arg-type]
    found = in_rows(given, knots)
    at = moments[inner] + share * (moments[inner + 1] - moments[inner])
    assert found.interval + found.share == pytest.approx(at)
    assert np.array_equal(found.interval, knots.interval(inner))
    for name in ("lower", "upper", "verdict", "link_point", "other_point"):
        assert getattr(found, name) is getattr(given, name)


@pytest.mark.parametrize("degree", [1, 3, 5])
def test_long_intervals_are_cut_and_short_ones_stay(degree: int) -> None:
    """By the longest way of a column, along its control points, in parts of `PART`."""
    rng = np.random.default_rng([11, degree])
    sizes = np.array([0.0, 0.3, 1.0, 1.7, 2.5, 9.0, 1e3, 1e3]) * PART
    for _ in range(6):
        steps = rng.permutation(sizes)[:, None] * rng.choice([-1.0, 1.0, 0.5], (8, 2))
        knots = np.concatenate([np.zeros((1, 2)), steps.cumsum(axis=0)])
        inner = np.zeros((0, 0, 2))
        if degree > 1:
            share = np.sort(rng.uniform(-0.2, 1.2, (8, degree - 1, 2)), axis=1)
            inner = knots[:-1, None] + share * steps[:, None]
        path = Path(knots, inner, np.arange(9.0))
        counts = []
        for piece in path.controls:
            way = max(np.abs(np.diff(column)).sum() for column in piece.T)
            counts.append(int(min(max(1, np.ceil(way / PART)), MOST_PARTS)))
        cut, where = in_short_parts(path, Knots.of(path, path.times))
        assert cut.n_intervals == sum(counts)
        assert np.diff(where.first).tolist() == counts
        assert max(counts) == MOST_PARTS
        slow = Path(knots / 1e4, inner / 1e4)
        rows = Knots.of(slow, None)
        assert in_short_parts(slow, rows) == (slow, rows)
    alone = Path(np.zeros((1, 2)))
    rows = Knots.of(alone, None)
    assert in_short_parts(alone, rows) == (alone, rows)


def test_without_times_knots_are_the_rows() -> None:
    path = Path(np.zeros((4, 1)))
    for knots in (Knots.of(path, None), Knots.of(path, np.zeros(2))):
        assert knots.moment.tolist() == knots.first.tolist() == [0, 1, 2, 3]
        assert knots.are_rows
    alone = Knots.of(Path(np.zeros((1, 1))), None)
    assert (alone.moment.tolist(), alone.first.tolist()) == ([0.0], [0, 1])


@pytest.mark.parametrize("seed", range(8))
def test_chunks_end_where_no_more_intervals_fit(seed: int) -> None:
    rng = np.random.default_rng([2, seed])
    for _ in range(20):
        first = np.cumsum(rng.integers(1, 9, int(rng.integers(2, 30)))) - 1
        length, expected = int(rng.integers(1, 30)), [0]
        while expected[-1] < len(first) - 1:
            end = expected[-1] + 1
            while (
                end < len(first) - 1 and first[end + 1] - first[expected[-1]] <= length
            ):
                end += 1
            expected.append(end)
        assert _steps(first, length) == expected


@pytest.mark.parametrize("seed", range(8))
def test_intervals_of_the_joint_path_are_merged_to_those_of_the_motion(
    seed: int,
) -> None:
    rng = np.random.default_rng([3, seed])
    knots = random_knots(rng, 6)
    first = int(rng.integers(0, 4))
    last = int(rng.integers(first + 1, 7))
    count = int(knots.first[last] - knots.first[first])
    chunk = random_chunk(rng, first, count, 3)
    found = _merged(chunk, knots, last)
    assert found.first_interval == first
    for k in range(first, last):
        rows = np.arange(knots.first[k], knots.first[k + 1]) - knots.first[first]
        for pair in range(3):
            upper = chunk.upper[rows, pair]
            at = int(rows[np.flatnonzero(upper == upper.min())[-1]])
            place = k - first, pair
            assert found.lower[place] == chunk.lower[rows, pair].min()
            assert found.upper[place] == upper.min()
            inner = np.array([at + knots.first[first]])
            share = knots.share(inner, chunk.share[at : at + 1, pair])
            assert found.share[place] == share[0]
            assert found.verdict[place] == max(
                chunk.verdict[rows, pair], key=lambda v: RANK[v]
            )
            assert np.array_equal(found.link_point[place], chunk.link_point[at, pair])
            assert np.array_equal(found.other_point[place], chunk.other_point[at, pair])


@pytest.mark.parametrize("stride", [1, 2, 5])
def test_a_profile_is_by_intervals_of_the_motion(stride: int) -> None:
    rng = np.random.default_rng(stride)
    knots = random_knots(rng, 7)
    bins = -(-int(knots.first[-1]) // stride)
    profile = rng.normal(size=(2, 5, bins))
    found = profile_of(profile.copy(), stride, knots, 3)
    begins = [int(knots.interval(np.array([k * stride]))[0]) for k in range(bins)]
    assert found.first_interval.tolist() == sorted({*begins})
    for row, begin in enumerate(found.first_interval):
        mine = profile[:, :, np.array(begins) == begin].min(axis=2)
        told = np.array([
            [*found.link_lower[row], *found.obstacle_lower[row]],
            [*found.link_upper[row], *found.obstacle_upper[row]],
        ])  # fmt: skip
        assert np.array_equal(told, mine)
    rows = Knots.of(Path(np.zeros((bins + 1, 1))), None)
    plain = profile_of(profile.copy(), stride, rows, 3)
    assert plain.first_interval.tolist() == [k * stride for k in range(bins)]
    assert np.array_equal(plain.link_lower, profile[0, :3].T)


# ---- meshes that the arm is inside of ----------------------------------------


@pytest.mark.parametrize("seed", range(6))
def test_the_arm_is_inside_until_its_axis_may_meet_the_surface(seed: int) -> None:
    rng, asked = np.random.default_rng([4, seed]), problem()
    pairs, least = arm_assembly(asked).pairs, -ARM.least_radius
    bodies = {("a", "link 2"), ("a", "link 3"), ("c", "link 1")}
    mine = [k for k, p in enumerate(pairs) if (p.obstacle, p.own) in bodies]
    got: list[ClearanceChunk] = []
    sink = EnclosedSink(got.append, dict.fromkeys(mine, Inside(np.zeros(3), least)))
    left = set[int]()
    for part in range(4):
        chunk = random_chunk(rng, 5 * part, 5, len(pairs))
        lower = np.abs(chunk.lower) + rng.choice(
            [0.0, least - 9.0], (5, 1), p=[0.9, 0.1]
        )
        lower[rng.random(lower.shape) < 0.01] = least
        chunk = replace(chunk, lower=lower)
        sink(chunk)
        expected = {f.name: np.array(getattr(chunk, f.name)) for f in fields(chunk)}
        for k in range(5):
            left |= {i for i in mine if lower[k, i] <= least}
            for i in mine:
                expected["lower"][k, i] = least
                if i not in left:
                    expected["upper"][k, i] = least
                    expected["verdict"][k, i] = REFUTED
                    expected["other_point"][k, i] = chunk.link_point[k, i]
        for name, truth in expected.items():
            assert np.array_equal(getattr(got[-1], name), truth), name


def test_a_profile_has_the_depth_of_what_is_inside() -> None:
    rng, asked = np.random.default_rng(5), arm_assembly(problem())
    least = -ARM.least_radius
    bodies = {("c", "link 2"), ("a", "link 1"), ("a", "link 8")}
    mine = [k for k, p in enumerate(asked.pairs) if (p.obstacle, p.own) in bodies]
    for _ in range(20):
        lower, upper = rng.uniform(-0.02, 1.0, (2, 7, 3))
        lower[rng.random((7, 3)) < 0.1] = least
        links = rng.uniform(-0.2, 0.5, (2, 7, ARM.n_links))
        profile = ClearanceProfile(*links, lower, upper, np.arange(7))
        inside = dict.fromkeys(mine, Inside(np.zeros(3), least))
        found = enclosed_profile(profile, asked, inside)
        for name, inside in (("a", (0, 7)), ("b", ()), ("c", (1,))):
            column, left = NAMES.index(name), not inside
            for k in range(7):
                left = left or lower[k, column] <= least
                low, high = (
                    (least, upper[k, column]) if inside else (lower[k, 1], upper[k, 1])
                )
                assert found.obstacle_lower[k, column] == low
                assert found.obstacle_upper[k, column] == (high if left else least)
        for link in range(ARM.n_links):
            name = {0: "a", 7: "a", 1: "c"}.get(link)
            out = name is None
            for k in range(7):
                out = out or bool(name and lower[k, NAMES.index(name)] <= least)
                low, high = links[:, k, link]
                assert found.link_lower[k, link] == (min(low, least) if name else low)
                assert found.link_upper[k, link] == (high if out else min(high, least))


# ---- proved bounds that Coal is held against ----------------------------------------


def test_a_row_has_the_larger_bound_of_the_intervals_that_meet_there() -> None:
    rng = np.random.default_rng(6)
    proved = ProvedLowers(
        rng.normal(size=4), np.array([1, -1, 0, -1]), rng.normal(size=(5, 2))
    )
    for row in range(6):
        for pair in range(4):
            found = proved.at(np.array([row]), np.array([pair]))[0]
            column = proved.column[pair]
            near = [k for k in (row - 1, row) if 0 <= k < 5]
            best = max(proved.lower[k, column] for k in near)
            assert found == (best if column >= 0 else proved.least[pair])


@pytest.mark.parametrize("spare", [0, -1])
def test_bounds_are_kept_where_they_fit(
    spare: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng, asked = np.random.default_rng(7), problem()
    motion: Any = SimpleNamespace(n_samples=6)
    columns = 3 * ARM.axis_radii.size
    monkeypatch.setattr(coal_check, "COMPARED", 5 * columns + spare)
    sink = LowersSink(asked, motion)
    assert sink.fits is (spare == 0)
    monkeypatch.setattr(coal_check, "COMPARED", 5 * 4 + spare)
    pairs, parts = (
        np.array([3, 1, 6, 2]),
        [random_chunk(rng, k, n, 4) for k, n in ((0, 2), (2, 3))],
    )
    for part in parts:
        sink.keep(replace(part, pairs=pairs))
    for sent in (5, 4):
        proof: Any = SimpleNamespace(
            least=SimpleNamespace(lower=rng.normal(size=8)),
            sent=sent,
            motion=SimpleNamespace(n_trajectory_intervals=5),
        )
        found = sink.proved(proof)
        assert np.array_equal(found.least, proof.least.lower)
        if spare or sent < 5:
            assert (found.column == -1).all()
            assert found.lower.shape == (1, 1)
            continue
        assert found.column.tolist() == [-1, 1, 3, 0, -1, -1, 2, -1]
        assert np.array_equal(found.lower, np.concatenate([p.lower for p in parts]))
    none: Any = SimpleNamespace(n_samples=1)
    assert LowersSink(replace(asked, scene=Scene()), none).fits is False


@pytest.mark.parametrize("seed", range(8))
def test_of_each_link_and_obstacle_the_row_that_lacks_most_is_told(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng, asked = (
        np.random.default_rng([10, seed]),
        replace(problem(), required_clearance=0.5),
    )
    pairs = CoalPairs(arm_assembly(asked))
    of_obstacles = np.flatnonzero(pairs.other >= pairs.n_own)
    table = np.zeros((ARM.n_links, len(asked.scene.obstacles)))
    if seed >= 4:
        table = rng.choice([0.0, 0.1, 0.3], table.shape)
    margin: Any = table if seed >= 4 else 0.0
    parts, expected = [], dict[tuple[int, int], tuple[Any, ...]]()
    for part in range(3):
        n = 60
        gaps = rng.choice([-0.2, 0.0, 0.1, 0.3, 0.5, 0.7, -np.inf], n)
        pair = rng.choice(of_obstacles, n)
        moments, unknown = np.arange(n) + n * part, np.zeros(n)
        parts.append(CoalDistances(moments + 0.0, pair, gaps, unknown, unknown))
        for k in range(n):
            other = int(pairs.other[pair[k]]) - pairs.n_own
            key = min(int(pairs.one[pair[k]]) + 1, ARM.n_links), other
            kept = 0.5 + table[key[0] - 1, other]
            if not (np.isfinite(gaps[k]) and gaps[k] < kept):
                continue
            if key not in expected or gaps[k] < expected[key][1]:
                expected[key] = k + n * part, gaps[k]

    def near(motion: str, room: float, **_: Any) -> Any:
        assert room == margins.NEAR * ARM.most_radius + np.max(margin)
        return parts

    def witness(motion: str, row: int, pair: int) -> Any:
        return row, pair, None

    arm = SimpleNamespace(near=near, pairs=pairs, problem=asked, witness=witness)
    monkeypatch.setattr(margins, "CoalArm", lambda *_, **__: arm)
    blank: Any = "a motion"
    found = margins.CoalMeasure(asked)(blank, margin)
    assert [(one.link, one.obstacle) for one in found] == sorted(expected)
    for one in found:
        assert (one.row, one.distance) == expected[one.link, one.obstacle]
        row, pair = map(int, (one.on_link, one.on_obstacle))
        of_link = min(int(pairs.one[pair]) + 1, ARM.n_links)
        assert (row, of_link) == (one.row, one.link)
        assert pairs.other[pair] - pairs.n_own == one.obstacle


@pytest.mark.parametrize("travel", [0.0, 0.3, 2.0])
def test_rows_are_looked_at_where_the_arm_has_moved_on(travel: float) -> None:
    """The first, and each at which the way since then passes a multiple of a length."""
    rng = np.random.default_rng(9)
    centres = rng.normal(0.0, 0.1, (40, 4, 3)).cumsum(axis=0)
    moved, found = _Moved(travel), []
    for first, last in ((0, 1), (1, 9), (9, 10), (10, 40)):
        found += moved(centres[first:last]).tolist()
    way, expected = 0.0, [True]
    for before, after in pairwise(centres):
        now = way + max(np.linalg.norm(after - before, axis=1))
        expected.append(travel == 0.0 or now // travel > way // travel)
        way = now
    assert found == expected


# ---- lines of a certificate ----------------------------------------


@pytest.mark.parametrize("at_once", [1, 2, 4, 9])
def test_lines_hold_all_planes_in_order(
    at_once: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Read back: of each interval and pair its slices by time, its planes by pieces."""
    monkeypatch.setattr(certificate_lines, "PAIRS", at_once)
    rng, n = np.random.default_rng([8, at_once]), 4
    pairs: Any = SimpleNamespace(rough=np.zeros((n, 0)), required=np.zeros(n))
    task: Any = SimpleNamespace(pairs=pairs)
    rows, expected = [], []
    for k in range(3, 6):
        proofs = []
        for pair in range(n):
            cuts = [0.0, *np.sort(rng.uniform(size=rng.integers(3))), 1.0]
            slices = []
            for start, end in pairwise(cuts):
                planes, pieces = [], int(rng.integers(1, 4))
                for first in range(pieces):
                    normal = [rng.choice([2.0, -0.5, 0.25]) for _ in range(3)]
                    claim = float(rng.uniform(0.1, 1.0))
                    row = np.zeros(RECORD)
                    row[:4] = k, pair, start, end
                    row[[FIRST, LAST]] = first, first + 1
                    row[PLANE_NORMAL:CLAIM], row[CLAIM] = normal, claim
                    rows.append(row)
                    lower = certificate_lines._counted(claim, 0.0)
                    planes.append([first, first + 1, *normal, lower])
                slices.append([start, end, planes])
            proofs.append(slices)
        expected.append({"k": k, "proofs": proofs})
    records = np.array(rows)[rng.permutation(len(rows))]
    text = "".join(certificate_lines._interval_lines(task, records, 3, 6))
    assert [json.loads(line) for line in text.splitlines()] == expected
    assert " " not in text
    assert text.endswith("\n")
    whole = json.dumps(expected, separators=(",", ":"))[1:-1]
    for value in ("2.0", "1.0,[", "0.0,"):
        whole = whole.replace(value, value.replace(".0", "", 1))
    assert text.splitlines() == [line if line.startswith('{"k"') else '{"k"' + line
                                 for line in whole.split(',{"k"')]  # fmt: skip


@pytest.mark.parametrize(
    ("pairs", "intervals", "most", "line", "refused"),
    [(6, 5, 30, 10**9, False), (6, 5, 29, 10**9, True), (6, 0, 6, 10**9, False),
     (6, 5, 99, 6 * certificate_lines.SHORTEST, False),
     (6, 5, 99, 6 * certificate_lines.SHORTEST - 1, True)],
)  # fmt: skip
def test_what_nobody_would_read_is_refused(
    pairs: int, intervals: int, most: int, line: int, refused: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr(certificate_lines, "MOST_CLEARANCES", most)
    monkeypatch.setattr(certificate_lines, "MAX_LINE", line)
    task = SimpleNamespace(pairs=SimpleNamespace(rough=np.zeros((pairs, 0))))
    motion = SimpleNamespace(knots=np.zeros((intervals + 1, 1)))
    proof: Any = SimpleNamespace(task=task, motion=motion)
    if refused:
        with pytest.raises(CertificateTooLarge):
            certificate_lines._check_size(proof)
    else:
        certificate_lines._check_size(proof)


def random_least(rng: np.random.Generator, verdict: Any) -> LeastClearances:
    """Brackets of pairs, some of them never bounded from above."""
    n = len(verdict)
    lower = rng.uniform(-0.1, 0.1, n)
    upper = np.where(rng.random(n) < 0.3, np.inf, lower + rng.uniform(0.0, 0.05, n))
    upper = np.where(verdict == REFUTED, lower + 0.01, upper)
    points = rng.normal(size=(2, n, 3))
    return LeastClearances(
        rng.integers(0, 9, n), rng.random(n), lower, upper, verdict, *points
    )


@pytest.mark.parametrize("late", [False, True])
def test_a_row_of_clearance_is_its_worst_pair(late: bool) -> None:
    """Refuted before undecided before certified; of each kind of pair by itself."""
    rng, seen = np.random.default_rng(int(late)), set()
    asked = replace(problem(), required_clearance=0.03, required_self_clearance=0.04)
    for _ in range(60):
        n = int(rng.integers(1, 5))
        pairs = tuple(
            Pair(k + 1, "a") if rng.integers(2) else Pair(k + 1, other_link=k + 3)
            for k in range(n)
        )
        verdict = rng.choice([CERTIFIED, REFUTED, UNDECIDED], n, p=[0.6, 0.2, 0.2])
        least = random_least(rng, verdict)
        counts = np.zeros((n, 3), np.int64)
        counts[:, CERTIFIED] = rng.integers(0, 5, n)
        counts[np.arange(n), verdict] += rng.integers(1, 5, n)
        outer = np.array([bool(pair.obstacle) for pair in pairs])
        evidence = Evidence(
            pairs, outer, least, counts, lambda k, worst: worst < -0.001 * k, (), False,
            (),
        )  # fmt: skip
        rows = clearance_checks(asked, evidence, Deadline(3.0) if late else None)
        expected = []
        for name, limit, kind in (
            (CheckKind.OBSTACLES, 0.03, True),
            (CheckKind.LINKS, 0.04, False),
        ):
            mine = [k for k in range(n) if bool(pairs[k].obstacle) is kind]
            if mine:
                expected.append((name, limit, mine))
        assert [row.name for row in rows] == [name for name, _, _ in expected]
        for row, (_, limit, mine) in zip(rows, expected, strict=True):
            found, values = Verdict.CERTIFIED, {k: least.lower[k] for k in mine}
            if any(verdict[k] == REFUTED for k in mine):
                found = Verdict.REFUTED
                values = {k: least.upper[k] for k in mine if verdict[k] == REFUTED}
            elif any(verdict[k] == UNDECIDED for k in mine):
                found = Verdict.UNDECIDED
            seen.add(found)
            k = min(values, key=lambda one: values[one])
            words = str(pairs[k])
            if found is Verdict.UNDECIDED:
                open_ = counts[mine, UNDECIDED].sum()
                words += f"; {open_} of {counts[mine].sum()} undecided"
            assert row.where.startswith(words)
            told = late and found is Verdict.UNDECIDED
            assert (row.where != words) == told and ("time" in row.where) == told
            assert (row.verdict, row.worst, row.limit) == (found, values[k], limit)
            assert row.count == counts[mine].sum()
            moment = least.interval[k] + least.share[k]
            known = np.isfinite(least.upper[k])
            assert row.moment == moment if known else np.isnan(row.moment)
            deep = found is not Verdict.UNDECIDED and values[k] < -0.001 * k
            assert row.deeper == deep
            # Nobody looked for when it is lost.
            assert (row.too_close_intervals, row.too_close_stretches) == (0, 0)
            assert np.isnan([row.first_moment, row.last_moment]).all()
    assert len(seen) == 3


def test_contacts_and_counterexamples_stand_in_the_row_of_their_kind() -> None:
    pairs = (Pair(2, "a"), Pair(1, other_link=4))
    least = random_least(np.random.default_rng(3), np.array([REFUTED, UNDECIDED]))
    counts = np.array([[3, 2, 0], [4, 0, 1]])
    first = FirstContact(pairs[0], 2.5, True, last=7.25, intervals=5, stretches=2,
                         time=1.0, last_time=4.5)  # fmt: skip
    alone = FirstContact(pairs[1], 1.0, False, last=1.0, intervals=1, stretches=1)
    unknown = FirstContact(pairs[1], 1.125, True)
    point = np.zeros(3)
    found = Counterexample(
        3, 0.5, pairs[1], point, point, -0.02, 0.0, point, point, deeper=True
    )

    def rows(contacts: Any, examples: Any = (), nominal: bool = False) -> Any:
        outer, found = np.array([True, False]), (examples, nominal, contacts)
        told = Evidence(pairs, outer, least, counts, lambda *_: False, *found)
        return clearance_checks(problem(), told)

    near, links = rows((first, alone))
    assert near.where == (
        "link 2 and a; first too close at waypoint 2.5 (1.000 s); "
        "last at waypoint 7.25 (4.500 s); 5 intervals in 2 stretches"
    )
    assert (near.first_moment, near.last_moment) == (2.5, 7.25)
    assert (near.too_close_intervals, near.too_close_stretches) == (5, 2)
    assert links.where == (
        "link 1 and link 4; 1 of 5 undecided; first found too close at waypoint 1: "
        "link 1 and link 4; last at waypoint 1; 1 interval"
    )
    _, links = rows((unknown,))
    assert links.where.endswith("first too close at waypoint 1.125: link 1 and link 4")
    between = FirstContact(pairs[0], 2.3456, True, last=7.2504, intervals=5,
                           stretches=1, time=1.0009, last_time=4.5001)  # fmt: skip
    near, _ = rows((between,))
    assert near.where.endswith(
        "first too close at waypoint 2.345 (1.000 s); "
        "last at waypoint 7.251 (4.501 s); 5 intervals"
    )
    for nominal, words in ((True, "; the nominal motion is clear"), (False, "")):
        near, links = rows((), (found,), nominal)
        assert near.verdict is links.verdict is Verdict.REFUTED
        assert (links.worst, links.moment, links.deeper) == (-0.02, 3.5, True)
        assert near.where == "link 2 and a" and near.worst == least.upper[0]
        assert (
            links.where == f"link 1 and link 4, with errors within the error box{words}"
        )


def test_pairs_that_come_nearest_are_listed_obstacles_first() -> None:
    rng = np.random.default_rng(9)
    for n in (0, 1, 8, 30):
        pairs = tuple(
            Pair(1, f"o{k}") if rng.integers(2) else Pair(1, other_link=k + 3)
            for k in range(n)
        )
        least = random_least(rng, rng.integers(0, 3, n))
        outer = np.array([bool(pair.obstacle) for pair in pairs], bool)
        found = nearest_pairs(pairs, outer, least)
        known = [k for k in range(n) if np.isfinite(least.upper[k])]
        known.sort(key=lambda k: (not pairs[k].obstacle, least.upper[k]))
        assert [*found] == known[:10]
        for k, one in found.items():
            assert one.pair is pairs[k]
            assert one.moment == least.interval[k] + least.share[k]
            assert (one.lower, one.upper) == (least.lower[k], least.upper[k])
            assert (one.link_point == least.link_point[k]).all()
            assert (one.other_point == least.other_point[k]).all()


@pytest.mark.parametrize("feed", [None, Feed(0.3, 0.05)])
def test_a_profile_has_each_link_by_itself(feed: Feed | None) -> None:
    """A ball beside one of them; the feed counts as what link 1 is mounted on."""
    arm, still = replace(ARM, feed=feed), np.zeros((1, 8))
    rest = Trajectory([False], [0.0], [0.0], still, still)
    for k in range(8 if feed is None else 1):
        x = ARM.stations[k] + ARM.link_lengths[k] / 2.0 if feed is None else -0.15
        thick = ARM.link_radius if feed is None else 0.05
        ball = Sphere("ball", np.array([x, 0.1 + thick + 0.004, 0.0]), 0.1)
        asked = PlanningProblem(arm, Scene((ball,)), None, 0.0, name="p")
        profile = prove_clearance(asked, rest, ErrorBox()).profile
        assert profile.link_lower.shape == (1, 8)
        assert int(profile.link_lower.argmin()) == k
        assert profile.link_lower.min() == pytest.approx(0.004, abs=1e-6)
        assert profile.link_upper[0, k] == pytest.approx(0.004, abs=1e-6)
        assert np.sort(profile.link_lower[0])[1] > 0.01


def test_sinks_hear_of_every_interval_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """In chunks that follow one another, and the proof says how many were sent."""
    monkeypatch.setattr(clearance, "CHUNK_VALUES", 29 * (2 * BLOCK + 1))
    ball = Sphere("ball", np.array([1.0, 0.3, 0.0]), 0.1)
    asked = PlanningProblem(ARM, Scene((ball,)), None, 0.0, name="p")
    for rows, most in ((3 * BLOCK, 2 * BLOCK), (1, 7), (2, 7), (8, 7), (30, 7)):
        still, chunks = np.zeros((rows, 8)), list[ClearanceChunk]()
        rest = np.zeros(rows)
        motion = Trajectory(rest > 0, rest, np.linspace(0, 0.1, rows), still, still)
        whole = AskedMotion.of_arm(asked, motion, ErrorBox())
        proof = prove_motion(whole, Budget(), (chunks.append,))
        monkeypatch.setattr(clearance, "CHUNK", 7)
        assert max(len(chunk.lower) for chunk in chunks) == min(most, max(1, rows - 1))
        assert proof.sent == proof.motion.n_trajectory_intervals == max(1, rows - 1)
        heard = [c.first_interval + k for c in chunks for k in range(len(c.lower))]
        assert heard == [*range(proof.motion.n_trajectory_intervals)]
        lower = np.concatenate([chunk.lower for chunk in chunks])
        assert (lower.min(axis=0) >= proof.least.lower).all()
        assert (lower.min(axis=0) <= proof.least.upper).all()


def test_evidence_of_coal_is_its_largest_disagreement() -> None:
    evidence, limit = CoalEvidence(), TOLERANCES.coal_agreement
    none = evidence.check()
    assert (none.count, none.verdict) == (0, Verdict.UNDECIDED)
    assert np.isnan(none.worst) and np.isnan(none.moment)
    for count, excess in enumerate((0.5, 0.25, 1.0, 1.0, 1.5, 0.0), start=1):
        evidence.count = count
        evidence.add(excess * limit, f"pair {count}", float(count))
        most = (1, 1, 3, 3, 5, 5)[count - 1]  # the first of equals
        row = evidence.check("; so many")
        assert row.worst == (0.5, 0.5, 1.0, 1.0, 1.5, 1.5)[count - 1] * limit
        assert (row.where, row.moment) == (f"pair {most}; so many", float(most))
        agreed = row.worst <= limit
        assert row.verdict is (Verdict.CERTIFIED if agreed else Verdict.UNDECIDED)
        assert (row.count, row.limit) == (count, limit)


def test_what_begins_inside_is_refuted_from_the_beginning() -> None:
    rng, point = np.random.default_rng(5), np.array([1.0, 2.0, 3.0])
    least = random_least(rng, rng.integers(0, 3, 6))
    inside = {2: Inside(point, -0.04), 5: Inside(-point, -0.03)}
    assert enclosed_least(least, {}) is least
    found = enclosed_least(least, inside)
    for field in fields(LeastClearances):
        before, after = getattr(least, field.name), getattr(found, field.name)
        assert not after.flags.writeable
        np.testing.assert_array_equal(np.delete(after, [2, 5], 0), np.delete(
            before, [2, 5], 0))  # fmt: skip
    for k, one in inside.items():
        assert (found.interval[k], found.share[k]) == (0, 0.0)
        assert found.lower[k] == found.upper[k] == one.clearance
        assert found.verdict[k] == REFUTED
        assert (found.link_point[k] == one.point).all()
        assert (found.other_point[k] == one.point).all()
    rows = (
        Check(
            "a", Verdict.CERTIFIED, 7, 0.5, 0.1, "m", "x", 3.0, False, 2.0, 4.0, 5, 6
        ),
        Check("b", Verdict.UNDECIDED, 7, 0.5, 0.1, "m"),
    )
    asked = arm_assembly(problem())
    where = {(p.obstacle, p.own): k for k, p in enumerate(asked.pairs)}
    outside, within = (Place(Location(s), point) for s in (Side.OUTSIDE, Side.INSIDE))
    places = {where["a", "link 1"]: outside, where["c", "link 2"]: outside}
    assert enclosed_checks(rows, asked, places) is rows
    places |= {where["a", "link 2"]: within, where["b", "link 3"]: within}
    for worst, first in ((-0.5, -0.5), (-ARM.least_radius, 0.5)):
        told = replace(rows[0], worst=first), rows[1]
        refuted, other = enclosed_checks(told, asked, places)
        assert other is rows[1] and refuted.worst == worst
        assert refuted.where == "the arm is inside 'a'; the arm is inside 'b'"
        assert (refuted.verdict, refuted.count) == (Verdict.REFUTED, 7)
        assert refuted.moment == refuted.first_moment == 0.0
        assert np.isnan(refuted.last_moment) and refuted.deeper is True
        assert refuted.too_close_intervals == refuted.too_close_stretches == 0


def test_without_obstacles_nothing_is_missing() -> None:
    problem = PlanningProblem(ARM, Scene(), None, 0.1, name="p")
    still, rows = np.zeros(2), np.zeros((2, ARM.n_links))
    motion = Trajectory(still > 0, still, still, rows, rows)
    assert margins.CoalMeasure(problem)(motion) == ()


def test_counterexamples_are_told_in_rows_of_the_trajectory() -> None:
    """Rows 0, 1 and 2 with knots between, where something else has some."""
    path = Path(np.zeros((3, 1)), times=np.array([5.0, 6.0, 8.0]))
    shown, share = SimpleNamespace(x=7), 0.3
    found: Any = tuple(
        Counterexample(k, share, *[shown] * 4, 0.0, *[shown] * 3)  # type: ignore[arg-type]
        for k in range(4)
    )
    times = np.array([5.0, 5.5, 6.0, 7.0, 8.0])
    told = counterexample.in_rows(found, Knots.of(path, times))
    assert [one.interval for one in told] == [0, 0, 1, 1]
    expected = [0.15, 0.65, 0.15, 0.65]
    assert [one.share for one in told] == pytest.approx(expected)
    assert all(one.joints is shown for one in told)
    assert counterexample.in_rows((), Knots.of(path, times)) == ()
    assert counterexample.in_rows(found[:2], Knots.of(path, None)) == found[:2]


def test_rows_of_what_moves_stand_behind_those_of_the_arm() -> None:
    still, rows = np.zeros(3), np.zeros((3, ARM.n_links))
    place = np.array([0.0, 1.0, 2.0])
    alone = Trajectory(still > 0, still, place, rows, rows)
    moments = np.array([0.5, 1.25])
    problem: Any = SimpleNamespace(scene=SimpleNamespace(carriers=()))
    found = whole_rows(problem, alone, moments)
    assert found.shape == (2, 1 + 2 * ARM.n_links)
    assert found[:, 0].tolist() == [0.5, 1.25]
    timed = replace(alone, times=np.array([3.0, 4.0, 6.0]))
    carrier = Path(np.array([[10.0], [16.0]]), times=np.array([3.0, 6.0]))
    problem.scene.carriers = (SimpleNamespace(path=carrier),)
    found = whole_rows(problem, timed, moments)
    assert found[:, 0].tolist() == [0.5, 1.25]
    assert found[:, -1] == pytest.approx([11.0, 13.0])  # at 3.5 and 4.5 s
    assert np.array_equal(whole_rows(problem, alone, moments), found[:, :-1])


def test_a_profile_has_a_column_for_each_link_and_each_obstacle() -> None:
    """The feed, behind the base, counts with link 1; links among them with none."""
    arm, n = replace(ARM, feed=Feed(0.3, 0.05)), ARM.n_links
    balls = tuple(Sphere(f"b{k}", np.array([9.0, k, 9.0]), 0.1) for k in range(3))
    asked = arm_assembly(PlanningProblem(arm, Scene(balls), None, 0.0, name="p"))
    question, task = asked.question, asked.question.task
    assert question.n_columns == n + 3
    links = [max(link, 1) - 1 for link in asked.links]
    assert task.bodies.column.tolist() == links == [*range(n), 0]
    others = [int(k) - len(asked.own) for k in asked.table.one]
    expected = [n + k if k >= 0 else -1 for k in others]
    assert task.pairs.column.tolist() == expected
    assert {*expected} == {-1, n, n + 1, n + 2}


def test_no_ball_is_looked_for_when_time_is_over() -> None:
    zeros, points = np.zeros(2), np.zeros((2, 3))
    least: Any = LeastClearances(
        np.zeros(2, np.int64),
        zeros,
        zeros,
        zeros,
        np.full(2, UNDECIDED),
        points,
        points,
    )
    path = Path(np.zeros((2, 1)))
    motion: Any = SimpleNamespace(
        asked=None, path=path, span_on_path=np.array([0.0, 1.0])
    )
    found = clearances.with_depths(motion, least, deadline=Deadline.after(0.0))
    for name in (one.name for one in fields(least)):
        np.testing.assert_array_equal(getattr(found, name), getattr(least, name))
    with pytest.raises(AttributeError):  # it asks for poses otherwise
        clearances.with_depths(motion, least)


def test_common_balls_are_looked_for_in_few_pairs_of_those_that_meet(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Undecided ones first, then the nearest of those that nothing grows."""
    n = 3 * clearances.MOST
    rng = np.random.default_rng(3)
    verdict = np.where(np.arange(n) % 3 == 0, UNDECIDED, REFUTED)
    upper, zeros, points = -rng.uniform(0.0, 1.0, n), np.zeros(n), np.zeros((n, 3))
    rows = np.zeros(n, np.int64), zeros, zeros - 2.0, upper, verdict, points, points
    looked = list[int]()

    def noted(k: int, *_: object) -> tuple[float, object]:
        looked.append(k)
        return 0.0, None

    monkeypatch.setattr(clearances, "_placed", lambda _, k, at: (k, at))
    monkeypatch.setattr(clearances, "_moments", lambda *_: iter([0.0]))
    monkeypatch.setattr(clearances, "common_ball", noted)
    asked = SimpleNamespace(ball=lambda k: 0.1 * (k % 3 == 1))
    motion: Any = SimpleNamespace(asked=asked, span_on_path=np.array([0.0, 1.0]))
    clearances.with_depths(motion, LeastClearances(*rows))
    first = sorted(range(0, n, 3), key=lambda k: upper[k])
    assert looked == first[: clearances.MOST]
    verdict[verdict == UNDECIDED], looked[:] = REFUTED, []
    clearances.with_depths(motion, LeastClearances(*rows))
    even = [k for k in range(n) if k % 3 != 1]
    assert looked == sorted(even, key=lambda k: upper[k])[: clearances.MOST]
