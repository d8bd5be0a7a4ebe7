"""A folder with a problem to start from: `vdsm new`."""

import re
import shutil
import tempfile
from pathlib import Path
from typing import Final

from vdsm_pin.errors import InvalidInput
from vdsm_pin.io.atomic import writing
from vdsm_pin.io.problem_file import built_in_text

TEMPLATES: Final = Path(__file__).parent / "templates"

KINDS: Final = {
    "snake": "an arm, a few obstacles, a circle to draw",
    "port": "a vessel from a mesh, entered through a port",
    "robot": "a robot from a URDF, its cell and a motion to verify",
    "paper": "the paper's arm and its first obstacle",
}
"""What may be started from, in words."""

_NAME: Final = re.compile(r"[^\W_][\w.-]{0,99}")
"""Fit for a folder, a problem file and a command line."""

_WORD: Final = re.compile(r"\bNAME\b")


def new_project(folder: Path, kind: str) -> list[str]:
    """Make a folder with problem.yaml, what it names and a README.

    Args:
        folder: What is made; its name is the problem's.
        kind: One of `KINDS`.

    Returns:
        Names of the files made, sorted.

    Raises:
        InvalidInput: If there is such a folder, its name is none for a problem, or
            there is no such kind.
        CannotWrite: If it cannot be written; nothing is left.
    """
    name = folder.name
    if not _NAME.fullmatch(name):
        message = (
            f"{str(folder)!r} cannot name a problem; expected letters, digits, "
            "'.', '_' and '-', a letter or digit first"
        )
        raise InvalidInput(message)
    if kind not in KINDS:
        message = f"unknown template {kind!r}; known: {', '.join(KINDS)}"
        raise InvalidInput(message)
    if folder.exists() or folder.is_symlink():
        message = f"{folder}: is there already; expected a new folder"
        raise InvalidInput(message)
    with writing(folder):
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent, prefix=".vdsm-") as aside:
            made = Path(aside) / "made"
            made.mkdir()
            _fill(made, kind, name)
            made.rename(folder)
    return sorted(path.name for path in folder.iterdir())


def _fill(folder: Path, kind: str, name: str) -> None:
    texts = {"README.md": (TEMPLATES / "README.md").read_text(encoding="utf-8")}
    if kind == "paper":
        text = built_in_text("paper/obs1")
        texts["problem.yaml"] = text.replace("\nname: obs1\n", f'\nname: "{name}"\n')
    else:
        for source in (TEMPLATES / kind).iterdir():
            if source.suffix in (".yaml", ".md"):
                texts[source.name] = source.read_text(encoding="utf-8")
            else:
                shutil.copyfile(source, folder / source.name)
    for file, text in texts.items():
        content = _WORD.sub(lambda _: name, text)
        (folder / file).write_text(content, encoding="utf-8")
