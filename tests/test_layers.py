"""The import order of ARCHITECTURE.md holds, and so do the two walls."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "vdsm_pin"

# Lower number: lower layer. A module may import from its own number or below.
LAYERS = {
    "errors": 0,
    "tolerances": 0,
    "units": 0,
    "kept": 0,
    "geometry": 1,
    "manipulator": 2,
    "kinematics": 3,
    "cables": 4,
    "urdf_writer": 4,
    "urdf_validator": 4,
    "scene": 5,
    "trajectory": 5,
    "problem": 6,
    "io": 7,
    "planner": 8,
    "robot_model": 9,
    "verification": 10,
    "refinement": 11,
    "report": 12,
    "visualization": 12,
    "workflow": 13,
    "batch": 13,
    "certificate_checker": 13,
    "cli": 14,
}
ROBOTICS = {"pinocchio", "coal", "yourdfpy", "meshcat", "hppfcl"}
ROBOTICS_ALLOWED = {"robot_model", "verification", "visualization", "cli"}

MODULES = sorted(PACKAGE.rglob("*.py"))
CHECKER = PACKAGE / "certificate_checker"


def owner(module: str) -> str:
    return module.removeprefix("vdsm_pin").lstrip(".").split(".")[0]


def imported(path: Path) -> set[str]:
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
    return names


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
    if own_layer(path) in ROBOTICS_ALLOWED:
        return
    found = {name.split(".")[0] for name in imported(path)} & ROBOTICS
    assert not found


def test_verification_never_sees_the_planner() -> None:
    for path in (PACKAGE / "verification").rglob("*.py"):
        assert not any(n.startswith("vdsm_pin.planner") for n in imported(path)), path


def test_planner_never_sees_what_judges_it() -> None:
    for path in (PACKAGE / "planner").rglob("*.py"):
        judges = ("vdsm_pin.verification", "vdsm_pin.robot_model")
        assert not any(n.startswith(judges) for n in imported(path)), path


def test_certificate_checker_shares_no_code_with_the_verifier() -> None:
    own = {n for p in CHECKER.glob("*.py") for n in imported(p) if "vdsm_pin" in n}
    others = {n for n in own if owner(n) != "certificate_checker"}
    assert others <= {"vdsm_pin.errors"}
    claims = CHECKER / "claims.py"
    assert len(claims.read_text(encoding="utf-8").splitlines()) <= 500


def test_only_the_command_line_knows_the_certificate_checker() -> None:
    for path in MODULES:
        if CHECKER in path.parents or path.stem == "cli":
            continue
        assert not any(owner(n) == "certificate_checker" for n in imported(path)), path
