"""Where the last link looks: proved again between rows, and wrong looks refused."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.certificate_cases import certificate_lines
from oracles.certificate_oracle import sealed, sha256

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.certificate_checker import check_certificate
from vdsm_pin.certificate_checker.balls import SLACK, norm
from vdsm_pin.certificate_checker.path import Drawing
from vdsm_pin.certificate_checker.rows import PARTS, Rows
from vdsm_pin.certificate_writer.certificate import write_certificate
from vdsm_pin.certificate_writer.lines import Hashes
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.trajectory_file import read_trajectory, write_trajectory
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.pointing import NAME
from vdsm_pin.verification.verify import verify

ARM = built_in("hrm8")
NO_ERRORS = ErrorBox()
STEADY = 0.02
"""Turn of a joint from row to row; [rad]."""

BEHIND = -0.3
"""Where the base then stands; [m]."""


class Looking:
    """A random motion all of which draws, its last link near to where it shall look."""

    def __init__(
        self, folder: Path, seed: int, smooth: bool = False, steady: bool = False
    ) -> None:
        """Steady is a motion of a straight arm whose joint 1 alone turns, evenly."""
        rng, rows = np.random.default_rng(seed), 5
        self.problem, self.rows = folder / "p.yaml", folder / "t.csv"
        self.certificate = folder / "c"
        turns = rng.uniform(-1.0, 1.0, (2, rows, ARM.n_links))
        angles = rng.uniform(-0.2, 0.2, (2, 1, ARM.n_links)) + 0.002 * turns.cumsum(1)
        x0 = 0.002 * rng.uniform(0.0, 1.0, rows).cumsum()
        rates = 1e-4 * rng.normal(size=(rows, 1 + 2 * ARM.n_links))
        if steady:
            angles, x0, rates = 0.0 * angles, 0.0 * x0 + BEHIND, 0.0 * rates
            angles[0, :, 0] = STEADY * np.arange(rows)
            rates[:, 1] = STEADY
        centres = joint_centres(ARM, x0, *angles)
        self.tips, self.centres = centres[:, -1], centres
        gaps = np.linalg.norm(np.diff(self.tips, axis=0), axis=1)
        on, more = np.ones(rows, dtype=np.bool_), {}
        if smooth:
            more["times"] = np.arange(rows) * 1.0
            more["rates"] = rates
        stations = np.append(0.0, gaps.cumsum())
        write_trajectory(Trajectory(on, stations, x0, *angles, **more), self.rows)
        axes = centres[:, -1] - centres[:, -2]
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        aside = 0.02 * rng.normal(size=3)
        self.aims: dict[str, Any] = {
            "target": (self.tips[2] + 2.0 * axes[2] + 0.1 * aside).tolist(),
            "direction": (axes[2] + aside).tolist(),
            "directions": (axes + aside).tolist(),
        }

    def ask(self, cone: float, kind: str, obstacles: Sequence[Any] = ()) -> None:
        """Write the problem file."""
        points = self.tips.tolist()
        path = {"points": points, "spacing": 1.0, "required_coverage": 0.0}
        rows = read_trajectory(self.rows, ARM)
        path["start"] = {
            "joints": {
                "x0": float(rows.x0[0]),
                "alpha_deg": np.rad2deg(rows.alpha[0]).tolist(),
                "theta_deg": np.rad2deg(rows.theta[0]).tolist(),
            }
        }
        path["pointing"] = {"cone_deg": cone, kind: self.aims[kind]}
        data = {"vdsm_problem": 1, "length_unit": "m", "manipulator": "hrm8"}
        data |= {"obstacles": [*obstacles], "required_clearance": 0.0, "tip_path": path}
        self.problem.write_text(json.dumps(data))

    def look(self, errors: ErrorBox = NO_ERRORS) -> float:
        """Write a certificate; the proved bound of the angle; [deg]."""
        file, rows = read_problem(self.problem), read_trajectory(self.rows, ARM)
        found = verify(file.under(errors), rows)
        row = next(check for check in found.checks if check.name == NAME)
        assert found.verdict.value == "certified", found.checks
        hashes = Hashes(file.sha256, sha256(self.rows.read_bytes()))
        write_certificate(self.certificate, found, hashes)
        self.lines = certificate_lines(self.certificate)[:-1]
        return float(np.rad2deg(row.worst))

    def reason(self) -> str:
        found = check_certificate(self.certificate, self.problem, self.rows)
        return found.reason

    def forge(self) -> None:
        """Make the certificate one of the problem file as it is now."""
        lines = self.lines
        lines[0]["problem_sha256"] = read_problem(self.problem).sha256
        self.certificate.write_bytes(sealed(lines))


@pytest.mark.parametrize("kind", ["target", "direction", "directions"])
@pytest.mark.parametrize("smooth", [False, True])
def test_a_narrower_cone_is_refused(kind: str, smooth: bool, tmp_path: Path) -> None:
    for seed in range(1 if smooth else 3):
        case = Looking(tmp_path, seed, smooth)
        case.ask(30.0, kind)
        worst = case.look()
        assert case.reason() == ""
        for cone, good in ((1.02 * worst, True), (0.98 * worst - 0.06, False)):
            if cone <= 0.0:
                continue
            case.ask(cone, kind)
            case.forge()
            assert (case.reason() == "") is good, (seed, worst)
            assert good or "last link" in case.reason()


@pytest.mark.parametrize("kind", ["target", "direction", "directions"])
@pytest.mark.parametrize(
    "errors",
    [ErrorBox(joint=1e-3), ErrorBox(base_turn=0.01), ErrorBox(base=0.05)],
    ids=["joint", "turn", "base"],
)
def test_a_cone_is_proved_under_the_errors(
    kind: str, errors: ErrorBox, tmp_path: Path
) -> None:
    """Accepted in the cone that the verifier proves; not in what is kept without."""
    case = Looking(tmp_path, 4)
    case.ask(30.0, kind)
    nominal = case.look()
    worst = case.look(errors)
    assert case.reason() == ""
    felt = worst > nominal + 0.2
    assert felt or (kind != "target" and errors.base > 0.0)
    for cone in (1.02 * worst + 0.06, nominal + 0.06):
        case.ask(cone, kind)
        case.forge()
        good = cone > worst + 0.05 or not felt
        assert (case.reason() == "") is good
        assert good or "within the errors" in case.reason()


@pytest.mark.parametrize("smooth", [False, True])
def test_between_rows_the_tip_leaves_its_chord_by_what_is_reckoned(
    smooth: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of joint 1 turning evenly a circle, whose height over a chord is known."""
    case = Looking(tmp_path, 0, smooth, steady=True)
    case.ask(30.0, "direction")
    case.look()
    kept, bends = Drawing.draw, []

    def draw(self: Drawing, *taken: Any) -> None:
        bends.append((float(norm(taken[2][1] - taken[2][0])), float(taken[3])))
        kept(self, *taken)

    monkeypatch.setattr(Drawing, "draw", draw)
    assert case.reason() == ""
    parts = PARTS if smooth else 1
    assert len(bends) == 4 * parts
    length, turn = float(ARM.total_length), STEADY / parts
    for chord, bend in bends:
        assert chord == pytest.approx(2.0 * length * np.sin(turn / 2.0), rel=1e-6)
        height = length * (1.0 - np.cos(turn / 2.0))
        assert height <= bend <= 1.01 * height


