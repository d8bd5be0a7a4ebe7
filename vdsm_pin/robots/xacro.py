"""The text of a URDF; a xacro file is expanded by xacrodoc (extra `xacro`)."""

import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from vdsm_pin.errors import InvalidFile
from vdsm_pin.io.source import check_is_file, read_text

MAX_BYTES: Final = 16 << 20
SLOWEST: Final = 60.0
"""How long an expansion may take; [s]."""


def urdf_text(path: Path, package_dirs: tuple[Path, ...] = ()) -> str:
    """The URDF in a file.

    Args:
        path: A URDF, or a xacro file by its ending `.xacro`.
        package_dirs: Where `$(find NAME)` looks for packages.

    Raises:
        InvalidFile: If it cannot be read or expanded, or xacrodoc is not installed.
    """
    if path.suffix.lower() != ".xacro":
        return read_text(path, limit=MAX_BYTES)
    check_is_file(path)
    if find_spec("xacrodoc") is None:
        problem = "xacro needs xacrodoc: pip install 'vdsm-pin[xacro]'"
        raise InvalidFile(file=path, problem=problem)
    with tempfile.TemporaryDirectory() as folder:
        return _expanded(path, package_dirs, Path(folder) / "robot.urdf")


def _expanded(path: Path, package_dirs: tuple[Path, ...], out: Path) -> str:
    """The text that xacrodoc makes, in a process of its own: macros are programs."""
    places = [word for folder in package_dirs for word in ("-d", str(folder.resolve()))]
    script = "import sys; from xacrodoc.cli import main; sys.exit(main())"
    command = [sys.executable, "-c", script, str(path.resolve()), "-o", str(out)]
    try:
        done = subprocess.run(
            [*command, *places],
            capture_output=True,
            text=True,
            errors="replace",
            timeout=SLOWEST,
            check=False,
        )
    except subprocess.TimeoutExpired:
        problem = f"is not expanded by xacrodoc within {SLOWEST:g} s"
        raise InvalidFile(file=path, problem=problem) from None
    if done.returncode or not out.is_file():
        said = done.stderr.strip().splitlines() or ["no output"]
        problem = f"is not expanded by xacrodoc: {said[-1].strip()}"
        raise InvalidFile(file=path, problem=problem)
    return read_text(out, limit=MAX_BYTES)
