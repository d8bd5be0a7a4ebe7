"""Oracles: an HTML parser, the records, and what a self-contained page may not hold."""

import math
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import jinja2
import made_up
import numpy as np
import pytest

from vdsm_pin import kept
from vdsm_pin.problem.scene import Scene
from vdsm_pin.report import html
from vdsm_pin.report.arm_drawing import ArmDrawing
from vdsm_pin.report.facts import batch_row, verification_file
from vdsm_pin.report.files import BatchRow
from vdsm_pin.report.html import (
    message_page,
    point,
    sentence,
    view_page,
    write_index,
    write_report,
)
from vdsm_pin.verification.records import Verdict, Verification


class Page(HTMLParser):
    """Text outside of scripts, and every address a page would load."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.words: list[str] = []
        self.open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.open.append(tag)
        for name, value in attrs:
            if name in ("src", "href", "srcset", "action") and value:
                self.loads.append(value)

    def handle_endtag(self, tag: str) -> None:
        while self.open and self.open.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        if not {"script", "style"} & set(self.open):
            self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())


def report(path: Path, verification: Verification) -> str:
    file = verification_file(verification, made_up.RECORD)
    write_report(path / "report.html", verification, file)
    return (path / "report.html").read_text(encoding="utf-8")


def test_a_report_loads_nothing_and_stays_small(tmp_path: Path) -> None:
    text = report(tmp_path, made_up.verification(n=1000))
    assert len(text.encode()) < 6_000_000
    assert Page(text).loads == ["data:,"]


@pytest.mark.parametrize(
    ("remark", "words"),
    [
        ("drew 3 mm of `path`", "Drew 3 mm of <code>path</code>."),
        ("arm_1 is < 'wall'", "arm_1 is &lt; &#39;wall&#39;."),
        ("panda: held", "panda: held."),
        ("Already told.", "Already told."),
    ],
)
def test_remarks_are_sentences_and_names_stay_as_they_are(
    remark: str, words: str
) -> None:
    assert sentence(remark) == words


@pytest.mark.parametrize("verdict", list(Verdict))
def test_the_verdict_comes_first_and_only_certified_is_green(
    tmp_path: Path, verdict: Verdict
) -> None:
    text = report(tmp_path, made_up.verification(verdict))
    page = Page(text)
    words = [word.value for word in Verdict]
    body = page.text.split("waypoints ·", 1)[1]
    assert min(words, key=body.index) == verdict.value
    assert f'class="banner verdict {verdict.value}"' in text
    assert verification_file(made_up.verification(verdict), made_up.RECORD).reason in (
        page.text
    )


def test_everything_a_reader_needs_is_there(tmp_path: Path) -> None:
    text = Page(report(tmp_path, made_up.verification())).text
    for needed in (
        "4.100 mm", "±0.1317°", "87.3 %", "link 1 to pillar", "forward kinematics",
        "1000.0 mm", "vdsm verify made-up.yaml --trajectory 'a b.csv' --out out",
        "1" * 64, "numpy", "coal agreement", "42.500°",
    ):  # fmt: skip
        assert needed in text, needed


def test_missing_evidence_is_shown_as_missing(tmp_path: Path) -> None:
    text = report(tmp_path, made_up.verification(scene=Scene(), joint_error=math.nan))
    assert 'class="value missing">not available' in text
    assert 'class="value">not sought' in text
    assert "there is no obstacle" in text


def test_names_cannot_break_out_of_the_page(tmp_path: Path) -> None:
    shapes = made_up.every_shape().obstacles
    evil = type(shapes[1])("</script><b>", shapes[1].centre, 0.2)  # type: ignore
    text = report(tmp_path, made_up.verification(scene=Scene((evil,))))
    assert "</script><b>" not in text


def test_a_motion_of_one_row_has_a_report(tmp_path: Path) -> None:
    assert "made up" in report(tmp_path, made_up.verification(n=1))


def test_the_view_loads_nothing_and_only_a_live_one_asks() -> None:
    shown = ArmDrawing(made_up.problem(), made_up.trajectory(5))
    still, live = view_page(shown), view_page(shown, "abc")
    assert Page(still).loads == ["data:,"]
    assert "fetch(`changed?seen=" not in still
    assert "fetch(`changed?seen=" in live
    assert 'data-seen="abc"' in live
    assert "<b>" not in message_page("bad <b>", "").split("<body>")[1]


def test_the_index_links_every_finished_problem(tmp_path: Path) -> None:
    file = verification_file(made_up.verification(), made_up.RECORD)
    good = batch_row("a-b", "paper", file)
    lost = BatchRow.model_validate(
        {"folder": "<c>", "problem": "c", "strategy": "paper", "outcome": "time-limit"}
    )
    write_index(tmp_path / "index.html", [good, lost], {"a-b": "report.html"})
    text = (tmp_path / "index.html").read_text(encoding="utf-8")
    page = Page(text)
    assert "1 of 2 problems certified" in page.text
    assert set(page.loads) == {
        "data:,", "a-b/picture.svg", "a-b/report.html", "timing.js",
    }  # fmt: skip
    assert "<c>" in page.text


def test_templates_are_compiled_once_and_again_where_what_was_kept_is_damaged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept_in = tmp_path / "kept"
    monkeypatch.setattr(kept, "folders", lambda: iter([kept_in]))
    compiled: list[str | None] = []
    compile_it = jinja2.Environment.compile

    def note(self: jinja2.Environment, source: Any, name: Any, path: Any) -> Any:
        compiled.append(name)
        return compile_it(self, source, name, path)

    monkeypatch.setattr(jinja2.Environment, "compile", note)
    pages = []
    for damage in (False, False, True):
        if damage:
            for file in kept_in.iterdir():
                file.write_bytes(file.read_bytes()[:-1] + b"?")
        html._environment.cache_clear()
        pages.append(message_page("text", "state"))
    html._environment.cache_clear()
    assert compiled[: len(compiled) // 2] == compiled[len(compiled) // 2 :] != []
    assert pages[0] == pages[1] == pages[2]


def test_plots_run_over_time_where_the_motion_has_times(tmp_path: Path) -> None:
    judged = made_up.verification(n=40)
    option = '<option value="time">'
    assert option not in report(tmp_path, judged)
    rows = replace(judged.trajectory, times=np.linspace(3.0, 5.0, 40))
    assert option in report(tmp_path, replace(judged, trajectory=rows))


def test_a_point_on_an_axis_has_no_negative_zero() -> None:
    assert point((-1e-9, 0.1, -0.02)) == "0.0, 100.0, −20.0"
    assert point(None) == "not available"
