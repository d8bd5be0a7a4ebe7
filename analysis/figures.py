"""Every figure and the page that shows them: `make figures`.

python analysis/figures.py --out reports/paper
"""

import importlib
import time
from typing import Final

from paper_figures import numbers, style
from paper_figures.page import page
from paper_figures.runs import Runs
from result_files import output_folder

SCRIPTS: Final = (
    "fig01_model",
    "fig02_angles",
    "fig03_flow",
    "fig04_fig11_paths",
    "fig05_collision",
    "fig06_tip_path",
    "fig07_projected_arm",
    "fig08_step5",
    "fig09_moving_on",
    "fig10_holes",
    "fig14_link_angles",
    "fig15_local",
    "fig16_ranges",
    "fig17_clearance",
    "fig18_cables",
    "closed_loop_figures",
)
WITHOUT_SVG: Final = ("fig20", "fig21")
"""Twenty thousand points a curve: a picture is smaller."""


def main(runs: Runs | None = None) -> None:
    """Draw everything and write the page."""
    folder, runs = output_folder(__doc__), runs or Runs()
    for script in SCRIPTS:
        begin = time.perf_counter()
        figures = importlib.import_module(script).draw(runs)
        style.save_all(figures, folder)
        for name in figures:
            if name.startswith(WITHOUT_SVG):
                (folder / f"{name}.svg").unlink()
        print(f"{script}: {time.perf_counter() - begin:.1f} s", flush=True)
    found = numbers.numbers(runs)
    numbers.write(found, folder / "numbers.json")
    (folder / "README.md").write_text(page(found), encoding="utf-8")


if __name__ == "__main__":
    main()
