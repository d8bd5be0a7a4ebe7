"""Oracles: the PDF's own bytes, and stand-ins for browsers that fail."""

import shutil
from pathlib import Path

import made_up
import pytest

from vdsm_pin.errors import InvalidInput
from vdsm_pin.report.facts import verification_file
from vdsm_pin.report.film import find_browser, print_page
from vdsm_pin.report.html import write_report


def stand_in(folder: Path, script: str) -> str:
    """A program in place of the browser."""
    program = folder / "browser"
    program.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
    program.chmod(0o755)
    return str(program)


@pytest.fixture
def page(tmp_path: Path) -> Path:
    path = tmp_path / "a page.html"
    path.write_text("<p>made up", encoding="utf-8")
    return path


def test_without_a_browser_one_message_says_what_to_do(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("CHROMIUM", str(tmp_path / "absent"))
    with pytest.raises(InvalidInput, match=r"need Chromium .*absent"):
        find_browser()


@pytest.mark.parametrize(
    ("script", "said"),
    [("exit 0", "printed nothing"), ("exit 3", r"failed \(status 3")],
)
def test_a_browser_that_prints_nothing_leaves_the_old_file(
    monkeypatch: pytest.MonkeyPatch, page: Path, script: str, said: str
) -> None:
    monkeypatch.setenv("CHROMIUM", stand_in(page.parent, script))
    old = page.with_suffix(".pdf")
    old.write_text("old")
    with pytest.raises(InvalidInput, match=said):
        print_page(page, old)
    assert old.read_text() == "old"
    assert {path.name for path in page.parent.iterdir()} == {
        page.name, old.name, "browser"
    }  # fmt: skip


def test_the_browser_gets_the_page_and_its_file_is_moved_in(
    monkeypatch: pytest.MonkeyPatch, page: Path
) -> None:
    script = 'for word; do case "$word" in --print-to-pdf=*) to="${word#*=}";; esac; '
    script += 'done; echo "$word" > "$to"'
    monkeypatch.setenv("CHROMIUM", stand_in(page.parent, script))
    print_page(page, page.with_suffix(".pdf"))
    assert page.with_suffix(".pdf").read_text().strip() == page.as_uri()


@pytest.mark.slow
@pytest.mark.display
@pytest.mark.skipif(shutil.which("chromium") is None, reason="no chromium here")
def test_a_report_is_printed_on_pages(tmp_path: Path) -> None:
    judged = made_up.verification(n=40)
    path = tmp_path / "report.html"
    write_report(path, judged, verification_file(judged, made_up.RECORD))
    print_page(path, tmp_path / "report.pdf")
    printed = (tmp_path / "report.pdf").read_bytes()
    assert printed.startswith(b"%PDF-")
    assert 3 <= printed.count(b"/Type /Page\n") <= 8
    assert b"/Subtype /Image" in printed, "the still picture of the scene"
