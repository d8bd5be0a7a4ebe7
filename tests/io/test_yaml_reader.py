"""YAML 1.2 where the parser is one for 1.1, and names in any alphabet."""

import itertools
import json
import re
from functools import partial
from pathlib import Path

import jsonschema
import numpy as np
import pytest
import yaml
from problem_texts import EVERYTHING, edited, write_everything
from typer.testing import CliRunner

from vdsm_pin.batch.folders import folder_names
from vdsm_pin.cli import app
from vdsm_pin.errors import InvalidFile
from vdsm_pin.io.problem_file import problem_schema, read_problem
from vdsm_pin.io.yaml_reader import read_yaml

PLAIN = EVERYTHING.replace("1e3", "1000").replace("1.5e1", "15")
SIGNS = ("\x85", "\u2028", "\u2029")
SCHEMA = jsonschema.Draft202012Validator(problem_schema())
NAMES = (
    "Säule", "оболочка", "外壳 2", "σωλήνας/α: 1", "می\u200cشود", "a/b", "../up",
    "C:\\x",
    "{{ name }}", '"quoted", <b>', "100 % \U0001f600",
)  # fmt: skip


@pytest.mark.parametrize("sign", SIGNS)
def test_a_remark_goes_on_behind_signs_that_end_no_line(sign: str) -> None:
    text = f"a: 1  # first{sign}b: 2\nc: 3\n# x{sign}a: 4\nd: 5\n"
    document = read_yaml(text, file="f")
    assert document.data == {"a": 1, "c": 3, "d": 5}
    assert document.lines[("d",)] == 4


@pytest.mark.parametrize("signs", list(itertools.permutations(SIGNS, 2)))
@pytest.mark.parametrize("quote", ['"', "'", ""])
def test_such_signs_stand_in_values_and_keys_as_they_are(
    signs: tuple[str, str], quote: str
) -> None:
    a, b = signs
    text = f"k{a}: {quote}x{a}y{b}{b}\U000f0000z{quote}\n"
    assert read_yaml(text, file="f").data == {f"k{a}": f"x{a}y{b}{b}\U000f0000z"}


@pytest.mark.parametrize(
    "end", ["---", "---\n", "--- \n---\n", "---\n# no more\n", "...\n---\n...\n"]
)
def test_empty_documents_may_follow(end: str) -> None:
    assert read_yaml(f"---\na: 1\n{end}", file="f").data == {"a": 1}


@pytest.mark.parametrize("word", [".inf", "+.Inf", "+.INF", "-.inf", ".NaN"])
def test_no_number_is_a_word_of_its_own(word: str) -> None:
    """By the core schema of YAML 1.2 (10.3.2)."""
    (value,) = read_yaml(f"[{word}]", file=Path("a.yaml")).data
    assert str(value) == str(float(word.replace(".", "").lower()))


def test_texts_without_such_signs_are_read_as_before() -> None:
    rng = np.random.default_rng(0)
    letters = "ab: -\n'\"#\U000f0000é"
    for _ in range(300):
        text = "".join(rng.choice(list(letters), int(rng.integers(1, 30))))
        try:
            expected = yaml.load(text, Loader=yaml.CBaseLoader)
        except yaml.YAMLError:
            with pytest.raises(InvalidFile):
                read_yaml(text, file="f")
            continue
        try:
            found = read_yaml(text, file="f").data
        except InvalidFile as error:
            assert re.search("no data|twice|key|line", str(error))
            continue
        assert json.dumps(found).replace("null", '""') == json.dumps(
            expected
        ).replace("null", '""')  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_names_in_any_alphabet_are_read_and_the_schema_agrees(
    tmp_path: Path, name: str
) -> None:
    path = write_everything(tmp_path)
    for where in (("name",), ("manipulator", "name"), ("obstacles", 0, "name")):
        text = edited(PLAIN, where, name)
        SCHEMA.validate(yaml.safe_load(text))
        path.write_text(text, encoding="utf-8")
        problem = read_problem(path)
        assert name in (problem.name, problem.manipulator.name, *problem.scene.names)


@pytest.mark.parametrize("name", [" a", "=a", "+a", "@a", "-a", "a\tb", "a\x1b[2J"])
def test_names_that_hide_something_are_refused_by_schema_and_reader(
    tmp_path: Path, name: str
) -> None:
    path = write_everything(tmp_path)
    text = edited(PLAIN, ("obstacles", 0, "name"), name)
    with pytest.raises(jsonschema.ValidationError):
        SCHEMA.validate(yaml.safe_load(text))
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InvalidFile, match="expected signs that can be seen"):
        read_problem(path)


def test_folders_of_a_batch_have_names_that_every_file_system_takes() -> None:
    problems = tuple(f"{name * 40}.yaml" for name in NAMES)
    names = folder_names(problems, ["summary.csv"])
    assert len(set(names.values())) == len(NAMES)
    for name in names.values():
        assert len(f"{name}.replaced".encode()) < 255
        assert not re.search(r"[/\\:<>\"|?*\x00-\x1f]", name)
        assert name.strip(". ") == name


def test_names_of_any_alphabet_go_through_every_command(tmp_path: Path) -> None:
    problem, out = tmp_path / "外壳: 1.yaml", tmp_path / "вывод"
    ball = {"shape": "sphere", "center": [1200, 0, -700], "radius": 100}
    data = {
        "vdsm_problem": 1,
        "name": "Ψ/κ: <1>",
        "length_unit": "mm",
        "manipulator": {
            "link_lengths": [400] * 4, "link_radius": 30, "max_link_angle_deg": 45,
            "max_joint_angle_deg": 45,
        },
        "obstacles": [
            ball | {"name": name, "center": [1200, 200 * i - 500, -700]}
            for i, name in enumerate(NAMES[:5] + NAMES[-2:])
        ],
        "tip_path": {"start": [1600, 0, 0], "points": [[1600, 0, 0], [1700, 0, 0]]},
        "required_clearance": 5,
    }  # fmt: skip
    problem.write_text(yaml.safe_dump(data, allow_unicode=True), encoding="utf-8")
    run = partial(CliRunner().invoke, obj="vdsm")
    assert run(app, ["plan", str(problem), "--out", str(out)]).exit_code == 0
    trajectory, certificate = out / "trajectory.csv", tmp_path / "доказательство"
    made = run(app, [
        "verify", str(problem), "--trajectory", str(trajectory), "--out", str(out),
        "--certificate", str(certificate),
    ])  # fmt: skip
    assert made.exit_code == 0, made.output
    checked = run(
        app, ["check-certificate", str(certificate), str(problem), str(trajectory)]
    )
    assert checked.exit_code == 0, checked.output
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "Ψ/κ: &lt;1&gt;" in page
    found = json.loads((out / "verification.json").read_text(encoding="utf-8"))
    assert found["problem"] == "Ψ/κ: <1>"
    assert {row["obstacle"] for row in found["closest"]} & set(NAMES)
