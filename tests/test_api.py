"""The package from Python: every name, every example, and what is refused."""

import ast
import doctest
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import made_up
import numpy as np
import pytest
from oracles.certificate_cases import certificate_lines

import vdsm_pin as vp
from vdsm_pin import api
from vdsm_pin.arm.cable_layout import paper_hole_angles
from vdsm_pin.certificate_checker import check_certificate
from vdsm_pin.errors import VerificationFailed
from vdsm_pin.geometry.convex import FlatCylinder, Hull
from vdsm_pin.geometry.solids import ConvexCover
from vdsm_pin.problem.error_boxes import ErrorBox as Box
from vdsm_pin.problem.error_boxes import ObstacleError


def test_every_name_is_there_and_is_what_type_checkers_see() -> None:
    tree = ast.parse(Path(vp.__file__).read_text(encoding="utf-8"))
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    seen = {}
    for node in imports:
        for alias in node.names:
            seen[alias.asname or alias.name] = node.module, alias.name
    assert set(vp.__all__) <= set(seen)
    for name in vp.__all__:
        module, its_name = seen[name]
        assert getattr(vp, name) is getattr(sys.modules[str(module)], its_name)
        assert getattr(vp, name).__doc__
    assert set(vp.__all__) <= set(dir(vp))


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'plam'"):
        _ = vp.plam  # type: ignore[attr-defined]


def test_importing_the_package_imports_nothing_heavy() -> None:
    program = "import vdsm_pin, sys; print(*sys.modules)"
    ended = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert not {"numpy", "pydantic", "numba", "pinocchio"} & set(ended.stdout.split())


