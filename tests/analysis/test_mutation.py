"""Changes are what they say, and a test that looks notices them."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from analysis.mutation import __main__ as program  # noqa: E402
from analysis.mutation.changes import Change, changes, uses  # noqa: E402
from analysis.mutation.coverage_map import Asked, CoverageMap, coverage_map  # noqa: E402
from analysis.mutation.trial import Task  # noqa: E402

MODULE = '''"""A module."""

SIZE: float = 2.0


def inside(low, value, high=1.0):
    """Whether a value lies between.

    >= 3 lines of text with 1 number stay.
    """
    if value < low and not value == 7:
        return min(
            -value,
            high * 2,
        )
    return f"{value + 1}"
'''


def test_every_change_is_one_valid_module_that_differs(tmp_path: Path) -> None:
    (tmp_path / "module.py").write_text(MODULE)
    found = changes(tmp_path, "module.py")
    assert {(one.before, one.after) for one in found} >= {
        ("2.0", "4.0"),
        ("1.0", "2.0"),
        ("value < low", "value <= low"),
        ("value < low", "value >= low"),
        ("value < low and (not value == 7)", "value < low or not value == 7"),
        ("not value == 7", "value == 7"),
        ("-value", "value"),
        ("high * 2", "high / 2"),
        ("min(-value, high * 2)", "max(-value, high * 2)"),
    }
    assert len({one.key for one in found}) == len(found)
    for one in found:
        assert one.content != MODULE
        assert one.content.count("\n") == MODULE.count("\n")
        assert one.before != one.after
        assert ast.parse(one.content)


STATEMENTS = """
def one(known, name, *more):
    if known:
        return 1
    for row in more:
        if not row:
            continue
        known.rows[row] = name
        known.put(name, row, strict=True)
        known.put(name, name)
        zip(known, row, strict=True)
    while known.open:
        raise ValueError(name)
    return max(name, [n for n in more if n.new] or isinstance(name, row))
"""


def test_statements_conditions_and_arguments_are_changed(tmp_path: Path) -> None:
    (tmp_path / "module.py").write_text(STATEMENTS)
    found = [f"{c.before} -> {c.after}" for c in changes(tmp_path, "module.py")]
    assert sorted(found) == sorted([
        "known -> not known",
        "known.open -> not known.open",
        "n.new -> not n.new",
        "not row -> row",
        "1 -> 2",
        "return 1 -> pass",
        "continue -> pass",
        "raise ValueError(name) -> pass",
        "known.rows[row] = name -> pass",
        "known.put(name, row, strict=True) -> pass",
        "known.put(name, row, strict=True) -> known.put(row, name, strict=True)",
        "known.put(name, name) -> pass",  # and not the two in each other's place
        "True -> False",
        "zip(known, row, strict=True) -> pass",
        "zip(known, row, strict=True) -> zip(row, known, strict=True)",
        "max(name, [n for n in more if n.new] or isinstance(name, row)) -> "
        "min(name, [n for n in more if n.new] or isinstance(name, row))",
        "[n for n in more if n.new] or isinstance(name, row) -> "
        "[n for n in more if n.new] and isinstance(name, row)",
    ])  # fmt: skip


def test_changes_alike_in_one_function_are_told_apart(tmp_path: Path) -> None:
    module = "def one(x):\n    return x[1] + x[1]\n\n\ndef two(x):\n    return x[1]\n"
    (tmp_path / "module.py").write_text(module)
    keys = [one.key for one in changes(tmp_path, "module.py") if one.before == "1"]
    assert keys == [
        "module.py:one: 1 -> 2",
        "module.py:one: 1 -> 2 (no. 2)",
        "module.py:two: 1 -> 2",
    ]


def test_what_is_listed_of_another_line_than_stands_there_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A line more above gives the number of one change to another."""
    (tmp_path / "module.py").write_text(
        "def one(x):\n    x[1] = 0\n    return x[1] | x[1]\n"
    )
    key = "module.py:one: 1 -> 2"
    good = [f"{key} || r || x[1] = 0", f"{key} (no. 3) || s || return x[1] | x[1]"]
    bad = [f"{key} (no. 2) || t || x[1] = 0", f"{key} (no. 4) || u || x[1] = 0"]
    bad += ["gone.py:: 1 -> 2 || v || x", "module.py:two: 1 -> 2 (all) || w"]
    words = ["# remark", *good, *bad, f"{key} (all) || of every one"]
    (tmp_path / "list.txt").write_text("\n".join(words) + "\n")
    monkeypatch.setattr(program, "EQUIVALENT", tmp_path / "list.txt")
    monkeypatch.setattr(program, "ROOT", tmp_path)
    program._lines_of.cache_clear()
    reasons = {key: "r", f"{key} (no. 3)": "s", f"{key} (all)": "of every one"}
    assert program.equivalent_changes() == reasons
    told = [f"no such change: {one.partition(' || ')[0]}" for one in bad]
    assert capsys.readouterr().out.splitlines() == told


