"""What this installation can do, and what it lacks: `vdsm doctor`."""

import importlib
import importlib.metadata
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Final

from vdsm_pin import kept
from vdsm_pin.compiled import plain_numba
from vdsm_pin.errors import InvalidInput
from vdsm_pin.report.film import find_browser, find_encoder
from vdsm_pin.report.run_record import machine, version_of, versions

USES: Final = {
    "cluster": "vdsm batch --scheduler: many machines",
    "parquet": "rows.parquet beside the folders of a batch",
    "simulation": "vdsm simulate: a plan in closed loop",
    "xacro": "robots as xacro files",
    "bags": "trajectories in ROS bags and MCAP files",
    "mjcf": "scenes of robots as worlds of MuJoCo",
    "ompl": "benchmark of foreign plans",
    "references": "benchmarks beside other planners",
}
"""What the extras are for."""

_DISTRIBUTION: Final = "vdsm-pin"

_COMPILED: Final = {
    "pin": "pinocchio",
    "coal": "coal",
    "python-flint": "flint",
    "shapely": "shapely",
}
"""Modules that link to libraries of the system, which may lack them."""

_LACKING: Final = (
    "install the system's package of that library (libgomp.so.1: libgomp1 in Debian)"
)


@dataclass(frozen=True)
class Finding:
    """One line of the examination.

    Args:
        what: What was looked at.
        found: What was found, in words.
        works: Whether it can be used.
        needed: Whether planning and verification need it.
        remedy: How to get what is missing; empty where nothing is.
    """

    what: str
    found: str
    works: bool
    needed: bool = False
    remedy: str = ""


def examine() -> list[Finding]:
    """Look at everything the commands use.

    Returns:
        Findings: the machine, the libraries, the machine code, the browser, the
            encoder, the extras.
    """
    known = versions()
    head = f"vdsm-pin {known['vdsm-pin']}, Python {known['python']}, {machine()}"
    return [
        Finding("version", head, True),
        *_libraries(),
        _machine_code(),
        _browser(),
        _encoder(),
        *_extras(),
    ]


def _libraries() -> Iterator[Finding]:
    if not _requirements():
        what = f"unknown: {_DISTRIBUTION} itself is not installed"
        yield Finding("libraries", what, False, True, f"pip install {_DISTRIBUTION}")
    for name in _required(""):
        if (version := version_of(name)) is None:
            yield Finding(name, "not installed", False, True, f"pip install {name}")
        elif why := _does_not_load(name):
            yield Finding(
                name, f"{version} does not load: {why}", False, True, _LACKING
            )
        else:
            yield Finding(name, version, True, True)


def _does_not_load(name: str) -> str:
    """Why a library of machine code cannot be loaded; empty where it can."""
    try:
        importlib.import_module(_COMPILED.get(name, "sys"))
    except ImportError as error:
        return str(error)
    return ""


def _machine_code() -> Finding:
    """Whether compiled functions can be kept between two runs."""
    if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
        what = "switched off by NUMBA_DISABLE_JIT: everything takes much longer"
        return Finding("machine code", what, False, True, "unset NUMBA_DISABLE_JIT")
    if plain_numba():
        what = "compiled and kept by numba as it comes, see VDSM_PLAIN_NUMBA"
        return Finding("machine code", what, True, True)
    for folder in kept.folders():
        count = kept.functions(folder)
        try:
            kept.probe(folder)
        except OSError:
            continue
        found = f"{count} functions kept in {folder}"
        if not count:
            found = f"none yet in {folder}: the first run compiles for about a minute"
        return Finding("machine code", found, True, True)
    tried = " or ".join(str(folder) for folder in kept.folders())
    what = "cannot be kept: every run compiles for about a minute"
    return Finding("machine code", what, False, True, f"make {tried} writeable")


def _browser() -> Finding:
    try:
        what = f"{find_browser()} prints reports and draws pictures"
        return Finding("browser", what, True)
    except InvalidInput:
        remedy = "install Chromium or Chrome, or set CHROMIUM to its program"
        return Finding(
            "browser", "none: no --pdf, no PNG, no MP4", False, remedy=remedy
        )


def _encoder() -> Finding:
    try:
        return Finding("encoder", f"{find_encoder()} makes films", True)
    except InvalidInput:
        remedy = "install ffmpeg, or set FFMPEG to its program"
        return Finding("encoder", "none: no MP4", False, remedy=remedy)


def _extras() -> Iterator[Finding]:
    for extra, use in USES.items():
        names = _required(extra)
        missing = [name for name in names if version_of(name) is None]
        if names and not missing:
            yield Finding(extra, use, True)
            continue
        found = f"without {', '.join(missing) or 'knowing what it needs'}: no {use}"
        remedy = f"pip install '{_DISTRIBUTION}[{extra}]'"
        yield Finding(extra, found, False, remedy=remedy)


@cache
def _requirements() -> tuple[str, ...]:
    try:
        return tuple(importlib.metadata.requires(_DISTRIBUTION) or ())
    except importlib.metadata.PackageNotFoundError:
        return ()


def _required(extra: str) -> list[str]:
    """Names of the distributions that an extra asks for, or the package itself."""
    names = []
    for line in _requirements():
        wanted, _, condition = line.partition(";")
        asked = re.search(r"extra\s*==\s*['\"]([\w-]+)", condition)
        if (asked.group(1) if asked else "") == extra:
            names.append(re.split(r"[^\w.-]", wanted.strip())[0])
    return names
