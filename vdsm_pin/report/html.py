"""HTML pages: report.html, the 3D view, index.html; each is one file, no request."""

import hashlib
import re
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import jinja2.compiler
from jinja2.bccache import Bucket
from markupsafe import Markup, escape

from vdsm_pin import __version__, kept, units
from vdsm_pin.errors import NoPlanFound, OutOfTime, VdsmError, VerificationFailed
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.report import words
from vdsm_pin.report.drawing import Drawing
from vdsm_pin.report.files import BatchRow, PlanFile, VerificationFile
from vdsm_pin.report.impasse import impasse_of
from vdsm_pin.report.inputs import assumption, scene_rows, scene_words
from vdsm_pin.report.page_data import impasse_data, report_data, view_data
from vdsm_pin.report.reason import failing, left_out_words, nearest_to_obstacle
from vdsm_pin.report.rows import Point
from vdsm_pin.report.run_record import RunRecord, machine, versions
from vdsm_pin.report.thinning import MOST_DRAWN
from vdsm_pin.verification.records import ArmVerification, Verification

_TEMPLATES: Final = Path(__file__).parent / "templates"
_CODE: Final = re.compile(r"`([^`]+)`")
_TWO_WORDS: Final = re.compile(r"[a-z]+ [a-z\d]")  # no name of a file's


class _Templates(jinja2.BytecodeCache):
    """Keeps templates as Python's byte code; jinja2 sees by itself when one changed.

    It does not see that its own rules or the options below did.
    """

    def load_bytecode(self, bucket: Bucket) -> None:
        """Fill a bucket from what was kept."""
        content = kept.read(self._name(bucket))
        if content is not None:
            bucket.bytecode_from_string(content)

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Keep what a bucket holds."""
        kept.keep(self._name(bucket), bucket.bytecode_to_string())

    def _name(self, bucket: Bucket) -> str:
        rules = (Path(jinja2.compiler.__file__), Path(__file__))
        digest = hashlib.sha256(b"".join(path.read_bytes() for path in rules))
        return f"template-{bucket.key}-{digest.hexdigest()[:32]}"


@cache
def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_TEMPLATES),
        bytecode_cache=_Templates(),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    filters = [
        *(words.at_least, words.at_most, words.check_cells, words.counted, words.depth),
        *(words.errors, words.kept_at_least, words.limit, words.lost, words.mean_count),
        *(words.outcome, words.place, words.survived, words.term, units.quantity),
        *(units.measured, units.measured_at_most, units.percent, units.percent_at_most),
        *(assumption, css_text, point, scene_words, sentence),
    ]
    environment.filters |= {one.__name__: one for one in filters}
    environment.globals |= {
        "asset": _asset,
        "meshcat": _meshcat,
        "outcomes": words.OUTCOMES,
        "vdsm_version": __version__,
    }
    return environment


@cache
def _asset(name: str) -> str:
    return (_TEMPLATES / name).read_text(encoding="utf-8")


@cache
def _meshcat() -> str:
    """Meshcat's viewer, the script that draws in 3D."""
    spec = find_spec("meshcat")  # finds the package without importing it
    if spec is None or spec.origin is None:
        message = "meshcat is not installed, so no 3D page can be written"
        raise VerificationFailed(message)
    script = Path(spec.origin).parent / "viewer" / "dist" / "main.min.js"
    return script.read_text(encoding="utf-8").replace("</script", "<\\/script")


def point(point: Point | None) -> str:
    """A point in mm."""
    return units.MISSING if point is None else units.point_mm(point)


def sentence(text: str) -> Markup:
    """A remark as a sentence; names between backticks are set as code."""
    if _TWO_WORDS.match(text):
        text = text[0].upper() + text[1:]
    end = "" if text.endswith((".", "?", "!")) else "."
    return Markup(_CODE.sub(r"<code>\1</code>", str(escape(text)))) + end


def css_text(text: str) -> Markup:
    """The inside of a CSS string; whatever is not a letter or digit is escaped."""
    signs = (sign if sign.isalnum() else f"\\{ord(sign):x} " for sign in text)
    return Markup("".join(signs))


