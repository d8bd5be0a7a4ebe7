"""Files that appear whole or not at all, also when the process is killed."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from vdsm_pin.errors import CannotWrite, InvalidFile
from vdsm_pin.io.atomic import atomic_path, check_replaceable, write_text, writing


def test_the_file_takes_its_name_when_the_block_ends(tmp_path: Path) -> None:
    path = tmp_path / "new" / "folder" / "a.txt"
    with atomic_path(path) as temporary:
        temporary.write_text("whole")
        assert temporary.parent == path.parent
        assert not path.exists()
    assert path.read_text() == "whole"
    assert list(path.parent.iterdir()) == [path]


def test_a_pipe_or_a_folder_is_not_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path, why in ((tmp_path / "pipe", "no"), (tmp_path, "is a folder")):
        with pytest.raises(InvalidFile, match=why):
            check_replaceable(path)
    (tmp_path / "a.txt").write_text("old")
    for name in ("a.txt", "new.txt"):
        check_replaceable(tmp_path / name)


def test_of_a_closed_pipe_nothing_is_told_of_what_is_written() -> None:
    with pytest.raises(BrokenPipeError), writing("-"):
        raise BrokenPipeError
    with pytest.raises(CannotWrite, match="the disc is full"), writing("a.txt"):
        raise OSError(28, "the disc is full")


def test_a_failing_block_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    write_text(path, "old")
    with pytest.raises(RuntimeError), atomic_path(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_permissions_are_those_of_any_new_file(tmp_path: Path) -> None:
    write_text(tmp_path / "a.txt", "")
    (tmp_path / "b.txt").write_text("")
    modes = {(tmp_path / name).stat().st_mode for name in ("a.txt", "b.txt")}
    assert len(modes) == 1


def test_long_names_get_a_temporary_name_too(tmp_path: Path) -> None:
    for name in ("n" * 250, "\u754c" * 80, "[x]" * 40):
        write_text(tmp_path / name, "x")
        assert (tmp_path / name).read_text() == "x"


def test_what_cannot_be_written_is_told_in_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidFile, match=r"is a folder, expected a file"):
        write_text(tmp_path, "")
    with pytest.raises(
        InvalidFile, match=r"cannot be written: (Not a dir|File exists)"
    ):
        write_text(tmp_path / "file" / "a.txt", "")
    with pytest.raises(InvalidFile, match=r"cannot be written: No such file"):
        with atomic_path(tmp_path / "a.txt"):
            pass  # nothing was written
    with pytest.raises(InvalidFile, match=r"cannot be written: File name too long"):
        write_text(tmp_path / ("n" * 300), "x")
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_readers_see_a_whole_file_at_every_moment(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    texts = ["a" * 100_000, "b" * 50_000]
    write_text(path, texts[0])
    done = threading.Event()

    def write() -> None:
        for i in range(40):
            write_text(path, texts[i % 2])
        done.set()

    writer = threading.Thread(target=write)
    writer.start()
    seen = set()
    while not done.is_set():
        seen.add(path.read_text())
    writer.join()
    assert seen <= set(texts)


def test_killing_the_writer_leaves_the_old_file_or_the_new_one(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    code = (
        "import sys, itertools; from vdsm_pin.io.atomic import write_text\n"
        "for i in itertools.count():\n"
        "    write_text(sys.argv[1], str(i % 10) * 200_000)\n"
    )
    for delay in (0.0, 0.013, 0.037):
        process = subprocess.Popen([sys.executable, "-c", code, str(path)])
        while not path.exists():
            time.sleep(0.005)
        time.sleep(delay)
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        text = path.read_text()
        assert len(text) == 200_000
        assert len(set(text)) == 1
        path.unlink()


def test_a_library_without_room_is_no_file_that_cannot_be_written() -> None:
    lost = OSError("libx.so: failed to map segment from shared object")
    with pytest.raises(MemoryError, match="a library has no room"), writing("a"):
        raise lost
    other = OSError("no space")
    with pytest.raises(CannotWrite), writing("a"):
        raise other
