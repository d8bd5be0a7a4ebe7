"""Certificates of robots: accepted as written, refused where anything is untrue.

The oracle of acceptance is the prover, that of refusal the forgery: every hash and the
seal are made to fit again, so that only what is claimed can be wrong.
"""

import copy
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
from flint import arb, ctx
from oracles.certificate_cases import write_cube
from oracles.certificate_mutations import change_number, changes
from oracles.random_robots import MESH, random_urdf
from oracles.robot_certificates import BASES, CELL, VIRTUAL, Made, cell, text

from vdsm_pin.certificate_checker.balls import SLACK, Rejected
from vdsm_pin.certificate_checker.robot import Model, Robot
from vdsm_pin.certificate_checker.rows import within
from vdsm_pin.certificate_checker.solids import Body
from vdsm_pin.certificate_checker.tree import Tree
from vdsm_pin.cli import main
from vdsm_pin.problem.error_boxes import ErrorBox, JointError
from vdsm_pin.robots.files import MeshCover, RobotFiles
from vdsm_pin.robots.urdf import read_robot

Rng = np.random.Generator


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("smooth", range(3))
def test_what_is_certified_is_accepted(tmp_path: Path, base: str, smooth: int) -> None:
    made = Made(tmp_path, base, smooth)
    for more in (
        {},
        {"bodies": "parts", "parts": 10},
        {"bodies": "primitives"},
        {"group": "arm", "lock": {"lift": 0.2}},
    ):
        if "group" in more and base != "fixed":
            continue
        if "group" in more:
            heads = made.rows[0]
            keep = [k for k, head in enumerate(heads) if not head.startswith("lift")]
            made.rows = [[row[k] for k in keep] for row in made.rows]
        made.cell["robot"] = CELL["robot"] | more
        lines = made.certified()
        joined = ("linear", "cubic", "quintic")[smooth]
        assert lines[0]["interpolation"] == joined


def moved(made: Made) -> None:
    made.rows[2][1] += 1.0


def swollen(made: Made) -> None:
    write_cube(made.folder / "tool.stl", 50.0)


WRONG: dict[str, tuple[Callable[[Made], None], str]] = {
    "origin": (text('xyz="0.8 0 0"', 'xyz="2.5 0 0"'), "claims"),
    "axis": (text('xyz="0 1 0.2"', 'xyz="1 0 0"'), "claims"),
    "mimic": (text('multiplier="-0.5"', 'multiplier="9"'), "claims"),
    "offset": (text('offset="0.1"', 'offset="2"'), "claims"),
    "shape": (text('radius="0.04" length', 'radius="0.2" length'), "claims"),
    "cylinder": (text('radius="0.05"', 'radius="0.45"'), "claims"),
    "scale": (text('scale="0.02', 'scale="0.2'), "claims"),
    "turned": (text('rpy="0.1 0.2 0.3"/><axis', 'rpy="2 0.2 0.3"/><axis'), "claims"),
    "mesh": (swollen, "claims"),
    "limits": (text('lower="-0.1" upper="0.4"', 'lower="-0.001" upper="0"'), "limits"),
    "limits of a mimic": (text('lower="-3" upper="3"', 'lower="0.09" upper="3"'),
                          "joint 'bend' leaves its limits"),
    "rates of a mimic": (text('upper="3" effort="1" velocity="1"',
                              'upper="3" effort="1" velocity="0.001"'),
                         "the limit of its rates"),
    "rates": (text('velocity="0.5"', 'velocity="0.01"'), "the limit of its rates"),
    "pair": (text('link1="mast" link2="boom"', 'link1="mast" link2="foot"', "all.srdf"),
             "pairs are not those"),
    "required": (cell(required_clearance=700), "claims"),
    "self": (cell(required_self_clearance=700), "claims"),
    "base": (cell(base={"position": [0, 0, -700]}), "claims|half-space"),
    "obstacle": (
        lambda made: made.cell["obstacles"][0].update(radius=900),
        "claims",
    ),
    "other": (lambda made: made.cell["obstacles"].pop(0), "of each of"),
    "primitives": (
        lambda made: made.cell["robot"].update(bodies="primitives"),
        "what holds its mesh is missing",
    ),
    "motion": (moved, "claims|limits"),
}  # fmt: skip


