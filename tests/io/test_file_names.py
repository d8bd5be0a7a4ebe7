"""Files are called as they are called: bytes, of which some are no text."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from problem_texts import TETRAHEDRON, binary_stl

from vdsm_pin.cli import main

PROBLEM = """\
vdsm_problem: 1
length_unit: mm
manipulator: {link_lengths: [400, 400], link_radius: 30, max_link_angle_deg: 45,
  max_joint_angle_deg: 45}
obstacles: [{name: part, shape: mesh, file: part.stl, scale: 200, center: [0, 900, 0]}]
tip_path: {start: [800, 0, 0], points: [[800, 0, 0], [900, 0, 0]]}
required_clearance: 5
"""


def run(folder: Path, *words: bytes) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(
        [os.fsencode(sys.executable), b"-m", b"vdsm_pin", *words],
        cwd=folder, capture_output=True, check=False,
    )  # fmt: skip


def test_every_command_takes_names_that_are_no_text(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Latin-1 names on a system of UTF-8, as archives from elsewhere bring them."""
    where = tmp_path / os.fsdecode(b"Geh\xe4use")
    where.mkdir()
    (where / "part.stl").write_bytes(binary_stl(TETRAHEDRON))
    names = problem, rows, proof = b"p\xff.yaml", b"t\xfe.csv", b"c\xfd.certificate"
    (where / os.fsdecode(problem)).write_text(PROBLEM)
    done = run(where, b"plan", problem, b"--out", b"o\xff")
    assert done.returncode == 0, done.stderr.decode()
    monkeypatch.chdir(where)

    def ended(*words: bytes) -> object:
        with pytest.raises(SystemExit) as end:
            main([*map(os.fsdecode, words)])
        return end.value.code

    assert ended(b"batch", problem, b"--out", b"b\xff") == 0
    assert ended(b"view", problem, b"--html", b"v\xff.html") == 0
    shutil.copy(
        where / os.fsdecode(b"o\xff") / "trajectory.csv", where / os.fsdecode(rows)
    )
    done = run(where, b"verify", problem, b"--trajectory", rows, b"--out", b"o\xff",
               b"--certificate", proof)  # fmt: skip
    assert done.returncode == 0, done.stderr.decode()
    assert ended(b"check-certificate", proof, problem, rows) == 0
    capsys.readouterr()
    for name in names:
        (where / os.fsdecode(name)).unlink()
        assert ended(b"check-certificate", proof, problem, rows) == 2
        assert capsys.readouterr().err.count("\n") == 1
        (where / os.fsdecode(name)).write_bytes(b"x")


@pytest.mark.parametrize("name", [b"\xff", b"a\x1b[31m", b"a\nb"])
def test_a_name_in_a_message_is_one_line_of_what_can_be_seen(
    tmp_path: Path, name: bytes
) -> None:
    done = run(tmp_path, b"plan", name + b".yaml", b"--out", b"o")
    assert done.returncode == 2
    assert done.stderr.count(b"\n") == 1
    assert done.stderr.decode().strip().isprintable()
