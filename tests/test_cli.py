"""Oracle: exit status, the two output streams, and what is on the disk afterwards.

Commands run in this process through `main`; one runs as a real process.
"""

import html
import json
import math
import os
import re
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import jsonschema
import numpy as np
import pytest
import typer
from problem_files import BEHIND_A_WALL, NEAR, OUT_OF_REACH, write_problem

from vdsm_pin.batch.run import Batch, run_batch
from vdsm_pin.batch.task import TaskSettings
from vdsm_pin.cli import app, main
from vdsm_pin.cli.ending import fail
from vdsm_pin.errors import NoPlanFound
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.strategies import STRATEGIES, strategy
from vdsm_pin.report.files import SCHEMA_NAMES, BatchRow, schema

COMMANDS = list(typer.main.get_command(app).commands)  # type: ignore[attr-defined]


@dataclass
class Ran:
    status: int
    out: str
    err: str


class Shell:
    """Runs `vdsm` in this process."""

    def __init__(self, capsys: pytest.CaptureFixture[str]) -> None:
        self.capsys = capsys

    def __call__(self, *words: object) -> Ran:
        self.capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            main([str(word) for word in words])
        captured = self.capsys.readouterr()
        return Ran(int(ended.value.code or 0), captured.out, captured.err)


@pytest.fixture
def vdsm(capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(capsys)


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a problem, its plan and its verification."""
    folder = tmp_path_factory.mktemp("planned")
    problem = write_problem(folder / "near.yaml", NEAR)
    with pytest.raises(SystemExit) as plan:
        main(["plan", str(problem), "--out", str(folder)])
    assert plan.value.code == 0
    trajectory = str(folder / "trajectory.csv")
    with pytest.raises(SystemExit) as verify:
        main(["verify", str(problem), "--trajectory", trajectory, "--out", str(folder)])
    assert verify.value.code == 0
    return folder


def one_message(ran: Ran) -> str:
    """The one line on stderr, after checking that it is one."""
    assert "Traceback" not in ran.err
    lines = ran.err.strip().splitlines()
    assert len(lines) == 1, ran.err
    assert ran.out == ""
    return lines[0]


def test_help_is_quick_and_every_command_shows_an_example(vdsm: Shell) -> None:
    assert {"plan", "verify", "check-certificate"} < set(COMMANDS)
    assert vdsm("--help").status == 0
    assert "..." not in vdsm("--help").out.partition("Commands:")[2]
    for command in COMMANDS:
        ran = vdsm(command, "--help")
        assert ran.status == 0
        assert not re.search(r"^  --[\w-]+ <(str|path|int|float)", ran.out, re.M)
        assert re.search(rf"Examples:\n +vdsm {command}", ran.out), ran.out


def test_the_installed_command_answers_before_libraries_are_loaded() -> None:
    script = "import sys; sys.argv = ['vdsm', '--help']; import vdsm_pin.cli as c\n"
    script += "try: c.main()\nexcept SystemExit: pass\n"
    script += "print(sorted(m for m in sys.modules if '.' not in m))"
    ran = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    loaded = set(re.findall(r"'(\w+)'", ran.stdout.splitlines()[-1]))
    heavy = {"numpy", "numba", "pinocchio", "coal", "meshcat", "pydantic", "rich"}
    assert not loaded & heavy
    started = time.perf_counter()
    subprocess.run(
        [sys.executable, "-m", "vdsm_pin", "--help"], capture_output=True, check=True
    )
    assert time.perf_counter() - started < 2.0, "a sane machine needs a tenth of it"


@pytest.mark.parametrize(
    "words",
    [
        ["dance"],
        ["plan"],
        ["plan", "paper/free"],
        ["plan", "paper/free", "--out"],
        ["plan", "paper/free", "--out", "x", "--speed", "9"],
        ["verify", "paper/free", "--out", "x"],
        ["batch", "--out", "x", "--jobs", "0"],
        ["batch", "--out", "x", "--time-limit", "-1"],
        ["view", "paper/free", "--port", "99999"],
        ["view", "paper/free", "--html", "x.html", "--watch"],
        ["view", "paper/free", "--html", "x.html", "--port", "8000"],
        ["convert", "paper/free", "--out", "x"],
        ["convert", "paper/free", "--out", "x", "--cables", "a", "--centres", "b"],
    ],
)
def test_wrong_usage_is_status_2(vdsm: Shell, words: list[str]) -> None:
    ran = vdsm(*words)
    assert ran.status == 2
    assert "Traceback" not in ran.err


def test_a_folder_of_packages_that_is_missing_is_refused(
    vdsm: Shell, tmp_path: Path
) -> None:
    place = tmp_path / "nowhere"
    words = ["verify", "--urdf", "a.urdf", "--trajectory", "a.csv", "--out", "a"]
    result = vdsm(*words, "--package-dir", place)
    assert (result.status, "does not exist" in result.err) == (2, True)


def test_a_batch_without_a_folder_goes_to_out(
    vdsm: Shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = vdsm("batch", "paper/free")
    assert (result.status, "see out/index.html" in result.out) == (0, True)
    assert (tmp_path / "out" / "index.html").exists()


def test_an_arm_is_converted_both_ways(
    vdsm: Shell, planned: Path, tmp_path: Path
) -> None:
    """Angles, centres, cables and back (the paper's section 5)."""
    near, rows = planned / "near.yaml", planned / "trajectory.csv"
    made = tmp_path / "all"
    assert vdsm("convert", near, "--trajectory", rows, "--out", made).status == 0
    wanted = np.loadtxt(rows, delimiter=",", skiprows=1)
    for kind in ("centres", "cables"):
        back, file = tmp_path / kind, made / f"{kind}.csv"
        assert vdsm("convert", near, f"--{kind}", file, "--out", back).status == 0
        for name in ("trajectory", "centres", "cables"):
            found = np.loadtxt(back / f"{name}.csv", delimiter=",", skiprows=1)
            first = (
                wanted
                if name == "trajectory"
                else np.loadtxt(made / f"{name}.csv", delimiter=",", skiprows=1)
            )
            np.testing.assert_allclose(found, first, rtol=0, atol=1e-9)


def test_a_certified_motion_has_every_file(planned: Path) -> None:
    names = {path.name for path in planned.iterdir()}
    assert names == {
        "near.yaml", "trajectory.csv", "plan.json", "verification.json",
        "clearance.csv", "link_angles.csv", "centres.csv", "cables.csv",
        "report.html",
    }  # fmt: skip
    for name in ("plan", "verification"):
        content = json.loads((planned / f"{name}.json").read_text(encoding="utf-8"))
        jsonschema.validate(content, schema(name))
        assert content["verdict"] == "certified"
        assert content["command"].startswith(f"vdsm {name.replace('ication', 'y')}"[:9])
    report = (planned / "report.html").read_text(encoding="utf-8")
    assert "planned by" in report


def test_the_terminal_shows_every_check(
    vdsm: Shell, planned: Path, tmp_path: Path
) -> None:
    ran = vdsm(
        "verify", planned / "near.yaml",
        "--trajectory", planned / "trajectory.csv", "--out", tmp_path / "out",
    )  # fmt: skip
    assert ran.status == 0
    content = json.loads((planned / "verification.json").read_text(encoding="utf-8"))
    for check in content["checks"]:
        assert check["name"].replace("_", " ") in ran.out
    assert ran.out.startswith("✓ certified")
    assert "\x1b" not in ran.out, "no colours without a terminal"


def test_a_spoilt_motion_is_refuted_and_still_reported(
    vdsm: Shell, planned: Path, tmp_path: Path
) -> None:
    lines = (planned / "trajectory.csv").read_text(encoding="utf-8").splitlines()
    cells = lines[2].split(",")
    cells[4] = "0.9"  # alpha1, beyond every limit
    lines[2] = ",".join(cells)
    spoilt = tmp_path / "spoilt.csv"
    spoilt.write_text("\n".join(lines) + "\n", encoding="utf-8")
    out = tmp_path / "out"
    ran = vdsm("verify", planned / "near.yaml", "--trajectory", spoilt, "--out", out)
    assert ran.status == 1
    assert ran.out.startswith("✗ refuted")
    content = json.loads((out / "verification.json").read_text(encoding="utf-8"))
    assert content["verdict"] == "refuted"
    assert "planner unknown" in (out / "report.html").read_text(encoding="utf-8")


def test_an_infeasible_problem_leaves_a_page_that_says_why(
    vdsm: Shell, tmp_path: Path
) -> None:
    problem, out = write_problem(tmp_path / "far.yaml", OUT_OF_REACH), tmp_path / "out"
    ran = vdsm("plan", problem, "--out", out, "--strategy", "paper")
    assert ran.status == 1
    message = one_message(ran)
    assert "reach" in message
    assert str(out / "no_plan.html") in message
    assert [path.name for path in out.iterdir()] == ["no_plan.html"]
    page = (out / "no_plan.html").read_text(encoding="utf-8")
    said = message.removeprefix("vdsm: ").split("; see")[0].strip()
    assert said[0].upper() + said[1:] in page
    near = write_problem(tmp_path / "near.yaml", NEAR)
    assert vdsm("plan", near, "--out", out, "--strategy", "paper").status == 0
    assert not (out / "no_plan.html").exists(), "there is a plan now"
    report = (out / "report.html").read_text(encoding="utf-8")
    assert "planned by paper" in report
    assert 'class="banner verdict certified"' in report
    assert "vdsm verify looks for it" in report


def test_a_plan_that_draws_less_than_required_is_written_and_called_incomplete(
    vdsm: Shell, tmp_path: Path
) -> None:
    problem = write_problem(tmp_path / "wall.yaml", BEHIND_A_WALL)
    out = tmp_path / "out"
    ran = vdsm("plan", problem, "--out", out)
    assert (ran.status, "vdsm: " in ran.err) == (1, False), "it may tell progress"
    assert ran.out.startswith("◐ incomplete")
    plan = json.loads((out / "plan.json").read_text(encoding="utf-8"))
    assert plan["verdict"] == "incomplete"
    assert 0.12 < plan["coverage"] < 335.0 / 2500.0
    share = f"{math.floor(plan['coverage'] * 1000) / 10:.1f} % of the desired path"
    drew = f"The motion draws {share}, 100.0 % is required: "
    assert plan["reason"].startswith(f"{drew}the path is not drawn from")
    assert "within the margin of 'wall'" in plan["reason"]
    assert plan["reason"] in ran.out

    words = ["--trajectory", out / "trajectory.csv", "--out", out]
    ran = vdsm("verify", problem, *words, "--certificate", tmp_path / "proof")
    assert ran.status == 1
    assert ran.out.startswith("◐ incomplete")
    assert f"{drew}it leaves out 1 stretch, from" in ran.out
    assert re.search(r"\n  coverage of the desired path +1\d\.\d %\n", ran.out)
    assert not (tmp_path / "proof").exists()
    page = (out / "report.html").read_text(encoding="utf-8")
    assert html.escape(plan["reason"], quote=False).replace("'", "&#39;") in page


@pytest.mark.parametrize("share", [0.1, 0.0])
def test_less_coverage_is_enough_where_the_problem_says_so(
    vdsm: Shell, tmp_path: Path, share: float
) -> None:
    asked = f"spacing: 40\n  required_coverage: {share}\n"
    text = BEHIND_A_WALL.replace("spacing: 40\n", asked)
    problem, out = write_problem(tmp_path / "wall.yaml", text), tmp_path / "out"
    ran = vdsm("plan", problem, "--out", out)
    assert (ran.status, ran.out.split()[:2]) == (0, ["✓", "certified"])
    assert re.search(r"not drawn +from \d+\.\d+ mm to 2500\.000 mm", ran.out)
    ran = vdsm("verify", problem, "--trajectory", out / "trajectory.csv", "--out", out)
    assert ran.status == 0
    assert re.search(r"1\d\.\d % of the desired path is drawn", ran.out)


def test_without_detours_nothing_is_planned_that_leaves_something_out(
    vdsm: Shell, tmp_path: Path
) -> None:
    text = BEHIND_A_WALL.replace("spacing: 40", "blocked: fail")
    problem = write_problem(tmp_path / "wall.yaml", text)
    ran = vdsm("plan", problem, "--out", tmp_path / "out")
    assert ran.status == 1
    assert "'wall' blocks the tip path" in one_message(ran)
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["no_plan.html"]


def test_two_rows_that_rest_on_the_path_draw_nothing(
    vdsm: Shell, tmp_path: Path
) -> None:
    problem = write_problem(tmp_path / "wall.yaml", BEHIND_A_WALL)
    joints = ",".join(["0.0"] * 17)
    names = ",".join(f"alpha{i}_rad,theta{i}_rad" for i in range(1, 9))
    rows = [
        f"waypoint,on_path,path_m,x0_m,{names}",
        *(f"{k},1,0.0,{joints}" for k in "01"),
    ]
    motion = write_problem(tmp_path / "rest.csv", "\n".join(rows) + "\n")
    ran = vdsm("verify", problem, "--trajectory", motion, "--out", tmp_path / "out")
    assert ran.status == 1
    assert "The motion draws 0.0 % of the desired path" in ran.out
    failed = [line for line in ran.out.splitlines() if line.endswith("◐ incomplete")]
    assert [line.split()[0] for line in failed] == ["coverage"]
    assert ran.out.count("✓ certified") > 10
    assert "refuted" not in ran.out
    assert "undecided" not in ran.out


def test_a_problem_without_path_is_verified_shown_and_planned_to_its_goal(
    vdsm: Shell, tmp_path: Path
) -> None:
    """A joint-space move past a ball: clearance, limits, start and goal."""
    joints = "{x0: 100, alpha_deg: [20, 0, 0, 0, 0, 0, 0, 0], theta_deg: [%s]}"
    text = BEHIND_A_WALL.partition("tip_path:")[0] + (
        "start: [3126, 0, 0]\n"
        f"goal: {{joints: {joints % ', '.join(['0'] * 8)}}}\n"
        "required_clearance: 3.5\n"
    )
    text = text.replace("[0, 400, 0]", "[0, 1400, 0]")
    problem = write_problem(tmp_path / "move.yaml", text)
    names = ",".join(f"alpha{i}_rad,theta{i}_rad" for i in range(1, 9))
    rows = [f"waypoint,on_path,path_m,x0_m,{names}"]
    for k in range(11):
        turn = [0.1 * k * math.radians(20), *[0.0] * 15]
        rows.append(",".join(map(str, (k, 0, 0.0, 0.01 * k, *turn))))
    motion = write_problem(tmp_path / "move.csv", "\n".join(rows) + "\n")
    out, proof = tmp_path / "out", tmp_path / "proof"
    words = ["--trajectory", motion, "--out", out, "--certificate", proof]
    ran = vdsm("verify", problem, *words)
    assert ran.status == 0, ran.out
    assert "no desired path is asked for" in ran.out
    assert "joints at their goal" in ran.out
    for word in ("nan", "coverage", "on the path", "not available", "None"):
        assert word not in ran.out
    content = json.loads((out / "verification.json").read_text(encoding="utf-8"))
    jsonschema.validate(content, schema("verification"))
    assert content["coverage"] is content["path_length_m"] is None
    page = (out / "report.html").read_text(encoding="utf-8")
    words_of_page = re.sub(r"<(script|style).*?</\1>", "", page, flags=re.DOTALL)
    assert "desired path</th><td>none" in words_of_page
    for word in ("nan", "Coverage", ">None"):
        assert word not in words_of_page
    assert vdsm("check-certificate", proof, problem, motion).status == 0
    assert vdsm("diff", out, out).out.startswith("no difference")
    view = ["view", problem, "--html", tmp_path / "view.html"]
    assert vdsm(*view).status == 0
    assert vdsm(*view, "--trajectory", motion).status == 0

    made = tmp_path / "made"
    ran = vdsm("plan", problem, "--out", made)
    assert ran.status == 0, ran.out
    content = json.loads((made / "plan.json").read_text(encoding="utf-8"))
    jsonschema.validate(content, schema("plan"))
    for word in ("nan", "coverage", "on the path", "not available", "None"):
        assert word not in ran.out
    words = ["--trajectory", made / "trajectory.csv", "--out", made]
    assert vdsm("verify", problem, *words).status == 0

    goal = text.index("goal:")
    problem.write_text(text[:goal] + text[text.index("required_clearance") :])
    ran = vdsm("plan", problem, "--out", tmp_path / "plan")
    assert ran.status == 2
    assert "move.yaml: tip_path: is missing; planning needs it" in one_message(ran)
    assert not (tmp_path / "plan").exists()
    (row,) = run_batch(
        Batch((str(problem),), tmp_path / "batch", TaskSettings("fewest"))
    )
    assert (row.outcome, "tip_path: is missing" in row.reason) == ("error", True)


def test_a_search_in_vain_tells_how_far_it_came_and_how_long_it_took(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def in_vain(*_: object) -> None:
        message = "drew 100.000 mm of 400.000 mm"
        raise NoPlanFound(message)

    monkeypatch.setattr("vdsm_pin.app.workflow.plan_to_folder", in_vain)
    file = write_problem(tmp_path / "near.yaml", NEAR)
    with pytest.raises(SystemExit) as ended:
        main(["plan", str(file), "--out", str(tmp_path / "out")])
    assert ended.value.code == 1
    said = capsys.readouterr().err
    assert re.search(
        r"no plan found: drew 100\.000 mm of .*; searched for \d+\.\d s", said
    )


def test_a_time_limit_ends_planning(vdsm: Shell, tmp_path: Path) -> None:
    read_problem("paper/obs2")  # so that the time is not over before it is read
    words = ["plan", "paper/obs2", "--strategy", "sturdiest", "--out", tmp_path / "out"]
    ran = vdsm(*words, "--time-limit", "0.1")
    assert ran.status == 1
    assert "time limit of 0.1 s" in one_message(ran)
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["no_plan.html"]


def bad_inputs(folder: Path, planned: Path) -> dict[str, list[object]]:
    """Command lines with bad input, by the words their message must hold."""
    good, rows = planned / "near.yaml", planned / "trajectory.csv"
    file = folder / "file"
    file.write_text("x")
    text = folder / "text.yaml"
    text.write_text("just words")
    named = folder.parent / "made" / "problem.yaml"
    named.parent.mkdir()
    named.write_text("just words")
    short = folder / "short.csv"
    short.write_text("\n".join(rows.read_text().splitlines()[:3]).rpartition(",")[0])
    out = folder / "out"
    verify = ["verify", good, "--out", out, "--trajectory"]
    return {
        "absent.yaml": ["plan", folder / "absent.yaml", "--out", out],
        "built-in problems: paper/free": ["plan", "paper/obs9", "--out", out],
        "expected a file": ["plan", folder, "--out", out],
        f"try {named}": ["plan", named.parent, "--out", out],
        "trajectory.csv: ends in '.csv', expected .html": [
            "view",
            good,
            "--html",
            rows,
        ],
        "file: has no ending, expected .pdf": [*verify, rows, "--pdf", file],
        "trajectory.csv: ends in '.csv', expected .certificate, .jsonl or none": [
            *(*verify, rows, "--certificate", folder / "other" / "trajectory.csv")
        ],
        "notes.md: ends in '.md', expected .urdf or .xml": [
            *("urdf", "hrm8", "--out", folder / "notes.md")
        ],
        "text.yaml": ["plan", text, "--out", out],
        "file: is a file, expected a folder": ["plan", good, "--out", file],
        "unknown strategy": ["plan", good, "--out", out, "--strategy", "luck"],
        "absent.csv": [*verify, folder / "absent.csv"],
        "short.csv": [*verify, short],
        "folder": [*verify, folder],
        "near.yaml": [*verify, good],
        "is a folder, expected a file": [*verify, rows, "--certificate", folder],
        ": is a folder, expected": [*verify, rows, "--pdf", folder],
        "unknown schema": ["schema", "poem"],
        "unknown manipulator": ["urdf", "octopus", "--out", folder / "o.urdf"],
        "neither summary.csv": ["diff", folder, folder],
        "none.cert: does not exist": [
            *("check-certificate", folder / "none.cert", good, rows),
        ],
        "text.yaml: header: cannot be read as a certificate: Expecting value": [
            "check-certificate",
            text,
            good,
            rows,
        ],
        "--certificate needs a value; --pdf": [*verify, rows, "--certificate", "--pdf"],
        "--out needs a value; --quiet": ["batch", good, "--out", "--quiet"],
        "argument 4 is empty": ["plan", good, "--out", ""],
        "is a variable not set?": ["plan", good, "--out="],
        "vdsm: /: is a folder": [*verify, "/"],
    }


def test_bad_input_is_one_message_and_writes_nothing(
    vdsm: Shell, planned: Path, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    work = tmp_path / "work"
    work.mkdir()
    cases = bad_inputs(work, planned)
    cases["holds no .yaml"] = [
        "batch",
        tmp_path_factory.mktemp("e"),
        "--out",
        work / "out",
    ]
    before = {path: path.read_bytes() for path in work.iterdir()}
    for words, command in cases.items():
        ran = vdsm(*command)
        assert (ran.status, words in one_message(ran)) == (2, True), (command, ran)
        assert {p: p.read_bytes() for p in work.iterdir()} == before, command


def test_a_failed_run_leaves_earlier_results_alone(
    vdsm: Shell, planned: Path, tmp_path: Path
) -> None:
    (tmp_path / "verification.json").write_text("earlier")
    bad = tmp_path / "bad.csv"
    bad.write_text("waypoint\n1\n")
    ran = vdsm("verify", planned / "near.yaml", "--trajectory", bad, "--out", tmp_path)
    assert ran.status == 2
    assert {p.name for p in tmp_path.iterdir()} == {"verification.json", "bad.csv"}
    assert (tmp_path / "verification.json").read_text() == "earlier"


def test_problems_are_listed_and_printed(vdsm: Shell) -> None:
    names = vdsm("problems").out.split()
    assert "paper/obs1" in names
    for name in names:
        assert vdsm("problems", "--show", name).out.startswith("#") or name
    assert "vdsm_problem: 1" in vdsm("problems", "--show", "paper/obs2").out
    assert vdsm("problems", "--show", "poem").status == 2


@pytest.mark.parametrize("name", SCHEMA_NAMES)
def test_schemas_are_printed(vdsm: Shell, name: str) -> None:
    jsonschema.Draft202012Validator.check_schema(json.loads(vdsm("schema", name).out))


def test_the_urdf_is_written_whole(vdsm: Shell, tmp_path: Path) -> None:
    committed = Path(__file__).parents[1] / "urdf" / "hrm8.urdf"
    assert vdsm("urdf", "hrm8", "--out", tmp_path / "arm.urdf").status == 0
    assert (tmp_path / "arm.urdf").read_text() == committed.read_text()


def test_a_view_is_written_as_one_page(
    vdsm: Shell, planned: Path, tmp_path: Path
) -> None:
    ran = vdsm(
        "view", planned / "near.yaml", "--trajectory", planned / "trajectory.csv",
        "--html", tmp_path / "view.html",
    )  # fmt: skip
    assert ran.status == 0
    assert "MeshCat" in (tmp_path / "view.html").read_text(encoding="utf-8")


def test_the_help_names_every_strategy(vdsm: Shell) -> None:
    for command in ("plan", "batch"):
        text = " ".join(vdsm(command, "--help").out.split()).replace("- ", "-")
        assert f"One of {', '.join(STRATEGIES)}" in text
    assert all(callable(strategy(name)) for name in STRATEGIES)


def test_without_a_browser_nothing_is_verified_for_paper(
    vdsm: Shell, planned: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CHROMIUM", str(tmp_path / "absent"))
    ran = vdsm(
        "verify", planned / "near.yaml", "--trajectory", planned / "trajectory.csv",
        "--out", tmp_path / "out", "--pdf", tmp_path / "report.pdf",
    )  # fmt: skip
    assert ran.status == 2
    assert "PDF, PNG and MP4 need Chromium" in one_message(ran)
    assert list(tmp_path.iterdir()) == []


def test_a_certificate_is_checked_against_a_built_in_problem(
    vdsm: Shell, planned: Path, tmp_path: Path
) -> None:
    empty = tmp_path / "empty.cert"
    empty.write_text("")
    rows = planned / "trajectory.csv"
    by_name = vdsm("check-certificate", empty, "paper/free", rows)
    assert "does not exist" not in by_name.out + by_name.err
    unknown = vdsm("check-certificate", empty, "paper/obs9", rows)
    assert unknown.status == 2
    assert "built-in problems: paper/free" in one_message(unknown)


def test_a_result_does_not_differ_from_itself(vdsm: Shell, planned: Path) -> None:
    ran = vdsm("diff", planned, planned)
    assert ran.status == 0
    assert ran.out.startswith("no difference")


def test_a_certificate_is_written_and_accepted(
    vdsm: Shell, planned: Path, tmp_path: Path
) -> None:
    rows, proof = planned / "trajectory.csv", tmp_path / "proof.jsonl"
    ran = vdsm(
        "verify", planned / "near.yaml", "--trajectory", rows,
        "--out", tmp_path / "out", "--certificate", proof,
    )  # fmt: skip
    assert ran.status == 0, ran.err
    assert vdsm("check-certificate", proof, planned / "near.yaml", rows).status == 0
    other = write_problem(tmp_path / "other.yaml", NEAR.replace("3.5", "3.6"))
    ran = vdsm("check-certificate", proof, other, rows, "--json")
    told = json.loads(ran.out)
    assert (ran.status, told["accepted"]) == (1, False)
    assert told["reason"] in vdsm("check-certificate", proof, other, rows).out


@pytest.mark.usefixtures("in_this_process")
def test_the_joint_error_that_the_sturdiest_plan_claims_is_the_one_verified(
    vdsm: Shell, tmp_path: Path
) -> None:
    problem, out = write_problem(tmp_path / "near.yaml", NEAR), tmp_path / "out"
    words = ("batch", problem, "--out", out, "--strategy", "sturdiest")
    assert vdsm(*words).status == 0
    (folder,) = (file.parent for file in out.glob("*/plan.json"))
    plan = json.loads((folder / "plan.json").read_text(encoding="utf-8"))
    jsonschema.validate(plan, schema("plan"))
    assert plan["strategy"] == "sturdiest"
    told = re.search(r"off by ±(\S+)° at once \(proved\)", " ".join(plan["notes"]))
    assert told is not None
    verified = (folder / "verification.json").read_text(encoding="utf-8")
    proved = math.degrees(json.loads(verified)["max_joint_error_rad"])
    assert 0.0 <= proved - float(told[1]) < 1e-3, "rounded down"
    before = (folder / "manifest.json").stat().st_mtime_ns
    assert vdsm(*words, "--resume").status == 0
    assert (folder / "manifest.json").stat().st_mtime_ns == before
    assert vdsm(*words[:-1], "clearest", "--resume").status == 0
    again = json.loads((folder / "plan.json").read_text(encoding="utf-8"))
    assert again["strategy"] == "clearest"


@pytest.mark.parametrize(
    "words",
    [
        ["problems", "--show", "paper/obs1"],
        ["schema", "verification"],
        ["verify", "near.yaml", "--trajectory", "trajectory.csv", "--out", "piped"],
    ],
)
def test_a_closed_pipe_is_no_verdict(words: list[str], planned: Path) -> None:
    """The status is that of SIGPIPE, standard error is silent, files are whole."""
    script = "import sys; from vdsm_pin.cli import main; main(sys.argv[1:])"
    reader, writer = os.pipe()
    os.close(reader)
    ran = subprocess.run(
        [sys.executable, "-c", script, *words],
        stdout=writer,
        stderr=subprocess.PIPE,
        cwd=planned,
        text=True,
        check=False,
    )
    os.close(writer)
    assert (ran.returncode, ran.stderr) == (141, "")
    if words[0] == "verify":
        text = (planned / "piped" / "verification.json").read_text(encoding="utf-8")
        assert json.loads(text)["verdict"] == "certified"


@pytest.mark.parametrize(
    ("closed", "more", "status"),
    [
        (">&-", [], 0),
        ("2>&-", ["--time-limit", "-1"], 2),
        (">&- 2>&-", [], 0),
        (">/dev/full 2>/dev/full", [], 2),
    ],
)
def test_a_closed_stream_is_no_verdict(
    closed: str, more: list[str], status: int, planned: Path
) -> None:
    """Whoever wants no output, or has no room for it, hears the status alone."""
    script = "import sys; from vdsm_pin.cli import main; main(sys.argv[1:])"
    words = ["verify", "near.yaml", "--trajectory", "trajectory.csv", "--out", "mute"]
    run = [sys.executable, "-c", script, *words, *more]
    ran = subprocess.run(
        ["sh", "-c", f'exec "$@" {closed}', "sh", *run],
        capture_output=True,
        cwd=planned,
        check=False,
    )
    assert ran.returncode == status
    assert b"Traceback" not in ran.stderr


def test_results_can_be_read_by_programs_or_not_said_at_all(
    vdsm: Shell, tmp_path: Path
) -> None:
    near, out = write_problem(tmp_path / "near.yaml", NEAR), tmp_path / "out"
    words = ["plan", near, "--out", out, "--strategy", "paper"]
    ran = vdsm(*words, "--json")
    assert ran.out == (out / "plan.json").read_text(encoding="utf-8")
    assert vdsm(*words, "--quiet").out == ""
    words = ["verify", near, "--out", out, "--trajectory", out / "trajectory.csv"]
    ran = vdsm(*words, "--json")
    assert ran.out == (out / "verification.json").read_text(encoding="utf-8")
    assert vdsm(*words, "--quiet").out == ""


SPEAK_FOR_THEMSELVES = {"problems", "schema", "view"}


def test_every_command_has_an_answer_for_programs_and_can_be_silent(
    vdsm: Shell, planned: Path, tmp_path: Path
) -> None:
    """Oracle: the files that a command has written, the words that it says else."""
    rows, near = planned / "trajectory.csv", planned / "near.yaml"
    for command in set(COMMANDS) - SPEAK_FOR_THEMSELVES:
        text = vdsm(command, "--help").out
        assert "--json" in text and "--quiet" in text, command
    made, urdf = tmp_path / "made", tmp_path / "arm.urdf"
    commands: dict[str, list[object]] = {
        "doctor": ["doctor"],
        "diff": ["diff", planned, planned],
        "urdf": ["urdf", "hrm8", "--out", urdf],
        "convert": ["convert", near, "--trajectory", rows, "--out", tmp_path / "c"],
        "export": ["export", near, "--out", tmp_path / "a.glb"],
        "new": ["new", made],
    }
    found = {}
    for name, words in commands.items():
        shutil.rmtree(made, ignore_errors=True)
        ran = vdsm(*words, "--json")
        found[name] = json.loads(ran.out)
        shutil.rmtree(made, ignore_errors=True)
        assert (ran.status, vdsm(*words, "--quiet").out) == (0, ""), name
    assert set(found["new"]["files"]) == {path.name for path in made.iterdir()}
    assert found["diff"] == {"worse": False, "changes": []}
    assert found["urdf"]["files"] == [str(urdf), str(urdf.with_suffix(".srdf"))]
    assert found["convert"]["waypoints"] == len(rows.read_text().splitlines()) - 1
    assert Path(found["export"]["file"]).stat().st_size > 1000
    needed = [one for one in found["doctor"]["findings"] if one["needed"]]
    assert needed and all(one["works"] for one in needed)


@pytest.mark.usefixtures("in_this_process")
def test_a_batch_can_be_proved_under_errors_with_certificates(
    vdsm: Shell, tmp_path: Path
) -> None:
    near, out = write_problem(tmp_path / "near.yaml", NEAR), tmp_path / "out"
    words = ["batch", near, "--out", out, "--strategy", "paper", "--certificate"]
    ran = vdsm(*words, "--joint-error-deg", "0.01", "--json")
    (row,) = json.loads(ran.out)
    assert (ran.status, row["outcome"]) == (0, "certified")
    result = out / "near"
    told = json.loads((result / "verification.json").read_text(encoding="utf-8"))
    box = told["error_box"]["joint_error_rad"]
    assert box == pytest.approx(math.radians(0.01))
    proof, motion = result / "certificate.jsonl", result / "trajectory.csv"
    assert vdsm("check-certificate", proof, near, motion).status == 0
    assert "--joint-error-deg 0.01 --certificate" in told["command"]
    # Another error box is another question: nothing is kept of the answer.
    more = [*words, "--joint-error-deg", "0.02", "--resume"]
    assert "(kept)" not in vdsm(*more).out
    assert "(kept)" in vdsm(*more).out
    assert vdsm(*more, "--quiet").out == ""
    lost = vdsm(*words, "--obstacle-error-mm", "900", "--json")
    assert (lost.status, json.loads(lost.out)[0]["outcome"]) == (1, "infeasible")


def test_each_problem_of_a_batch_has_the_time_of_a_plan(
    vdsm: Shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: what the batch is asked for. A plan that comes too late is no success."""
    near = write_problem(tmp_path / "near.yaml", NEAR)
    asked: list[float | None] = []

    def note(batch: Batch) -> tuple[BatchRow, ...]:
        asked.append(batch.settings.time_limit)
        return ()

    words = ["batch", near, "--out", tmp_path / "out", "--strategy", "paper"]
    with monkeypatch.context() as changed:
        changed.setattr("vdsm_pin.batch.run.run_batch", note)
        for cold in (False, True):
            changed.setattr(
                "vdsm_pin.app.first_plan.is_cold", lambda cold=cold: bool(cold)
            )
            for more in ((), ("--scheduler", "tcp://x:1"), ("--time-limit", "inf")):
                vdsm(*words, *more)
    assert asked == [60.0, 600.0, math.inf, 600.0, 600.0, math.inf]
    monkeypatch.setattr("vdsm_pin.app.first_plan.PLAN_LIMIT", 0.001)
    monkeypatch.setattr("vdsm_pin.app.first_plan.is_cold", lambda: False)
    ran = vdsm(*words, "--json")
    (row,) = json.loads(ran.out)
    assert (ran.status, row["outcome"]) == (1, "time-limit")


@pytest.mark.usefixtures("in_this_process")
def test_errors_hold_for_plan_verify_and_batch_alike(
    vdsm: Shell, tmp_path: Path
) -> None:
    """Stated in the file or asked for at the command, a plan is made for them."""
    beside = NEAR.replace("[2000, 900, 0]", "[2000, 330, 0]")
    plain = write_problem(tmp_path / "near.yaml", beside)
    asking = beside + "errors: {joint_deg: 0.2}\n"
    stated = write_problem(tmp_path / "stated.yaml", asking)
    out = tmp_path / "out"
    words = ["--out", out]
    ran = vdsm("plan", plain, *words)
    assert "under errors" not in ran.out
    motion = tmp_path / "exact.csv"
    shutil.copy(out / "trajectory.csv", motion)
    nominal = motion.read_bytes()
    asked = "--joint-error-deg", "0.2"
    judged = ["--trajectory", motion, "--out", tmp_path / "judged"]
    assert vdsm("verify", stated, *judged).status == 1
    assert vdsm("verify", plain, *judged, *asked).status == 1

    rows = []
    for problem, more in ((plain, asked), (stated, ())):
        ran = vdsm("plan", problem, *words, *more)
        assert ran.status == 0, ran.err
        assert re.search(r"under errors up to +±0.200° of every joint angle", ran.out)
        rows.append((out / "trajectory.csv").read_bytes())
        ran = vdsm("batch", problem, "--out", tmp_path / "batch", *more)
        assert (ran.status, "1 of 1 certified" in ran.out) == (0, True), ran.out
        (path,) = (tmp_path / "batch").glob("*/trajectory.csv")
        rows.append(path.read_bytes())
        shutil.rmtree(tmp_path / "batch")
        shutil.copy(out / "trajectory.csv", motion)
        assert vdsm("verify", stated, *judged).status == 0
        assert vdsm("verify", plain, *judged, *asked).status == 0
    assert len(set(rows)) == 1
    assert rows[0] != nominal


def test_a_shell_can_be_taught_to_complete(
    vdsm: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran = vdsm("--help")
    assert "--install-completion" in ran.out
    monkeypatch.setenv("_VDSM_COMPLETE", "complete_bash")
    for words, found in {
        "vdsm ver": ["verify"],
        "vdsm plan paper/obs2": ["paper/obs2", "paper/obs2-small"],
        "vdsm plan x --strategy f": ["fewest", "follow-the-leader"],
        "vdsm batch --keep a": ["all"],
        "vdsm verify paper/obs2": ["paper/obs2", "paper/obs2-small"],
        "vdsm batch paper/free paper/obs1": ["paper/obs1"],
        "vdsm problems --show paper/f": ["paper/free"],
        "vdsm new x --from p": ["port", "paper"],
        "vdsm schema pl": ["plan"],
    }.items():
        monkeypatch.setenv("COMP_WORDS", words)
        monkeypatch.setenv("COMP_CWORD", str(words.count(" ")))
        assert vdsm().out.split() == found


@pytest.mark.parametrize("terminal", [True, False])
def test_parts_of_an_error_stand_on_lines_of_a_terminal(
    terminal: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    with pytest.raises(SystemExit, match="1"):
        fail(NoPlanFound("no plan found; the path is long"), 1)
    between = "\n  " if terminal else "; "
    told = f"vdsm: no plan found{between}the path is long\n"
    assert capsys.readouterr().err == told


def test_of_many_faults_the_first_are_told_and_how_many_there_are(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "many.yaml"
    file.write_text("vdsm_problem: 1\nobstacles: [" + "0, " * 100 + "]\n")
    with pytest.raises(SystemExit) as ended:
        main(["plan", str(file), "--out", str(tmp_path / "out")])
    told = capsys.readouterr().err.splitlines()
    assert ended.value.code == 2
    assert len(told) == 51
    assert "obstacles[0]" in told[0] and told[-1] == "vdsm: and 53 more"
