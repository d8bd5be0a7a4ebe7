"""The checker's core on random trees: what the prover proves, and nothing else."""

import copy
import re
from typing import Any

import numpy as np
import pytest
from flint import ctx
from oracles.tree_certificates import Core, proofs_of
from oracles.tree_queries import (
    TreeQuery,
    at,
    clearances,
    make_query,
    random_box,
    wrong_poses,
)

from vdsm_pin.certificate_checker.balls import Rejected
from vdsm_pin.proof.bodies import ErrorBox

Rng = np.random.Generator
MOST_SLICES = 60


def found_of(rng: Rng) -> tuple[TreeQuery, ErrorBox, float, list[Any]] | None:
    """A query of one piece a body that the prover certifies in few slices."""
    degree, joints = int(rng.choice([1, 3, 5])), int(rng.integers(1, 9))
    query = make_query(rng, degree, joints)
    if query.shape == "pieces" or not query.nearest > 0.01:
        return None
    box = random_box(rng, query.tree)
    required = float(rng.choice([0.0, 0.3, 0.9])) * query.nearest
    proofs = proofs_of(query, box, required)
    if proofs is None or len(proofs[0]) > MOST_SLICES:
        return None
    return query, box, required, proofs


def refused(core: Core, proofs: list[Any]) -> str:
    """Why the proofs are not accepted, empty where they are."""
    with ctx.workprec(128):
        try:
            core.check(proofs)
        except Rejected as error:
            return str(error)
    return ""


def assert_true(query: TreeQuery, box: ErrorBox, proofs: list[Any], rng: Rng) -> None:
    """No sampled clearance of a wrong motion is below what is claimed of its slice."""
    for start, stop, planes in proofs[0]:
        t = rng.uniform(start, stop, 4)
        poses = np.stack(
            [wrong_poses(query.tree, q, box, rng) for q in at(query.path, t)]
        )
        seen = clearances(query.tree, query.bodies, poses)
        assert (seen >= planes[0][-1] - 1e-9).all()


def proved(core: Core, proofs: list[Any], plane: Any) -> float:
    """What the checker says that a plane proves; [m]."""
    plane[-1] = 1e3
    found = re.search("proves (.*) mm, required", refused(core, proofs))
    assert found is not None
    return float(found[1]) / 1e3


def damaged(core: Core, proofs: list[Any], rng: Rng) -> tuple[list[Any], str]:
    """The same with one thing changed that no longer is as it was proved."""
    made = copy.deepcopy(proofs)
    k = int(rng.integers(len(made[0])))
    slice_, plane = made[0][k], made[0][k][2][0]
    kind = str(
        rng.choice(["more", "turned", "gone", "later", "wider", "pieces", "nan"])
    )
    if kind == "more":
        plane[-1] = proved(core, made, plane) + 10.0 ** rng.uniform(-10, 0)
    elif kind == "turned":
        plane[2:5] = [-x for x in plane[2:5]]
    elif kind == "gone":
        made[0].pop(k)
    elif kind == "later":
        slice_[0] += 1e-3
    elif kind == "wider":
        slice_[1] += 1e-3
    elif kind == "pieces":
        plane[1] += 1
    else:
        plane[int(rng.integers(2, 6))] = float("nan")
    return made, kind


def run(seed: int, count: int) -> tuple[int, int]:
    """Random queries; how many were accepted, and how many forgeries refused."""
    rng, accepted, forged = np.random.default_rng(seed), 0, 0
    for _ in range(count):
        if (found := found_of(rng)) is None:
            continue
        query, box, required, proofs = found
        core = Core(query, box, required)
        assert refused(core, proofs) == "", (query.shape, query.path.degree)
        assert_true(query, box, proofs, rng)
        accepted += 1
        for _ in range(6):
            made, kind = damaged(core, proofs, rng)
            assert refused(core, made), kind
            forged += 1
        forged += assert_more_errors_are_refused(query, box, core, proofs)
    return accepted, forged


def assert_more_errors_are_refused(
    query: TreeQuery, box: ErrorBox, core: Core, proofs: list[Any]
) -> bool:
    """All that is proved under an error box is too much of a larger one, if felt."""
    made, shifts = copy.deepcopy(proofs), box.shifts + 1e-4
    plane = made[0][0][2][0]
    plane[-1] = proved(core, made, plane) - 1e-9
    assert refused(core, made) == ""
    larger = ErrorBox(box.joints, shifts, box.tilts)
    wrong = Core(query, larger, core.pair.required)
    steps = wrong.tree.way(query.bodies[1].frame, query.bodies[0].frame)
    assert bool(refused(wrong, made)) == bool(steps)
    return bool(steps)


@pytest.mark.parametrize("seed", range(2))
def test_what_is_proved_of_trees_is_accepted_and_forgeries_are_not(seed: int) -> None:
    accepted, forged = run(seed, 20)
    assert accepted > 4
    assert forged > 25


@pytest.mark.slow
def test_thousands_of_trees_and_forgeries() -> None:
    accepted, forged = run(99, 3_000)
    print(accepted, forged)  # noqa: T201  (shown by pytest -s)
    assert accepted > 1_000
    assert forged > 6_000
