"""The plant against the closed form, Pinocchio, and itself with another step."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.cables import cable_lengths
from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.arm.mounted import Tool
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.simulation.feed_forward import Statics
from vdsm_pin.simulation.plant import free_ends, plant_xml, stiffnesses
from vdsm_pin.simulation.settings import Bodies, Cables, Settings

mujoco = pytest.importorskip("mujoco")
HRM8 = built_in("hrm8")
TWO = Manipulator(
    "two",
    np.array([0.4, 0.3]),
    0.03,
    1.0,
    0.9,
    (-1.0, 1.0),
    CableLayout(0.02, 0.01, paper_hole_angles(2)),
)


def plant(arm: Manipulator, settings: Settings) -> tuple[Any, Any]:
    model = mujoco.MjModel.from_xml_string(plant_xml(arm, settings))
    return model, mujoco.MjData(model)


def placed(arm: Manipulator, q: FloatArray, settings: Settings | None = None) -> Any:
    model, data = plant(arm, settings or Settings())
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    return data


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    "arm", [HRM8, TWO, replace(TWO, tool=Tool(0.1, 0.01))], ids=["hrm8", "two", "tool"]
)
def test_frames_and_cables_are_those_of_the_closed_form(
    arm: Manipulator, seed: int
) -> None:
    q = np.random.default_rng(seed).uniform(-0.5, 0.5, 1 + 2 * arm.n_links)
    data = placed(arm, q)
    rows = q[None, :1].ravel(), q[None, 1::2], q[None, 2::2]
    centres = joint_centres(arm, *rows)[0]
    found = [data.body(f"link{i + 1}").xpos for i in range(arm.n_links)]
    np.testing.assert_allclose(found, centres[:-1], atol=1e-14)
    lengths = cable_lengths(arm, *rows[1:]).ravel() - free_ends(arm)
    np.testing.assert_allclose(data.ten_length, lengths, atol=1e-14)


@pytest.mark.parametrize("seed", range(3))
def test_gravity_is_that_of_mujoco_and_of_pinocchio(seed: int) -> None:
    import pinocchio as pin

    q = np.random.default_rng(seed).uniform(-0.5, 0.5, 17)
    settings = Settings()
    mine = Statics(HRM8, settings).gravity(q[None, 1:])[0]
    np.testing.assert_allclose(mine, placed(HRM8, q).qfrc_bias[1:], atol=1e-6)
    model = pin_model(settings)
    weight = pin.computeGeneralizedGravity(model, model.createData(), q)
    np.testing.assert_allclose(mine, weight[1:], atol=1e-6)


def pin_model(settings: Settings) -> Any:
    """The links of the arm in Pinocchio, with MuJoCo's inertias."""
    import pinocchio as pin

    seen, _ = plant(HRM8, settings)
    model = pin.Model()
    parent = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x0")
    model.appendBodyToJoint(
        parent, pin.Inertia(20.0, np.zeros(3), np.eye(3)), pin.SE3.Identity()
    )
    before = 0.0
    for i, length in enumerate(HRM8.link_lengths, start=1):
        place = pin.SE3(np.eye(3), np.array([before, 0.0, 0.0]))
        yaw = model.addJoint(parent, pin.JointModelRZ(), place, f"a{i}")
        parent = model.addJoint(yaw, pin.JointModelRY(), pin.SE3.Identity(), f"t{i}")
        body = seen.body(f"link{i}")
        turn = pin.Quaternion(*body.iquat).toRotationMatrix()
        inertia = turn @ np.diag(body.inertia) @ turn.T
        model.appendBodyToJoint(
            parent,
            pin.Inertia(float(body.mass[0]), body.ipos, inertia),
            pin.SE3.Identity(),
        )
        before = length
    return model


def slack(settings: Settings) -> Settings:
    """No friction, cables that never pull."""
    bodies = settings.bodies.model_copy(
        update={"joint_damping_nm_s": 0.0, "joint_friction_nm": 0.0}
    )
    cables = settings.cables.model_copy(update={"damping_n_s_m": 0.0})
    return settings.model_copy(update={"bodies": bodies, "cables": cables})


