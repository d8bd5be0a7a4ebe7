"""docs/modules.md: every module of the package by folder, in its own words.

    python analysis/module_index.py

Folders stand in the order of their layers, the lowest last.
"""

import ast
from pathlib import Path
from typing import Final

PACKAGE: Final = Path(__file__).parents[1] / "vdsm_pin"
TARGET: Final = PACKAGE.parent / "docs" / "modules.md"
HEAD: Final = """# Modules

Every module of the package, by the first sentence of its docstring; made by
`analysis/module_index.py`. [Architecture](../ARCHITECTURE.md) says how they work
together.
"""
ORDER: Final = (
    *("cli", "app", "app/explanation", "batch", "report", "simulation", "repair"),
    *("", "planner", "planner/paper", "planner/fewest", "planner/impossible"),
    *("verification", "robots", "certificate_writer", "certificate_checker"),
    *("io", "io/meshes", "problem", "arm", "proof", "geometry", "compiled"),
)


def summary(path: Path) -> str:
    """The first sentences of a module's docstring, up to its first blank line."""
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return " ".join(text.split("\n\n")[0].split())


def page() -> str:
    """The page; a folder that `ORDER` does not know raises ValueError."""
    folders: dict[str, list[Path]] = {}
    for path in sorted(PACKAGE.rglob("[!_]*.py")):
        folder = path.parent.relative_to(PACKAGE).as_posix().removeprefix(".")
        folders.setdefault(folder, []).append(path)
    parts = [HEAD.strip()]
    for folder in sorted(folders, key=ORDER.index):
        parts.append(f"## {folder or 'At the top'}")
        if folder:
            parts.append(summary(PACKAGE / folder / "__init__.py"))
        lines = [f"* `{path.stem}`: {summary(path)}" for path in folders[folder]]
        parts.append("\n".join(lines))
    return "\n\n".join(filter(None, parts)) + "\n"


def main() -> None:
    """Write the page."""
    TARGET.write_text(page(), encoding="utf-8")
    print(TARGET)


if __name__ == "__main__":
    main()
