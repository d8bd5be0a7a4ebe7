"""What a command imports is what its user waits for."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from some_slow import few_of

from vdsm_pin.planner.strategies import STRATEGIES
from vdsm_pin.startup import OBJECTS, SETTINGS

# Not pydantic: typer itself imports it where a command has parameters.
HEAVY = {"numba", "numpy", "pinocchio", "coal", "shapely", "trimesh", "rich"}
NOT_FOR_OBS1 = {
    *("numba", "shapely", "trimesh", "yourdfpy", "meshcat", "rich", "dask"),
    *("numpy.ma", "asyncio", "concurrent.futures", "multiprocessing", "flint"),
    *("vdsm_pin.certificate_writer.certificate", "vdsm_pin.certificate_checker"),
}
NEEDED = {"paper": {"shapely"}}
NOT_FOR_A_PROOF = {
    *("vdsm_pin.planner.fewest", "vdsm_pin.planner.paper", "vdsm_pin.refinement"),
}
PROGRAM = """
import sys
from vdsm_pin.cli import main
try:
    main(sys.argv[1:])
except SystemExit:
    pass
sys.stderr.write(" ".join(sys.modules))
"""
SETTLED = """
import gc, os
from vdsm_pin.startup import SETTINGS, live_briefly
live_briefly()
print(*(os.environ[name] for name in SETTINGS), gc.get_threshold()[0], gc.isenabled())
"""


def run(*words: str) -> subprocess.CompletedProcess[str]:
    program = [sys.executable, "-c", PROGRAM, *words]
    return subprocess.run(program, capture_output=True, text=True, check=True)


def imported(ended: subprocess.CompletedProcess[str]) -> set[str]:
    return set(ended.stderr.split())


@pytest.mark.parametrize("command", [["--help"], ["plan", "--help"]])
def test_help_imports_nothing_heavy(command: list[str]) -> None:
    ended = run(*command)
    assert "Usage" in ended.stdout
    assert not HEAVY & imported(ended)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where obs1 was planned and verified, so that all its machine code is there.

    Whoever comes next compiles nothing: without numba nobody can.
    """
    folder = tmp_path_factory.mktemp("obs1")
    run("plan", "paper/obs1", "--out", str(folder))
    run(*verifying(folder))
    return folder


def verifying(folder: Path) -> tuple[str, ...]:
    trajectory = str(folder / "trajectory.csv")
    return "verify", "paper/obs1", "--trajectory", trajectory, "--out", str(folder)


@pytest.mark.parametrize(
    "strategy", few_of(sorted(STRATEGIES, key=("clearest", "sturdiest").count), 3)
)
def test_a_plan_imports_no_more_than_it_needs(
    folder: Path, strategy: str, tmp_path: Path
) -> None:
    words = "plan", "paper/obs1", "--out", str(tmp_path), "--strategy", strategy
    run(*words)  # compiles what is not there
    found = imported(run(*words))
    assert found.isdisjoint(NOT_FOR_OBS1 - NEEDED.get(strategy, set()))


def test_a_verification_imports_no_more_than_it_needs(folder: Path) -> None:
    found = imported(run(*verifying(folder)))
    assert "vdsm_pin.report.html" in found
    assert found.isdisjoint(NOT_FOR_OBS1 | NOT_FOR_A_PROOF)


def test_what_the_user_has_set_stays() -> None:
    def settled(**chosen: str) -> str:
        around = {k: v for k, v in os.environ.items() if k not in SETTINGS} | chosen
        program = [sys.executable, "-c", SETTLED]
        ended = subprocess.run(
            program, capture_output=True, text=True, check=True, env=around
        )
        return ended.stdout.strip()

    assert settled() == f"1 __all__ {OBJECTS} True"
    assert settled(OPENBLAS_NUM_THREADS="3") == f"3 __all__ {OBJECTS} True"


def test_numpy_and_pydantic_come_after_what_they_read_when_they_are_imported() -> None:
    program = "import sys, vdsm_pin.cli; print(*sys.modules)"
    ended = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert not {"numpy", "pydantic"} & set(ended.stdout.split())
