"""A report on paper: a Chromium of this machine prints the page."""

import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Final

from vdsm_pin.errors import InvalidInput
from vdsm_pin.io.atomic import atomic_path

_NAMES: Final = (
    "chromium", "chromium-browser", "google-chrome", "google-chrome-stable",
    "chrome", "microsoft-edge", "msedge",
)  # fmt: skip
_MAC: Final = Path("/Applications/Google Chrome.app/Contents/MacOS/Google Chrome")
_LONGEST: Final = 180.0  # seconds a browser may take
_FLAGS: Final = (
    "--headless",
    "--no-sandbox",  # containers forbid it, and the only page opened is our own
    "--use-gl=angle",
    "--use-angle=swiftshader",  # draws in 3D without a graphics card
    "--enable-unsafe-swiftshader",
    "--no-first-run",
    "--no-pdf-header-footer",  # the page brings its own
    "--virtual-time-budget=20000",  # its scripts end before it is printed
)


def find_browser() -> str:
    """The browser that prints: the variable CHROMIUM, or the first one installed.

    Raises:
        InvalidInput: If there is none.
    """
    asked = os.environ.get("CHROMIUM")
    known = (asked,) if asked else (*_NAMES, str(_MAC))
    for name in known:
        found = shutil.which(name)
        if found is not None:
            return found
    what = f"{asked!r}, which CHROMIUM names, is no program" if asked else "none found"
    message = (
        f"--pdf needs Chromium or Chrome to print the report: {what}; "
        "install one, or set CHROMIUM to its program"
    )
    raise InvalidInput(message)


def print_page(page: Path, pdf: Path) -> None:
    """Print an HTML page to a PDF file, whole or not at all.

    Raises:
        InvalidInput: If there is no browser, or it fails.
    """
    browser = find_browser()
    with tempfile.TemporaryDirectory(prefix="vdsm-") as profile, atomic_path(pdf) as to:
        command = [browser, *_FLAGS, f"--user-data-dir={profile}"]
        command += [f"--print-to-pdf={to.resolve()}", page.resolve().as_uri()]
        try:
            ran = subprocess.run(
                command, check=False, capture_output=True, timeout=_LONGEST
            )
        except subprocess.TimeoutExpired as error:
            message = f"{pdf}: {browser} took more than {_LONGEST:g} s to print it"
            raise InvalidInput(message) from error
        if ran.returncode or not to.is_file() or not to.stat().st_size:
            message = f"{pdf}: {browser} printed nothing (status {ran.returncode})"
            raise InvalidInput(message)