def rendered(template: str, **values: Any) -> str:
    """A template of `templates/` with its values."""
    return _environment().get_template(template).render(**values)


def write_report(
    path: Path,
    verification: Verification,
    file: VerificationFile,
    plan: PlanFile | None = None,
    index: str = "",
) -> None:
    """report.html of one verification.

    Args:
        path: The file.
        verification: The records, for the plots and the scene.
        file: The same as words and rows.
        plan: How the trajectory was planned, where that is known.
        index: Where the page of the batch is that it belongs to; empty if to none.
    """
    arm = None
    if isinstance(verification, ArmVerification):
        arm = verification.problem.manipulator
    page = rendered(
        "report.html.j2",
        file=file,
        plan=plan,
        problem=verification.problem,
        arm=arm,
        most_drawn=MOST_DRAWN,
        timed=verification.trajectory.times is not None,
        obstacles=scene_rows(verification.problem),
        worst=nearest_to_obstacle(verification),
        first_bad=next(
            (words.finite(one.moment) for one in failing(verification)), None
        ),
        left_out=left_out_words(file.left_out),
        held=any(pair.obstacle for pair in verification.pairs),
        index=index,
        **report_data(verification),
    )
    path.write_text(page, encoding="utf-8")


def view_page(drawing: Drawing, live: str = "") -> str:
    """The 3D view as one page.

    Args:
        drawing: The motion to play, in its scene.
        live: State of the files shown; with it the page asks its server for changes.
    """
    problem = drawing.problem
    return rendered(
        "view.html.j2",
        problem=problem,
        arm=isinstance(problem, PlanningProblem),
        data=view_data(drawing),
        live=live,
        most_drawn=MOST_DRAWN,
    )


def export_page(page: str, asked: str, size: tuple[int, int]) -> str:
    """A 3D view of that size [pixels] that draws what is asked and writes it down."""
    width, height = size
    script = f'<script type="application/json" id="asked">{asked}</script>'
    script += f"<script>{_asset('export.js')}</script>"
    style = f"position: fixed; left: 0; top: 0; width: {width}px; height: {height}px"
    style = f"<style>#view {{ {style} }}</style>"
    return page.replace("</body>", f"{style}{script}</body>")


def write_no_plan(
    path: Path,
    problem: PlanningProblem,
    error: VdsmError,
    strategy: str,
    record: RunRecord,
    index: str = "",
) -> None:
    """The page of a search that ended without a plan: why, how far it came, the arm.

    Args:
        path: The page.
        problem: What was asked.
        error: What ended the search.
        strategy: Name of the strategy.
        record: The run.
        index: Where the page of the batch is that it belongs to; empty if to none.
    """
    place = impasse_of(problem, error)
    page = rendered(
        "no_plan.html.j2",
        problem=problem,
        place=place,
        outcome_word=words.TIME_LIMIT if isinstance(error, OutOfTime) else "infeasible",
        message=str(error),
        searched=isinstance(error, NoPlanFound | OutOfTime),
        strategy=strategy,
        record=record,
        versions=versions(),
        machine=machine(),
        data=impasse_data(problem, place),
        index=index,
        most_drawn=MOST_DRAWN,
    )
    path.write_text(page, encoding="utf-8")


def message_page(message: str, live: str) -> str:
    """A page that says what is wrong, until the files are right again."""
    return rendered("message.html.j2", message=message, live=live)


def write_index(path: Path, rows: Sequence[BatchRow], pages: Mapping[str, str]) -> None:
    """index.html of a batch; durations stand in timing.js beside it.

    Args:
        path: The page.
        rows: One per problem.
        pages: The page of each problem that has one, by its folder.
    """
    counts = {word: sum(row.outcome == word for row in rows) for word in words.OUTCOMES}
    passed = sum(count for word, count in counts.items() if words.outcome(word).passed)
    page = rendered(
        "index.html.j2",
        rows=rows,
        counts=counts,
        passed=passed,
        pages=pages,
    )
    path.write_text(page, encoding="utf-8")
