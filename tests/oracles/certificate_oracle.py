"""A slow, simple certificate writer, to test the checker without the verifier.

Written from docs/certificate.md with numpy alone: nearest points by Wolfe's algorithm,
the plane between them, halving where it does not prove enough. For small problems.
"""

import hashlib
import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from vdsm_pin.geometry.convex import FlatCylinder, HalfSpacePiece, Hull
from vdsm_pin.geometry.solids import Prism
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.trajectory_file import read_trajectory

PAD = 1e-11
SMALLEST_SLICE = 2.0**-5


class CannotCertify(Exception):
    """The motion does not keep its clearance, or this writer is too simple."""


def frames_and_centres(lengths: Any, q: Any) -> tuple[Any, Any]:
    frames, centres = [np.eye(3)], [np.array([q[0], 0.0, 0.0])]
    for length, a, t in zip(lengths, q[1::2], q[2::2], strict=True):
        yaw = np.array(
            [[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]]
        )
        pitch = np.array(
            [[np.cos(t), 0, np.sin(t)], [0, 1, 0], [-np.sin(t), 0, np.cos(t)]]
        )
        frames.append(frames[-1] @ yaw @ pitch)
        centres.append(centres[-1] + length * frames[-1][:, 0])
    return frames, np.array(centres)


def nearest(support: Any, start: Any, rounds: int = 30) -> Any:
    """Point of least norm of a convex set; `support(d)` is its point of least d.x.

    Wolfe's algorithm; any rounding only makes the plane worse, never the proof wrong.
    """
    points, weights, x = [start], np.ones(1), start
    for _ in range(rounds):
        q = support(x)
        if x @ x - x @ q <= 1e-9 * (x @ x):
            break
        points, weights = [*points, q], np.append(weights, 0.0)
        for _ in range(len(points) + 3):
            matrix = np.block(
                [
                    [np.array(points) @ np.array(points).T, np.ones((len(points), 1))],
                    [np.ones((1, len(points))), np.zeros((1, 1))],
                ]
            )
            right = np.append(np.zeros(len(points)), 1.0)
            best = np.linalg.lstsq(matrix, right, rcond=None)[0][:-1]
            if (best > 1e-14).all():
                weights = best
                break
            falling = best < weights
            ratios = np.where(
                falling, weights / np.where(falling, weights - best, 1), 1.0
            )
            ratios = np.where(best > 1e-14, 1.0, ratios)
            weights = weights + ratios.min() * (best - weights)
            keep = weights > 1e-14
            points = [p for p, k in zip(points, keep, strict=True) if k]
            weights = weights[keep] / weights[keep].sum()
        x = weights @ np.array(points)
    return x


