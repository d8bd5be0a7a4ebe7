"""What a simulation assumes: masses, cables, motors, sensors, controller, disturbances.

The paper gives none of these numbers. The defaults are assumptions, each with its
reason, to be changed in a file and swept; none was fitted to a result.
"""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from vdsm_pin.errors import InvalidInput
from vdsm_pin.io.problem_errors import checked
from vdsm_pin.io.schema_types import FileModel, NotNegative, Number, Positive
from vdsm_pin.io.source import decode, read_bytes
from vdsm_pin.io.yaml_reader import read_yaml

MAX_BYTES = 1 << 20


class Bodies(FileModel):
    """The links."""

    mass_per_length_kg_m: Positive = Field(
        default=4.0, description="assumed: aluminium tube of 123 mm with joints, cables"
    )
    joint_damping_nm_s: NotNegative = Field(
        default=2.0, description="viscous, of every joint axis; assumed"
    )
    joint_friction_nm: NotNegative = Field(
        default=0.2, description="Coulomb friction of every joint axis; assumed"
    )
    gravity_m_s2: NotNegative = Field(default=9.81, description="along -z of the base")


class Cables(FileModel):
    """The cables; tension is uniform along each (no capstan friction)."""

    stiffness_ea_n: Positive = Field(
        default=3.5e5, description="EA of a cable: steel rope 7x19 of about 3 mm"
    )
    to_motor_m: NotNegative = Field(
        default=0.5, description="of each cable between the base and its motor; assumed"
    )
    damping_n_s_m: NotNegative = Field(default=200.0, description="assumed")
    largest_tension_n: Positive = Field(
        default=4000.0, description="of a cable; below the rope's breaking load"
    )
    least_tension_n: NotNegative = Field(
        default=30.0, description="held in every cable: a slack one gives no stiffness"
    )
    pretension_n: NotNegative = Field(
        default=100.0, description="aimed at where gravity asks for no more"
    )


class Motors(FileModel):
    """What winds the cables and moves the base."""

    lag_s: NotNegative = Field(default=0.005, description="first-order; assumed")
    largest_rate_m_s: Positive = Field(default=0.25, description="of a cable; assumed")
    base_stiffness_n_m: Positive = Field(default=2e6, description="of the rail's drive")


class Sensors(FileModel):
    """Encoders of the joints, and of the cables."""

    resolution_deg: NotNegative = Field(default=360.0 / 2**16, description="16 bits")
    noise_deg: NotNegative = Field(default=0.005, description="standard deviation")
    length_noise_m: NotNegative = Field(
        default=1e-5,
        description="of a cable's length, where that is regulated; assumed",
    )


class Controller(FileModel):
    """PID on the joint angles or on the cable lengths.

    Angles commanded go through the cable kinematics; lengths are commanded as they are.
    The gains are those with which a kicked arm comes to rest; with no derivative it
    swings up.
    """

    regulates: Literal["angles", "lengths"] = Field(
        default="angles", description="joint angles, or lengths of the taut cables"
    )
    period_s: Positive = Field(default=0.005, description="200 Hz; assumed")
    proportional: NotNegative = Field(
        default=0.2, description="commanded per radian, or metre, of error"
    )
    integral_per_s: NotNegative = Field(default=0.5, description="the same, per second")
    derivative_s: NotNegative = Field(
        default=0.015, description="the same, of its rate"
    )
    derivative_lag_s: Positive = Field(
        default=0.02, description="first-order filter of the derivative"
    )
    gravity_feed_forward: bool = Field(
        default=True, description="tensions that hold the planned arm against gravity"
    )


class Speed(FileModel):
    """Limits of the time law."""

    tip_m_s: Positive = Field(default=0.05, description="of the tip; assumed")
    joint_deg_s: Positive = Field(default=5.0, description="of every angle; assumed")
    joint_deg_s2: Positive = Field(default=20.0, description="acceleration; assumed")


class Kick(FileModel):
    """A torque pulse at one joint axis."""

    axis: Literal["alpha", "theta"]
    joint: int = Field(ge=1, description="joints count from 1 at the base")
    share: float = Field(ge=0.0, le=1.0, description="when, as part of the duration")
    torque_nm: Number
    duration_s: Positive = 0.2


class Settings(FileModel):
    """Everything a simulation assumes."""

    bodies: Bodies = Bodies()
    cables: Cables = Cables()
    motors: Motors = Motors()
    sensors: Sensors = Sensors()
    controller: Controller = Controller()
    speed: Speed = Speed()
    kicks: Annotated[tuple[Kick, ...], Field(strict=False)] = ()
    seed: int = Field(default=0, ge=0, description="of the noise")
    step_s: Positive = Field(default=0.0005, description="of the integrator, at most")
    record_s: Annotated[Positive, Field(le=0.1)] = Field(
        default=0.02, description="between recorded rows"
    )

    def check(self, n_links: int) -> None:
        """Refuse what contradicts itself or an arm of N links.

        Raises:
            InvalidInput: Naming the field.
        """
        cables = self.cables
        expected = f"expected below largest_tension_n, {cables.largest_tension_n:g}"
        for name in ("least_tension_n", "pretension_n"):
            value = getattr(cables, name)
            if not value < cables.largest_tension_n:
                message = f"cables.{name} is {value:g}, {expected}"
                raise InvalidInput(message)
        for k, kick in enumerate(self.kicks):
            if kick.joint > n_links:
                known = f"expected 1 to {n_links}"
                message = f"kicks[{k}].joint is {kick.joint}, {known}"
                raise InvalidInput(message)


def read_settings(path: Path) -> Settings:
    """Settings of a YAML file; what it does not name keeps its default.

    Raises:
        InvalidFile: If the file or a value breaks the contract.
    """
    document = read_yaml(decode(read_bytes(path, limit=MAX_BYTES), path), file=path)
    if document.data is None:
        document = replace(document, data={})
    return checked(document, Settings)
