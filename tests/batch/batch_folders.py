"""What two runs of a batch must agree on."""

from pathlib import Path

MAY_DIFFER = ("timing.json", "timing.js", ".lock")


def tree(folder: Path) -> dict[str, bytes]:
    """Every file but the timings, by its path in the folder."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in MAY_DIFFER
    }