@pytest.mark.parametrize("what", WRONG)
def test_a_forged_certificate_of_other_files_is_refused(
    tmp_path: Path, what: str
) -> None:
    made = Made(tmp_path, "fixed", 1)
    lines = made.certified()
    change, reason = WRONG[what]
    change(made)
    made.write()
    assert not made.check(copy.deepcopy(lines), fits=False).accepted
    outcome = made.check(lines)
    assert not outcome.accepted
    assert any(word in outcome.reason for word in reason.split("|")), outcome.reason


def test_limits_that_are_not_judged_are_told(tmp_path: Path) -> None:
    """Those of a mimic that leave what it mimics no room, as the verifier says too."""
    made = Made(tmp_path, "fixed", 1)
    text('lower="-3" upper="3"', 'lower="2" upper="3"')(made)
    outcome = made.check(made.certified())
    assert outcome.accepted
    (note,) = (one for one in outcome.notes if "not judged" in one)
    assert note.startswith("limits of joint 'follow', 2 to 3, are not judged: they")


def test_what_was_assumed_is_told(tmp_path: Path) -> None:
    """Of the robot and of meshes beside it: in this order, and nothing else."""
    made = Made(tmp_path)
    write_cube(tmp_path / "block.stl", 100.0)
    where = {"center": [-900, 900, 1500], "solid": False}
    mesh = {"name": "block", "shape": "mesh", "file": "block.stl", **where}
    made.cell["obstacles"].append(mesh)
    assert [*made.check(made.certified()).notes] == [
        "hulls of meshes; boxes, cylinders, spheres, capsules as they are",
        "linear pieces",
        "4 of 10 link pairs left out",
        "block is a surface only",
        "block is taken to be 200 x 200 x 200 mm; no unit is stated",
    ]


@pytest.mark.parametrize("rows", [1, 2])
def test_motions_of_few_rows_are_accepted_and_held_to_their_rates(
    tmp_path: Path, rows: int
) -> None:
    """A single row has no rates; of two there is one interval with some."""
    made = Made(tmp_path, "fixed", 1)
    made.rows = made.rows[: rows + 1]
    lines = made.certified()
    WRONG["rates"][0](made)
    outcome = made.check(lines)
    assert outcome.accepted is (rows == 1)
    assert rows == 1 or "the limit of its rates" in outcome.reason


def timed(folder: Path, smooth: int, middle: float = 7.0) -> Made:
    """Rows at moments that do not begin at 0; of two ways the shorter is the faster."""
    made = Made(folder, "fixed", smooth)
    rows = np.array([[0, 0.01, 0], [0.1, 0.1, 0.1], [0.2, 0.2, 0.1]])
    rows[1, 1] = 0.11 if middle < 6.0 else 0.1
    rest = np.zeros((3, 3 * smooth))
    times = np.array([[5.0], [middle], [7.5]])
    if not smooth:
        made.rows[0].append("time_s")
    made.rows[1:] = np.hstack([rows, times, rest]).tolist()
    return made


@pytest.mark.parametrize(
    ("smooth", "peak", "middle"),
    [(0, 0.2, 5.5), (0, 0.2, 7.0), (1, 0.3, 7.0), (2, 0.375, 5.5)],
)
def test_rates_are_per_second_wherever_the_clock_begins(
    tmp_path: Path, smooth: int, peak: float, middle: float
) -> None:
    """0.1 m in 0.5 s: evenly, or by a piece that is 3/2 or 15/8 as fast inside."""
    made = timed(tmp_path, smooth, middle)
    lines, urdf = made.certified(), made.texts["all.urdf"]
    for share, good in ((1.0 + 1e-8, True), (1.0 - 1e-8, False)):
        made.texts["all.urdf"] = urdf
        text('velocity="0.5"', f'velocity="{share * peak!r}"')(made)
        outcome = made.check(copy.deepcopy(lines))
        assert outcome.accepted is good
        assert good or "the limit of its rates" in outcome.reason


@pytest.mark.parametrize(("end", "sense"), [(-0.1, -1.0), (0.4, 1.0)])
def test_a_joint_may_stand_at_its_limit(
    tmp_path: Path, end: float, sense: float
) -> None:
    made = Made(tmp_path)
    for off, good in ((0.0, True), (1e-9, False)):
        files = RobotFiles(made.folder / "all.urdf", lock={"lift": end + sense * off})
        if good:
            assert Model(files, np.eye(4)).values["lift"] == (None, 1.0, end)
        else:
            with pytest.raises(Rejected, match="'lift' stands outside of its limits"):
                Model(files, np.eye(4))


