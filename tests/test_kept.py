"""What is kept comes back as it was, or not at all."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdsm_pin import kept
from vdsm_pin.app import first_plan

PROGRAM = """
import sys
from pathlib import Path
from vdsm_pin import kept
kept.folders = lambda: iter([Path(sys.argv[1])])
print("begun", flush=True)
while True:
    kept.keep("name", bytes([int(sys.argv[2])]) * 300_000)
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    found = tmp_path / "kept"
    monkeypatch.setattr(kept, "folders", lambda: iter([found]))
    return found


def test_content_comes_back(folder: Path) -> None:
    assert kept.read("name") is None
    for content in (b"", b"one", bytes(range(256)) * 100):
        kept.keep("name", content)
        assert kept.read("name") == content
        assert kept.read("other") is None
    assert [path.name for path in folder.iterdir()] == ["name"]
    assert (folder / "name").stat().st_mode & 0o777 == 0o644


def test_nothing_is_read_from_a_folder_that_others_can_write(folder: Path) -> None:
    mask = os.umask(0)
    try:
        kept.keep("name", b"one")
    finally:
        os.umask(mask)
    assert kept.read("name") == b"one"
    for mode in (0o757, 0o777, 0o775):
        folder.chmod(mode)
        kept.keep("name", b"two")
        assert kept.read("name") is None
    folder.chmod(0o755)
    assert kept.read("name") == b"one"


@pytest.mark.skipif(os.getuid() != 0, reason="gives a folder to another user")
def test_nothing_is_read_from_a_folder_of_another_user(folder: Path) -> None:
    kept.keep("name", b"one")
    os.mkfifo(folder / "endless")  # to open it would wait for ever
    os.chown(folder, 65534, -1)
    assert kept.read("name") is None
    assert kept.read("endless") is None
    kept.keep("name", b"two")
    os.chown(folder, 0, -1)
    assert kept.read("name") == b"one"


@given(data=st.data())
def test_every_damage_is_noticed(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("kept")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kept, "folders", lambda: iter([folder]))
        kept.keep("name", data.draw(st.binary(max_size=50)))
        good = (folder / "name").read_bytes()
        place = data.draw(st.integers(0, len(good) - 1))
        kind = data.draw(st.sampled_from(["cut", "flip", "insert"]))
        flipped = bytes([good[place] ^ data.draw(st.integers(1, 255))])
        middle = {"cut": b"", "flip": flipped + good[place + 1 :], "insert": b"x"}
        rest = good[place:] if kind == "insert" else b""
        (folder / "name").write_bytes(good[:place] + middle[kind] + rest)
        assert kept.read("name") is None


def test_first_folder_that_can_be_written_and_any_that_can_be_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    closed, home = tmp_path / "file" / "kept", tmp_path / "home"
    monkeypatch.setattr(kept, "folders", lambda: iter([closed, home]))
    kept.keep("name", b"content")
    assert kept.read("name") == b"content"
    assert (home / "name").exists()
    monkeypatch.setattr(kept, "folders", lambda: iter([closed]))
    kept.keep("name", b"content")
    assert kept.read("name") is None


FULL = """
import logging, resource, sys
from pathlib import Path
from vdsm_pin import kept
logging.basicConfig(level=logging.DEBUG)
resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))
kept.folders = lambda: iter(map(Path, sys.argv[1:]))
kept.keep("name", b"small")
kept.keep("name", bytes(300_000))
print(kept.read("name"))
"""


def test_a_full_disk_costs_time_only(tmp_path: Path) -> None:
    folders = [str(tmp_path / name) for name in ("one", "other")]
    ended = subprocess.run(
        [sys.executable, "-c", FULL, *folders],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert ended.stdout == "b'small'\n"
    assert ended.stderr.count("name is not kept in") == 2
    assert [p.name for p in (tmp_path / "one").iterdir()] == ["name"]
    assert not list((tmp_path / "other").iterdir())


def test_damage_in_one_folder_does_not_hide_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, other = tmp_path / "one", tmp_path / "other"
    for folder in (one, other):
        monkeypatch.setattr(kept, "folders", lambda folder=folder: iter([folder]))
        kept.keep("name", b"content")
    monkeypatch.setattr(kept, "folders", lambda: iter([one, other]))
    (one / "name").write_bytes(b"damaged")
    assert kept.read("name") == b"content"


def test_user_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert list(kept.folders())[1] == tmp_path / "vdsm_pin"
    monkeypatch.setenv("XDG_CACHE_HOME", "beside/the/command")
    assert list(kept.folders())[1] == Path.home() / ".cache" / "vdsm_pin"
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert list(kept.folders())[1] == Path.home() / ".cache" / "vdsm_pin"

    def homeless() -> Path:
        raise RuntimeError

    monkeypatch.setattr(Path, "home", homeless)
    assert len(list(kept.folders())) == 1


def test_writers_that_meet_and_are_killed_leave_it_whole(folder: Path) -> None:
    kept.keep("name", b"first")
    for _ in range(3):
        writers = [
            subprocess.Popen(
                [sys.executable, "-c", PROGRAM, str(folder), str(number)],
                stdout=subprocess.PIPE,
            )
            for number in (1, 2)
        ]
        for writer in writers:
            assert writer.stdout is not None
            assert writer.stdout.readline() == b"begun\n"
        for _ in range(20):
            assert _is_whole(kept.read("name"))
        time.sleep(0.001 * os.urandom(1)[0] / 8)
        for writer in writers:
            os.kill(writer.pid, signal.SIGKILL)
            writer.communicate()
        assert _is_whole(kept.read("name"))


def _is_whole(content: bytes | None) -> bool:
    assert content is not None
    return content == b"first" or content == content[:1] * 300_000


def test_it_is_cold_until_a_plan_was_made_to_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kept, "folders", lambda: iter([tmp_path / "a", tmp_path / "b"]))
    assert first_plan.is_cold()
    kept.keep("vdsm_pin.planner.some", b"machine code")
    assert first_plan.is_cold(), "one small run compiles little"
    assert first_plan.default_limit() == 600.0
    first_plan.note_planned()
    assert not first_plan.is_cold()
    assert first_plan.default_limit() == 60.0


def test_other_versions_are_cold_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was compiled before an upgrade is of no use after it."""
    monkeypatch.setattr(kept, "folders", lambda: iter([tmp_path / "kept"]))
    (tmp_path / "package" / "proof").mkdir(parents=True)
    monkeypatch.setattr(first_plan, "__file__", str(tmp_path / "package/app/plan.py"))
    source = tmp_path / "package" / "proof" / "tree.py"
    source.write_text("one = 1\n")
    first_plan.note_planned()
    assert not first_plan.is_cold()
    source.write_text("one = 10\n")
    assert first_plan.is_cold()
    first_plan.note_planned()
    assert not first_plan.is_cold()
    monkeypatch.setattr(first_plan, "version", lambda name: "another")
    assert first_plan.is_cold()
