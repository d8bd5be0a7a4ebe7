"""How certificates round what planes prove, and tell what covers a mesh."""

from fractions import Fraction
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any, get_args

import numpy as np
import pytest
from pydantic import BaseModel, ValidationError

from vdsm_pin.arm.mounted import LinkBody
from vdsm_pin.certificate_checker.program import VERSION
from vdsm_pin.certificate_writer import lines
from vdsm_pin.certificate_writer.lines import PER_METRE, _counted
from vdsm_pin.certificate_writer.pieces import (
    _triangles,
    link_pieces,
    pieces_carried,
    pieces_of_obstacles,
)
from vdsm_pin.certificate_writer.schema import (
    ErrorLimits,
    HeaderLine,
    IntervalLine,
    LastLine,
    LinkPieces,
    Primitive,
)
from vdsm_pin.errors import CertificateTooLarge, VerificationFailed
from vdsm_pin.geometry.convex import Hull
from vdsm_pin.geometry.pieces import pack_pieces
from vdsm_pin.geometry.solids import BOX_CORNERS, Prism
from vdsm_pin.time_limit import NO_LIMIT


def test_claims_leave_the_checker_room_where_they_may() -> None:
    """A ten-billionth of a metre, but never less than what is required."""
    rng = np.random.default_rng(0)
    for _ in range(2000):
        lower = float(rng.uniform(0.0, 10.0))
        required = lower - float(10.0 ** rng.uniform(-12.0, 0.0))
        written = _counted(lower, required)
        claim = (
            Fraction(written, PER_METRE) if type(written) is int else Fraction(written)
        )
        assert Fraction(required) <= claim <= Fraction(lower)
        if lower - required > 2.5 / PER_METRE:
            assert Fraction(lower) - claim >= Fraction(99, 100 * PER_METRE)
    assert _counted(2.2587605964, 0.0) == 22587605963
    for parts in (0, PER_METRE // 2):  # required to the last part
        required = parts / PER_METRE
        assert _counted(required + 1.5 / PER_METRE, required) == parts
        assert _counted(required + 0.5 / PER_METRE, required) == parts
        assert _counted(required, required) == parts


def test_a_link_is_told_where_its_order_or_cover_is_not_that_of_its_file() -> None:
    """Hulls by the triangles under them, primitives by one corner and its edges."""
    rng = np.random.default_rng(3)
    corners = BOX_CORNERS * [0.1, 0.2, 0.3] + [1.0, 2.0, 3.0]
    ball, rod, box = (Hull(p, 0.5) for p in (corners[:1], corners[:2], corners))
    groups = tuple(np.sort(part) for part in np.split(rng.permutation(9), [2, 5]))
    pieces: Any = SimpleNamespace(
        order=np.array([7, 0, 1, 2, 0, 2, 1, 0, 1]),
        first_piece=np.array([0, 1, 4, 7, 9]),
    )
    links = [("plain", ()), ("sorted", ()), ("covered", (groups, ball, rod, box))]
    found = dict(link_pieces(links, [1, 2, 3], pieces))
    assert [*found] == ["sorted", "covered"]
    assert found["sorted"] == LinkPieces(order=[0, 2, 1], meshes=[])
    told = found["covered"]
    assert told.order == []
    hulls, *primitives = told.meshes
    assert hulls == [
        next(k for k, group in enumerate(groups) if i in group) for i in range(9)
    ]
    for primitive, hull in zip(primitives, (ball, rod, box), strict=True):
        assert isinstance(primitive, Primitive) and primitive.radius_m == 0.5
        edges = np.array(primitive.edges_m).reshape(-1, 3)
        shares = np.array([*product((0, 1), repeat=len(edges))]).reshape(
            2 ** len(edges), -1
        )
        made = primitive.origin_m + shares @ edges
        for corner in hull.points:
            assert np.linalg.norm(made - corner, axis=1).min() < 1e-12
        assert len(made) == len(hull.points)


@pytest.mark.parametrize("turned", [1, -1])
def test_triangles_of_a_prism_run_as_its_polygon(turned: int) -> None:
    """Each by the corners of the file, and of the same sense and area together."""
    rng = np.random.default_rng(8)
    for n in (3, 5, 9):
        turns = np.sort(rng.uniform(0.0, 2.0 * np.pi, n))
        turns[:3] += [0.0, 2.1, 4.2]
        star = np.sort(turns % (2.0 * np.pi))
        out = rng.uniform(0.3, 1.0, n)[:, None]
        polygon = (out * np.column_stack([np.cos(star), np.sin(star)]))[::turned]
        away = polygon + rng.uniform(-3.0, 3.0, 2)
        prism = Prism("p", np.zeros(3), np.eye(3), away, (0.0, 1.0))
        areas = [_area(prism.polygon[k]) for k in _triangles(prism)]
        assert all(area * turned > 0.0 for area in areas)
        assert sum(areas) == pytest.approx(_area(prism.polygon), rel=1e-9)


def test_prisms_of_several_pieces_are_told_by_them() -> None:
    """Of one piece nothing is told; planes count the pieces in the order packed."""
    inward = {1: [[0, 0], [2, 0], [2, 2], [0, 2]], 2: [[0, 0], [2, -1], [1, 0], [2, 1]]}
    for count, polygon in inward.items():
        prism = Prism("bar", np.zeros(3), np.eye(3), np.array(polygon, float), (0, 1))
        assert len(prism.pieces) == count
        told = pieces_of_obstacles([(0, prism)], pack_pieces([prism.pieces]))
        assert [*told] == (["bar"] if count > 1 else [])
        assert [*pieces_carried([LinkBody(1, prism)])] == [*told]
        areas = [_area(prism.polygon[loop]) for loop in told.get("bar", [])]
        assert len(areas) == (count if count > 1 else 0)
        assert sum(areas) in (0.0, pytest.approx(_area(prism.polygon)))


def test_pieces_are_told_that_are_counted_in_another_order_than_the_file_has() -> None:
    solids: Any = [SimpleNamespace(name="sorted"), SimpleNamespace(name="plain")]
    order, first = np.array([0, 1, 1, 0, 2, 0, 1, 2]), np.array([0, 2, 5, 8])
    packed: Any = SimpleNamespace(order=order, first_piece=first)
    told = pieces_of_obstacles([(1, solids[0]), (2, solids[1])], packed)
    assert told == {"sorted": []}


def _area(corners: np.ndarray) -> float:
    """Of a polygon, above 0 where it runs anticlockwise."""
    x, y = corners.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0


PLANE = [0, 1, 1.0, 0.0, -1.0, 5]
ERRORS = {"base": [0.0, 0.0], "obstacles": {"post": [0.0, 0.5]}, "joints_rad": [0.0]}


@pytest.mark.parametrize(
    ("model", "good", "bad"),
    [
        (
            IntervalLine,
            [
                {"k": 0, "proofs": []},
                {"k": 3, "proofs": [[[0.0, 0.5, [PLANE]], [0.5, 1, [PLANE, PLANE]]]]},
                {"k": 0, "proofs": [[[0, 1, [[0, 1, -1.0, 0.0, 0.5, 0.25]]]]]},
            ],
            [
                {"k": -1, "proofs": []},
                {"k": 0, "proofs": [[]]},
                {"k": 0, "proofs": [[[0.0, 1.0, []]]]},
                {"k": 0, "proofs": [[[-1e-9, 1.0, [PLANE]]]]},
                {"k": 0, "proofs": [[[0.0, 1.0 + 1e-9, [PLANE]]]]},
                {"k": 0, "proofs": [[[0.0, 1.0, [[-1, *PLANE[1:]]]]]]},
                {"k": 0, "proofs": [[[0.0, 1.0, [[*PLANE[:5], float("nan")]]]]]},
                {"k": 0, "proofs": [], "more": 1},
            ],
        ),
        (
            ErrorLimits,
            [ERRORS],
            [ERRORS | {"base": [0.0, -1e-9]}, ERRORS | {"joints_rad": [-1e-9]}],
        ),
        (
            LastLine,
            [{"end": True, "sha256": 32 * "0f"}],
            [{"end": False, "sha256": 32 * "0f"}, {"end": True, "sha256": 31 * "0f"}],
        ),
    ],
)
def test_lines_hold_what_their_limits_allow(
    model: type[BaseModel], good: list[Any], bad: list[Any]
) -> None:
    for data in good:
        line = model.model_validate(data)
        with pytest.raises(ValidationError, match="frozen"):
            setattr(line, next(iter(data)), None)
    for data in bad:
        with pytest.raises(ValidationError):
            model.model_validate(data)


@pytest.mark.parametrize("most", [1000, 60])
def test_each_line_has_a_limit_and_the_file_none(
    most: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Lines come in parts, which belong together up to their end."""
    parts = ["y" * 40 + "\n"] * 100 + ["x" * 40, "y" * 40 + "\n"]
    monkeypatch.setattr(lines, "_lines", lambda *_: iter(parts))
    monkeypatch.setattr(lines, "_check_size", lambda _: None)
    monkeypatch.setattr(lines, "MAX_LINE", most)
    header: Any = SimpleNamespace(model_dump_json=lambda: "{}")
    nothing: Any = None
    if most < 81:
        with pytest.raises(CertificateTooLarge):
            lines.write_lines(tmp_path / "c", header, nothing)
        assert not (tmp_path / "c").exists()
    else:
        lines.write_lines(tmp_path / "c", header, nothing)
        assert (tmp_path / "c").exists()


def test_a_header_is_of_the_version_that_the_checker_reads() -> None:
    version = HeaderLine.model_fields["vdsm_certificate"]
    (read,) = get_args(version.annotation)
    assert version.default == read == VERSION


@pytest.mark.parametrize("pair", [0, 3])
def test_a_proof_that_is_not_found_again_is_told(
    pair: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lines, "new_workspace", lambda *_: None)
    monkeypatch.setattr(lines, "record", lambda *_: (0, 4, pair))
    proof: Any = SimpleNamespace(
        motion=SimpleNamespace(knots=np.zeros((9, 3))), task=None
    )
    with pytest.raises(
        VerificationFailed, match=f"interval 4: the proof of pair {pair}"
    ):
        list(lines._lines(proof, NO_LIMIT))