def test_text_and_annotations_stay(tmp_path: Path) -> None:
    (tmp_path / "module.py").write_text(MODULE)
    assert not any("+" in one.before for one in changes(tmp_path, "module.py"))
    (tmp_path / "module.py").write_text("y = x.reshape(-1, 3)[-1]\n")
    found = sorted((one.before, one.after) for one in changes(tmp_path, "module.py"))
    # -2 is the same size left open, but another place.
    assert found == [
        ("-1", "1"),
        ("-1", "1"),
        ("1", "2"),
        ("3", "4"),
        ("x.reshape(-1, 3)", "x.reshape(3, -1)"),
    ]


def test_what_runs_at_import_has_its_effect_where_its_name_is_used(
    tmp_path: Path,
) -> None:
    module = (
        "SIZE = 2\n\n\ndef one(x=3):\n    y = SIZE\n    return x + (\n        y * 4)\n"
    )
    (tmp_path / "module.py").write_text(module)
    lines = {one.before: one.lines for one in changes(tmp_path, "module.py")}
    assert lines["2"] == (5,)
    names = {one.before: one.names for one in changes(tmp_path, "module.py")}
    assert names.pop("2") == ("SIZE",)
    assert not any(names.values())
    (tmp_path / "fields.py").write_text(
        "class One:\n    x: int = 7\n\n    def y(self):\n        return self.x\n\n\n"
        "def one():\n    return One()\n"
    )
    (default,) = changes(tmp_path, "fields.py")
    assert (default.names, default.lines) == (("One",), (9, 5))
    (tmp_path / "made.py").write_text(
        "A = 7\nB = list[A]\n\n\nclass One:\n    x: B\n\n\n"
        "class Two:\n    y: One\n\n\ndef one():\n    return Two\n"
    )
    (made,) = changes(tmp_path, "made.py")
    assert {*made.lines} == {2, 6, 10, 14}
    other = tmp_path / "other.py"
    other.write_text("from module import SIZE\n\nTWICE = 2 * SIZE\n")
    assert uses(other, "module", ("SIZE",)) == (3,)
    assert uses(other, "another", ("SIZE",)) == uses(other, "module", ("one",)) == ()
    assert lines["3"] == (5, 6, 7)
    assert lines["4"] == (7, 6)


def test_the_map_knows_which_test_runs_a_line(tmp_path: Path) -> None:
    (tmp_path / "module.py").write_text("def one():\n    return 1\n")
    test = "from module import one\n\ndef test_one():\n    assert one() == 1\n"
    (tmp_path / "test_one.py").write_text(test)
    (tmp_path / "analysis").symlink_to(ROOT / "analysis")
    asked, kept = Asked(tmp_path, ["module.py"], plain=False), tmp_path / "kept"
    kept.mkdir()
    seen = coverage_map(asked, ["test_one.py"], 1, kept)
    assert list(seen.asked({"module.py": (2,)})) == ["test_one.py::test_one"]
    # No test runs line 3: what a module does at import, any test may see.
    assert list(seen.asked({"module.py": (3,)})) == ["test_one.py::test_one"]
    # What is kept of a module that is gone, and that no test ran, is left out.
    (place,) = kept.iterdir()
    before = json.loads(place.read_text())
    before["tests"]["gone.py"] = {"1": [], "2": []}
    place.write_text(json.dumps(before))
    again = coverage_map(asked, ["test_one.py"], 1, kept)
    assert again == seen
    assert json.loads(place.read_text()) == before  # the tests did not run again


