"""What the scripts that write tables share: where to, and both forms of a table."""

import argparse
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

REPORTS: Final = Path(__file__).resolve().parents[1] / "reports" / "paper"
"""Where the tables are committed."""


def output_folder(description: str | None) -> Path:
    """The folder of the option --out, made where it is missing."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--out", type=Path, default=REPORTS)
    folder: Path = parser.parse_args().out
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def table_lines(head: Sequence[str], rows: Iterable[Iterable[object]]) -> list[str]:
    """The lines of a table in Markdown."""
    lines = ["| " + " | ".join(map(str, row)) + " |" for row in (head, *rows)]
    return [lines[0], "|" + "---|" * len(head), *lines[1:]]


def at_least(value: float, digits: int = 0) -> str:
    """A number that is kept, rounded down."""
    return f"{math.floor(_without_noise(value, digits)) / 10.0**digits:.{digits}f}"


def at_most(value: float, digits: int = 0) -> str:
    """A number that is not exceeded, rounded up."""
    return f"{math.ceil(_without_noise(value, digits)) / 10.0**digits:.{digits}f}"


def _without_noise(value: float, digits: int) -> float:
    return round(value * 10.0**digits, 6)


def write_table(folder: Path, name: str, rows: Sequence[Any], text: str) -> None:
    """Write name.json and name.md, and print the latter.

    Args:
        folder: Where to.
        name: File name without its ending.
        rows: Dataclasses or dicts.
        text: The same for reading.
    """
    plain = [row if isinstance(row, dict) else asdict(row) for row in rows]
    lines = (json.dumps(row, separators=(",", ":")) for row in plain)
    content = "[\n" + ",\n".join(lines) + "\n]\n"
    (folder / f"{name}.json").write_text(content, encoding="utf-8")
    (folder / f"{name}.md").write_text(text, encoding="utf-8")
    print(text)