@pytest.mark.parametrize("kind", ["target", "direction"])
def test_what_moves_far_away_turns_no_look(kind: str, tmp_path: Path) -> None:
    """Errors of the arm's joints count, and no joints of what obstacles move on."""
    case, box = Looking(tmp_path, 4, smooth=True), ErrorBox(joint=1e-3)
    case.ask(30.0, kind)
    worst = case.look(box)
    way = {"times_s": [0, 9], "positions": [[0, 0, 0], [0, 0, 1]]}
    ball = {"name": "ball", "shape": "sphere", "center": [0, 8, 0], "radius": 0.1}
    ball["motion"] = way | {"rpy_deg": [[0, 0, 0], [0, 0, 9]]}
    case.ask(30.0, kind, [ball])
    assert case.look(box) == pytest.approx(worst, abs=1e-9)
    for cone, good in ((1.02 * worst + 0.06, True), (0.98 * worst - 0.06, False)):
        case.ask(cone, kind, [ball])
        case.forge()
        assert (case.reason() == "") is good


def bound(case: Looking, kind: str, k: int, errors: ErrorBox) -> float:
    """What docs/certificate.md reckons of an interval of a steady motion; [rad]."""
    tips, length, aims = case.tips[k : k + 2], float(ARM.total_length), case.aims[kind]
    axes = case.centres[k : k + 2, -1] - case.centres[k : k + 2, -2]
    if kind == "target":
        wanted, way = aims - tips, length * STEADY
    elif kind == "direction":
        wanted, way = np.array([aims, aims]) / np.linalg.norm(aims), 0.0
    else:
        every = aims / np.linalg.norm(aims, axis=1, keepdims=True)
        sides = np.linalg.norm(np.diff(case.tips, axis=0), axis=1)
        steepest = np.linalg.norm(np.diff(every, axis=0), axis=1) / sides
        wanted, way = every[k : k + 2], steepest.max() * sides[k]
    across = np.linalg.norm(np.cross(axes, wanted), axis=1)
    seen = np.arctan2(across, (axes * wanted).sum(axis=1)).mean()
    away = np.linalg.norm(wanted, axis=1).mean() - way / 2.0
    turn = 2.0 * np.arccos(np.cos(errors.joint / 2.0) ** 2)
    behind = length - np.append(0.0, np.cumsum(ARM.link_lengths[:-1]))
    moved = (
        errors.base + errors.base_turn * (abs(BEHIND) + length) + turn * behind.sum()
    )
    moved = moved if kind == "target" else 0.0
    astray = errors.base_turn + len(behind) * turn + moved / (away - moved)
    return float(seen + STEADY / 2.0 + way / away / 2.0 + astray)


