"""What is asked as compiled code reads it: bodies, pairs, what lies between them."""

from collections.abc import Sequence

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.pieces import PackedPieces, pack_pieces
from vdsm_pin.proof.bodies import Body, ErrorBox, PairTable
from vdsm_pin.proof.moving_sides import moving_sides
from vdsm_pin.proof.packed_tree import pack_tree, strokes
from vdsm_pin.proof.terms import ACROSS, WITHIN, Pairs, Rules, Task
from vdsm_pin.proof.tree import Tree
from vdsm_pin.proof.ways import WayErrors, way_errors


def pack_task(
    tree: Tree,
    bodies: Sequence[Body],
    pairs: PairTable,
    rules: Rules,
    reach: FloatArray | None = None,
    columns: IntArray | None = None,
    pieces: PackedPieces | None = None,
) -> Task:
    """What is asked, without errors.

    Args:
        tree: The joints.
        bodies: The bodies; they are the packed scene's obstacles, in their order.
        pairs: The first body of each is one bounded convex piece and moves past the
            second.
        rules: What may be assumed.
        reach: How large each column of q gets, where that is known, (n_columns,); where
            placements may turn and it is not, nothing is proved.
        columns: Where a profile has each body's bounds, -1 for nowhere, (n_bodies,).
        pieces: Those of the bodies packed already, at least of the second ones.

    Raises:
        ValueError: If a first body is not of that kind, or both ride on one frame.
    """
    joints, frames = pack_tree(tree, reach), np.array([body.frame for body in bodies])
    if columns is None:
        columns = np.full(len(bodies), -1)
    each, mover = np.unique(pairs.one, return_inverse=True)
    same = np.flatnonzero(frames[pairs.one] == frames[pairs.other])
    if same.size:
        one, other = pairs.one[same[0]], pairs.other[same[0]]
        message = f"bodies {one} and {other} ride on one frame: they cannot part"
        raise ValueError(message)
    branch, n = tree.branches, pairs.one.size
    apart = branch[frames[pairs.one]] != branch[frames[pairs.other]]
    sides, n_movers = frames[pairs.other], max(1, each.size)
    asked, of_pair = np.unique(sides * n_movers + mover, return_inverse=True)
    moving = moving_sides(
        tree,
        tuple(bodies[k] for k in each.tolist()),
        tuple(
            zip((asked // n_movers).tolist(), (asked % n_movers).tolist(), strict=True)
        ),
    )
    packed = Pairs(
        rough=np.zeros((n, 0), np.int64) if pairs.rough is None else pairs.rough,
        body=mover.astype(np.int64),
        obstacle=pairs.other.astype(np.int64),
        way=moving.way[of_pair],
        slot=moving.slot[of_pair],
        slots=moving.slots,
        group=np.where(apart, ACROSS, WITHIN),
        column=np.where(apart, columns[pairs.other], -1).astype(np.int64),
        required=pairs.required.astype(np.float64),
        loose=np.zeros(n) if pairs.loose is None else pairs.loose,
        lost=np.zeros(n),
        rise=np.zeros(n),
    )
    movers = moving.bodies._replace(
        number=each.astype(np.int64), column=columns[each].astype(np.int64)
    )
    if pieces is None:
        pieces = pack_pieces([body.pieces for body in bodies])
    exact = moving.exact
    between = moving.ways, exact, moving.places
    task = Task(pieces, joints, *between, movers, packed, rules)
    return _erring(task, exact, np.zeros(n))


def for_motion(
    task: Task, tree: Tree, reach: FloatArray, rules: Rules, errors: ErrorBox
) -> Task:
    """A task of no motion, as one motion under errors asks it.

    Args:
        task: What is asked.
        tree: Its joints.
        reach: How large each column of q gets, shape (n_columns,).
        rules: What may be assumed.
        errors: Of joints, placements and surfaces.
    """
    joints = task.tree._replace(stroke=strokes(tree, reach))
    return with_errors(task._replace(tree=joints, rules=rules), errors)


def with_errors(task: Task, box: ErrorBox) -> Task:
    """The same asked about another error box."""
    pairs = task.pairs
    arrays = (np.ascontiguousarray(x) for x in (box.joints, box.shifts, box.tilts))
    erring = way_errors(task.tree, task.ways, *arrays)
    shift = erring.shifted[pairs.way]
    if box.surfaces is not None:
        moving = task.bodies.number[pairs.body]
        shift = shift + box.surfaces[pairs.obstacle] + box.surfaces[moving]
    return _erring(task, erring, shift)


def _erring(task: Task, errors: WayErrors, shift: FloatArray) -> Task:
    """The same with what errors come to, and by how much each pair is shifted.

    Where errors turn, what bodies sweep is told corner by corner: no pair is rough.
    """
    pairs, pad, steady = task.pairs, task.rules.pad, not errors.any_turn
    rules = task.rules._replace(steady=steady, nominal=steady and not shift.any())
    radius = task.bodies.radius[pairs.body]
    rough = pairs.rough if steady else np.full_like(pairs.rough, -1)
    lost = radius + pad + shift + pairs.loose
    pairs = pairs._replace(rough=rough, lost=lost, rise=pad - radius)
    return task._replace(pairs=pairs, rules=rules, errors=errors)
