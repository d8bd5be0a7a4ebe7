"""Random small problems with certificates, over all shapes of the problem file."""

import gzip
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.certificate_oracle import CannotCertify, OracleWriter, sealed

from vdsm_pin.certificate_checker import Outcome, check_certificate, claims
from vdsm_pin.certificate_writer.lines import Hashes

SHAPES = (
    "cylinder",
    "cylinder_oblique",
    "prism",
    "prism_notched",
    "sphere",
    "capsule",
    "box",
    "half_space",
    "mesh_stl",
    "mesh_obj",
)
NOTCHED = [[0, 0], [3, 0], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]]
ROUNDED = 3e-10
"""Of a claim, a whole number of 1e-10 m, and of what the prover keeps to spare; [m]."""

CUBE = [(i, j, k) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]
CUBE_FACES = [
    *[(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)],
    *[(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)],
]


def certificate_lines(path: Path) -> list[Any]:
    """The lines of a certificate that is stored packed."""
    return [
        json.loads(line) for line in gzip.decompress(path.read_bytes()).splitlines()
    ]


def accepted_closely(*files: Path, most: float = ROUNDED) -> Outcome:
    """A certificate is accepted, and no plane proves more than it claims.

    Verifier and checker work out by code of their own what a plane proves.

    Args:
        files: Certificate, problem and trajectory.
        most: What may be between the two; [m].
    """
    spared, kept = list[float](), claims.clearances

    def clearances(pair: Any, planes: list[claims.Plane], slices: Any) -> Any:
        proved = kept(pair, planes, slices)
        spared.extend(proved - [plane.lower for plane in planes])
        return proved

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(claims, "clearances", clearances)
        outcome = check_certificate(*files)
    assert outcome.accepted, outcome.reason
    assert len(spared) == outcome.n_claims
    assert max(spared, default=0.0) <= most
    return outcome


def check_sealed(
    lines: list[Any], folder: Path, files: tuple[Path, Path], hashes: Hashes | None
) -> Outcome:
    """What is said of lines beside files, sealed, with these hashes if any."""
    if hashes is not None:
        lines[0] |= {
            "problem_sha256": hashes.problem,
            "trajectory_sha256": hashes.trajectory,
        }
    (folder / "forged").write_bytes(sealed(lines))
    return check_certificate(folder / "forged", *files)


