"""Oracle: what a plain HTTP client gets, and the port afterwards."""

import os
import re
import signal
import socket
import subprocess
import sys
import threading
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from urllib.error import HTTPError

import made_up
import numpy as np
import pytest

from vdsm_pin.app.new_project import new_project
from vdsm_pin.app.subjects import read_problem_or_cell
from vdsm_pin.app.visualization import ViewServer, drawing, write_page
from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.errors import InvalidFile, InvalidInput
from vdsm_pin.io.problem_file import built_in_text, read_problem
from vdsm_pin.io.trajectory_file import write_trajectory
from vdsm_pin.report.impasse import at_start

TETRAHEDRON = """v 0 0 900
v 0 90 900
v 90 0 900
v 0 0 990
f 1 2 3
f 1 3 4
f 1 4 2
f 3 2 4
"""


@contextmanager
def serving(trajectory: Path | None, watch: bool = True) -> Iterator[ViewServer]:
    with ViewServer("paper/obs1", trajectory, 0, watch) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


def get(url: str) -> str:
    with urllib.request.urlopen(url, timeout=30.0) as answer:
        return str(answer.read().decode("utf-8"))


def test_the_server_hands_out_the_page_and_lets_go_of_its_port() -> None:
    with serving(None) as server:
        text = get(server.url)
        assert "paper/obs1" in text or "obs1" in text
        with pytest.raises(HTTPError):
            get(server.url + "etc/passwd")
        port = server.server_address[1]
        with pytest.raises(InvalidInput, match=f"port {port} cannot be used"):
            ViewServer("paper/obs1", None, port, False)
    with socket.socket() as again:
        again.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        again.bind(("127.0.0.1", port))


