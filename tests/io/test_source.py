"""Files that are cut short, too long in a line or changed while they are read."""

import gzip
import hashlib
from pathlib import Path

import pytest

from vdsm_pin.errors import InvalidFile, InvalidInput
from vdsm_pin.io.source import (
    BLOCK,
    bounded_lines,
    check_is_file,
    check_unchanged,
    naming_file,
    opened,
    path_of,
    sha256_of_file,
)


def test_lines_are_bounded_and_come_whole_from_packed_files(tmp_path: Path) -> None:
    plain, packed = tmp_path / "a", tmp_path / "a.gz"
    content = b"one\n12345\nlast"
    plain.write_bytes(content)
    packed.write_bytes(gzip.compress(content))
    for path in (plain, packed):
        assert [*bounded_lines(path, limit=6)] == [b"one\n", b"12345\n", b"last"]
        with pytest.raises(InvalidFile, match="line 2: is longer than"):
            [*bounded_lines(path, limit=5)]
    packed.write_bytes(packed.read_bytes()[:-9])
    with pytest.raises(InvalidFile, match=r"a\.gz: cannot be read: "):
        [*bounded_lines(packed)]


def test_a_file_that_is_cut_while_it_is_read_is_refused(tmp_path: Path) -> None:
    path, digest = tmp_path / "a", hashlib.sha256()
    path.write_bytes(bytes(3 * BLOCK))
    with (
        pytest.raises(InvalidFile, match="cannot be read: it was cut short while"),
        opened(path, limit=4 * BLOCK, digest=digest) as (size, stream),
    ):
        assert size == 3 * BLOCK
        stream.read(10)
        path.write_bytes(bytes(2 * BLOCK))
        stream.read()


def test_a_file_that_changes_is_told(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_text("one")
    before = sha256_of_file(path)
    check_unchanged(path, before)
    path.write_text("two")
    with pytest.raises(InvalidFile, match="a: changed while it was worked on"):
        check_unchanged(path, before)


def test_an_error_names_the_file_unless_it_names_its_own() -> None:
    with pytest.raises(InvalidFile, match=r"^a: is wrong$"), naming_file(Path("a")):
        message = "is wrong"
        raise InvalidInput(message)
    with pytest.raises(InvalidFile, match=r"^b: is wrong$"), naming_file(Path("a")):
        raise InvalidFile(file="b", fault="is wrong")


def test_what_names_no_file_is_told() -> None:
    assert path_of("a/b") == path_of(Path("a/b")) == Path("a/b")
    for value in (None, 7, b"a", ["a"]):
        with pytest.raises(InvalidInput, match=f"found {type(value).__name__}$"):
            path_of(value)


def test_a_name_longer_than_any_file_has_is_refused() -> None:
    with pytest.raises(InvalidFile, match="cannot be opened: "):
        check_is_file(Path("a" * 300))