@pytest.mark.parametrize("name", vp.__all__)
def test_every_name_has_an_example_that_does_what_it_says(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    named = getattr(vp, name)
    known = {**vars(sys.modules[named.__module__]), "np": np, "vp": vp}
    finder, runner = doctest.DocTestFinder(recurse=False), doctest.DocTestRunner()
    for one in finder.find(named, name, globs=known):
        runner.run(one)
    assert runner.tries > 0
    assert runner.failures == 0


def test_the_example_of_the_module_does_what_it_says() -> None:
    runner = doctest.DocTestRunner()
    (one,) = doctest.DocTestFinder(recurse=False).find(api, "api")
    runner.run(one)
    assert runner.tries > 3 and runner.failures == 0


ARM = vp.Manipulator(
    name="three",
    link_lengths=np.array([0.4, 0.3, 0.3]),
    link_radius=0.03,
    max_link_angle=1.0,
    max_joint_angle=0.9,
    base_range=(-2.0, 2.0),
    cables=vp.CableLayout(0.02, 0.01, paper_hole_angles(3)),
)


def in_python(name: str = "mine") -> vp.Problem:
    path = vp.DesiredPath(
        start=np.array([1.0, 0.0, 0.0]),
        points=np.array([[1.0, 0.0, 0.0], [1.2, 0.0, 0.0]]),
    )
    ball = vp.Sphere("ball", np.array([0.6, 0.3, 0.0]), 0.1)
    return vp.Problem(ARM, vp.Scene((ball,)), path, 0.01, name=name)


def test_a_problem_built_in_python_is_planned_verified_and_reported(
    tmp_path: Path,
) -> None:
    problem = in_python()
    plan = vp.plan(problem)
    result = vp.verify(problem, plan.trajectory)
    assert result.verdict is vp.Verdict.CERTIFIED
    # The arm stays on the rail, 0.3 m from the ball's centre.
    assert result.min_clearance == pytest.approx(0.3 - 0.1 - 0.03, abs=2e-6)
    assert result.closest(1) == result.approaches[:1]
    vp.write_report(result, tmp_path / "report.html")
    assert "built in Python" in repr(problem)
    assert "certified" in (tmp_path / "report.html").read_text(encoding="utf-8")
    file = tmp_path / "t.csv"
    vp.write_trajectory(plan.trajectory, file)
    with pytest.raises(vp.InvalidInput, match="this problem has none"):
        vp.write_certificate(result, tmp_path / "c", file)


def test_a_problem_built_in_python_is_certified_once_it_is_a_file(
    tmp_path: Path,
) -> None:
    problem = vp.write_problem(in_python(), tmp_path / "p.yaml")
    assert problem == in_python() and problem.source is not None
    result = vp.verify(problem, vp.plan(problem).trajectory)
    proof, motion = tmp_path / "c.certificate", tmp_path / "c.csv"
    vp.write_certificate(result, proof)
    assert check_certificate(proof, problem.source.path, motion).accepted
    content = motion.read_bytes()
    vp.write_certificate(result, proof)  # the same motion stands there
    assert motion.read_bytes() == content
    motion.write_bytes(b"".join(content.splitlines(keepends=True)[:-1]))
    with pytest.raises(vp.InvalidInput, match="is another motion"):
        vp.write_certificate(result, proof)


def test_what_a_problem_is_made_of_shows_itself_in_words() -> None:
    problem = in_python()
    tool = replace(problem.manipulator, tool=vp.Tool(0.05, 0.01))
    shown = {
        tool: (
            "links                3, 1000.0 mm together",
            "mounted              tool",
        ),
        problem.scene: ("obstacles  1 Sphere", "names      ball"),
        problem.tip_path: ("corners     2, open", "length      200.000 mm"),
        vp.ErrorBox(base_mm=2.0, obstacles_mm={"ball": 1.0}): (
            "base  2.000 mm",
            "ball  1.000 mm",
        ),
        vp.ErrorBox(): ("errors  none",),
    }
    for one, lines in shown.items():
        text = repr(one)
        assert "array(" not in text
        for line in lines:
            assert line in text
        assert f"<td>{text.split('  ')[-1]}</td></tr></table>" in one._repr_html_()


def test_what_is_not_certified_leaves_no_file(tmp_path: Path) -> None:
    problem = vp.write_problem(in_python(), tmp_path / "p.yaml")
    motion = vp.plan(problem).trajectory
    result = vp.verify(problem, motion, errors=vp.ErrorBox(base_mm=200.0))
    assert result.verdict is not vp.Verdict.CERTIFIED
    with pytest.raises(vp.VdsmError, match="verdict is"):
        vp.write_certificate(result, tmp_path / "c.certificate")
    assert [one.name for one in tmp_path.iterdir()] == ["p.yaml"]


def test_a_certificate_is_of_the_files_that_were_verified(tmp_path: Path) -> None:
    problem = vp.read_problem("paper/free")
    plan = vp.plan(problem, "paper")
    result = vp.verify(problem, plan.trajectory)
    file, certificate = tmp_path / "t.csv", tmp_path / "c"
    vp.write_trajectory(plan.trajectory, file)
    vp.write_certificate(result, certificate, file)
    assert problem.source is not None
    assert check_certificate(certificate, problem.source.path, file).accepted

    vp.write_trajectory(plan.trajectory.part(0, 50), file)
    with pytest.raises(vp.InvalidInput, match="another motion"):
        vp.write_certificate(result, certificate, file)

    late = replace(plan.trajectory, times=np.arange(plan.trajectory.n_samples) + 1.0)
    vp.write_trajectory(late, file)
    with pytest.raises(vp.InvalidInput, match="another motion"):
        vp.write_certificate(result, certificate, file)

    changed = replace(problem, required_clearance=0.5)
    assert changed.source is None  # it stands in no file
    with pytest.raises(vp.InvalidInput, match="this problem has none"):
        vp.write_certificate(vp.verify(changed, plan.trajectory), certificate, file)


def test_no_certificate_of_what_is_not_certified(tmp_path: Path) -> None:
    problem = vp.read_problem("paper/obs1")
    straight = vp.plan(vp.read_problem("paper/free"), "paper").trajectory
    result = vp.verify(problem, straight)
    assert result.verdict is not vp.Verdict.CERTIFIED
    file = tmp_path / "t.csv"
    vp.write_trajectory(straight, file)
    with pytest.raises(VerificationFailed, match="refuted"):
        vp.write_certificate(result, tmp_path / "c", file)
    assert not (tmp_path / "c").exists()


def test_arguments_of_another_kind_are_refused_in_a_sentence() -> None:
    problem = vp.read_problem("paper/free")
    motion = np.zeros((1, 8))
    still = vp.Trajectory([False], [0.0], [0.0], motion, motion)
    refused: dict[str, Callable[[], object]] = {
        "found str": lambda: vp.plan("paper/free"),  # type: ignore[arg-type]
        "trajectory; found Problem$": lambda: vp.verify(problem, problem),  # type: ignore[arg-type]
        "expected ErrorBox": lambda: vp.verify(problem, still, errors=1.0),  # type: ignore[arg-type]
        "limit is nan": lambda: vp.verify(problem, still, time_limit=np.nan),
        "limit is '5'": lambda: vp.plan(problem, time_limit="5"),  # type: ignore[arg-type]
        "expected Problem, as of": lambda: vp.plan(None),  # type: ignore[arg-type]
        "file, as text or Path; found NoneType": lambda: vp.read_problem(None),  # type: ignore[arg-type]
        "file, as text or Path; found bytes": lambda: vp.read_problem(b"paper/free"),  # type: ignore[arg-type]
        "file, as text or Path; found int": lambda: vp.write_trajectory(still, 3),  # type: ignore[arg-type]
        "pinned is 3, expected": lambda: vp.repair_trajectory(problem, still, 3),  # type: ignore[arg-type, call-overload]
        "pinned is .1.5., expected": lambda: vp.repair_trajectory(
            problem,
            still,
            [1.5],  # type: ignore[list-item]
        ),
        "topic is of a robot's": lambda: vp.read_trajectory("a", problem, topic="b"),  # type: ignore[call-overload]
        "'wavy', expected one of auto, linear": lambda: vp.read_trajectory(
            "a",
            problem,
            "wavy",  # type: ignore[call-overload]
        ),
        "expected obstacles, as Sphere or Box; found str": lambda: vp.Scene("ab"),  # type: ignore[arg-type]
        "obstacles is a Sphere, expected": lambda: vp.Scene(vp.Sphere("a", [0] * 3, 1)),  # type: ignore[arg-type]
        "name of a solid is 5": lambda: vp.Sphere(5, [0, 0, 0], 1),  # type: ignore[arg-type]
        r"name of a solid is '\\x1b\[2J'": lambda: vp.Sphere("\x1b[2J", [0, 0, 0], 1),  # type: ignore[arg-type]
        "no rigid motion": lambda: replace(problem, T_world_base=2.0 * np.eye(4)),
    }
    for expected, call in refused.items():
        with pytest.raises(vp.InvalidInput, match=expected):
            call()


TUBE = FlatCylinder(np.zeros(3), np.array([0.0, 0.0, 1.0]), 0.2, 0.1)


def test_values_made_twice_are_equal_and_found_in_lists() -> None:
    """Arrays are compared by their values, never as a truth of many."""
    for name in ("paper/obs1", "paper/obs2"):
        one, other = vp.read_problem(name), vp.read_problem(name)
        assert one == other
        assert hash(one) == hash(other)
        assert one.scene.obstacles[0] in list(other.scene.obstacles)
        assert len({one.manipulator, other.manipulator}) == 1
    assert vp.read_problem("paper/obs1") != vp.read_problem("paper/obs3")
    motion = vp.Trajectory([0], [0], [0.1], [[0.2] * 3], [[0.3] * 3])
    same = vp.Trajectory([0], [0], [0.1], [[0.2] * 3], [[0.3] * 3])
    assert motion == same
    assert motion != replace(same, x0=np.array([0.1 + 1e-16]) * 1.1)
    assert motion != replace(same, times=np.array([0.0]))
    assert motion not in (None, 3, motion.x0.tolist())
    row = vp.JointTrajectory(("a",), [[1.0]])
    assert (
        row == vp.JointTrajectory(("a",), [[1.0]]) != vp.JointTrajectory(("b",), [[1]])
    )
    covers = [ConvexCover("c", (Hull(np.eye(3)), TUBE)) for _ in range(2)]
    assert covers[0] == covers[1] != ConvexCover("c", (Hull(np.eye(3), 0.1), TUBE))
    mesh = vp.Mesh("m", np.eye(3), [[0, 1, 2]])
    assert mesh == vp.Mesh("m", np.eye(3), [[0, 1, 2]]) != vp.Sphere("m", [0, 0, 0], 1)


def test_errors_are_equal_in_whatever_units_they_were_stated() -> None:
    stated = vp.ErrorBox(
        joint_deg=[0.5, 0.1, 0.2], base_mm=2.0, obstacles_mm={"ball": 1.0}
    )
    kept = in_python().under(stated).errors
    assert type(kept) is not type(stated)
    assert kept == stated
    assert {kept, stated} == {stated}
    assert kept != vp.ErrorBox(base_mm=2.0)
    assert kept != 0.002


def test_arguments_that_an_error_box_has_not_are_refused_by_its_public_name() -> None:
    with pytest.raises(TypeError, match=r"^ErrorBox\(\) got an unexpected .* 'base'"):
        vp.ErrorBox(base=1.0)  # type: ignore[call-arg]


def test_numbers_of_numpy_are_time_limits() -> None:
    problem = vp.read_problem("paper/free")
    for limit in (np.float32(500.0), np.int64(500)):
        assert vp.plan(problem, "paper", time_limit=limit).trajectory.n_samples  # type: ignore[arg-type]


def test_no_result_shows_more_clearance_than_is_proved() -> None:
    problem = in_python()
    result = vp.verify(problem, vp.plan(problem).trajectory)
    lower = np.full_like(result.least.lower, 0.0123458)
    shown = replace(result, least=replace(result.least, lower=lower))
    assert "12.345 mm" in repr(shown)
    near = result.closest(1)[0]
    assert repr(near).startswith("ClosestApproach(link ")
    assert "\n" not in repr(near)
    assert ": 12.345 mm to 12.350 mm, nearest at waypoint " in repr(
        replace(near, lower=0.0123458, upper=0.0123499)
    )
    assert ": −0.001 mm to " in repr(replace(near, lower=-1e-9))
    assert result.closest(-1) == ()


def test_results_show_themselves_in_a_few_lines() -> None:
    problem = in_python("<b>&")
    plan = vp.plan(problem)
    result = vp.verify(problem, plan.trajectory)
    for value in (problem, plan, plan.trajectory, result):
        assert len(repr(value).splitlines()) < 15
        assert len(repr(value)) < 1000
        page = value._repr_html_()
        assert "<b>" not in page
    assert "169.999 mm" in repr(result)  # proved: rounded down
    assert "&lt;b&gt;&amp;" in result._repr_html_()


@pytest.mark.parametrize(
    ("scene", "strategy", "depth_mm"),
    [
        ("obs1", "paper", -61.4),
        ("obs1", "fewest", -45.0),
        ("obs2", "paper", -40.1),
        ("obs2", "fewest", -26.8),
        ("obs2-small", "paper", -28.3),
        ("obs2-small", "fewest", -13.4),
        ("obs3", "paper", -27.4),
        ("obs3", "fewest", None),
    ],
)
def test_the_papers_joint_error_touches(
    scene: str, strategy: str, depth_mm: float | None
) -> None:
    """The table of docs/paper.md: every joint off by 0.3 deg, in the worst case."""
    problem = vp.read_problem(f"paper/{scene}")
    plan = vp.plan(problem, strategy)
    result = vp.verify(problem, plan.trajectory, errors=vp.ErrorBox(joint_deg=0.3))
    if depth_mm is None:
        assert result.verdict is vp.Verdict.CERTIFIED
        return
    assert result.verdict is not vp.Verdict.CERTIFIED
    worst = min(found.clearance for found in result.counterexamples)
    assert depth_mm - 0.1 < 1e3 * worst <= depth_mm  # at least so deep


def test_a_certificate_states_a_turn_of_the_base(tmp_path: Path) -> None:
    problem = vp.read_problem("paper/free")
    motion = vp.plan(problem, "paper").trajectory
    result = vp.verify(problem, motion, errors=vp.ErrorBox(base_deg=np.rad2deg(1e-4)))
    assert result.verdict is vp.Verdict.CERTIFIED
    vp.write_trajectory(motion, tmp_path / "t.csv")
    vp.write_certificate(result, tmp_path / "c", tmp_path / "t.csv")
    assert certificate_lines(tmp_path / "c")[0]["errors"]["base"] == [0.0, 1e-4]
    assert problem.source is not None
    source = problem.source.path
    found = check_certificate(tmp_path / "c", source, tmp_path / "t.csv")
    assert found.accepted, found.reason


@pytest.mark.parametrize("scene", ["obs1", "obs3"])
def test_the_profile_has_the_same_least_by_link_and_by_obstacle(scene: str) -> None:
    """One obstacle: in each bin the least over the links is the obstacle's."""
    problem = vp.read_problem(f"paper/{scene}")
    result = vp.verify(problem, vp.plan(problem).trajectory)
    for side in ("lower", "upper"):
        of_links = getattr(result.profile, f"link_{side}").min(axis=1)
        of_obstacles = getattr(result.profile, f"obstacle_{side}")[:, 0]
        np.testing.assert_array_equal(of_links, of_obstacles)
    assert result.profile.link_lower.min() == result.min_clearance


def test_a_motion_without_a_path_says_nothing_of_drawing() -> None:
    judged = made_up.verification()
    assert "drawn" in repr(judged)
    task = replace(judged.problem, tip_path=None)
    judged = replace(judged, problem=task, coverage=float("nan"))
    assert "drawn" not in repr(judged)


def test_what_is_handed_over_once_stays() -> None:
    """Generators were empty after they had been checked: nothing was in the way."""
    ball, name = vp.Sphere("s", [1.0, 0.0, 0.0], 0.1), ObstacleError("s", 0.1)
    assert vp.Scene(one for one in [ball]).names == ("s",)
    arm = replace(vp.built_in("hrm8"), bodies=(vp.LinkBody(1, b) for b in [ball]))
    assert arm.body_names[-1] == "s"
    assert Box(obstacles=(one for one in [name])).of_obstacle("s").shift == 0.1
    given = [ball]
    scene = vp.Scene(given)
    given.clear()
    assert len(scene.obstacles) == 1
    half = vp.HalfSpace("h", np.zeros(3), np.array([0.0, 0.0, 1.0]))
    with pytest.raises(vp.InvalidInput, match="a HalfSpace rides on no link"):
        vp.LinkBody(1, half)
    with pytest.raises(vp.InvalidInput, match=r"link is 1\.5"):
        vp.LinkBody(1.5, ball)
    with pytest.raises(vp.InvalidInput, match="span 2 ends"):
        vp.Prism("p", np.zeros(3), np.eye(3), np.eye(3)[:, :2], (0.0, 1.0, 9.0))
    for number in (np.float32(0.1), np.array(0.1), np.float64(0.1)):
        assert vp.ErrorBox(joint_deg=number).joint == np.deg2rad(float(number))
