"""A second robot beside the one that is judged: closed forms, Coal, swapped roles."""

from pathlib import Path

import numpy as np
import pytest
from oracles.certificate_cases import write_cube
from oracles.random_robots import MESH, random_urdf
from oracles.shortcuts import read_rows

from tests.robots.test_robots import write
from vdsm_pin.certificate_checker import Outcome, check_certificate
from vdsm_pin.certificate_writer.certificate import write_certificate
from vdsm_pin.certificate_writer.lines import Hashes
from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import FloatArray, rotation_from_rpy
from vdsm_pin.io import bags
from vdsm_pin.io.source import sha256_of_file
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.proof.paths import Path as Motion
from vdsm_pin.proof.terms import CERTIFIED, REFUTED
from vdsm_pin.report.inputs import scene_words
from vdsm_pin.report.page_data import report_data
from vdsm_pin.report.robot_facts import robot_facts
from vdsm_pin.robots.by_itself import POSES
from vdsm_pin.robots.cell import Cell, read_cell
from vdsm_pin.robots.files import HULLS, MeshCover, RobotFiles
from vdsm_pin.robots.judgement import verify_robot
from vdsm_pin.robots.trajectory_csv import csv_text
from vdsm_pin.robots.urdf import read_robot
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.coal_shapes import CoalShapes, Sides, link_shapes
from vdsm_pin.verification.records import Verdict

RADIUS, REQUIRED = {"left": 0.05, "right": 0.08}, 0.01
BASES = {"left": ([0.0, 0.0, 0.3], [0, 0, 0]), "right": ([0.9, 0.1, 0.3], [0, 0, 180])}
TIMES = {"left": np.array([0.0, 1.0, 3.0]), "right": np.array([0.25, 1.5, 2.5])}


def urdf(radius: float) -> str:
    """A ball at the end of half a metre that turns about z."""
    return f"""<robot name="swing"><link name="base"/>
      <link name="ball"><collision><origin xyz="0.5 0 0"/>
        <geometry><sphere radius="{radius}"/></geometry></collision></link>
      <joint name="turn" type="revolute"><parent link="base"/><child link="ball"/>
        <axis xyz="0 0 1"/><limit lower="-9" upper="9" effort="1" velocity="99"/>
      </joint></robot>"""


def rows_text(q: FloatArray, times: FloatArray) -> str:
    """A trajectory of one joint."""
    rows = zip(q.tolist(), times.tolist(), strict=True)
    return "\n".join(["turn_rad,time_s", *(f"{a!r},{t!r}" for a, t in rows)])


def two(folder: Path, q: dict[str, FloatArray], own: str = "left") -> tuple[Cell, Path]:
    """The problem of one of two swings beside the other, and its trajectory."""
    for name in BASES:
        write(folder, f"{name}.urdf", urdf(RADIUS[name]))
        write(folder, f"{name}.csv", rows_text(q[name], TIMES[name]))
    other = "right" if own == "left" else "left"
    bases = {
        name: f"base: {{position: {place}, rpy_deg: {rpy}}}"
        for name, (place, rpy) in BASES.items()
    }
    text = (
        "vdsm_problem: 1\nlength_unit: m\n"
        f"robot: {{urdf: {own}.urdf}}\n{bases[own]}\nrequired_clearance: {REQUIRED}\n"
        f"others:\n  - {{name: {other}, robot: {{urdf: {other}.urdf}},\n"
        f"     {bases[other]}, trajectory: {other}.csv}}\n"
    )
    return read_cell(write(folder, f"{own}.yaml", text)), folder / f"{own}.csv"


def truth(q: dict[str, FloatArray], at: FloatArray) -> FloatArray:
    """Clearance of both balls at some times; [m]."""
    centres = []
    for name, (place, rpy) in BASES.items():
        angle = np.interp(at, TIMES[name], q[name]) + np.radians(rpy[2])
        circle = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
        centres.append(0.5 * circle + np.array(place))
    away = np.linalg.norm(centres[0] - centres[1], axis=1)
    return np.asarray(away - sum(RADIUS.values()))


