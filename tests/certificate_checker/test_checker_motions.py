"""Certificates beside what moves and of smooth pieces: accepted, and forgeries not."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.certificate_cases import certificate_lines
from oracles.certificate_oracle import sealed, sha256
from some_slow import few_of

from vdsm_pin.certificate_checker import check_certificate
from vdsm_pin.certificate_writer.certificate import write_certificate
from vdsm_pin.certificate_writer.lines import Hashes
from vdsm_pin.errors import InvalidFile
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.trajectory_file import read_trajectory, write_trajectory
from vdsm_pin.problem.error_boxes import ErrorBox, ObstacleError
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.verify import verify

Rng = np.random.Generator
SOLIDS: tuple[dict[str, Any], ...] = (
    {"shape": "sphere", "center": [0, 0, 0], "radius": 50},
    {"shape": "box", "center": [10, 0, 0], "size": [60, 80, 100]},
    {"shape": "cylinder", "center": [0, 10, 0], "axis": "z", "radius": 40}
    | {"length": 150},
    {"shape": "capsule", "center": [0, 0, 0], "axis": [1, 1, 0], "radius": 30}
    | {"length": 100},
)
FLOOR = {"name": "floor", "shape": "half_space", "point": [0, 0, -3000]}
ARM = {"link_lengths": [300, 300, 300], "link_radius": 40, "max_link_angle_deg": 80}


class Motion:
    """A random motion beside obstacles that move, and its certificate."""

    def __init__(self, folder: Path, rng: Rng) -> None:
        self.problem, self.rows = folder / "p.yaml", folder / "t.csv"
        self.certificate = folder / "c"
        self.data: dict[str, Any] = {
            "vdsm_problem": 1,
            "length_unit": "mm",
            "manipulator": ARM
            | {"max_joint_angle_deg": 80, "base_range": [-4000, 4000]},
            "base": {
                "position": rng.uniform(-100, 100, 3).tolist(),
                "rpy_deg": rng.uniform(-30, 30, 3).tolist(),
            },
            "required_clearance": 5,
            "obstacles": [FLOOR | {"normal": [0.1, 0, 1]}],
        }
        count = int(rng.integers(1, 4))
        self.data["obstacles"] += [self._obstacle(k, rng) for k in range(count)]
        self.write_problem()
        self._write_rows(rng)

    def _obstacle(self, number: int, rng: Rng) -> dict[str, Any]:
        knots = int(rng.integers(1, 4))
        away = rng.choice([-1, 1]) * np.array([0.0, 0.0, 450.0])
        motion = {
            "times_s": np.cumsum(rng.uniform(0.1, 1.0, knots)).tolist(),
            "positions": (away + 120 * rng.normal(size=(knots, 3))).tolist(),
            "rpy_deg": rng.uniform(-90, 90, (knots, 3)).tolist(),
        }
        solid = SOLIDS[rng.integers(len(SOLIDS))]
        return solid | {"name": f"one {number}", "motion": motion}

    def write_problem(self) -> None:
        self.problem.write_text(json.dumps(self.data))

    def _write_rows(self, rng: Rng) -> None:
        n, more = int(rng.integers(1, 5)), {}
        q = np.cumsum(0.1 * rng.normal(size=(n, 7)), axis=0)
        q[:, 0] *= 0.3
        smooth = int(rng.integers(3))
        if smooth:
            more["rates"] = 0.2 * rng.normal(size=q.shape)
        if smooth > 1:
            more["changes"] = 0.4 * rng.normal(size=q.shape)
        times, none = np.cumsum(rng.uniform(0.2, 0.6, n)), np.zeros(n)
        joints = q[:, 0], q[:, 1::2], q[:, 2::2]
        write_trajectory(
            Trajectory(none > 0, none, *joints, times=times, **more), self.rows
        )

    def certify(self, errors: ErrorBox) -> bool:
        """Write the certificate; false where the motion is not certified."""
        file = read_problem(self.problem)
        arm = file.manipulator
        self.motion = read_trajectory(self.rows, arm)
        found = verify(file.under(errors), self.motion)
        if found.verdict.value != "certified":
            return False
        hashes = Hashes(file.sha256, sha256(self.rows.read_bytes()))
        write_certificate(self.certificate, found, hashes)
        self.lines = certificate_lines(self.certificate)[:-1]
        return True

    def reason(self) -> str:
        try:
            found = check_certificate(self.certificate, self.problem, self.rows)
        except InvalidFile as error:
            return str(error)
        return found.reason

    def forge(self, change: Callable[[Any], None]) -> str:
        """Why the certificate is refused after a change, with hashes that fit."""
        lines = json.loads(json.dumps(self.lines))
        change(lines)
        lines[0]["problem_sha256"] = read_problem(self.problem).sha256
        lines[0]["trajectory_sha256"] = sha256(self.rows.read_bytes())
        self.certificate.write_bytes(sealed(lines))
        return self.reason()


def random_errors(rng: Rng) -> ErrorBox:
    if rng.random() < 0.4:
        return ErrorBox()
    return ErrorBox(
        joint=float(rng.uniform(0, 0.004)),
        base=float(rng.uniform(0, 0.002)),
        base_turn=0.003 * int(rng.integers(2)),
        obstacle=0.001,
        obstacles=(ObstacleError("one 0", 0.002, 0.01),),
    )


def assert_the_motion_of_the_file_counts(case: Motion, rng: Rng) -> None:
    """A plane that proves no more than is claimed does not survive both ways.

    What a plane loses is convex in the place of the obstacle: there or back it is more.
    """
    beside = [k for k, pair in enumerate(case.lines[0]["pairs"]) if "one 0" in pair]
    plane = any_plane(case.lines, rng, beside)
    plane[5] = proved_by(case, plane) - 1e-9
    there, back = (moved(case, by_mm) for by_mm in (1.0, -1.0))
    assert there or back


def moved(case: Motion, by_mm: float) -> str:
    """Why the certificate is refused with the first obstacle that moves elsewhere."""
    motion = case.data["obstacles"][1]["motion"]
    kept = motion["positions"]
    motion["positions"] = [[x, y, z + by_mm] for x, y, z in kept]
    case.write_problem()
    motion["positions"] = kept
    return case.forge(lambda _: None)


def run(folder: Path, seed: int, count: int) -> tuple[int, int]:
    """Random motions: how many were accepted, and forgeries refused."""
    rng, accepted, forged = np.random.default_rng(seed), 0, 0
    for number in range(count):
        (home := folder / str(number)).mkdir()
        case = Motion(home, rng)
        if not case.certify(random_errors(rng)):
            continue
        assert case.reason() == "", seed
        accepted += 1
        assert_no_more_is_claimed(case, rng)
        for kind in ("linear", "interval", "turned", "error"):
            reason = case.forge(lambda lines, kind=kind: damage(lines, kind, rng))
            if kind == "linear" and not reason:
                found = check_certificate(case.certificate, case.problem, case.rows)
                assert found.notes[-1] == "linear pieces join the rows"
            else:
                assert reason, kind
            forged += 1
        assert_the_motion_of_the_file_counts(case, rng)
        forged += 2
    return accepted, forged


def any_plane(lines: Any, rng: Rng, pairs: Sequence[int] = ()) -> Any:
    """A random plane, of one of some pairs."""
    line = lines[int(rng.integers(1, len(lines)))]
    proof = line["proofs"][rng.choice(pairs or range(len(line["proofs"])))]
    return proof[int(rng.integers(len(proof)))][2][0]


def proved_by(case: Motion, plane: Any) -> float:
    """What the checker says that a plane proves; [m]."""
    kept, plane[5] = plane[5], 1e3
    reason = case.forge(lambda _: None)
    plane[5] = kept
    return float(reason.split("proves ")[1].split(" mm")[0]) / 1e3


def assert_no_more_is_claimed(case: Motion, rng: Rng) -> None:
    """As much as a plane proves may be claimed, and not a hair more."""
    plane = any_plane(case.lines, rng)
    kept, most = plane[5], proved_by(case, plane)
    for claimed, good in ((most - 1e-9, True), (most + 1e-9, False)):
        plane[5] = claimed
        assert (case.forge(lambda _: None) == "") is good
    plane[5] = kept


def damage(lines: Any, kind: str, rng: Rng) -> None:
    """Change what is claimed."""
    plane = any_plane(lines, rng)
    if kind == "linear":
        lines[0]["interpolation"] = "linear"
    elif kind == "interval":
        lines.pop()
    elif kind == "turned":
        plane[2:5] = [-x for x in plane[2:5]]
    else:
        for off in lines[0]["errors"]["obstacles"].values():
            off[0] += 1e-3


@pytest.mark.parametrize("seed", few_of(3, 1))
def test_motions_beside_what_moves_are_accepted(seed: int, tmp_path: Path) -> None:
    accepted, forged = run(tmp_path, seed, 5)
    assert accepted > 1
    assert forged > 8


@pytest.mark.slow
def test_many_motions_beside_what_moves(tmp_path: Path) -> None:
    accepted, forged = run(tmp_path, 77, 600)
    print(accepted, forged)  # noqa: T201  (shown by pytest -s)
    assert accepted > 300
    assert forged > 1_500


def test_a_door_a_tenth_of_a_millimetre_nearer_is_refused(tmp_path: Path) -> None:
    """The certificate is forged to say so; the file's motion alone decides."""
    case = Motion(tmp_path, np.random.default_rng(1))
    assert case.certify(ErrorBox())
    door = case.data["obstacles"][1]
    for row in door["motion"]["positions"]:
        row[2] -= 0.1 * np.sign(row[2])
    case.write_problem()
    assert "claims" in case.forge(lambda _: None)
