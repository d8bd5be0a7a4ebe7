"""docs/gallery/pipes.gif, the moving picture: an arm through a port, round pipes.

    python analysis/readme_animation.py

Needs a Chromium (`vdsm doctor` says which is found).
"""

import io
from pathlib import Path
from typing import Final

import numpy as np
from PIL import Image

import vdsm_pin as vp
from vdsm_pin.report.arm_drawing import ArmDrawing
from vdsm_pin.report.film import Shot, pictures
from vdsm_pin.report.gltf import play_times
from vdsm_pin.report.html import view_page

ROOT: Final = Path(__file__).parents[1]
PROBLEM: Final = ROOT / "examples" / "pipes_behind_a_port" / "pipes.yaml"
TARGET: Final = ROOT / "docs" / "gallery" / "pipes.gif"
FRAMES: Final = 90
SECONDS: Final = 9.0
SHOT: Final = Shot(look=(0.5, -1.2, 0.3), width=1520, height=680)
"""Drawn twice as large as shown, which smooths edges."""

COLOURS: Final = 200


def moments(drawing: ArmDrawing, count: int) -> list[float]:
    """Waypoints at which what moves most has gone on by the same way."""
    rows = np.arange(float(drawing.trajectory.n_samples))
    times = play_times(drawing, rows, SECONDS)
    clock = np.linspace(0.0, times[-1], count)
    return np.interp(clock, times, rows).tolist()


def animation(frames: list[bytes]) -> list[Image.Image]:
    """Small pictures that share one palette."""
    half = SHOT.width // 2, SHOT.height // 2
    small = [
        Image.open(io.BytesIO(one)).convert("RGB").resize(half, Image.Resampling.BOX)
        for one in frames
    ]
    width, height = half
    sheet = Image.new("RGB", (width, 3 * height))
    for k, one in enumerate((small[0], small[len(small) // 2], small[-1])):
        sheet.paste(one, (0, k * height))
    # Links are a small part of a picture, and its colours are theirs.
    palette = sheet.quantize(COLOURS, method=Image.Quantize.MAXCOVERAGE)
    return [one.quantize(palette=palette, dither=Image.Dither.NONE) for one in small]


def main() -> None:
    """Plan, draw and write the picture."""
    problem = vp.read_problem(PROBLEM)
    drawing = ArmDrawing(problem, vp.plan(problem).trajectory)
    shown = moments(drawing, FRAMES)
    drawn = pictures(view_page(drawing), shown, SHOT, "png", TARGET)
    first, *rest = animation(drawn)
    each = [round(1000.0 * SECONDS / FRAMES)] * FRAMES
    each[-1] = 1500
    first.save(
        TARGET, save_all=True, append_images=rest, duration=each, loop=0, optimize=True
    )


if __name__ == "__main__":
    main()
