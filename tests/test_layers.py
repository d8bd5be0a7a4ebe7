"""The import order of ARCHITECTURE.md holds, and so do the two walls."""

import ast
import io
import re
import subprocess
import sys
import tokenize
from functools import cache
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "vdsm_pin"

# Lower number: lower layer. A module may import from its own number or below.
LAYERS = {
    "errors": 0,
    "time_limit": 0,
    "tolerances": 0,
    "units": 0,
    "kept": 0,
    "progress": 0,
    "startup": 0,
    "text": 0,
    "notebook": 1,
    "compiled": 0.5,
    "geometry": 1,
    "proof": 1.5,
    "arm": 2,
    "problem": 3,
    "io": 7,
    "planner": 8,
    "verification": 10,
    "margins": 11,
    "refinement": 11,
    "report": 12,
    "simulation": 13,
    "app": 13,
    "batch": 13,
    "robots": 11,
    "repair": 12,
    "certificate_writer": 12,
    "certificate_checker": 13,
    "api": 14,
    "cli": 14,
}
ROBOTICS = {"pinocchio", "coal", "yourdfpy", "meshcat", "hppfcl"}
ROBOTICS_ALLOWED = {"verification", "robots"}

MODULES = sorted(PACKAGE.rglob("*.py"))
CHECKER = PACKAGE / "certificate_checker"
READING = {
    *("errors", "text", "geometry.solids"),
    *("problem.planning_problem", "problem.desired_path"),
    *("problem.scene", "problem.trajectory"),
    *("problem.error_boxes",),
    *("io.problem_file", "io.source", "io.trajectory_file", "io.mesh_file"),
    *("io.others", "io.xml_reader"),
    *("arm.urdf_validator", "robots.files", "robots.joint_limits", "robots.model"),
    *("robots.srdf", "robots.trajectory_files", "robots.xacro"),
}
"""What the certificate checker shares: files as they were read."""

WORKED_OUT = {
    *("axis_spans", "axis_radii", "axis_names"),
    *("pieces", "convex_sections", "closed_mesh", "corner_stations"),
    *("of_obstacle", "angles", "widened"),
}
"""What those types work out for planner and verifier; the checker does it again."""

NOT_FOR_THE_CHECKER = (
    *("vdsm_pin.verification", "vdsm_pin.planner", "vdsm_pin.certificate_writer"),
    *("vdsm_pin.geometry.kernels", "vdsm_pin.geometry.pieces", "numba", "coal"),
)
NO_CODE = (tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.ENDMARKER)


def owner(module: str) -> str:
    return module.removeprefix("vdsm_pin").lstrip(".").split(".")[0]


@cache
def imported(path: Path) -> frozenset[str]:
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            assert node.module is not None
            if node.module == "vdsm_pin":
                names |= {f"vdsm_pin.{alias.name}" for alias in node.names}
            else:
                names.add(node.module)
    return frozenset(names)


