"""The text of a URDF; a xacro file is expanded by xacrodoc (extra `xacro`)."""

import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
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

UNDEFINED: Final = "Undefined substitution argument"
"""What xacro says of an argument that was not given."""

SLOWEST: Final = 60.0
"""How long an expansion may take; [s]."""


def urdf_text(
    path: Path,
    package_dirs: tuple[Path, ...] = (),
    arguments: Mapping[str, str] = MappingProxyType({}),
) -> tuple[str, tuple[Path, ...]]:
    """The URDF in a file, and the files that this one includes.

    Args:
        path: A URDF, or a xacro file by its ending `.xacro`.
        package_dirs: Where `$(find NAME)` looks for packages.
        arguments: What `$(arg NAME)` stands for in a xacro file.

    Raises:
        InvalidFile: If it cannot be read or expanded, or xacrodoc is not installed.
    """
    if path.suffix.lower() != ".xacro":
        if arguments:
            given = ", ".join(arguments)
            fault = f"is no xacro file, which ends in .xacro, and is given {given}"
            raise InvalidFile(file=path, fault=fault)
        return declared(read_text(path, limit=MAX_BYTES)), ()
    check_is_file(path)
    for name in arguments:
        if not re.fullmatch(r"\w[\w.-]*", name):
            fault = f"xacro argument {name!r}, expected a name of letters, digits, _.-"
            raise InvalidFile(file=path, fault=fault)
    if find_spec("xacrodoc") is None:
        fault = "xacro needs xacrodoc: pip install 'vdsm-pin[xacro]'"
        raise InvalidFile(file=path, fault=fault)
    with tempfile.TemporaryDirectory() as folder:
        words = [f"{name}:={value}" for name, value in arguments.items()]
        for one in package_dirs:
            words += ["-d", str(one.resolve())]
        return _expanded(path, words, Path(folder) / "robot.urdf")


def _expanded(path: Path, words: list[str], out: Path) -> tuple[str, tuple[Path, ...]]:
    """The text that xacrodoc makes, in a process of its own: macros are programs.

    It takes names that are relative from where it runs, which is beside the file.
    """
    beside = path.resolve().parent
    command = [sys.executable, "-c", SCRIPT, str(path.resolve()), "-o", str(out)]
    try:
        done = subprocess.run(
            [*command, *words],
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
        if UNDEFINED in said[-1]:
            fault += "; give it as --xacro-arg NAME=VALUE or in xacro_args"
        raise InvalidFile(file=path, fault=fault)
    named = dict.fromkeys(json.loads(done.stdout.splitlines()[-1]))
    included = dict.fromkeys((beside / name).resolve() for name in named)
    # One that is optional need not be there.
    return read_text(out, limit=MAX_BYTES), tuple(filter(Path.is_file, included))
