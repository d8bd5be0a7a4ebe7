"""Pages in Chromium whose requests and errors are written down."""

import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

CHROMIUM = os.environ.get("CHROMIUM") or shutil.which("chromium")
SHOTS = Path(__file__).parents[2] / "test-output"
SOFTWARE_GL = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-gpu-compositing",  # a quarter less work without a graphics card
]
NEEDS_CHROMIUM = [
    pytest.mark.display,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine"),
]
"""Marks of a module of tests that open pages."""


OPENED: list[Any] = []
"""Pages not closed yet: one that nobody looks at still draws."""


class Watched:
    """A page whose requests and errors are written down."""

    def __init__(self, browser: Any, address: str, **options: Any) -> None:
        small = {"viewport": {"width": 480, "height": 360}}
        self.page = browser.new_page(**small | options)
        OPENED.append(self.page)
        self.requests: list[str] = []
        self.errors: list[str] = []
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("console", self.said)
        self.page.goto(address)

    def said(self, message: Any) -> None:
        if message.type == "error" and "load resource" not in message.text:
            self.errors.append(message.text)

    def shot(self, name: str) -> None:
        SHOTS.mkdir(exist_ok=True)
        self.page.screenshot(path=SHOTS / f"{name}.png")


def pixels(page: Any) -> np.ndarray:
    """The 3D pane as it is drawn, shape (n_pixels, 3)."""
    matplotlib_image = pytest.importorskip("matplotlib.image")
    SHOTS.mkdir(exist_ok=True)
    shot = SHOTS / "pane.png"
    page.locator("#view").screenshot(path=shot)
    return np.asarray(matplotlib_image.imread(shot))[..., :3].reshape(-1, 3)