def test_a_connection_that_is_cut_is_passed_over_and_no_other_error(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with ViewServer("paper/free", None, 0, watch=False) as server:
        for error, told in ((OSError(9, "Bad file"), False), (KeyError("k"), True)):
            try:
                raise error
            except (OSError, KeyError):
                server.handle_error(None, ("127.0.0.1", 1))
            assert ("Exception occurred" in capsys.readouterr().err) is told


def test_a_robot_is_shown_with_its_motion_or_where_it_begins(tmp_path: Path) -> None:
    new_project(tmp_path / "cell", "robot")
    urdf, problem = tmp_path / "cell" / "robot.urdf", tmp_path / "cell" / "problem.yaml"
    text = urdf.read_text(encoding="utf-8")
    low = re.sub(r'lower="[^"]*" upper', 'lower="0.5" upper', text, count=1)
    urdf.write_text(low, encoding="utf-8")
    shown = drawing(read_problem_or_cell(problem), None)
    names = [joint.name for joint in shown.problem.robot.joints]  # type: ignore
    q = shown.trajectory.q  # type: ignore[attr-defined]
    assert low != text and q.tolist() == [[0.5, *[0.0] * (len(names) - 1)]]
    assert drawing(read_problem_or_cell(problem), problem.parent / "plan.csv")
    write_page(tmp_path / "v.html", str(problem), problem.parent / "plan.csv")
    page = (tmp_path / "v.html").read_text(encoding="utf-8")
    assert '"name":"gripper"' in page and '"nSamples":6' in page
    assert 'data-look="tip"' not in page


def test_a_robot_whose_joints_all_stand_is_shown(tmp_path: Path) -> None:
    new_project(tmp_path / "cell", "robot")
    urdf = tmp_path / "cell" / "robot.urdf"
    text = re.sub(
        r'type="(revolute|prismatic|continuous)"', 'type="fixed"', urdf.read_text()
    )
    urdf.write_text(text, encoding="utf-8")
    shown = drawing(read_problem_or_cell(tmp_path / "cell" / "problem.yaml"), None)
    assert shown.trajectory.q.shape == (1, 0)  # type: ignore[attr-defined]


def test_a_changed_file_is_noticed_and_a_broken_one_explained(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    write_trajectory(made_up.trajectory(4), path)
    with serving(path) as server:
        first = get(server.url)
        state = server.state()
        assert f'data-seen="{state}"' in first
        write_trajectory(made_up.trajectory(6), path)
        assert get(f"{server.url}changed?seen={state}") == "yes"
        assert get(server.url) != first
        path.write_text("not a table\n")
        assert "Cannot be shown" in get(server.url)
        write_trajectory(made_up.trajectory(5), path)
        assert "Cannot be shown" not in get(server.url)


def test_a_bad_motion_is_refused_before_a_page_is_promised(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("not a table\n")
    with pytest.raises(InvalidFile, match=r"t\.csv: line 1"):
        ViewServer("paper/obs1", tmp_path / "t.csv", 0, watch=False)


def test_without_watching_no_page_asks(tmp_path: Path) -> None:
    with serving(None, watch=False) as server:
        assert "data-seen" not in get(server.url)


def test_a_page_is_one_file(tmp_path: Path) -> None:
    write_page(tmp_path / "view.html", "paper/obs1", None)
    assert (tmp_path / "view.html").stat().st_size < 2_000_000
    with pytest.raises(InvalidFile, match="expected a file"):
        write_page(tmp_path, "paper/obs1", None)
    with pytest.raises(InvalidFile):
        drawing(made_up.problem(), tmp_path / "absent.csv")


def test_the_meshes_of_a_problem_are_watched_too(tmp_path: Path) -> None:
    source = tmp_path / "p.yaml"
    part = "obstacles: [{name: part, shape: mesh, file: part.obj, check_size: false}]"
    source.write_text(built_in_text("paper/free").replace("obstacles: []", part))
    (tmp_path / "part.obj").write_text(TETRAHEDRON)
    with ViewServer(str(source), None, 0, True) as server:
        before = server.current_page()
        assert server.current_page() is before, "nothing changed, nothing is done"
        (tmp_path / "part.obj").write_text(TETRAHEDRON.replace("900", "950"))
        assert server.current_page() != before


@pytest.fixture
def interruptible() -> Iterator[None]:
    """A process started in the background ignores Ctrl-C, and so do its children."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interruptible")
def test_an_interrupt_ends_it_cleanly_with_a_page_still_open() -> None:
    command = [sys.executable, "-m", "vdsm_pin", "view", "paper/free", "--port", "0"]
    with subprocess.Popen(
        [*command, "--watch"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={key: value for key, value in os.environ.items() if key != "DISPLAY"},
    ) as process:
        assert process.stdout is not None
        url = process.stdout.readline().split()[0]
        seen = re.search('data-seen="(\\w+)"', get(url))
        assert seen is not None
        waiting = threading.Thread(
            target=quietly, args=(f"{url}changed?seen={seen[1]}",)
        )
        waiting.start()
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60.0)
        waiting.join()
    assert (process.returncode, out, err) == (0, "closed\n", "")


def quietly(url: str) -> None:
    with suppress(OSError):
        get(url)


def test_without_a_motion_the_tip_is_drawn_at_the_start() -> None:
    """Oracle: forward kinematics of what is drawn."""
    problem, rng = read_problem("paper/obs1"), np.random.default_rng(0)
    starts = [np.array([2.9, 0.9, 0.3]), np.array([3.126, 0.0, 0.0])]
    starts += list(rng.uniform([-1.0, -0.7, -0.7], [4.0, 0.7, 0.7], (20, 3)))
    for start in starts:
        path = replace(problem.path, start=start)
        rows = at_start(replace(problem, tip_path=path))
        centres = joint_centres(problem.manipulator, rows.x0, rows.alpha, rows.theta)
        np.testing.assert_allclose(centres[0, -1], start, rtol=0.0, atol=1e-12)
        links = np.diff(centres[0], axis=0)
        straight = np.cross(links[:-1], links[1:])
        np.testing.assert_allclose(straight, 0.0, rtol=0.0, atol=1e-12)
