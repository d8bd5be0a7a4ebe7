"""Oracle: what is on the disk afterwards."""

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from vdsm_pin.errors import CannotWrite, InvalidFile
from vdsm_pin.io.atomic import write_text
from vdsm_pin.report.folder import (
    check_output_folder,
    check_outputs,
    locked,
    staged,
)


def test_files_arrive_together_and_others_stay(tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "out"
    folder.mkdir(parents=True)
    (folder / "mine.txt").write_text("mine")
    (folder / "a").write_text("old")
    with staged(folder) as aside:
        (aside / "a").write_text("new")
        (aside / "b").write_text("b")
        assert (folder / "a").read_text() == "old"
    assert {p.name for p in folder.iterdir()} == {"a", "b", "mine.txt"}
    assert (folder / "a").read_text() == "new"


def test_a_failure_leaves_everything_as_it_was(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("old")
    with pytest.raises(KeyError), staged(tmp_path) as aside:
        (aside / "a").write_text("half")
        raise KeyError
    assert [p.name for p in tmp_path.iterdir()] == ["a"]
    assert (tmp_path / "a").read_text() == "old"


def test_a_folder_where_a_file_must_go_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    with pytest.raises(CannotWrite) as told, staged(tmp_path) as aside:
        (aside / "a").write_text("new")
    assert str(told.value) == f"{tmp_path / 'a'}: cannot be written: Is a directory"
    with pytest.raises(CannotWrite) as told, staged(tmp_path) as aside:
        write_text(aside / ("n" * 300), "of a file aside, told by its final name")
    assert told.value.file == str(tmp_path / ("n" * 300))
    assert [p.name for p in tmp_path.iterdir()] == ["a"]


STRANGER = """
import os, sys
from pathlib import Path
from vdsm_pin.errors import InvalidFile
from vdsm_pin.report.folder import check_output_folder, staged
closed, free, shared = map(Path, sys.argv[1:])
os.setgid(65534)
os.setuid(65534)
for work in (
    lambda: check_output_folder(closed),
    lambda: check_output_folder(closed / "in" / "it"),
    lambda: staged(closed).__enter__(),
):
    try:
        work()
    except InvalidFile as error:
        print(error)
for folder in (free, shared):
    try:
        with staged(folder) as aside:
            (aside / "a").write_text("new")
    except InvalidFile as error:
        print(error)
"""


@pytest.mark.skipif(os.getuid() != 0, reason="becomes another user")
def test_folders_of_other_users(tmp_path: Path) -> None:
    for parent in (tmp_path, *tmp_path.parents):
        if parent.stat().st_mode & 0o005 != 0o005:  # as pytest makes them
            parent.chmod(0o755)
    closed, free, shared = (tmp_path / name for name in ("closed", "free", "shared"))
    for folder, mode in ((closed, 0o755), (free, 0o777), (shared, 0o1777)):
        folder.mkdir()
        folder.chmod(mode)
        (folder / "a").write_text("old")
    words = [sys.executable, "-c", STRANGER, closed, free, shared]
    ended = subprocess.run(words, capture_output=True, text=True, check=True)
    assert ended.stdout.splitlines() == [
        *[f"{closed}: is not writable"] * 3,
        f"{shared / 'a'}: cannot be written: Operation not permitted",
    ]
    assert (free / "a").read_text() == "new"
    assert (closed / "a").read_text() == (shared / "a").read_text() == "old"
    for folder in (closed, free, shared):
        assert [path.name for path in folder.iterdir()] == ["a"]


FILLS = """
import sys, time
from pathlib import Path
from vdsm_pin.report.folder import staged
folder = Path(sys.argv[1])
with staged(folder) as aside:
    for name in "abc":
        (aside / name).write_text(sys.argv[2])
    print("ready", flush=True)
    sys.stdin.read()
"""


def filling(folder: Path, text: str) -> subprocess.Popen[str]:
    """A process that has its files ready, and moves them when its input ends."""
    command = [sys.executable, "-c", FILLS, str(folder), text]
    pipe = subprocess.PIPE
    process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True)
    assert process.stdout
    assert process.stdout.readline() == "ready\n"
    return process


def test_what_a_killed_process_left_is_removed_and_a_living_one_is_not_disturbed(
    tmp_path: Path,
) -> None:
    killed, living = filling(tmp_path, "killed"), filling(tmp_path, "living")
    killed.send_signal(signal.SIGKILL)
    killed.communicate()
    assert len(list(tmp_path.iterdir())) == 2
    with staged(tmp_path) as aside:
        (aside / "d").write_text("mine")
        assert len(list(tmp_path.iterdir())) == 2
    living.communicate("")
    assert living.returncode == 0
    texts = {path.name: path.read_text() for path in tmp_path.iterdir()}
    assert texts == {"a": "living", "b": "living", "c": "living", "d": "mine"}


def test_files_of_two_processes_do_not_mix(tmp_path: Path) -> None:
    """While one moves its files, which takes the folder's lock, another one waits."""
    with locked(tmp_path):
        other = threading.Thread(target=fill, args=(tmp_path,))
        other.start()
        other.join(0.2)
        assert other.is_alive()
        assert not list(tmp_path.iterdir())
    other.join()
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def fill(folder: Path) -> None:
    with staged(folder) as aside:
        (aside / "a").write_text("a")


def test_bad_places_are_refused_before_any_work(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("x")
    with pytest.raises(InvalidFile, match="expected a folder"):
        check_output_folder(file)
    with pytest.raises(InvalidFile, match="expected a folder"):
        check_output_folder(file / "below")
    with pytest.raises(InvalidFile, match="expected a file"):
        check_outputs([], files=[(tmp_path, ())])
    check_output_folder(tmp_path / "new" / "deep")
    check_outputs([], files=[(tmp_path / "new.html", ())])
