"""A report on paper: a Chromium of this machine prints the page."""

from pathlib import Path
from typing import Final

from vdsm_pin.errors import InvalidInput
from vdsm_pin.io.atomic import atomic_path
from vdsm_pin.report.browser import find_browser, open_page

_LONGEST: Final = 180.0  # seconds a browser may take


def print_page(page: Path, pdf: Path) -> None:
    """Print an HTML page to a PDF file, whole or not at all.

    Raises:
        InvalidInput: If there is no browser, or it fails.
    """
    with atomic_path(pdf) as to:
        # The page brings its own header and footer.
        options = ["--no-pdf-header-footer", f"--print-to-pdf={to.resolve()}"]
        open_page(page, options, pdf, _LONGEST)
        if not to.is_file() or not to.stat().st_size:
            message = f"{pdf}: {find_browser()} printed nothing"
            raise InvalidInput(message)
