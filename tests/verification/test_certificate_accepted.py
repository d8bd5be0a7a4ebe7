"""What the verifier writes, the checker accepts: all shapes, errors, one row."""

import gzip
import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from oracles.certificate_cases import SHAPES, certificate_lines, random_case
from oracles.certificate_mutations import forged
from oracles.certificate_oracle import sha256

from vdsm_pin.certificate_checker import check_certificate
from vdsm_pin.certificate_writer import lines as lines_module
from vdsm_pin.certificate_writer.certificate import write_certificate
from vdsm_pin.certificate_writer.lines import Hashes
from vdsm_pin.certificate_writer.schema import certificate_schema
from vdsm_pin.errors import CertificateTooLarge, InvalidFile
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.trajectory_file import read_trajectory
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.verification.robust import largest_joint_error
from vdsm_pin.verification.verify import verify


def written(case: object, path: Path, box: ErrorBox | None = None) -> None:
    """A certificate by the verifier of a case that need not draw its path."""
    file = read_problem(case.problem)
    arm = file.manipulator
    trajectory = read_trajectory(case.trajectory, arm)
    box = box or ErrorBox(*case.writer.errors)
    found = verify(file.under(box or ErrorBox()), trajectory)
    kept = [
        c for c in found.checks if not c.name.startswith(("tip", "change", "joints at"))
    ]
    assert all(c.verdict == "certified" for c in kept), kept
    object.__setattr__(found, "checks", tuple(kept))
    digest = sha256(case.trajectory.read_bytes())
    write_certificate(path, found, Hashes(file.sha256, digest))


@pytest.mark.parametrize("seed", range(len(SHAPES)))
def test_the_verifiers_certificate_is_accepted(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    case = random_case(rng, tmp_path, [SHAPES[seed], SHAPES[(seed + 3) % len(SHAPES)]])
    written(case, case.certificate)
    outcome = check_certificate(case.certificate, case.problem, case.trajectory)
    assert outcome.accepted, outcome.reason
    lines = certificate_lines(case.certificate)
    fits = jsonschema.Draft202012Validator(certificate_schema()).is_valid
    assert all(map(fits, lines))
    assert not fits(lines[0] | {"coverage": 2.0})
    assert not fits(lines[1] | {"proofs": [[[0.0, 1.0, [[0, 1, 0.0]]]]]})


def test_lines_are_the_same_in_parts_and_none_is_too_long(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = random_case(np.random.default_rng(5), tmp_path, [SHAPES[1], SHAPES[2]])
    whole, parts, none = (tmp_path / name for name in ("whole", "parts", "none"))
    written(case, whole)
    for name in ("PAIRS", "ROOM"):
        monkeypatch.setattr(lines_module, name, 3)
    written(case, parts)
    assert parts.read_bytes() == whole.read_bytes()
    clearances = sum(len(line["proofs"]) for line in certificate_lines(whole)[1:-1])
    longest = max(map(len, gzip.decompress(whole.read_bytes()).splitlines(True)[:-1]))
    for name, enough in (("MOST_CLEARANCES", clearances), ("MAX_LINE", longest)):
        with monkeypatch.context() as changed:
            changed.setattr(lines_module, name, enough)
            written(case, parts)
            changed.setattr(lines_module, name, enough - 1)
            with pytest.raises(CertificateTooLarge, match=r"at most|longest line"):
                written(case, none)
            assert not none.exists()


def stood_away(path: Path, base: list[float]) -> None:
    """Move the base of a problem file and everything beside it."""
    data = json.loads(path.read_text())
    data["base"] = {"position": base}
    tip = data["tip_path"]
    vectors = [*tip["points"]]
    if isinstance(tip["start"], list):
        vectors.append(tip["start"])
    for obstacle in data["obstacles"]:
        vectors += [obstacle[key] for key in ("center", "point") if key in obstacle]
        if obstacle["shape"] == "prism":
            axis = "xyz".index(obstacle["axis"])
            away = base[(axis + 1) % 3], base[(axis + 2) % 3]
            moved = np.array(obstacle["polygon"]) + away
            obstacle["polygon"] = moved.tolist()
            obstacle["from"] += base[axis]
            obstacle["to"] += base[axis]
    for vector in vectors:
        vector[:] = (np.array(vector) + base).tolist()
    path.write_text(json.dumps(data))


@pytest.mark.parametrize("seed", range(2 * len(SHAPES)))
def test_the_verifiers_certificate_is_accepted_far_away(
    seed: int, tmp_path: Path
) -> None:
    rng = np.random.default_rng(300 + seed)
    shapes = [SHAPES[seed % len(SHAPES)], "prism_notched"]
    case = random_case(rng, tmp_path, shapes)
    far = 10.0 ** rng.uniform(2, 9)
    stood_away(case.problem, rng.uniform(-far, far, 3).tolist())
    written(case, case.certificate)
    outcome = check_certificate(case.certificate, case.problem, case.trajectory)
    assert outcome.accepted, outcome.reason


@pytest.mark.parametrize("seed", range(len(SHAPES)))
def test_the_certificate_of_the_survived_error_is_accepted(
    seed: int, tmp_path: Path
) -> None:
    case = random_case(np.random.default_rng(seed + 50), tmp_path, [SHAPES[seed]])
    problem = read_problem(case.problem)
    rows = read_trajectory(case.trajectory, problem.manipulator)
    found = largest_joint_error(problem, rows, ErrorBox())
    assert found > 0.0
    written(case, case.certificate, ErrorBox(joint=found))
    outcome = check_certificate(case.certificate, case.problem, case.trajectory)
    assert outcome.accepted, outcome.reason


def test_mutations_of_the_verifiers_certificate_are_rejected(tmp_path: Path) -> None:
    rng = np.random.default_rng(9)
    case = random_case(rng, tmp_path, ["mesh_stl", "prism_notched"])
    written(case, case.certificate)
    lines, accepted = certificate_lines(case.certificate)[:-1], 0
    for _ in range(60):
        _, content, _ = forged(lines, rng)
        case.certificate.write_bytes(content)
        try:
            files = case.certificate, case.problem, case.trajectory
            accepted += check_certificate(*files).accepted
        except InvalidFile:
            continue
    assert accepted < 12  # changes by an ulp leave the claims true
