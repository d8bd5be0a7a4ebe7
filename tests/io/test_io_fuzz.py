"""Damaged files give a problem or InvalidInput, never anything else.

pytest turns every warning into an error here, so a silent overflow counts as well.
"""

from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from mutations import changed_bytes, changed_data
from problem_texts import EVERYTHING, TETRAHEDRON, binary_stl, write_everything

from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.errors import InvalidInput
from vdsm_pin.io.mesh_file import read_mesh
from vdsm_pin.io.problem_file import built_in_names, built_in_text, read_problem
from vdsm_pin.io.trajectory_file import read_trajectory, write_trajectory
from vdsm_pin.problem.trajectory import Trajectory

MESHES = ("stl", "text.stl", "obj", "ply", "binary.ply", "glb", "dae")
TEXTS = [EVERYTHING.replace("1e3", "1000"), *map(built_in_text, built_in_names())]


def outcome(read: Callable[[], object], content: bytes) -> str:
    """`good` or `refused`; anything else fails with the content that did it."""
    try:
        read()
    except InvalidInput as error:
        message = str(error)
        assert 0 < len(message) < 2_000, message
        assert "\n" not in message, message
        return "refused"
    except BaseException as error:
        error.add_note(f"content: {content!r}")
        raise
    return "good"


def count_outcomes(
    read: Callable[[], object], path: Path, contents: list[bytes]
) -> Counter[str]:
    counts: Counter[str] = Counter()
    for content in contents:
        path.write_bytes(content)
        counts[outcome(read, content)] += 1
    return counts


def damaged_problems(count: int, seed: int) -> list[bytes]:
    """Half with changed values, half with changed bytes."""
    rng = np.random.default_rng(seed)
    contents = []
    for i in range(count):
        text = TEXTS[int(rng.integers(len(TEXTS)))]
        if i % 2:
            contents.append(changed_data(text, rng).encode())
        else:
            contents.append(changed_bytes(text.encode(), rng))
    return contents


def damaged_trajectories(folder: Path, count: int, seed: int) -> list[bytes]:
    rng = np.random.default_rng(seed)
    q = rng.uniform(-0.7, 0.7, (5, 17))
    trajectory = Trajectory(
        [True] * 5, np.arange(5) / 100, q[:, 0], q[:, 1::2], q[:, 2::2]
    )
    write_trajectory(trajectory, folder / "whole.csv")
    whole = (folder / "whole.csv").read_bytes()
    return [changed_bytes(whole, rng) for _ in range(count)]


def damaged_meshes(kind: str, count: int, seed: int) -> list[bytes]:
    rng = np.random.default_rng(seed)
    box = trimesh.creation.box()
    if kind == "stl":
        whole = binary_stl(TETRAHEDRON)
    elif kind == "text.stl":
        corners = "".join(f"vertex {i} 0 1\n" for i in range(3))
        loop = f"facet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet\n"
        whole = f"solid a\n{loop * 3}endsolid a\n".encode()
    elif kind == "ply":
        whole = box.export(file_type="ply", encoding="ascii")
    elif kind == "binary.ply":
        whole = box.export(file_type="ply", encoding="binary")
    elif kind == "glb":
        whole = trimesh.Scene(box).export(file_type="glb")
    elif kind == "dae":
        whole = box.export(file_type="dae")
    else:
        whole = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1/1 2//1 4 3\nf -1 -2 -3\n"
    return [changed_bytes(whole, rng) for _ in range(count)]


def fuzz_problems(folder: Path, count: int, seed: int) -> Counter[str]:
    path = write_everything(folder)
    contents = damaged_problems(count, seed)
    return count_outcomes(lambda: read_problem(path), path, contents)


def fuzz_trajectories(folder: Path, count: int, seed: int) -> Counter[str]:
    path, arm = folder / "t.csv", built_in("hrm8")
    contents = damaged_trajectories(folder, count, seed)
    return count_outcomes(lambda: read_trajectory(path, arm), path, contents)


def fuzz_meshes(folder: Path, count: int, seed: int) -> Counter[str]:
    counts: Counter[str] = Counter()
    for kind in MESHES:
        path = folder / f"part.{kind}"
        contents = damaged_meshes(kind, count // len(MESHES), seed)
        counts += count_outcomes(lambda path=path: read_mesh(path), path, contents)
    return counts


FUZZERS = (fuzz_problems, fuzz_trajectories, fuzz_meshes)


@pytest.mark.parametrize("fuzz", FUZZERS)
def test_hundreds_of_damaged_files(
    tmp_path: Path, fuzz: Callable[[Path, int, int], Counter[str]]
) -> None:
    counts = fuzz(tmp_path, 455, 0)
    assert counts["good"] + counts["refused"] == 455
    # Both ends are seen: some damage is harmless, most is not.
    assert counts["good"] > 1
    assert counts["refused"] > 150


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 11))
@pytest.mark.parametrize("fuzz", FUZZERS)
def test_thousands_of_damaged_files(
    tmp_path: Path, fuzz: Callable[[Path, int, int], Counter[str]], seed: int
) -> None:
    counts = fuzz(tmp_path, 6_300, seed)
    assert counts["good"] + counts["refused"] == 6_300
