"""The text of a URDF; a xacro file is expanded by xacrodoc (extra `xacro`)."""

import json
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from vdsm_pin.errors import InvalidFile
from vdsm_pin.io.source import check_is_file, read_text
from vdsm_pin.io.xml_reader import declared

MAX_BYTES: Final = 16 << 20
SCRIPT: Final = """
import json, resource, sys, xacro
from xacrodoc.cli import main
most, (_, hard) = 4 << 30, resource.getrlimit(resource.RLIMIT_AS)
if hard == resource.RLIM_INFINITY or hard > most:
    resource.setrlimit(resource.RLIMIT_AS, (most, hard))
try:
    main()
finally:
    print()
    print(json.dumps(xacro.all_includes))
"""
"""Expands a file within 4 GiB, and prints in its last line which others it has read."""

SLOWEST: Final = 60.0
"""How long an expansion may take; [s]."""


def urdf_text(
    path: Path, package_dirs: tuple[Path, ...] = ()
) -> tuple[str, tuple[Path, ...]]:
    """The URDF in a file, and the files that this one includes.

    Args:
        path: A URDF, or a xacro file by its ending `.xacro`.
        package_dirs: Where `$(find NAME)` looks for packages.

    Raises:
        InvalidFile: If it cannot be read or expanded, or xacrodoc is not installed.
    """
    if path.suffix.lower() != ".xacro":
        return declared(read_text(path, limit=MAX_BYTES)), ()
    check_is_file(path)
    if find_spec("xacrodoc") is None:
        fault = "xacro needs xacrodoc: pip install 'vdsm-pin[xacro]'"
        raise InvalidFile(file=path, fault=fault)
    with tempfile.TemporaryDirectory() as folder:
        return _expanded(path, package_dirs, Path(folder) / "robot.urdf")


def _expanded(
    path: Path, package_dirs: tuple[Path, ...], out: Path
) -> tuple[str, tuple[Path, ...]]:
    """The text that xacrodoc makes, in a process of its own: macros are programs.

    It takes names that are relative from where it runs, which is beside the file.
    """
    beside = path.resolve().parent
    places = [word for folder in package_dirs for word in ("-d", str(folder.resolve()))]
    command = [sys.executable, "-c", SCRIPT, str(path.resolve()), "-o", str(out)]
    try:
        done = subprocess.run(
            [*command, *places],
            capture_output=True,
            text=True,
            errors="replace",
            timeout=SLOWEST,
            cwd=beside,
            check=False,
        )
    except subprocess.TimeoutExpired:
        fault = f"is not expanded by xacrodoc within {SLOWEST:g} s"
        raise InvalidFile(file=path, fault=fault) from None
    if done.returncode or not out.is_file():
        said = done.stderr.strip().splitlines() or ["no output"]
        fault = f"is not expanded by xacrodoc: {said[-1].strip()}"
        raise InvalidFile(file=path, fault=fault)
    named = dict.fromkeys(json.loads(done.stdout.splitlines()[-1]))
    included = dict.fromkeys((beside / name).resolve() for name in named)
    # One that is optional need not be there.
    return read_text(out, limit=MAX_BYTES), tuple(filter(Path.is_file, included))
