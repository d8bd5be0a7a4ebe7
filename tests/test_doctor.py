"""`vdsm doctor` names what is missing and how to get it."""

import importlib.metadata
import sys
import tomllib
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

from vdsm_pin import kept
from vdsm_pin.app import doctor
from vdsm_pin.app.doctor import Finding, examine
from vdsm_pin.cli import main
from vdsm_pin.io.atomic import writing
from vdsm_pin.report import run_record

ROOT = Path(__file__).parents[1]
NO_OPENMP = "libgomp.so.1: cannot open shared object file"


def found(what: str) -> Finding:
    (one,) = [finding for finding in examine() if finding.what == what]
    return one


def test_an_installation_that_runs_the_tests_lacks_nothing_it_needs() -> None:
    needed = [one for one in examine() if one.needed]
    assert len(needed) > 10
    assert all(one.works for one in needed)
    assert {"coal", "pin", "yourdfpy", "numba", "numpy"} <= {one.what for one in needed}


def test_a_missing_library_is_named_with_its_remedy(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    real = importlib.metadata.version

    def without_shapely(name: str) -> str:
        if name in ("shapely", "distributed"):
            raise importlib.metadata.PackageNotFoundError(name)
        return real(name)

    monkeypatch.setattr(importlib.metadata, "version", without_shapely)
    with pytest.raises(SystemExit) as ended:
        main(["doctor"])
    lines = capsys.readouterr().out.splitlines()
    assert ended.value.code == 1
    assert "✗ shapely        not installed; pip install shapely" in lines
    (cluster,) = [line for line in lines if " cluster " in line]
    assert cluster.startswith("– ")
    assert cluster.endswith("pip install 'vdsm-pin[cluster]'")


def test_a_library_without_metadata_is_known_by_its_module(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As conda installs Pinocchio and Coal."""
    real, told = importlib.metadata.version, {"pin": "pinocchio", "coal": "coal"}

    def without_metadata(name: str) -> str:
        if name in told:
            raise importlib.metadata.PackageNotFoundError(name)
        return real(name)

    run_record.versions()  # kept for other tests
    monkeypatch.setattr(importlib.metadata, "version", without_metadata)
    for name, module in told.items():
        assert found(name).works
        assert found(name).found == import_module(module).__version__
        assert run_record.versions.__wrapped__()[name] == found(name).found
    del told["coal"]
    monkeypatch.setitem(sys.modules, "pinocchio", None)
    assert not found("pin").works


def test_a_library_that_the_system_cannot_load_is_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def without_openmp(name: str) -> ModuleType:
        if name == "pinocchio":
            raise ImportError(NO_OPENMP, name=name)
        return import_module(name)

    monkeypatch.setattr("vdsm_pin.app.doctor.importlib.import_module", without_openmp)
    pin = found("pin")
    assert not pin.works
    assert "does not load: libgomp.so.1" in pin.found
    assert "libgomp1" in pin.remedy
    assert found("coal").works


@pytest.mark.parametrize(
    ("said", "told"), [("", ""), ("no room for 9 GiB", "; no room for 9 GiB")]
)
def test_a_command_that_runs_out_of_memory_says_so_in_one_line(
    said: str,
    told: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """And ends as no verdict does: 1 would be taken for refuted or undecided."""

    def large(*_: object) -> None:
        raise MemoryError(said)

    monkeypatch.setattr(doctor, "examine", large)
    with pytest.raises(SystemExit) as ended:
        main(["doctor"])
    assert ended.value.code == 2
    assert capsys.readouterr().err == f"vdsm: there is too little memory{told}\n"


def _no_room() -> None:
    message = "libllvmlite.so: failed to map segment from shared object"
    raise OSError(message)


@pytest.mark.parametrize("kind", [ImportError, OSError])
def test_a_library_that_finds_no_room_in_memory_is_too_little_memory(
    kind: type[Exception],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Not a folder that cannot be written, and no status of a verdict."""

    def unloadable(*_: object) -> None:
        with writing(tmp_path):
            try:
                _no_room()
            except OSError:
                message = "Could not find/load shared object file"
                raise kind(message) from None

    monkeypatch.setattr(doctor, "examine", unloadable)
    with pytest.raises(SystemExit) as ended:
        main(["doctor"])
    assert ended.value.code == 2
    told = capsys.readouterr().err
    assert told == "vdsm: there is too little memory; a library has no room\n"


def test_a_command_that_cannot_load_a_library_says_so_in_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def unloadable(*_: object) -> None:
        raise ImportError(NO_OPENMP)

    monkeypatch.setattr(doctor, "examine", unloadable)
    with pytest.raises(SystemExit) as ended:
        main(["doctor"])
    assert ended.value.code == 1
    assert capsys.readouterr().err == (
        f"vdsm: {NO_OPENMP}; vdsm doctor says what is missing\n"
    )


def test_a_missing_browser_is_no_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CHROMIUM", "no-such-program")
    browser = found("browser")
    assert not browser.works
    assert not browser.needed
    assert "CHROMIUM" in browser.remedy


def test_machine_code_that_cannot_be_kept_is_told(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(kept, "folders", lambda: [tmp_path / "file" / "kept"])
    assert found("machine code").remedy.startswith("make ")
    monkeypatch.setattr(kept, "folders", lambda: [tmp_path / "kept"])
    assert "the first run compiles" in found("machine code").found
    assert not list((tmp_path / "kept").iterdir())
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    assert found("machine code").remedy == "unset NUMBA_DISABLE_JIT"


def test_what_is_not_installed_at_all_is_no_success(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(doctor, "_requirements", tuple)
    assert not found("libraries").works


def test_the_uses_told_are_the_extras_there_are() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    extras = project["project"]["optional-dependencies"]
    assert extras.keys() - {"dev", "docs"} == doctor.USES.keys()


def test_an_extra_of_which_nothing_is_known_is_no_success(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(doctor, "_requirements", lambda: ("numpy>=2.0",))
    assert not found("simulation").works
