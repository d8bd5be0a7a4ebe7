"""A Chromium of this machine, without a window: it prints pages and draws pictures."""

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
_FLAGS: Final = (
    "--headless",
    "--no-sandbox",  # containers forbid it, and the only page opened is our own
    "--use-gl=angle",
    "--use-angle=swiftshader",  # draws in 3D without a graphics card
    "--enable-unsafe-swiftshader",
    "--disable-gpu-compositing",
    "--disable-background-networking",
    "--no-first-run",
    "--virtual-time-budget=20000",  # its scripts end before the result is taken
)


def find_browser() -> str:
    """The browser: the variable CHROMIUM, or the first one installed.

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
        f"PDF, PNG and MP4 need Chromium or Chrome to draw the page: {what}; "
        "install one, or set CHROMIUM to its program"
    )
    raise InvalidInput(message)


def open_page(page: Path, options: list[str], wanted: Path, longest: float) -> bytes:
    """Open a page and let it run to its end.

    Args:
        page: The page.
        options: What the browser shall do with it.
        wanted: What is made of it, for messages.
        longest: How long it may take; [s].

    Returns:
        What the browser wrote.

    Raises:
        InvalidInput: If there is no browser, or it fails.
    """
    browser = find_browser()
    with tempfile.TemporaryDirectory(prefix="vdsm-") as profile:
        command = [browser, *_FLAGS, f"--user-data-dir={profile}", *options]
        command.append(page.resolve().as_uri())
        try:
            ran = subprocess.run(
                command, check=False, capture_output=True, timeout=longest
            )
        except subprocess.TimeoutExpired as error:
            message = f"{wanted}: {browser} took more than {longest:g} s for it"
            raise InvalidInput(message) from error
    if ran.returncode:
        message = f"{wanted}: {browser} failed (status {ran.returncode})"
        raise InvalidInput(message)
    return ran.stdout


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
