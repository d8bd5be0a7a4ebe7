"""Hundreds of files as programs write them: read to the last bit, or refused."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import reader_variants


def program(*words: object) -> subprocess.CompletedProcess[str]:
    path = Path(reader_variants.__file__)
    return subprocess.run(
        [sys.executable, "-W", "error", path, *map(str, words)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_hundreds_of_files_are_read_right_or_refused(tmp_path: Path) -> None:
    counts = reader_variants.check_many(tmp_path, 0, 200)
    assert sum(counts.values()) == 600
    for check in reader_variants.CHECKS:
        assert counts[f"{check.__name__} read"] > 60
        assert counts[f"{check.__name__} refused"] > 10


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 6))
def test_thousands_of_files_within_a_limit_of_memory(seed: int) -> None:
    done = program(seed, 4_000, 256)
    assert done.returncode == 0, done.stderr
    assert sum(json.loads(done.stdout).values()) == 12_000


@pytest.mark.slow
def test_the_limit_of_memory_is_felt() -> None:
    """The same within next to nothing ends badly: the limit above is a limit."""
    assert "MemoryError" in program(1, 400, 1).stderr


@pytest.mark.slow
def test_a_text_of_160_mb_is_read_within_four_times_its_triangles(
    tmp_path: Path,
) -> None:
    n, path = 1_130, tmp_path / "big.obj"
    i = np.arange(n * n).reshape(n, n) + 1
    quads = np.stack([i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]], axis=-1)
    with path.open("w") as file:
        for u in range(n):
            for v in range(n):
                x, y = u / 3, v / 7
                file.write(f"v {x:.16f} {y:.16f} {np.sin(x * y):.16f}\nvn 0 0 1\n")
        for face in quads.reshape(-1, 4).tolist():
            file.write("f " + " ".join(f"{k}//{k}" for k in face) + "\n")
    assert path.stat().st_size > 150e6
    code = (
        "import resource, sys; from pathlib import Path\n"
        "from vdsm_pin.io.mesh_file import read_mesh\n"
        "mesh = read_mesh(Path(sys.argv[1]))\n"
        "peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "print(len(mesh.triangles), peak)"
    )
    run = [sys.executable, "-c", code, str(path)]
    done = subprocess.run(run, capture_output=True, text=True, check=True)
    triangles, peak_kib = map(int, done.stdout.split())
    assert triangles == 2 * (n - 1) ** 2
    assert peak_kib * 1024 < 100e6 + 300 * triangles
