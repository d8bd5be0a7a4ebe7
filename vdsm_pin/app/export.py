"""A motion as a file for others: glTF, a picture or a film."""

from dataclasses import dataclass, field
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


@dataclass(frozen=True)
class ExportOrder:
    """What to export.

    Args:
        problem: As it was read.
        trajectory: The motion; None for the arm at the start.
        out: The file; its ending says what it is.
        moment: Which moment a picture shows, in waypoints.
        seconds: How long it plays; None: as the trajectory's times say, or 10 s.
        shot: How to look.
    """

    problem: ProblemOrCell
    trajectory: Path | None
    out: Path
    moment: float = 0.0
    seconds: float | None = None
    shot: Shot = field(default_factory=Shot)


def export(order: ExportOrder) -> None:
    """Write the file.

    Raises:
        InvalidInput: If it cannot be written, or what draws it is missing.
    """
    _check(order)
    shown = drawing(order.problem, order.trajectory)
    match order.out.suffix.lower():
        case ".glb":
            write_bytes(order.out, glb(shown, order.seconds))
        case ".png":
            moment = [_within(order.moment, shown)]
            page = view_page(shown)
            (one,) = pictures(page, moment, order.shot, "png", order.out)
            write_bytes(order.out, one)
        case _:
            moments, page = _moments(shown, order.seconds), view_page(shown)
            frames = pictures(page, moments, order.shot, "jpeg", order.out)
            with atomic_path(order.out) as file:
                encode(frames, file, order.out)


def _check(order: ExportOrder) -> None:
    """Refuse what cannot be done before any work is."""
    motion = () if order.trajectory is None else (order.trajectory,)
    check_outputs((*order.problem.files, *motion), files=[(order.out, ENDINGS)])
    if order.out.suffix.lower() == ".mp4":
        find_encoder()


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
