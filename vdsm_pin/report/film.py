"""Pages printed, pictures and films: a Chromium of this machine runs the page."""

import base64
import json
import math
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from vdsm_pin.errors import InvalidInput
from vdsm_pin.io.atomic import atomic_path
from vdsm_pin.report.html import export_page

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


LOOKS: Final = ("overview", "side", "top", "front", "tip")
FRAMES_PER_SECOND: Final = 24
_START: Final = 120.0
_EACH: Final = 2.0
"""Seconds that a browser may take at all, and for each picture."""

_BEGIN: Final = b'<pre id="pictures">'
_PICTURE: Final = re.compile(rb"data:image/\w+;base64,([A-Za-z0-9+/=]+)")


@dataclass(frozen=True)
class Shot:
    """How a motion is looked at.

    Args:
        look: One of `LOOKS`, or the direction from the scene to the eye in the base
            frame; [-].
        width: Of a picture; [pixels].
        height: Of a picture; [pixels].
        numbers: Whether links have their numbers.
    """

    look: str | tuple[float, float, float] = "overview"
    width: int = 1280
    height: int = 720
    numbers: bool = False


def look_of(text: str) -> str | tuple[float, float, float]:
    """A look by its name or by three numbers, as "1,-1,0.5".

    Raises:
        InvalidInput: If it is neither.
    """
    if text in LOOKS:
        return text
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        x = y = z = 0.0
    if math.isfinite(x + y + z) and (x, y, z) != (0.0, 0.0, 0.0):
        return x, y, z
    message = f"--look is {text!r}, expected one of {', '.join(LOOKS)}, or as 1,-1,0.5"
    raise InvalidInput(message)


def pictures(
    page: str, moments: Sequence[float], shot: Shot, kind: str, wanted: Path
) -> list[bytes]:
    """Pictures of moments of a motion.

    Args:
        page: The 3D view as a page.
        moments: In waypoints.
        shot: How to look.
        kind: "png" or "jpeg".
        wanted: What is made of them, for messages.

    Raises:
        InvalidInput: If there is no browser, or it draws nothing.
    """
    asked = {
        "look": shot.look,
        "numbers": shot.numbers,
        "type": f"image/{kind}",
        "moments": list(moments),
    }
    with tempfile.TemporaryDirectory(prefix="vdsm-") as folder:
        file = Path(folder) / "view.html"
        drawing = export_page(page, json.dumps(asked), (shot.width, shot.height))
        file.write_text(drawing, encoding="utf-8")
        options = ["--dump-dom", f"--window-size={shot.width},{shot.height}"]
        longest = _START + _EACH * len(moments)
        told = open_page(file, options, wanted, longest)
    _, _, drawn = told.rpartition(_BEGIN)
    found = [base64.b64decode(text) for text in _PICTURE.findall(drawn)]
    if len(found) != len(moments):
        message = f"{wanted}: the browser drew {len(found)} of {len(moments)} pictures"
        raise InvalidInput(message)
    return found


def find_encoder() -> str:
    """The program that makes films: the variable FFMPEG, or `ffmpeg`.

    Raises:
        InvalidInput: If there is none.
    """
    name = os.environ.get("FFMPEG", "ffmpeg")
    found = shutil.which(name)
    if found is None:
        message = (
            f"an MP4 needs ffmpeg: {name!r} is not installed; install it, or set "
            "FFMPEG to its program; .glb and .png do without"
        )
        raise InvalidInput(message)
    return found


def encode(frames: Sequence[bytes], file: Path, wanted: Path) -> None:
    """Make a film of JPEG pictures.

    Raises:
        InvalidInput: If there is no ffmpeg, or it fails.
    """
    encoder = find_encoder()
    command = [encoder, "-y", "-loglevel", "error", "-f", "image2pipe"]
    command += ["-framerate", str(FRAMES_PER_SECOND), "-c:v", "mjpeg", "-i", "-"]
    # What every player understands: colours at half the resolution, black at 16.
    command += ["-vf", "scale=out_range=tv", "-pix_fmt", "yuv420p"]
    command += ["-movflags", "+faststart", "-f", "mp4", str(file)]
    ran = subprocess.run(
        command, input=b"".join(frames), check=False, capture_output=True
    )
    if ran.returncode:
        told = ran.stderr.decode(errors="replace").strip().splitlines()
        message = f"{wanted}: {encoder} failed: {told[-1] if told else ran.returncode}"
        raise InvalidInput(message)
