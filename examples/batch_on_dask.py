"""Many problems on a Dask cluster: here on two workers of this machine."""

import subprocess
import sys
from pathlib import Path

import yaml
from distributed import LocalCluster

VDSM = [sys.executable, "-m", "vdsm_pin"]
HEIGHTS = (500, 600, 700, 800)


def write_problems(folder: Path) -> None:
    """One problem for each height of the pillar of paper/obs1."""
    folder.mkdir(exist_ok=True)
    shown = subprocess.run(
        [*VDSM, "problems", "--show", "paper/obs1"], check=True, capture_output=True
    )
    problem = yaml.safe_load(shown.stdout)
    for height in HEIGHTS:
        problem["name"] = f"pillar{height}"
        problem["obstacles"][0]["center"][2] = height
        path = folder / f"pillar{height}.yaml"
        path.write_text(yaml.safe_dump(problem), encoding="utf-8")


if __name__ == "__main__":
    write_problems(Path("pillars"))
    with LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        processes=False,  # each worker thread keeps a process of its own at work
        protocol="tcp",
        dashboard_address=None,
    ) as cluster:
        asked = ["--scheduler", cluster.scheduler_address, "--out", "pillars_out"]
        ended = subprocess.run([*VDSM, "batch", "pillars", *asked], check=False)
    assert ended.returncode == 0
    for line in Path("pillars_out/summary.csv").read_text().splitlines():
        print(", ".join(line.split(",")[:3]))