def area(polygon: Any, loop: Any) -> float:
    """Twice the signed area of some corners of a polygon."""
    u = polygon[list(loop)] - polygon[loop[0]]
    v = np.roll(u, -1, axis=0)
    return float((u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum())


def least(piece: Any, n: Any) -> tuple[float, Any]:
    """Least n.x over a piece, for any n, and where."""
    if isinstance(piece, Hull):
        heights = piece.points @ n
        k = int(np.argmin(heights))
        size, where = np.linalg.norm(n), piece.points[k]
        if size > 0.0:
            where = where - (piece.radius / size) * n
        return float(heights[k] - piece.radius * size), where
    assert isinstance(piece, FlatCylinder)
    along = piece.axis @ n
    across = n - along * piece.axis
    size = np.linalg.norm(across)
    where = piece.centre - piece.half_length * np.sign(along) * piece.axis
    if size > 0.0:
        where = where - piece.radius * across / size
    value = piece.centre @ n - piece.half_length * abs(along) - piece.radius * size
    return float(value), where


@dataclass(eq=False)
class OracleWriter:
    """Writes one certificate.

    Args:
        problem_path: The problem file.
        trajectory_path: The trajectory file.
        errors: E, of all angles or one by one, B, O.
    """

    problem_path: Path
    trajectory_path: Path
    errors: tuple[Any, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Read the two files."""
        self.problem = read_problem(self.problem_path)
        self.arm = self.problem.manipulator
        self.trajectory = read_trajectory(self.trajectory_path, self.arm)
        self.lengths = np.array(self.arm.link_lengths)
        count = 2 * len(self.lengths)
        self.joint_errors = np.broadcast_to(np.ravel(self.errors[0]), count)
        self.q = self.trajectory.joints
        if len(self.q) == 1:
            self.q = np.repeat(self.q, 2, axis=0)

    # ---- the bound -------------------------------------------------------------------

    @cache  # noqa: B019  (writers live as long as their test)
    def bends(self, k: int, first: int) -> tuple[Any, Any, Any]:
        """M_j, D_j and the second order, j = 0..N, for a chain from joint first on."""
        n = len(self.lengths)
        change = np.abs(self.q[k + 1] - self.q[k])
        bend, drift, second = np.zeros(n + 1), np.zeros(n + 1), np.zeros(n + 1)
        for j in range(first + 1, n + 1):
            for link in range(first, j):
                rate = sum(
                    change[1 + 2 * m] + change[2 + 2 * m]
                    for m in range(first, link + 1)
                )
                turned = self.joint_errors[2 * first : 2 * link + 2].sum()
                bend[j] += self.lengths[link] * rate**2
                drift[j] += turned * self.lengths[link] * rate
                second[j] += 0.5 * self.lengths[link] * turned**2
        return bend, drift, second

    @cache  # noqa: B019
    def pose(self, k: int, time: float) -> tuple[Any, Any]:
        return frames_and_centres(
            self.lengths, self.q[k] + time * (self.q[k + 1] - self.q[k])
        )

    def top(
        self, k: int, a: float, b: float, j: int, first: int, n: Any, link: int
    ) -> float:
        """Largest n.O_j over the slice; n in the frame of `link` (-1: the base)."""
        bend, drift, second = (values[j] for values in self.bends(k, first))
        heights, gains = [], []
        for time in (a, b):
            frames, centres = self.pose(k, time)
            m = frames[link + 1] @ n
            heights.append(m @ (centres[j] - (centres[first - 1] if first else 0.0)))
            gain = 0.0
            for p in range(first, j):
                axes = frames[p][:, 2], frames[p + 1][:, 1]
                for axis, error in zip(axes, self.joint_errors[2 * p :], strict=False):
                    gain += error * abs(m @ np.cross(axis, centres[j] - centres[p]))
            gains.append(gain)
        h = b - a
        growth = sum(gains) / 2 + h * drift / 2 + second
        return max(heights) + bend * h * h / 8 + growth

    def plane_to_pieces(
        self, k: int, a: float, b: float, link: int, pieces: Any
    ) -> Any:
        """[n, lower] for a range of pieces."""
        if isinstance(pieces[0], HalfSpacePiece):
            n = -np.array(pieces[0].normal)
        else:
            ends = np.vstack([self.pose(k, t)[1][link : link + 2] for t in (a, b)])

            def difference(d: Any) -> Any:
                low = min((least(piece, d) for piece in pieces), key=lambda x: x[0])
                return low[1] - ends[np.argmax(ends @ d)]

            v = nearest(difference, least(pieces[0], np.ones(3))[1] - ends[0])
            size = np.linalg.norm(v)
            n = v / size if size > 1e-12 else np.array([1.0, 0.0, 0.0])
        return n, self.proved_of_pieces(k, a, b, link, pieces, n) - PAD

    def proved_of_pieces(
        self, k: int, a: float, b: float, link: int, pieces: Any, n: Any
    ) -> float:
        """What a plane with unit normal n proves of a range of pieces."""
        if isinstance(pieces[0], HalfSpacePiece):
            support = -pieces[0].offset
        else:
            support = min(least(piece, n)[0] for piece in pieces)
        _, base, surface = self.errors
        tops = [self.top(k, a, b, j, 0, n, -1) for j in (link, link + 1)]
        lost = surface + base + self.arm.link_radius
        return float(support - lost - max(tops))

    def plane_to_link(self, k: int, a: float, b: float, link: int, other: int) -> Any:
        frames, centres = self.pose(k, (a + b) / 2)
        local = (centres[other : other + 2] - centres[link]) @ frames[link + 1]
        fixed = np.array([[0.0, 0, 0], [self.lengths[link], 0, 0]])

        def difference(d: Any) -> Any:
            return local[np.argmin(local @ d)] - fixed[np.argmax(fixed @ d)]

        v = nearest(difference, local[0] - fixed[0])
        n = -v / np.linalg.norm(v)
        return n, self.proved_of_link(k, a, b, link, other, n) - PAD

    def proved_of_link(
        self, k: int, a: float, b: float, link: int, other: int, n: Any
    ) -> float:
        """What a plane with unit normal n, from `other` to `link`, proves of a pair."""
        tops = [self.top(k, a, b, j, link + 1, n, link) for j in (other, other + 1)]
        own = max(0.0, -self.lengths[link] * n[0]) + 2 * self.arm.link_radius
        return float(-max(tops) - own)

    # ---- slices ----------------------------------------------------------------------

    def planes(
        self, k: int, a: float, b: float, link: int, pieces: Any, first: int
    ) -> Any:
        """Planes for pieces from number `first` on, or None."""
        n, lower = self.plane_to_pieces(k, a, b, link, pieces)
        if lower >= self.problem.required_clearance:
            return [[first, first + len(pieces), *map(float, n), float(lower)]]
        if len(pieces) == 1:
            return None
        half = len(pieces) // 2
        left = self.planes(k, a, b, link, pieces[:half], first)
        right = left and self.planes(k, a, b, link, pieces[half:], first + half)
        return right and left + right

    def proof(
        self, k: int, link: int, partner: Any, a: float = 0.0, b: float = 1.0
    ) -> Any:
        """Slices of one pair over [a, b]."""
        if isinstance(partner, int):
            n, lower = self.plane_to_link(k, a, b, link, partner)
            good = lower >= self.problem.required_self_clearance
            planes = [[0, 1, *map(float, n), float(lower)]] if good else None
        else:
            planes = self.planes(k, a, b, link, partner.pieces, 0)
        if planes:
            return [[a, b, planes]]
        if b - a <= SMALLEST_SLICE:
            message = f"interval {k} [{a}, {b}], link {link + 1}, {partner}"
            raise CannotCertify(message)
        middle = (a + b) / 2
        left = self.proof(k, link, partner, a, middle)
        return left + self.proof(k, link, partner, middle, b)

    # ---- the file --------------------------------------------------------------------

    def partners(self) -> Any:
        links = range(len(self.lengths))
        pairs: list[Any] = [(i, o) for o in self.problem.scene.obstacles for i in links]
        return pairs + [(i, k) for i in links for k in links if k >= i + 2]

    def pieces(self) -> Any:
        found = {}
        for obstacle in self.problem.scene.obstacles:
            if isinstance(obstacle, Prism) and len(obstacle.convex_sections) > 1:
                corners = obstacle.polygon.tolist()
                loops = [
                    [corners.index(point) for point in section.tolist()]
                    for section in obstacle.convex_sections
                ]
                sense = area(obstacle.polygon, range(len(corners)))
                found[obstacle.name] = [
                    loop[:: int(np.sign(area(obstacle.polygon, loop) * sense))]
                    for loop in loops
                ]
        return found

    def header(self) -> dict[str, Any]:
        pairs = [
            [f"link {other + 1}", f"link {i + 1}"]
            if isinstance(other, int)
            else [f"link {i + 1}", other.name]
            for i, other in self.partners()
        ]
        return {
            "vdsm_certificate": 9,
            "problem_sha256": self.problem.sha256,
            "trajectory_sha256": sha256(self.trajectory_path.read_bytes()),
            "versions": {"vdsm_pin": "0", "numpy": np.__version__},
            "errors": {
                "joints_rad": self.joint_errors.tolist(),
                "base": [self.errors[1], 0.0],
                "obstacles": {
                    one.name: [self.errors[2], 0.0]
                    for one in self.problem.scene.obstacles
                },
            },
            "interpolation": "linear",
            "pairs": pairs,
            "pieces": self.pieces(),
            "joined": {},
            "links": {},
        }

    def lines(self) -> list[Any]:
        """The certificate's lines but the last one."""
        intervals = [
            {"k": k, "proofs": [self.proof(k, *pair) for pair in self.partners()]}
            for k in range(len(self.q) - 1)
        ]
        return [self.header(), *intervals]


def sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def sealed(lines: list[Any]) -> bytes:
    """The file of these lines, with a last line that fits them."""
    body = "".join(json.dumps(line) + "\n" for line in lines).encode()
    end = {"end": True, "sha256": sha256(body)}
    return body + json.dumps(end).encode() + b"\n"