@pytest.mark.parametrize("kind", ["target", "direction", "directions"])
@pytest.mark.parametrize(
    "errors",
    [NO_ERRORS, ErrorBox(joint=1e-3, base=0.02, base_turn=3e-3)],
    ids=["none", "all"],
)
def test_an_interval_is_halved_only_where_its_bound_is_beyond_the_cone(
    kind: str, errors: ErrorBox, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the formula of the docs: angles at both ends, five rows, four intervals."""
    case = Looking(tmp_path, 0, steady=True)
    case.ask(40.0, kind)
    case.look(errors)
    kept, ends = Rows._seen, []

    def seen(self: Rows, *taken: Any) -> Any:
        ends.append(taken[2])
        return kept(self, *taken)

    monkeypatch.setattr(Rows, "_seen", seen)
    worst = max(bound(case, kind, k, errors) for k in range(4))
    for more, whole in ((2e-9, True), (-2e-9, False)):
        ends.clear()
        case.ask(float(np.rad2deg(worst - SLACK + more)), kind)
        case.forge()
        assert case.reason() == ""
        assert (len(ends) == 2 * (5 + 4)) is whole


@pytest.mark.parametrize("row", [0, 3])
@pytest.mark.parametrize("kind", ["target", "direction", "directions"])
def test_another_aim_is_refused(kind: str, row: int, tmp_path: Path) -> None:
    """A microradian outside of the cone at one row, in the problem that is forged."""
    case, cone = Looking(tmp_path, 5), 30.0
    case.ask(cone, kind)
    case.look()
    axis = case.centres[row, -1] - case.centres[row, -2]
    axis /= np.linalg.norm(axis)
    aside = np.cross(axis, [0.0, 0.6, 0.8])
    aside /= np.linalg.norm(aside)
    aim = axis + np.tan(np.deg2rad(cone) + 1e-6) * aside
    if kind == "directions":
        case.aims[kind][row] = aim.tolist()
    else:
        case.aims[kind] = (case.tips[row] + aim if kind == "target" else aim).tolist()
    case.ask(cone, kind)
    case.forge()
    assert "the last link looks" in case.reason()
    if kind == "directions":  # those of the other rows are as they were
        assert case.reason().startswith(f"interval {max(row - 1, 0)}: ")
        found = float(case.reason().split()[-2].removesuffix("°"))
        assert found == pytest.approx(cone + np.rad2deg(1e-6), abs=1e-9)