def write_cube(path: Path, half: float, *, skip: int = 0) -> None:
    """A cube about the origin, STL or OBJ by the ending; `skip` triangles left out."""
    faces = CUBE_FACES[skip:]
    if path.suffix == ".obj":
        corners = [f"v {half * x} {half * y} {half * z}" for x, y, z in CUBE]
        sides = [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
        path.write_text("\n".join([*corners, *sides]) + "\n")
        return
    records = [
        struct.pack("<12fH", 0, 0, 0, *(half * x for c in face for x in CUBE[c]), 0)
        for face in faces
    ]
    path.write_bytes(bytes(80) + struct.pack("<I", len(faces)) + b"".join(records))


def obstacle(shape: str, centre: Any, rng: np.random.Generator, folder: Path) -> Any:
    """One obstacle of about 0.1 m around a point, as in a problem file in metres."""
    name = f"{shape}_{rng.integers(10**6)}"
    rpy = [float(x) for x in rng.uniform(-180, 180, 3).round(3)]
    centre = [float(x) for x in np.round(centre, 4)]
    kind, axis = shape.split("_")[0], [float(x) for x in rng.normal(size=3).round(3)]
    common = {"name": name, "shape": kind, "center": centre}
    match shape:
        case "cylinder":
            return common | {"axis": "y", "radius": 0.07, "length": 0.25}
        case "cylinder_oblique" | "capsule":
            return common | {"axis": axis, "radius": 0.05, "length": 0.2}
        case "sphere":
            return common | {"radius": 0.11}
        case "box":
            return common | {"size": [0.1, 0.2, 0.15], "rpy_deg": rpy}
        case "prism" | "prism_notched":
            k = int(rng.integers(3))
            corners = NOTCHED if shape != "prism" else [[0, 0], [3, 0.5], [1, 3]]
            u, v = centre[(k + 1) % 3], centre[(k + 2) % 3]
            polygon = [[u + 0.05 * a - 0.075, v + 0.05 * b - 0.075] for a, b in corners]
            span = {"from": centre[k] - 0.1, "to": centre[k] + 0.1}
            return {"name": name, "shape": kind, "axis": "xyz"[k]} | {
                "polygon": polygon,
                **span,
            }
        case "half_space":
            return {"name": name, "shape": shape, "point": centre, "normal": axis}
    path = folder / f"{name}.{shape.split('_')[1]}"
    write_cube(path, 7.0)
    return common | {"file": path.name, "scale": 0.01, "rpy_deg": rpy}


def scaled(value: Any, key: str = "") -> Any:
    """The same problem data in millimetres."""
    if isinstance(value, dict):
        return {k: scaled(v, k) for k, v in value.items()}
    lengths = "normal" not in key and not key.endswith("_deg") and key != "axis"
    if isinstance(value, list):
        return [scaled(v, key) for v in value]
    if isinstance(value, float) and lengths and key != "required_coverage":
        return value * 1000.0
    return value


def random_problem(rng: np.random.Generator, folder: Path, shapes: Any) -> Any:
    """Problem data, and rows of joint values that bend the arm gently."""
    n = int(rng.integers(2, 6))
    lengths = [float(x) for x in rng.uniform(0.15, 0.4, n).round(3)]
    placed = []
    for shape in shapes:
        along, away = rng.uniform(0.0, sum(lengths)), rng.uniform(0.25, 0.5)
        angle = rng.uniform(-np.pi, np.pi)
        centre = np.array([along, away * np.cos(angle), away * np.sin(angle)])
        item = obstacle(shape, centre, rng, folder)
        if shape == "half_space":
            item["normal"] = [0.0, *(float(-x) for x in centre[1:].round(4))]
        placed.append(item)
    start, steps = rng.uniform(-0.15, 0.15, 2 * n), rng.normal(size=(2, 2 * n)) * 0.05
    angles = np.cumsum(np.vstack([start, steps[: rng.integers(0, 3)]]), axis=0)
    x0 = np.cumsum(rng.uniform(-0.02, 0.02, len(angles)))
    base = {
        "position": [float(x) for x in rng.uniform(-0.05, 0.05, 3).round(3)],
        "rpy_deg": [float(x) for x in rng.uniform(-15, 15, 3).round(2)],
    }
    data = {
        "vdsm_problem": 1,
        "name": "case",
        "length_unit": "m",
        "manipulator": {
            "link_lengths": lengths,
            "link_radius": 0.03,
            "max_link_angle_deg": 60.0,
            "max_joint_angle_deg": 50.0,
        },
        "obstacles": placed,
        "tip_path": {
            "start": {"joints": at_start(x0[0], angles[0])},
            "points": [[0.5, 0.1, 0.0], [0.6, 0.1, 0.0], [0.6, 0.3, 0.2]],
            "required_coverage": 0.0,
        },
        "required_clearance": 0.002,
    }
    if rng.random() < 0.5:
        data["base"] = base
    return data, np.column_stack([x0, angles])


def at_start(x0: float, angles: Any) -> Any:
    """Joint values of a row as a problem file states them."""
    turned = [float(x) for x in np.rad2deg(angles)]
    return {"x0": float(x0), "alpha_deg": turned[0::2], "theta_deg": turned[1::2]}


def write_rows(path: Path, q: Any, on_path: Any = None, path_m: Any = None) -> None:
    """A trajectory file."""
    n = (q.shape[1] - 1) // 2
    names = [f"{x}{i + 1}_rad" for i in range(n) for x in ("alpha", "theta")]
    lines = [",".join(["waypoint", "on_path", "path_m", "x0_m", *names])]
    for k, row in enumerate(q):
        flag = 0 if on_path is None else int(on_path[k])
        station = 0.0 if path_m is None else float(path_m[k])
        lines.append(
            ",".join([str(k), str(flag), repr(station), *map(repr, map(float, row))])
        )
    path.write_text("\n".join(lines) + "\n")


class Case:
    """A problem, a trajectory and a good certificate on disk."""

    def __init__(
        self, folder: Path, data: Any, q: Any, errors: Any, **drawn: Any
    ) -> None:
        self.folder, self.data = folder, data
        self.problem, self.trajectory = folder / "p.yaml", folder / "t.csv"
        self.certificate = folder / "c.jsonl"
        self.problem.write_text(json.dumps(data))
        write_rows(self.trajectory, q, **drawn)
        self.writer = OracleWriter(self.problem, self.trajectory, errors)
        self.lines = self.writer.lines()
        self.certificate.write_bytes(sealed(self.lines))


def random_case(rng: np.random.Generator, folder: Path, shapes: Any = None) -> Case:
    """A case that can be certified; what the simple writer fails on is thrown away."""
    while True:
        chosen = rng.choice(SHAPES, rng.integers(1, 4)) if shapes is None else shapes
        data, q = random_problem(rng, folder, chosen)
        if rng.random() < 0.5:
            data = scaled(data) | {"length_unit": "mm"}
        errors = [(0.0, 0.0, 0.0), (0.002, 0.001, 0.0005)][int(rng.integers(2))]
        try:
            return Case(folder, data, q, errors)
        except CannotCertify:
            continue
