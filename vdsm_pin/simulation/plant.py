"""The arm as a multibody for MuJoCo: rigid links, each cable an elastic tendon.

A cable of link j runs through the holes of both end faces of joints 1 to j and is fixed
behind joint j (paper, section 5.2; `cables.py`). It pulls with EA/L times what its
length exceeds the length its motor has paid out, and never pushes.
"""

from xml.sax.saxutils import quoteattr

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.simulation.settings import Settings

CABLES = "abc"


def cable_name(link: int, k: int) -> str:
    """Name of cable k (0 to 2) of a link counted from 1."""
    return f"cable{link}{CABLES[k]}"


def stiffnesses(manipulator: Manipulator, settings: Settings) -> FloatArray:
    """EA over the length of every cable in the straight arm, shape (3N,); [N/m]."""
    inside = manipulator.stations[:-1] + 2.0 * manipulator.cables.half_gap
    reach = inside + settings.cables.to_motor_m
    return np.repeat(settings.cables.stiffness_ea_n / reach, 3)


def free_ends(manipulator: Manipulator) -> FloatArray:
    """What `cable_lengths` counts past the hole where a cable ends, (3N,); [m]."""
    ends = manipulator.link_lengths - 2.0 * manipulator.cables.half_gap
    ends[-1] -= manipulator.tool_length
    return np.repeat(ends, 3)


def plant_xml(manipulator: Manipulator, settings: Settings) -> str:
    """The model as MJCF.

    Args:
        manipulator: Lengths, radius, cable holes.
        settings: Masses, stiffness, friction.

    Returns:
        A model whose coordinates are x0, alpha1, theta1, .. and whose controls are the
        base position and, after it, the lengths that the motors have paid out; [m].
    """
    lines = [
        "<mujoco><compiler angle='radian' autolimits='true'/>",
        f"<option timestep='{settings.step_s}' integrator='implicitfast'"
        f" gravity='0 0 {-settings.bodies.gravity_m_s2}'/>",
        "<worldbody>",
        *_bodies(manipulator, settings),
        "</worldbody><tendon>",
        *_tendons(manipulator),
        "</tendon><actuator>",
        *_actuators(manipulator, settings),
        "</actuator></mujoco>",
    ]
    return "\n".join(lines)


def _bodies(manipulator: Manipulator, settings: Settings) -> list[str]:
    """The base on its rail, then each link in the one before it."""
    density, d = settings.bodies.mass_per_length_kg_m, manipulator.cables.half_gap
    lines = [
        "<body name='base'><inertial pos='0 0 0' mass='20' diaginertia='1 1 1'/>",
        "<joint name='x0' type='slide' axis='1 0 0'/>",
        *_sites(manipulator, 0, -d, "out", 1),
    ]
    axis = (
        f"damping='{settings.bodies.joint_damping_nm_s}'"
        f" frictionloss='{settings.bodies.joint_friction_nm}'"
    )
    for i, length in enumerate(manipulator.link_lengths, start=1):
        before = 0.0 if i == 1 else manipulator.link_lengths[i - 2]
        lines += [
            f"<body name='link{i}' pos='{float(before)!r} 0 0'>",
            f"<joint name='alpha{i}' type='hinge' axis='0 0 1' {axis}/>",
            f"<joint name='theta{i}' type='hinge' axis='0 1 0' {axis}/>",
            f"<geom type='capsule' fromto='0 0 0 {float(length)!r} 0 0'"
            f" size='{manipulator.radius_of(i)}' mass='{density * float(length)!r}'"
            " contype='0' conaffinity='0'/>",
            *_sites(manipulator, i, d, "in", i),
        ]
        if i < manipulator.n_links:
            lines += _sites(manipulator, i, float(length) - d, "out", i + 1)
    return [*lines, "</body>" * (manipulator.n_links + 1)]


def _sites(
    manipulator: Manipulator, body: int, x: float, face: str, first: int
) -> list[str]:
    """The holes in one end face of the cables of links `first` to N."""
    cables = manipulator.cables
    lines = []
    for link in range(first, manipulator.n_links + 1):
        for k in range(3):
            phi = cables.hole_angles[link - 1, k]
            y, z = cables.hole_radius * np.sin(phi), cables.hole_radius * np.cos(phi)
            name = quoteattr(f"{cable_name(link, k)}-{body}-{face}")
            lines.append(f"<site name={name} pos='{x!r} {float(y)!r} {float(z)!r}'/>")
    return lines


def _tendons(manipulator: Manipulator) -> list[str]:
    """Each cable through its holes, from the base to its link."""
    lines = []
    for link in range(1, manipulator.n_links + 1):
        for k in range(3):
            name = cable_name(link, k)
            holes = "".join(
                f"<site site='{name}-{i}-out'/><site site='{name}-{i + 1}-in'/>"
                for i in range(link)
            )
            lines.append(f"<spatial name='{name}'>{holes}</spatial>")
    return lines


def _actuators(manipulator: Manipulator, settings: Settings) -> list[str]:
    """The rail's drive, then a motor a cable: force k (paid out - length), pulling."""
    k_base = settings.motors.base_stiffness_n_m
    lines = [f"<position name='base' joint='x0' kp='{k_base}' kv='{k_base * 0.02}'/>"]
    lag = max(settings.motors.lag_s, settings.step_s)
    cables = settings.cables
    for n, k in enumerate(stiffnesses(manipulator, settings)):
        name = cable_name(n // 3 + 1, n % 3)
        lines.append(
            f"<general name='{name}' tendon='{name}' dyntype='filter' dynprm='{lag}'"
            f" gaintype='fixed' gainprm='{float(k)!r}' biastype='affine'"
            f" biasprm='0 {-float(k)!r} {-cables.damping_n_s_m}'"
            f" forcerange='{-cables.largest_tension_n} 0'/>"
        )
    return lines