@pytest.mark.parametrize(
    ("smooth", "peak"), [(0, None), (1, 2.4), (2, 2.3094010767585)]
)
def test_accelerations_keep_their_limits(
    tmp_path: Path, smooth: int, peak: float | None
) -> None:
    """Of the same piece, 6 or 10 / sqrt(3) times 0.1 m a square of its time.

    Straight lines have none at their corners, so they keep no limit.
    """
    made = timed(tmp_path, smooth)
    lines = made.certified()
    made.cell["robot"] |= {"joint_limits": "limits.yaml"}
    for share, good in ((1.0 + 1e-8, peak is not None), (1.0 - 1e-8, False)):
        most = share * (peak or 99.0)
        words = f"has_acceleration_limits: true, max_acceleration: {most!r}"
        made.texts["limits.yaml"] = f"joint_limits:\n  lift: {{{words}}}\n"
        outcome = made.check(copy.deepcopy(lines))
        assert outcome.accepted is good
        assert good or "the limit of its rates" in outcome.reason


@pytest.mark.parametrize(("smooth", "row"), [(0, 1), (0, 2), (2, 1)])
def test_times_that_do_not_rise_are_refused(
    tmp_path: Path, smooth: int, row: int
) -> None:
    made = timed(tmp_path, smooth)
    lines = made.certified()
    at = made.rows[0].index("time_s")
    made.rows[1 + row][at] = made.rows[row][at]
    assert "times do not rise" in made.check(lines).reason


def test_meshes_of_a_robot_are_there(tmp_path: Path) -> None:
    made = Made(tmp_path)
    (tmp_path / "tool.stl").unlink()
    with pytest.raises(Rejected, match=r"mesh 'tool\.stl' is not found"):
        Model(RobotFiles(made.folder / "all.urdf"), np.eye(4))


def test_a_group_is_one_of_a_srdf(tmp_path: Path) -> None:
    made = Made(tmp_path)
    files = RobotFiles(made.folder / "all.urdf", group="arm")
    with pytest.raises(Rejected, match="a group without a SRDF"):
        Model(files, np.eye(4))


@pytest.mark.parametrize("leader", ["follow", "later", "nobody", "base", ""])
def test_a_joint_follows_one_of_one_value(tmp_path: Path, leader: str) -> None:
    """Not itself, one that follows it in turn, none at all or one of three values."""
    joints = (
        ("base", "planar", "a", "b", ""),
        ("follow", "revolute", "b", "c", f'<mimic joint="{leader}"/>'),
        ("later", "revolute", "c", "d", '<mimic joint="follow"/>'),
    )
    text = "".join(
        f'<link name="{child}"/><joint name="{name}" type="{kind}">'
        f'<parent link="{parent}"/><child link="{child}"/>{more}'
        '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        for name, kind, parent, child, more in joints
    )
    path = tmp_path / "r.urdf"
    path.write_text(f'<robot name="r"><link name="a"/>{text}</robot>')
    with pytest.raises(Rejected, match="no value that another could follow"):
        Model(RobotFiles(path), np.eye(4))


def test_a_joint_follows_one_that_follows_another(tmp_path: Path) -> None:
    """By the product of their multipliers; offsets go through the second one."""
    joints = (
        ("one", "a", "b", ""),
        ("two", "b", "c", '<mimic joint="one" multiplier="-0.5" offset="0.1"/>'),
        ("three", "c", "d", '<mimic joint="two" multiplier="3" offset="-1"/>'),
    )
    text = "".join(
        f'<link name="{child}"/><joint name="{name}" type="revolute">'
        f'<parent link="{parent}"/><child link="{child}"/>{more}'
        '<limit lower="-9" upper="9" effort="1" velocity="1"/></joint>'
        for name, parent, child, more in joints
    )
    path = tmp_path / "r.urdf"
    path.write_text(f'<robot name="r"><link name="a"/>{text}</robot>')
    values = Model(RobotFiles(path), np.eye(4)).values
    assert values["two"] == (0, -0.5, 0.1)
    assert values["three"] == pytest.approx((0, -1.5, 0.3 - 1.0))