@pytest.mark.parametrize("seed", range(6))
def test_closed_form_and_swapped_roles(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    q = {name: rng.uniform(-2.5, 2.5, 3) for name in BASES}
    for own, name in (("left", "right: ball"), ("right", "left: ball")):
        cell, file = two(tmp_path, q, own)
        found = verify_robot(cell, read_rows(file, cell.robot))
        start, end = TIMES[own][0], TIMES[own][-1]
        least = float(truth(q, np.linspace(start, end, 60_001)).min())
        (near,) = found.approaches
        assert near.pair.obstacle == name
        assert near.lower <= max(least, 0.0) + 1e-12
        assert max(least, 0.0) <= max(near.upper, 0.0) + 1e-4
        assert found.least.verdict[0] == (CERTIFIED if least >= REQUIRED else REFUTED)
        time = np.interp(near.interval + near.share, np.arange(3.0), TIMES[own])
        if least > 0.0:
            assert near.coal == pytest.approx(float(truth(q, time[None])[0]), abs=1e-6)
        poses = [check for check in found.checks if check.name.endswith(POSES)]
        assert [check.verdict for check in poses] == [Verdict.CERTIFIED] * 2
        longer = "'left: ball' moves from 0 s to 3 s; judged is the time of the "
        longer += "trajectory, 0.25 s to 2.5 s"
        assert (longer in robot_facts(found)["notes"]) == (own == "right")


def test_another_robot_may_stand_still(tmp_path: Path) -> None:
    """Of which no joint moves: judged as an obstacle at rest, and drawn."""
    q = {"left": np.array([1.0, 1.3, 1.2]), "right": np.zeros(3)}
    _, file = two(tmp_path, q)
    write(tmp_path, "right.csv", "time_s\n0\n1\n2\n")
    text = (tmp_path / "left.yaml").read_text()
    locked = "{urdf: right.urdf, lock: {turn: 0}}"
    cell = read_cell(
        write(tmp_path, "left.yaml", text.replace("{urdf: right.urdf}", locked))
    )
    found = verify_robot(cell, read_rows(file, cell.robot))
    least = truth(q, np.linspace(0.0, 3.0, 9_001)).min()
    assert found.approaches[0].lower <= least <= found.approaches[0].upper + 1e-9
    assert "right: ball" in report_data(found)["data"]


@pytest.mark.parametrize(
    ("most", "velocity", "wrong"),
    [(8.9, 99, ""), (9.5, 99, "limits"), (8.9, 6, "velocity limit")],
)
def test_another_robot_is_held_to_its_limits(
    most: float, velocity: float, wrong: str, tmp_path: Path
) -> None:
    """Of -9 to 9 rad, and of 7.12 rad/s in its first 1.25 s where most is 8.9."""
    q = {"left": np.array([1.5, 1.6, 1.5]), "right": np.array([0.0, most, most])}
    _, file = two(tmp_path, q)
    text = urdf(RADIUS["right"]).replace('velocity="99"', f'velocity="{velocity}"')
    write(tmp_path, "right.urdf", text)
    cell = read_cell(tmp_path / "left.yaml")
    checks = verify_robot(cell, read_rows(file, cell.robot)).checks
    rows = {one.name: one for one in checks if one.name.startswith("right: joint")}
    assert len(rows) == 2
    failed = [row for row in rows.values() if row.verdict is Verdict.REFUTED]
    names = [f"right: joint 'turn' in its {wrong}"] if wrong else []
    assert [row.name for row in failed] == names
    for row in failed:
        value = most if wrong == "limits" else most / 1.25
        assert row.worst == pytest.approx(value) and np.isnan(row.moment)


def test_swapped_roles_agree_to_the_padding(tmp_path: Path) -> None:
    q = {"left": np.array([1.0, 0.8, 0.9]), "right": np.array([-0.9, 0.9, 1.4])}
    for times in TIMES.values():
        assert truth(q, times).min() > REQUIRED
    whole = {**TIMES, "right": np.array([0.0, 1.5, 3.0])}
    found = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(TIMES, "right", whole["right"])
        for own in BASES:
            cell, file = two(tmp_path, q, own)
            found.append(verify_robot(cell, read_rows(file, cell.robot)))
    one, other = found
    assert "1 other robot of" in scene_words(one.problem.scene)
    assert one.verdict is other.verdict
    brackets = [(each.least.lower[0], each.least.upper[0]) for each in found]
    for low, high in brackets:
        assert high - low <= 2.0 * TOLERANCES.least_bracket
    assert max(low for low, _ in brackets) <= min(high for _, high in brackets)


def test_certificate_is_of_both_trajectories(tmp_path: Path) -> None:
    """Planes of one motion are no proof beside another one of the second robot."""
    q = {"left": np.array([1.2, 0.3, 1.2]), "right": np.array([1.0, 0.9, 1.1])}
    cell, file = two(tmp_path, q)
    found = verify_robot(cell, read_rows(file, cell.robot))
    proof = tmp_path / "proof"
    assert found.verdict is Verdict.CERTIFIED

    def outcome(*, told: bool = True) -> Outcome:
        if told:
            source = read_cell(tmp_path / "left.yaml").source
            assert source is not None
            hashes = Hashes(source.sha256, sha256_of_file(file))
            write_certificate(proof, found, hashes)
        return check_certificate(proof, tmp_path / "left.yaml", file)

    assert outcome().accepted
    nearer = q | {"right": np.array([1.0, -0.1, 1.1])}
    assert truth(nearer, np.linspace(0.0, 3.0, 999)).min() < 0.0
    two(tmp_path, nearer)
    assert "of another problem file" in outcome(told=False).reason
    assert "claims" in outcome().reason
    two(tmp_path, q)
    write(tmp_path, "right.csv", rows_text(q["right"], TIMES["right"] - 1.0))
    assert not outcome().accepted
    write(tmp_path, "right.csv", "turn_rad\n0\n1\n")
    with pytest.raises(InvalidFile, match="no times"):
        outcome(told=False)


def test_another_robot_moves_by_a_topic_of_a_bag(tmp_path: Path) -> None:
    """As by the same rows in CSV; the certificate is bound to the topic's motion."""
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    types = pytest.importorskip("rosbags.typesys")
    q = {"left": np.array([1.2, 0.3, 1.2]), "right": np.array([1.0, 0.9, 1.1])}
    cell, file = two(tmp_path, q)
    by_rows = verify_robot(cell, read_rows(file, cell.robot))
    store = types.get_typestore(types.Stores.ROS2_HUMBLE)
    with rosbag2.Writer(tmp_path / "right", version=9) as writer:
        for topic, turned in (("/far", 0.9), ("/plan", 0.0)):
            rows = (q["right"] + turned)[:, None]
            motion = JointTrajectory(("turn",), rows, TIMES["right"])
            data = store.serialize_cdr(bags._typed(store, motion), bags.PLANS[0])
            told = writer.add_connection(topic, bags.PLANS[0], typestore=store)
            writer.write(told, 0, data)
    problem, proof = tmp_path / "left.yaml", tmp_path / "proof"
    text = problem.read_text("utf-8")
    with pytest.raises(InvalidFile, match=r"has several; topics: /far .*, /plan "):
        read_cell(write(tmp_path, "left.yaml", text.replace("right.csv", "right")))
    with pytest.raises(InvalidFile, match="is no bag, so topic '/plan' has no meaning"):
        read_cell(
            write(tmp_path, "left.yaml", text.replace(".csv}", ".csv, topic: /plan}"))
        )
    chosen = text.replace("right.csv}", "right, topic: /plan}")
    cell = read_cell(write(tmp_path, "left.yaml", chosen))
    found = verify_robot(cell, read_rows(file, cell.robot))
    np.testing.assert_array_equal(found.least.lower, by_rows.least.lower)
    assert cell.source is not None
    assert {one.name for one in cell.source.files} >= {"metadata.yaml", "right.db3"}
    hashes = Hashes(cell.source.sha256, sha256_of_file(file))
    write_certificate(proof, found, hashes)
    assert check_certificate(proof, problem, file).accepted
    write(tmp_path, "left.yaml", chosen.replace("/plan", "/far"))
    assert "of another problem file" in check_certificate(proof, problem, file).reason


def test_what_is_wrong_with_another_robot_is_said(tmp_path: Path) -> None:
    cell, _ = two(tmp_path, {"left": np.zeros(3), "right": np.zeros(3)})
    (other,) = cell.scene.carriers
    assert other.itself.notes
    assert all(note.startswith("right: ") for note in other.itself.notes)
    write(tmp_path, "right.csv", "turn_rad\n0\n1\n")
    with pytest.raises(InvalidFile, match=r"'right\.csv' has no times, which it needs"):
        read_cell(tmp_path / "left.yaml")
    (tmp_path / "right.csv").unlink()
    with pytest.raises(InvalidFile, match=r"line 8.*does not exist"):
        read_cell(tmp_path / "left.yaml")


@pytest.mark.parametrize("seed", range(6))
def test_random_pairs_keep_what_dense_samples_by_coal_say(
    seed: int, tmp_path: Path
) -> None:
    """And what is certified the checker accepts, meshes in parts too."""
    rng, times = np.random.default_rng(seed), np.array([0.0, 1.0, 2.0])
    robots, motions = [], []
    write_cube(tmp_path / MESH, 4.0)
    for name, solids in (("a", HULLS), ("b", MeshCover("parts", 2))):
        urdf = write(tmp_path, f"{name}.urdf", random_urdf(rng, 4))
        robots.append(read_robot(RobotFiles(urdf, solids=solids)))
        q = rng.uniform(-0.4, 0.4, (3, len(robots[-1].joints)))
        motions.append(Motion(q, times=times))
        joints = tuple(joint.name for joint in robots[-1].joints)
        text = csv_text(JointTrajectory(joints, q, times), robots[-1])
        write(tmp_path, f"{name}.csv", text)
    place = [0.12 * seed, 0.2, 0.0]
    text = (
        "vdsm_problem: 1\nlength_unit: m\nrobot: {urdf: a.urdf}\n"
        "required_clearance: 0.001\nothers: [{name: b, trajectory: b.csv,\n"
        "  robot: {urdf: b.urdf, bodies: parts, parts: 2},\n"
        f"  base: {{position: {place}, rpy_deg: [0, 0, 90]}}}}]\n"
    )
    problem, file = write(tmp_path, "cell.yaml", text), tmp_path / "a.csv"
    cell = read_cell(problem)
    found = verify_robot(cell, read_rows(file, cell.robot))
    other = np.eye(4)
    other[:3, :3], other[:3, 3] = rotation_from_rpy(np.array([0, 0, np.pi / 2])), place
    at = np.linspace(0.0, 2.0, 400)
    poses = [r.poses(m.at(at)) for r, m in zip(robots, motions, strict=True)]
    frames = [body.frame for body in robots[0].bodies]
    frames += [body.frame + poses[0].shape[1] for body in robots[1].bodies]
    coal = CoalShapes(
        frames, [*link_shapes(robots[0].bodies), *link_shapes(robots[1].bodies)]
    )
    placed = np.concatenate([poses[0], other @ poses[1]], axis=1)[:, :, :3]
    rows, numbers = np.arange(len(at)), [body.name for body in robots[1].bodies]
    for k, pair in enumerate(found.pairs):
        if not pair.obstacle:
            continue
        one = pair.link - 1
        both = len(robots[0].bodies) + numbers.index(pair.obstacle.removeprefix("b: "))
        sides = Sides(rows, np.full(len(at), one), np.full(len(at), both))
        least = max(float(coal.distances(placed, sides).min()), 0.0)
        assert found.least.lower[k] <= least + 5e-6
        assert least <= max(found.least.upper[k], 0.0) + 5e-3
    if found.verdict is Verdict.CERTIFIED:
        assert cell.source is not None
        hashes = Hashes(cell.source.sha256, sha256_of_file(file))
        write_certificate(tmp_path / "proof", found, hashes)
        outcome = check_certificate(tmp_path / "proof", problem, file)
        assert outcome.accepted, outcome.reason
