"""What was assumed of the inputs stands where nobody can miss it."""

from dataclasses import replace
from pathlib import Path

import made_up
import numpy as np
import pytest

from vdsm_pin.arm.mounted import LinkBody
from vdsm_pin.geometry.solids import Mesh
from vdsm_pin.problem.scene import Scene
from vdsm_pin.report.facts import batch_row, verification_file
from vdsm_pin.report.html import write_report
from vdsm_pin.report.inputs import BEHIND
from vdsm_pin.report.terminal import show_verification
from vdsm_pin.verification.records import Verification


def judged(assumed: str, *notes: str, carried: bool = False) -> Verification:
    """A verification with a mesh for its last obstacle, or carried by a link."""
    made = made_up.verification()
    mesh = Mesh(
        "Wing <b>",
        np.eye(3),
        np.array([[0, 1, 2]]),
        assumed_size=assumed,
        notes=notes,
    )
    if carried:
        arm = replace(made.problem.manipulator, bodies=(LinkBody(2, mesh),))
        return replace(made, problem=replace(made.problem, manipulator=arm))
    obstacles = (*made.problem.scene.obstacles[:-1], mesh)
    return replace(made, problem=replace(made.problem, scene=Scene(obstacles)))


@pytest.mark.parametrize("carried", [False, True])
def test_an_assumed_size_stands_in_the_first_line_of_the_verdict(
    carried: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    verification = judged("12 x 3 x 0.6 mm", "something odd", carried=carried)
    file = verification_file(verification, made_up.RECORD)
    assert file.assumed_sizes == ("'Wing <b>' is 12 x 3 x 0.6 mm",)
    words = "assuming that 'Wing <b>' is 12 x 3 x 0.6 mm; no unit is stated"
    show_verification(file, tmp_path)
    first, *others = capsys.readouterr().out.splitlines()
    assert first.endswith(f", {words}")
    assert any("mesh 'Wing <b>': something odd" in line for line in others)
    assert batch_row("f", "fewest", file).reason == f"{file.reason}; {words}"
    write_report(tmp_path / "report.html", verification, file, None)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "assuming that &#39;Wing &lt;b&gt;&#39; is 12 x 3 x 0.6 mm" in page
    assert "mesh &#39;Wing &lt;b&gt;&#39;: something odd" in page


def test_nothing_is_said_where_nothing_was_assumed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = verification_file(judged(""), made_up.RECORD)
    assert file.assumed_sizes == ()
    assert file.notes == (BEHIND,)  # there is an obstacle
    show_verification(file, tmp_path)
    assert "assuming" not in capsys.readouterr().out
    assert batch_row("f", "fewest", file).reason == file.reason