SHAPED = """<robot name="r"><link name="l"><collision><origin xyz="-2 0 0"/>
<geometry>{}</geometry></collision></link></robot>"""
BALL = {"origin_m": [0.75, 0.0, 0.0], "edges_m": [], "radius_m": 0.5}


@pytest.mark.parametrize(
    ("shape", "cover", "extent"),
    [
        ('<mesh filename="m.stl"/>', "hull", 1.0 + (3.0 + 2.0)),
        ('<mesh filename="m.stl"/>', "primitives", 0.75 + (1.0 + 0.5) + 0.5),
        ('<box size="6 1 1"/>', "hull", 5.0 + (3.0 + 2.0)),
        ('<sphere radius="0.5"/>', "hull", 2.0 + (0.0 + 2.0) + 0.5),
        ('<cylinder radius="0.5" length="6"/>', "hull", 3.0 + (3.0 + 2.0) + 0.5),
    ],
)
def test_the_extent_of_a_link_is_that_of_all_it_is_worked_out_of(
    tmp_path: Path, shape: str, cover: Any, extent: float
) -> None:
    """A box whose corners are at 3 m at most, and then 2 m farther back."""
    mesh = trimesh.creation.box((0.5, 0.5, 0.5)).apply_translation([2.75, 0.0, 0.0])
    mesh.export(tmp_path / "m.stl")
    (tmp_path / "r.urdf").write_text(SHAPED.format(shape))
    files = RobotFiles(tmp_path / "r.urdf", solids=MeshCover(cover))
    (found,) = Model(files, np.eye(4)).links()
    told = {"l": {"order": [], "meshes": [BALL]}} if cover == "primitives" else {}
    assert found(told).extent == pytest.approx(extent, rel=1e-12)


def test_errors_of_every_joint_are_those_of_its_unit(tmp_path: Path) -> None:
    """Radians of what turns and metres of what slides; the larger one of two counts."""
    made = Made(tmp_path)
    model = Model(RobotFiles(made.folder / "all.urdf"), np.eye(4))
    named = (JointError("bend", turn=0.03), JointError("lift", shift=0.001))
    found = model.least_errors(ErrorBox(joint=0.01, slide=0.002, named=named))
    assert found == {
        "joints_rad": {"turn": 0.01, "bend": 0.03},
        "joints_m": {"lift": 0.002},
    }


def test_link_pairs_left_out_are_counted(tmp_path: Path) -> None:
    """Of three links in a row two are neighbours twice, and left out without a SRDF."""
    ball = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
    links = "".join(f'<link name="{name}">{ball}</link>' for name in "abc")
    joints = "".join(
        f'<joint name="j{child}" type="continuous"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin xyz="1 0 0"/></joint>'
        for parent, child in ("ab", "bc")
    )
    (tmp_path / "r.urdf").write_text(f'<robot name="r">{links}{joints}</robot>')
    model = Model(RobotFiles(tmp_path / "r.urdf"), np.eye(4))
    told: Any = {}
    robot: Any = Robot.__new__(Robot)
    robot.model, robot.tree, robot.notes = model, model.tree, []
    robot.links = {x.name: Body(x.frame, x(told)) for x in model.links()}
    robot.obstacles = []
    pairs = [*robot._pairs(0.1, 0.1)]
    assert [{*pair.names} for pair in pairs] == [{"a", "c"}]
    assert robot.notes == ["2 of 3 link pairs left out"]


def test_a_mesh_of_a_link_is_in_the_unit_that_its_file_states(tmp_path: Path) -> None:
    """Half metres, of a box whose corners are at 1 m."""
    found = trimesh.creation.box((2.0, 2.0, 2.0)).export(file_type="dae")
    text = found.decode().replace("<up_axis>", '<unit meter="0.5"/><up_axis>')
    (tmp_path / "m.dae").write_text(text)
    shape = '<mesh filename="m.dae" scale="1 3 1"/>'
    (tmp_path / "r.urdf").write_text(SHAPED.format(shape))
    (link,) = Model(RobotFiles(tmp_path / "r.urdf"), np.eye(4)).links()
    (solid,) = link.model.solids(link.element, "l", [])
    corners = solid.points[0]
    assert np.ptp(corners, axis=0) == pytest.approx([1.0, 3.0, 1.0], rel=1e-12)