def test_each_file_of_tests_is_asked_before_any_twice() -> None:
    seconds = {"a::1": 0.1, "a::2": 0.2, "b::1": 0.5, "b::2": 0.6, "a::3": 0.7}
    seen = CoverageMap({"module.py": {1: sorted(seconds)}}, seconds)
    tests = seen.asked({"module.py": (1,)})
    assert list(tests) == ["a::1", "b::1", "a::2", "b::2", "a::3"]
    change = Change("module.py", 1, "", "", "", "")
    assert Task(change, tests, 0.6).asked() == ["a::1", "b::1"]
    assert Task(change, tests, 0.8).asked("c::1", "b::2") == ["b::2", "a::1"]
    assert Task(change, tests, 0.01).asked() == ["a::1"]


def test_nobody_is_asked_about_a_line_within_a_function_that_nothing_runs() -> None:
    """What an import or a slow test runs stands in the map without a test."""
    module = "vdsm_pin/errors.py"
    seen = CoverageMap({module: {1: ["a::1"], 2: []}}, {"a::1": 0.1, "a::2": 0.2})

    def asked(line: int, function: str, *names: str) -> list[str]:
        change = Change(module, line, function, "", "", "", (line,), names)
        return [*program._task(change, seen, 3.0).tests]

    assert asked(1, "one") == ["a::1"]
    assert asked(2, "one") == ["a::1", "a::2"]
    assert asked(3, "one") == []
    assert asked(3, "") == asked(3, "One", "One") == ["a::1", "a::2"]


TRIED = """
import sys
from pathlib import Path
from queue import Queue
from analysis.mutation.changes import changes
from analysis.mutation.trial import Task, try_changes

folder, tasks, trials = Path(sys.argv[1]), Queue(), []
for change in [*changes(folder, "module.py"), None]:
    tasks.put(change and Task(change, {"test_one.py::test_one": 1.0}, 5.0))
try_changes(folder, ["test_one.py"], tasks, trials.append, None)
said = [f"{t.change.before} -> {t.change.after} {t.noticed}" for t in trials]
(folder / "said").write_text("\\n".join(said))
"""


def test_a_change_that_matters_is_noticed_and_the_module_is_put_back(
    tmp_path: Path,
) -> None:
    """Within functions and at import, the one as the other."""
    module = (
        "M = 3\n\ndef one(x, y=4):\n    if x < M:\n        return 0\n    return 5\n"
        "\n\ndef made():\n    return 7\n\n\nN = made()\n"
    )
    (tmp_path / "module.py").write_text(module)
    (tmp_path / "test_one.py").write_text(
        "from module import M, N, one\n\n"
        "def test_one():\n    assert (one(0), M, N) == (0, 3, 7)\n"
    )
    subprocess.run([sys.executable, "-c", TRIED, str(tmp_path)], cwd=ROOT, check=True)
    said = set((tmp_path / "said").read_text().splitlines())
    assert said == {
        "3 -> 4 True",
        "4 -> 5 False",
        "x < M -> x >= M True",
        "x < M -> x <= M False",  # nobody asks about 3
        "0 -> 1 True",
        "return 0 -> pass True",
        "5 -> 6 False",
        "7 -> 8 True",  # called at import
    }
    assert (tmp_path / "module.py").read_text() == module


def test_what_is_listed_as_equivalent_is_there_as_it_was_judged(
    capsys: pytest.CaptureFixture[str],
) -> None:
    listed = program.EQUIVALENT.read_text(encoding="utf-8").splitlines()[1:]
    assert len(program.equivalent_changes()) == len(listed) > 0
    assert capsys.readouterr().out == ""
