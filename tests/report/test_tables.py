"""Oracle: the tables read back by the csv module against the records."""

import csv
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import made_up
import numpy as np
import pytest

from vdsm_pin.arm.cables import cable_lengths
from vdsm_pin.report.facts import batch_row, verification_file
from vdsm_pin.report.summaries import read_summary, write_summary
from vdsm_pin.report.tables import (
    ClearanceCsv,
    write_cables,
    write_link_angles,
)
from vdsm_pin.report.thinning import nearest_obstacles
from vdsm_pin.verification.brackets import CoalRows, LeastClearances
from vdsm_pin.verification.records import Pair


def read(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_clearance_rows_are_complete_and_in_order(tmp_path: Path) -> None:
    judged = made_up.verification()
    pairs = judged.pairs
    with closing(ClearanceCsv(tmp_path / "c.csv", judged.problem, len(pairs))) as sink:
        sink(made_up.chunk(0, 3, len(pairs)))
        sink(made_up.chunk(3, 2, len(pairs), 0.5))
        sink.write(judged)
    rows = read(tmp_path / "c.csv")
    assert len(rows) == 5 * len(pairs)
    assert [int(row["interval"]) for row in rows[:: len(pairs)]] == [0, 1, 2, 3, 4]
    assert [row["obstacle"] for row in rows[: len(pairs)]] == [
        pair.obstacle for pair in pairs
    ]
    assert [float(row["moment"]) for row in rows[:: len(pairs)]] == [0, 1, 2, 3.5, 4.5]
    first = made_up.chunk(0, 3, len(pairs))
    lower = [float(row["lower_m"]) for row in rows[: 3 * len(pairs)]]
    upper = [float(row["upper_m"]) for row in rows[: 3 * len(pairs)]]
    np.testing.assert_allclose(lower, first.lower.ravel(), rtol=0, atol=1e-9)
    assert (np.array(lower) <= first.lower.ravel()).all()
    assert (np.array(upper) >= first.upper.ravel()).all()
    assert {row["verdict"] for row in rows} == {"certified", "refuted", "undecided"}


def test_a_pair_of_links_is_told_by_its_numbers(tmp_path: Path) -> None:
    judged = made_up.verification()
    with closing(ClearanceCsv(tmp_path / "c.csv", judged.problem, 1)) as c:
        c(made_up.chunk(0, 1, 1))
        c.write(replace(judged, pairs=(Pair(2, other_link=5),)))
    (row,) = read(tmp_path / "c.csv")
    assert (row["link"], row["obstacle"], row["other_link"]) == ("2", "", "5")


def test_names_with_commas_stay_one_field(tmp_path: Path) -> None:
    judged, name = made_up.verification(), 'a, "b"'
    pairs = [Pair(1, name, body=name), Pair(1, "", 2, body=name, other_body=name)]
    with closing(ClearanceCsv(tmp_path / "c.csv", judged.problem, len(pairs))) as sink:
        sink(made_up.chunk(0, 1, 2))
        sink.write(replace(judged, pairs=tuple(pairs)))
    found = [
        (r["link"], r["obstacle"], r["other_link"]) for r in read(tmp_path / "c.csv")
    ]
    assert found == [(name, name, ""), (name, "", name)]


def test_angles_and_cables_have_a_row_per_waypoint(tmp_path: Path) -> None:
    judged = made_up.verification(n=7)
    write_link_angles(tmp_path / "a.csv", judged)
    write_cables(tmp_path / "l.csv", judged.problem, judged.trajectory)
    angles, lengths = read(tmp_path / "a.csv"), read(tmp_path / "l.csv")
    assert len(angles) == len(lengths) == 7
    head = ["waypoint", "on_path", "path_m", "x0_m", "l1a_m", "l1b_m", "l1c_m"]
    assert list(lengths[0])[:7] == head
    arm, rows = judged.problem.manipulator, judged.trajectory
    expected = cable_lengths(arm, rows.alpha, rows.theta)
    got = [[float(v) for v in list(row.values())[4:]] for row in lengths]
    np.testing.assert_allclose(got, expected.reshape(7, -1), rtol=1e-11)
    assert float(angles[3]["x0_m"]) == pytest.approx(judged.trajectory.x0[3])


def test_a_summary_reads_back_as_it_was(tmp_path: Path) -> None:
    file = verification_file(made_up.verification(), made_up.RECORD)
    row = batch_row("made-up", "paper", file)
    short = row.model_copy(
        update={"outcome": "error", "waypoints": None, "coverage": None}
    )
    write_summary(tmp_path / "s.csv", [row, short])
    assert read_summary(tmp_path / "s.csv") == (row, short)


def test_far_pairs_have_one_row_and_near_ones_a_row_an_interval(tmp_path: Path) -> None:
    judged = made_up.verification()
    pairs, chunk = judged.pairs, made_up.chunk(0, 4, len(judged.pairs))
    reach = float(np.median(chunk.lower))
    numbers = np.arange(len(pairs))
    least = LeastClearances(
        interval=numbers % 4,
        share=np.full(len(pairs), 0.25),
        lower=np.full(len(pairs), 7.0),
        upper=np.full(len(pairs), 8.0),
        verdict=np.zeros(len(pairs), np.int64),
        link_point=np.zeros((len(pairs), 3)),
        other_point=np.ones((len(pairs), 3)),
    )
    with closing(
        ClearanceCsv(tmp_path / "c.csv", judged.problem, len(pairs), reach)
    ) as sink:
        sink(chunk)
        sink.write(replace(judged, least=least))
    rows = read(tmp_path / "c.csv")
    found = [
        (int(r["interval"]), r["link"], r["obstacle"], r["other_link"]) for r in rows
    ]
    expected = [
        (i, str(pairs[k].link), pairs[k].obstacle, str(pairs[k].other_link or ""))
        for i, k in np.argwhere(chunk.lower <= reach).tolist()
    ]
    far = np.flatnonzero(~(chunk.lower <= reach).any(axis=0))
    assert 0 < len(expected) < chunk.lower.size
    assert found[: len(expected)] == expected
    assert [float(row["lower_m"]) for row in rows[len(expected) :]] == [7.0] * far.size
    assert len({one[1:] for one in found}) == len(pairs)


def test_coal_stands_in_the_row_of_its_interval_and_pair(tmp_path: Path) -> None:
    """Two waypoints end the last interval; a far pair has the least of all rows."""
    judged = made_up.verification(n=5)
    pairs, chunk = judged.pairs[:3], made_up.chunk(0, 4, 3)
    lower = chunk.lower.copy()
    lower[:, 2] = 1.0  # far away
    least = LeastClearances(
        *(np.zeros(3, np.int64), np.zeros(3), np.ones(3), np.ones(3)),
        *(np.zeros(3, np.int64), np.zeros((3, 3)), np.zeros((3, 3))),
    )
    coal = CoalRows(
        waypoint=np.array([1, 3, 4, 0, 2, 4, 2]),
        pair=np.array([0, 0, 0, 2, 2, 2, 1]),
        distance=np.array([0.5, 0.25, 0.125, 0.75, 0.5, 0.625, np.nan]),
    )
    with closing(
        ClearanceCsv(tmp_path / "c.csv", judged.problem, len(pairs), 0.9)
    ) as sink:
        sink(replace(chunk, lower=np.minimum(lower, 1.0)))
        sink.write(replace(judged, pairs=pairs, least=least, coal=coal))
    rows = read(tmp_path / "c.csv")
    near = {
        (int(row["interval"]), row["link"]): (row["coal_waypoint"], row["coal_m"])
        for row in rows[:-1]
    }
    first, second = (str(pair.link) for pair in pairs[:2])
    expected = {(i, link): ("", "") for i in range(4) for link in (first, second)}
    expected |= {(1, first): ("1", "0.5"), (3, first): ("4", "0.125")}
    expected |= {(2, second): ("2", "")}  # Coal was asked and gave nothing usable
    assert near == expected
    assert (rows[-1]["coal_waypoint"], rows[-1]["coal_m"]) == ("2", "0.5")


@pytest.mark.parametrize("most", [1, 3, 100])
def test_pages_show_the_nearest_obstacles(most: int) -> None:
    judged = made_up.verification()
    obstacles, n_links = judged.problem.scene.obstacles, 8
    lower = np.linspace(1.0, 0.0, len(obstacles)).repeat(n_links)
    nan = np.full(lower.shape, np.nan)
    least = LeastClearances(nan, nan, lower, lower, nan, nan, nan)
    chosen = nearest_obstacles(replace(judged, least=least), most)
    count = min(most, len(obstacles))
    assert chosen.tolist() == list(range(len(obstacles)))[-count:]