@pytest.mark.parametrize(("cover", "parts", "most"), [("hull", 9, 1), ("parts", 3, 3)])
def test_a_mesh_is_covered_by_as_many_hulls_as_are_asked_for(
    cover: str, parts: int, most: int
) -> None:
    corners = np.random.default_rng(1).uniform(-1.0, 1.0, (6, 3, 3))
    asked = SimpleNamespace(files=SimpleNamespace(
        solids=SimpleNamespace(cover=cover, parts=parts)
    ))  # fmt: skip

    def covered(over: list[int] | None) -> list[Any]:
        place = np.eye(3), np.zeros(3)
        return [*Model._covered(asked, "l", corners, place, over)]  # type: ignore[arg-type]

    (whole,) = covered(None)
    assert len(whole.points) == 1
    numbers = [0] * 6, [2] * 6, [3] * 6, [-1] * 6, [0, 1] * 3, [0, 1, 2] * 2, [0] * 5
    for over in numbers:
        if len(over) == 6 and {*over} <= {*range(most)}:
            assert len(covered(over)) == len({*over})
            continue
        with pytest.raises(Rejected, match=f"a hull of at most {most} over each"):
            covered(over)


def lines_of(what: str, lines: list[Any]) -> None:
    """Change one thing that is claimed."""
    header, proofs = lines[0], lines[1]["proofs"]
    tool = header["links"].get("tool", {})
    match what:
        case "a pair less":
            header["pairs"].pop()
            for line in lines[1:]:
                line["proofs"].pop()
        case "a part less":
            tool["meshes"][0] = [max(k, 1) for k in tool["meshes"][0]]
        case "a triangle less":
            tool["meshes"][0].pop()
        case "more parts":
            tool["meshes"][0][0] = 10
        case "no part":
            tool["meshes"][0][0] = -1
        case "another order":
            tool["order"][0] = tool["order"][1]
        case "a smaller primitive":
            tool["meshes"][0]["radius_m"] *= 0.0
        case "a shifted primitive":
            tool["meshes"][0]["origin_m"][0] += 1e-3
        case "a link more":
            header["links"]["nobody"] = {"order": [], "meshes": []}
        case "a mesh more":
            header["links"]["foot"] = {"order": [], "meshes": [[[0]]]}
        case "an interval less":
            lines.pop()
        case "another interpolation":
            header["interpolation"] = "septic"
        case "errors":
            header["errors"] = {"joints_rad": []}
        case "more clearance":
            proofs[0][0][2][0][-1] += 10**9


@pytest.mark.parametrize(
    ("bodies", "what"),
    [
        *[("hull", "a pair less"), ("hull", "a link more"), ("hull", "a mesh more")],
        *[("hull", "an interval less"), ("hull", "another interpolation")],
        *[("hull", "errors"), ("hull", "more clearance"), ("parts", "a part less")],
        *[
            ("parts", "no part"),
            ("parts", "a triangle less"),
            ("parts", "another order"),
        ],
        *[("parts", "more parts"), ("primitives", "a smaller primitive")],
        ("primitives", "a shifted primitive"),
    ],
)
def test_a_forged_claim_is_refused(tmp_path: Path, bodies: str, what: str) -> None:
    made = Made(tmp_path, "planar", 1)
    more = {"parts": 10} if bodies == "parts" else {}
    made.cell["robot"] = CELL["robot"] | {"bodies": bodies} | more
    lines = made.certified()
    lines_of(what, lines)
    outcome = made.check(lines)
    assert not outcome.accepted
    assert outcome.reason


def test_numbers_changed_at_random_are_refused_or_true(tmp_path: Path) -> None:
    made, rng = Made(tmp_path, "floating", 2), np.random.default_rng(0)
    lines, refused = made.certified(), 0
    for _ in range(30):
        forged = copy.deepcopy(lines)
        change_number(forged, rng)
        outcome = made.check(forged)
        refused += not outcome.accepted
        if outcome.accepted:  # a claim that says less, or a plane that holds as well
            (place,) = changes(lines, forged) or [()]
            assert place[:2] not in [(0, "links"), (0, "pieces"), (0, "pairs")]
    assert refused > 12