def test_a_free_swing_is_pinocchios() -> None:
    """Acceleration of the arm with slack cables, by its articulated body algorithm."""
    import pinocchio as pin

    settings = slack(Settings())
    rng = np.random.default_rng(1)
    q, v = rng.uniform(-0.4, 0.4, 17), rng.uniform(-0.5, 0.5, 17)
    model, data = plant(HRM8, settings)
    data.qpos[:], data.qvel[:] = q, v
    data.act[:] = 100.0  # paid out far beyond every length
    model.actuator_gainprm[0, 0] = model.actuator_biasprm[0, 1] = 0.0
    model.actuator_biasprm[0, 2] = 0.0
    mujoco.mj_forward(model, data)
    same = pin_model(settings)
    found = pin.aba(same, same.createData(), q, v, np.zeros(17))
    np.testing.assert_allclose(data.qacc, found, rtol=1e-9, atol=1e-9)


def test_energy_is_kept_by_elastic_cables_without_friction() -> None:
    settings = slack(Settings(bodies=Bodies(gravity_m_s2=0.0), step_s=1e-5))
    model, data = plant(TWO, settings)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    k = stiffnesses(TWO, settings)
    rest = cable_lengths(TWO, np.zeros((1, 2)), np.zeros((1, 2))).ravel()
    rest -= free_ends(TWO) + 200.0 / k
    data.act[:] = data.ctrl[1:] = rest
    data.qvel[1:] = [0.3, -0.2, 0.1, 0.4]

    def energy() -> float:
        mujoco.mj_forward(model, data)
        mass = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, mass)
        stretch = np.maximum(data.ten_length - rest, 0.0)
        base = settings.motors.base_stiffness_n_m * data.qpos[0] ** 2
        moving = data.qvel @ mass @ data.qvel
        return float(0.5 * (moving + k @ stretch**2 + base))

    model.actuator_biasprm[0, 2] = 0.0  # the rail's drive damps, so it is taken off
    before = energy()
    swung = 0.0
    for _ in range(2000):
        mujoco.mj_step(model, data)
        swung = max(swung, float(np.abs(data.qpos[1:]).max()))
    assert swung > 1e-4
    assert energy() == pytest.approx(before, rel=1e-6)
    assert (data.actuator_force[1:] <= 0.0).all()  # cables pull, or do nothing


def test_at_rest_the_cables_hold_one_joint_as_by_hand() -> None:
    """Two links level: the torque about joint 1 is weight times lever."""
    settings = Settings(cables=Cables(pretension_n=0.0))
    statics = Statics(TWO, settings)
    angles = np.zeros(4)
    density, g = settings.bodies.mass_per_length_kg_m, settings.bodies.gravity_m_s2
    by_hand = density * g * 0.7**2 / 2.0
    assert statics.gravity(angles[None])[0][1] == pytest.approx(-by_hand, rel=1e-9)
    tensions = statics.tensions(angles)
    left = statics.slopes(angles).T @ tensions + statics.gravity(angles[None])[0]
    assert np.abs(left).max() < 1e-2
    assert (tensions >= 0.0).all()


def test_too_much_pretension_buckles_the_arm() -> None:
    statics = Statics(HRM8, Settings())
    straight = np.zeros(16)
    stiff = [statics.least_stiffness(straight, np.full(24, t)) for t in (0.0, 3000.0)]
    assert stiff[0] > 0.0 > stiff[1]


def test_settings_are_refused_by_name(tmp_path: Any) -> None:
    from vdsm_pin.errors import InvalidFile, InvalidInput
    from vdsm_pin.simulation.settings import read_settings

    file = tmp_path / "s.yaml"
    file.write_text("cables: {stiffness_ea_n: -1}\n")
    said = r"cables\.stiffness_ea_n \(line 1\): is -1, expected above 0"
    with pytest.raises(InvalidFile, match=said):
        read_settings(file)
    file.write_text("seed: 1\ncabels: {}\n")
    said = r"cabels \(line 2\): is not a known key; known: bodies, cables, motors"
    with pytest.raises(InvalidFile, match=said):
        read_settings(file)
    file.write_text("kicks: [{axis: alpha, joint: 5, share: 0.4, torque_nm: 10}]\n")
    assert read_settings(file).kicks[0].joint == 5
    file.write_text("cables: {least_tension_n: 500, largest_tension_n: 100}\n")
    with pytest.raises(InvalidInput, match=r"least_tension_n is 500, expected below"):
        read_settings(file).check(8)
    file.write_text("record_s: 9\n")  # of which one row would be left
    with pytest.raises(InvalidFile, match=r"record_s \(line 1\): is 9, expected"):
        read_settings(file)
    file.write_text("bodies: {gravity_m_s2: 1.62}\n")
    assert read_settings(file).bodies.gravity_m_s2 == 1.62
    assert replace(HRM8, name="x").name == "x"
