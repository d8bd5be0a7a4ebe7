"""Proofs of trees as the certificate checker's core takes them."""

from typing import Any

import numpy as np
from flint import arb, arb_mat
from oracles.shortcuts import start_proof
from oracles.tree_queries import TreeQuery

from vdsm_pin.certificate_checker.claims import Clearances
from vdsm_pin.certificate_checker.motion import Branch, Path
from vdsm_pin.certificate_checker.solids import Body, Pair, Solid
from vdsm_pin.certificate_checker.tree import Joint, Tree
from vdsm_pin.geometry.convex import FlatCylinder, HalfSpacePiece
from vdsm_pin.proof.bodies import ErrorBox, PairTable
from vdsm_pin.proof.bodies import Pair as Asked
from vdsm_pin.proof.layouts import CLAIM, FIRST, LAST, PLANE_NORMAL, RECORD
from vdsm_pin.proof.recording import record

ROOM = 20_000


def controls(*columns: Any) -> list[Any]:
    """Control points of q, of those of each of its columns."""
    rows = zip(*columns, strict=True)
    return [arb_mat([[arb(value) for value in row]]) for row in rows]


def solid_of(name: str, piece: Any) -> Solid:
    """One convex piece."""
    if isinstance(piece, HalfSpacePiece):
        found = Solid(name, [[piece.offset * piece.normal]])
        found.normal = np.array(piece.normal)
        return found
    if isinstance(piece, FlatCylinder):
        half = piece.half_length * piece.axis
        ends = [[piece.centre - half, piece.centre + half]]
        return Solid(name, ends, disc=(piece.axis, piece.radius))
    return Solid(name, [piece.points], radius=piece.radius)


def tree_of(query: TreeQuery, box: ErrorBox) -> Tree:
    """The joints with their errors."""
    joints = []
    for k, one in enumerate(query.tree.joints):
        moved = one.column, one.ratio, one.offset
        errors = [float(x[k]) for x in (box.joints, box.shifts, box.tilts)]
        place = one.parent, one.kind.name, one.axis, one.placement
        joints.append(Joint(*place, moved, (errors[0], errors[1], errors[2])))
    return Tree(joints)


class Core:
    """The checker's view of a query of two bodies of one piece each."""

    def __init__(self, query: TreeQuery, box: ErrorBox, required: float) -> None:
        motion = query.path
        inner = motion.inner if motion.inner.size else None
        self.path = Path(Branch(motion.knots, None, inner))
        self.tree, (one, other) = tree_of(query, box), query.bodies
        body = Body(one.frame, solid_of(one.name, one.pieces[0]))
        rests = Body(other.frame, solid_of(other.name, other.pieces[0]))
        self.pair = Pair(body, rests, required)

    def check(self, proofs: list[Any]) -> None:
        """Check the proofs of all intervals."""
        lines = ({"k": k, "proofs": [proof]} for k, proof in enumerate(proofs))
        Clearances(self.tree, self.path, [self.pair]).check(lines)


def proofs_of(query: TreeQuery, box: ErrorBox, required: float) -> list[Any] | None:
    """The proof of each interval by the prover, None where it finds none."""
    table = PairTable.of([Asked(1, 0, required)])
    made = start_proof(query.tree, query.bodies, query.path, table, box)
    if not made.plan.swapped.all():  # the first body is to be the one that moves
        return None
    records = np.zeros((ROOM, RECORD))
    n = query.path.n_intervals
    count, reached, pair = record(made.task, made.motion, made.work, 0, n, records)
    if pair >= 0 or reached < n:
        return None
    proofs: list[Any] = [[] for _ in range(n)]
    for row in records[:count].tolist():
        plane = [int(row[FIRST]), int(row[LAST]), *row[PLANE_NORMAL:CLAIM], row[CLAIM]]
        proofs[int(row[0])].append([row[2], row[3], [plane]])
    return [sorted(slices) for slices in proofs]