def assert_read_alike(files: RobotFiles, rng: Rng) -> None:
    """The checker's tree stands as the package's, which Pinocchio's agrees with."""
    robot = read_robot(files)
    joints = Model(files, np.eye(4))
    assert joints.moved == list(robot.joints)
    rows = rng.uniform(-2.0, 2.0, (3, len(robot.joints)))
    tree = Tree(joints.joints)
    with ctx.workprec(128):
        mine = [tree.pose([arb(x) for x in row]) for row in rows.tolist()]
    placed = robot.poses(rows)
    for name, frame in robot.frames.items():
        for pose, frames in zip(placed[:, frame], mine, strict=True):
            found = np.array(frames[joints.frames[name]].tolist(), float)
            np.testing.assert_allclose(pose, found, rtol=0, atol=1e-13)


def judged_at_random(folder: Path, seed: int) -> bool:
    """Read a random robot twice; whether a motion was certified, and accepted then."""
    rng, made = np.random.default_rng(seed), Made(folder)
    made.most = np.inf  # a plane that is far enough may be proved by rougher bounds
    (folder / "r.urdf").write_text(random_urdf(rng, int(rng.integers(1, 8))))
    write_cube(folder / MESH, 5.0)
    made.texts["all.srdf"] = VIRTUAL.format(base=rng.choice([*BASES]))
    made.write()
    asked = {"urdf": "r.urdf"} | ({"srdf": "all.srdf"} if rng.random() < 0.5 else {})
    asked |= {"bodies": str(rng.choice(["hull", "parts", "primitives"]))}
    srdf = folder / "all.srdf" if "srdf" in asked else None
    robot = read_robot(RobotFiles(folder / "r.urdf", srdf))
    locked = [joint.name for joint in robot.joints if rng.random() < 0.15]
    lock = {name: float(rng.uniform(-0.5, 0.5)) for name in locked}
    assert_read_alike(RobotFiles(folder / "r.urdf", srdf, (), lock), rng)
    moves = [joint for joint in robot.joints if joint.name not in lock]
    if not moves:
        return False
    made.cell["robot"] = asked | {"lock": lock}
    for _ in range(4):
        q = rng.uniform(-0.5, 0.5, (int(rng.integers(1, 4)), len(moves)))
        made.rows = [[f"{j.name}_{j.unit}" for j in moves], *q.tolist()]
        if made.is_certified():
            made.certified()
            return True
    return False


def test_random_robots_are_read_alike_and_their_proofs_accepted(tmp_path: Path) -> None:
    assert sum(judged_at_random(tmp_path, seed) for seed in range(6)) > 2


@pytest.mark.slow
def test_hundreds_of_random_robots(tmp_path: Path) -> None:
    assert sum(judged_at_random(tmp_path, seed) for seed in range(300)) > 100


def test_the_commands_write_and_check_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = Made(tmp_path)
    problem, rows = map(str, made.files)
    proof, out = str(tmp_path / "proof"), str(tmp_path / "out")

    def ends(*words: str) -> object:
        with pytest.raises(SystemExit) as ended:
            main(list(words))
        return ended.value.code

    verify = "verify", problem, "--trajectory", rows, "--out", out
    assert ends(*verify, "--certificate", proof) == 0
    assert f"certificate  {proof}" in " ".join(capsys.readouterr().out.split("\n"))
    assert ends("check-certificate", proof, problem, rows) == 0
    said = capsys.readouterr().out
    assert said.startswith("accepted: clearances hold under the errors stated")
    assert "4 of 10 link pairs left out" in said
    moved(made)
    made.write()
    assert ends("check-certificate", proof, problem, rows) == 1
    assert "of another trajectory file" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("points", "low", "high", "good"),
    [
        ([0.0, 2.0 + 1.9 * SLACK], -np.inf, 2.0, True),
        ([0.0, 2.0 + 2.1 * SLACK], -np.inf, 2.0, False),
        ([0.0, 1.0 + 0.9 * SLACK], -1.0, 1.0, True),
        ([0.0, 1.0 + 1.1 * SLACK], -1.0, 1.0, False),
        ([-1.0 - 1.1 * SLACK, 0.0], -1.0, 1e9, False),
        ([0.0, 5.0], -np.inf, 2.0, False),
        ([0.0, 1.5, 0.0], -1.0, 1.0, True),
        ([0.0, 2.5, 0.0], -1.0, 1.0, False),
    ],
)
def test_limits_are_kept_to_the_tolerance(
    points: list[float], low: float, high: float, good: bool
) -> None:
    """A parabola from 0 over h to 0 rises to h / 2; its control points say h."""
    assert within([arb(x) for x in points], low, high) is good
