"""docs/gallery/*.jpg: the 3D picture of every example's report.

    python analysis/gallery.py [EXAMPLE ...]

Needs a Chromium (`vdsm doctor` says which is found).
"""

import argparse
import io
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final

from PIL import Image
from playwright.sync_api import Page, sync_playwright

from vdsm_pin.report.film import find_browser

ROOT: Final = Path(__file__).parents[1]
TARGET: Final = ROOT / "docs" / "gallery"
SIZE: Final = (480, 360)
FLAGS: Final = ["--use-gl=angle", "--use-angle=swiftshader"]
QUALITY: Final = 85
"""Keeps a picture at some 20 kB."""


def run(script: Path, folder: Path) -> Path | None:
    """The first report that an example writes, if it writes one."""
    subprocess.run([sys.executable, str(script)], cwd=folder, check=True)
    reports = sorted([*folder.glob("*.html"), *folder.glob("*_out/**/report.html")])
    return reports[0] if reports else None


def photograph(page: Page, report: Path, target: Path) -> None:
    """The 3D picture as the report opens: the worst moment."""
    page.goto(report.as_uri())
    page.wait_for_timeout(2_000)
    shot = page.locator("canvas").first.screenshot()
    picture = Image.open(io.BytesIO(shot)).convert("RGB")
    picture.thumbnail(SIZE)
    picture.save(target, quality=QUALITY, optimize=True)


def main() -> None:
    """Run the examples and take their pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("examples", nargs="*")
    asked = parser.parse_args().examples
    scripts = sorted((ROOT / "examples").rglob("*.py"))
    TARGET.mkdir(exist_ok=True)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=find_browser(), args=FLAGS)
        page = browser.new_page(viewport={"width": 1300, "height": 1100})
        for script in scripts:
            if asked and script.stem not in asked:
                continue
            with tempfile.TemporaryDirectory() as folder:
                report = run(script, Path(folder))
                if report is not None:
                    photograph(page, report, TARGET / f"{script.stem}.jpg")
        browser.close()


if __name__ == "__main__":
    main()