def own_layer(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def ids(path: Path) -> str:
    return str(path.relative_to(PACKAGE))


@pytest.mark.parametrize("path", MODULES, ids=ids)
def test_imports_go_downwards(path: Path) -> None:
    layer = own_layer(path)
    if layer in ("__init__", "__main__"):
        return
    for name in imported(path):
        if not name.startswith("vdsm_pin."):
            continue
        target = owner(name)
        if target in ("__version__", "__init__"):
            continue
        assert LAYERS[target] <= LAYERS[layer], f"{layer} imports {name}"


@pytest.mark.parametrize("path", MODULES, ids=ids)
def test_only_the_upper_layers_know_robotics_libraries(path: Path) -> None:
    if own_layer(path) in ROBOTICS_ALLOWED or ids(path) == "io/urdf_arm.py":
        return
    found = {name.split(".")[0] for name in imported(path)} & ROBOTICS
    assert not found


def test_the_proof_imports_numpy_geometry_and_tolerances_only() -> None:
    for path in (PACKAGE / "proof").rglob("*.py"):
        for name in imported(path):
            if name.startswith("vdsm_pin."):
                assert owner(name) in ("proof", "geometry", "compiled", "tolerances"), (
                    f"{path}: {name}"
                )
            else:
                top = name.split(".")[0]
                assert top == "numpy" or top in sys.stdlib_module_names, name


def test_verification_never_sees_the_planner() -> None:
    for path in (PACKAGE / "verification").rglob("*.py"):
        assert not any(n.startswith("vdsm_pin.planner") for n in imported(path)), path


def test_planner_never_sees_what_judges_it() -> None:
    for path in (PACKAGE / "planner").rglob("*.py"):
        judged = (n.startswith("vdsm_pin.verification") for n in imported(path))
        assert not any(judged), path


@pytest.mark.parametrize(
    ("folder", "hidden"),
    [
        ("", ("fewest", "impossible")),  # a plan may have steps of the paper
        ("impossible", ("paper", "fewest")),
        ("paper", ("fewest", "impossible")),
        ("fewest", ("paper",)),
    ],
)
def test_strategies_share_what_stands_above_them(
    folder: str, hidden: tuple[str, ...]
) -> None:
    """Proofs of what is impossible stand below `fewest`, which asks for them."""
    for path in (PACKAGE / "planner" / folder).glob("*.py"):
        for name in imported(path):
            assert not name.startswith(
                tuple(f"vdsm_pin.planner.{one}" for one in hidden)
            ), path


def test_certificate_checker_shares_only_the_reading_of_files() -> None:
    own = {n for p in CHECKER.glob("*.py") for n in imported(p) if "vdsm_pin" in n}
    others = {n for n in own if owner(n) != "certificate_checker"}
    packages = {"geometry", "problem"}  # `from vdsm_pin.geometry import solids`
    assert others <= {f"vdsm_pin.{name}" for name in READING | packages}
    for path in CHECKER.glob("*.py"):
        tree = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        used = {node.attr for node in tree if isinstance(node, ast.Attribute)}
        assert not used & WORKED_OUT, path


def test_certificate_checker_runs_without_the_verifier() -> None:
    code = "import sys, vdsm_pin.certificate_checker as c; print(*sys.modules)"
    run = [sys.executable, "-c", code]
    loaded = subprocess.run(run, capture_output=True, text=True, check=True).stdout
    found = {name for name in loaded.split() if name.startswith(NOT_FOR_THE_CHECKER)}
    assert "vdsm_pin.io.problem_file" in loaded
    assert not found


def test_certificate_checker_is_short_enough_to_audit() -> None:
    assert sum(map(code_lines, CHECKER.glob("*.py"))) <= 1512


def code_lines(path: Path) -> int:
    """Lines with code on them: no blank ones, comments or docstrings."""
    text, lines = path.read_text(encoding="utf-8"), set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in NO_CODE and token.string.strip():
            lines |= set(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            lines -= set(range(node.lineno, (node.end_lineno or 0) + 1))
    return len(lines)


def test_code_lines_are_counted(tmp_path: Path) -> None:
    path = tmp_path / "some.py"
    path.write_text('"""One.\n\nTwo."""\n\n# three\nx = [\n    1,  # four\n]\n')
    assert code_lines(path) == 3


def test_only_the_command_line_knows_the_certificate_checker() -> None:
    for path in MODULES:
        if CHECKER in path.parents or own_layer(path) == "cli":
            continue
        assert not any(owner(n) == "certificate_checker" for n in imported(path)), path


def defined(dotted: str) -> tuple[Path, str]:
    """The module of a function, class or method, and its last name.

    Raises:
        AssertionError: If the module does not define it.
    """
    path, names = PACKAGE, dotted.split(".")
    while not path.with_suffix(".py").is_file():
        path /= names.pop(0)
    path, body = path.with_suffix(".py"), ast.parse(path.with_suffix(".py").read_text())
    for name in names:
        found = [one for one in body.body if getattr(one, "name", "") == name]
        assert found, f"{path} has no {dotted}"
        body = found[0]  # type: ignore[assignment]
    return path, names[-1]


def test_architecture_says_who_calls_whom() -> None:
    """Every name is there, and the module that a caller stands in speaks of it."""
    text = (PACKAGE.parent / "ARCHITECTURE.md").read_text(encoding="utf-8")
    above: dict[int, Path] = {}
    for line in text.split("```")[1].removeprefix("text\n").splitlines():
        if dotted := line.split()[:1]:
            depth = len(line) - len(line.lstrip())
            path, name = defined(*dotted)
            if depth:
                words = re.findall(r"\w+", above[depth - 2].read_text(encoding="utf-8"))
                assert name in words, f"{above[depth - 2]} does not call {dotted[0]}"
            above[depth] = path
    assert len(above) > 5
