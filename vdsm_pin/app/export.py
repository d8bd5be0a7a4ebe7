"""A motion as a file for others: glTF, a picture or a film."""

from pathlib import Path
from typing import Final

import numpy as np

from vdsm_pin.app.subjects import ProblemOrCell
from vdsm_pin.app.visualization import drawing
from vdsm_pin.errors import InvalidInput
from vdsm_pin.io.atomic import atomic_path, write_bytes
from vdsm_pin.report.drawing import Drawing
from vdsm_pin.report.film import FRAMES_PER_SECOND, Shot, encode, find_encoder, pictures
from vdsm_pin.report.folder import check_outputs
from vdsm_pin.report.gltf import glb, play_times
from vdsm_pin.report.html import view_page

ENDINGS: Final = (".glb", ".png", ".mp4")
MOST_SECONDS: Final = 120.0
"""Of a film; [s]."""

PLAIN: Final = Shot()
"""How to look where nobody says it."""


def export(
    problem: ProblemOrCell,
    trajectory: Path | None,
    out: Path,
    moment: float = 0.0,
    seconds: float | None = None,
    shot: Shot = PLAIN,
) -> None:
    """Write a motion as the file that its ending says.

    Args:
        problem: As it was read.
        trajectory: The motion; None for the arm at the start.
        out: The file.
        moment: Which moment a picture shows, in waypoints.
        seconds: How long it plays; None: as the trajectory's times say, or 10 s.
        shot: How to look.

    Raises:
        InvalidInput: If it cannot be written, or what draws it is missing.
    """
    motion = () if trajectory is None else (trajectory,)
    check_outputs((*problem.files, *motion), files=[(out, ENDINGS)])
    ending = out.suffix.lower()
    if ending == ".mp4":
        find_encoder()
    shown = drawing(problem, trajectory)
    if ending == ".glb":
        write_bytes(out, glb(shown, seconds))
    elif ending == ".png":
        at, page = [_within(moment, shown)], view_page(shown)
        (one,) = pictures(page, at, shot, "png", out)
        write_bytes(out, one)
    else:
        moments, page = _moments(shown, seconds), view_page(shown)
        frames = pictures(page, moments, shot, "jpeg", out)
        with atomic_path(out) as file:
            encode(frames, file, out)


def _within(moment: float, shown: Drawing) -> float:
    last = shown.trajectory.n_samples - 1
    if not 0.0 <= moment <= last:
        message = f"--moment is {moment:g}, expected a waypoint from 0 to {last}"
        raise InvalidInput(message)
    return moment


def _moments(shown: Drawing, seconds: float | None) -> list[float]:
    """The moment of each frame of a film, in waypoints."""
    rows = np.arange(float(shown.trajectory.n_samples))
    times = play_times(shown, rows, seconds)
    if times[-1] > MOST_SECONDS:
        message = (
            f"a film of {times[-1]:.0f} s is longer than {MOST_SECONDS:.0f} s; "
            "--seconds says how long it shall play"
        )
        raise InvalidInput(message)
    count = max(2, round(float(times[-1]) * FRAMES_PER_SECOND) + 1)
    clock = np.linspace(0.0, times[-1], count)
    return [float(at) for at in np.interp(clock, times, rows)]
