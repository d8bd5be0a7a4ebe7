"""A planned motion run by the simulated arm, its controller and its motors.

Commands are our cable lengths: the controller corrects the planned angles by a PID of
the measured error, the cable kinematics turns them into lengths, and the tensions that
gravity asks for are taken off as stretch. Or it corrects the lengths themselves.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.errors import InvalidInput, VerificationFailed
from vdsm_pin.geometry.arrays import FloatArray, frozen
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.robots.mjcf import load_mujoco
from vdsm_pin.simulation.feed_forward import Statics
from vdsm_pin.simulation.plant import free_ends, plant_xml, stiffnesses
from vdsm_pin.simulation.settings import Settings
from vdsm_pin.simulation.time_law import row_times

SLACK = 1.0
"""A cable with less tension counts as slack; [N]."""

SETTLE = 1.0
"""The arm is held so long at the start and again at the end of the motion; [s]."""

ROUNDING = 1e-9
"""A period longer than whole steps by less takes no step more; [-]."""

KNOTS = 200
"""Most rows at which tensions are solved for; they are interpolated between; [-]."""


@dataclass(frozen=True)
class Simulation:
    """What was commanded and what happened, at the recorded times.

    Args:
        times: Shape (m,); [s].
        planned: x0, alpha1, theta1, .. as planned, shape (m, 1 + 2N); [m], [rad].
        executed: The same as executed.
        tensions: Of the cables, shape (m, 3N); [N].
        path_m: Arc length of the planned tip along the path, shape (m,); [m].
        least_stiffness: Least joint stiffness at some times, shape (k, 2): time and
            value; [s], [N m/rad].
        tension_margin: What may be added to every tension before the arm buckles, at
            the same times, shape (k, 2): time and value; [s], [N].
        largest_errors: Of x0, alpha1, theta1, .., at any step of the controller,
            recorded or not, shape (1 + 2N,); [m], [rad].
        largest_tension: Of any cable at any such step; [N].
    """

    times: FloatArray
    planned: FloatArray
    executed: FloatArray
    tensions: FloatArray
    path_m: FloatArray
    least_stiffness: FloatArray
    tension_margin: FloatArray
    largest_errors: FloatArray
    largest_tension: float

    @property
    def errors(self) -> FloatArray:
        """Executed less planned angles, shape (m, 2N); [rad]."""
        return self.executed[:, 1:] - self.planned[:, 1:]

    @property
    def largest_error(self) -> float:
        """Largest error of any angle at any step of the controller; [rad]."""
        return float(self.largest_errors[1:].max())

    @property
    def trajectory(self) -> Trajectory:
        """The executed motion, for the verifier. It claims to draw nothing."""
        return Trajectory.of_joints(self.executed, path_m=self.path_m)


def simulate(
    manipulator: Manipulator, trajectory: Trajectory, settings: Settings
) -> Simulation:
    """Run a planned motion in closed loop.

    Args:
        manipulator: The arm.
        trajectory: The plan.
        settings: What is assumed.

    Returns:
        Planned and executed motion at the recorded times.

    Raises:
        InvalidInput: If settings contradict each other or the arm, or MuJoCo is not
            installed.
        VerificationFailed: If the simulation diverges.
    """
    settings.check(manipulator.n_links)
    return _Loop(manipulator, trajectory, settings).run()


def _mujoco() -> Any:
    try:
        return load_mujoco()
    except ImportError as error:
        message = "mujoco is not installed: pip install 'vdsm-pin[simulation]'"
        raise InvalidInput(message) from error


class _Loop:
    """One run: the plant, the plan over time, the controller's state."""

    def __init__(
        self, manipulator: Manipulator, trajectory: Trajectory, settings: Settings
    ) -> None:
        self._mujoco = _mujoco()
        self._settings = settings
        self._statics = Statics(manipulator, settings)
        self._model = self._mujoco.MjModel.from_xml_string(
            plant_xml(manipulator, settings)
        )
        self._data = self._mujoco.MjData(self._model)
        self._row_times = SETTLE + row_times(manipulator, trajectory, settings.speed)
        self._trajectory = trajectory
        self._stiffness = stiffnesses(manipulator, settings)
        self._ends = free_ends(manipulator)
        self._rng = np.random.default_rng(settings.seed)
        self._knots, self._knot_tensions = self._tensions_along()

    def _tensions_along(self) -> tuple[FloatArray, FloatArray]:
        """Times and the tensions then: what gravity asks for, or the pretension."""
        n_rows = self._trajectory.n_samples
        chosen = np.unique(np.linspace(0, n_rows - 1, min(KNOTS, n_rows)).astype(int))
        angles = self._trajectory.joints[chosen, 1:]
        if self._settings.controller.gravity_feed_forward:
            found = np.array([self._statics.tensions(row) for row in angles])
        else:
            even = self._settings.cables.pretension_n
            found = np.full((len(chosen), len(self._stiffness)), even)
        return self._row_times[chosen], found

    def _planned(self, times: FloatArray) -> FloatArray:
        """The plan at times, shape (k, 1 + 2N); [m], [rad]."""
        columns = self._trajectory.joints.T
        return np.stack([np.interp(times, self._row_times, c) for c in columns], axis=1)

    def _feed_forward(self, time: float) -> FloatArray:
        columns = self._knot_tensions.T
        return np.array([np.interp(time, self._knots, c) for c in columns])

    def run(self) -> Simulation:
        """Step the plant, its motors and the controller to the end of the plan."""
        settings, data = self._settings, self._data
        control = settings.controller
        period, lag = control.period_s, control.derivative_lag_s
        most = settings.motors.largest_rate_m_s * period
        substeps = int(np.ceil(period / settings.step_s - ROUNDING))
        self._model.opt.timestep = period / substeps
        count = int(np.ceil((self._row_times[-1] + SETTLE) / period)) + 1
        times = frozen(period * np.arange(count))
        planned = self._planned(times)
        every = max(1, round(settings.record_s / period))
        data.qpos[:] = planned[0]
        self._mujoco.mj_fwdPosition(self._model, data)  # how long the cables are
        integral = smoothed = np.zeros(1)
        paid = self._rest(planned[0, 1:], 0.0)
        data.act[:] = paid
        rows, tensions = [], []
        worst, strongest = np.zeros(planned.shape[1]), 0.0
        for k in range(count):
            error = self._error(planned[k, 1:])
            integral = integral + period * error
            rate = (error - smoothed) / lag
            smoothed = smoothed + min(1.0, period / lag) * (error - smoothed)
            correction = (
                control.proportional * error
                + control.integral_per_s * integral
                + control.derivative_s * rate
            )
            wanted = self._corrected(planned[k, 1:], correction, float(times[k]))
            paid = paid + np.clip(wanted - paid, -most, most)
            data.ctrl[0], data.ctrl[1:] = planned[k, 0], paid
            data.qfrc_applied[:] = self._kicks(float(times[k]))
            self._mujoco.mj_step(self._model, data, substeps)
            if not np.isfinite(data.qpos).all() or np.abs(data.qpos[1:]).max() > np.pi:
                message = f"the simulation diverges at {times[k]:.3f} s"
                raise VerificationFailed(message)
            off = np.abs(data.qpos - planned[min(k + 1, count - 1)])
            worst, pull = np.maximum(worst, off), 0.0 - data.actuator_force[1:]
            strongest = max(strongest, float(pull.max()))
            if k % every == 0:
                rows.append((k, data.qpos.copy()))
                tensions.append(pull)
        found = self._recorded(frozen(times + period), rows, tensions)
        return replace(found, largest_errors=frozen(worst), largest_tension=strongest)

    def _error(self, planned: FloatArray) -> FloatArray:
        """Planned less measured angles (2N,) or cable lengths (3N,); [rad], [m]."""
        sensors, angles = self._settings.sensors, self._data.qpos[1:]
        if self._by_length:
            noise = sensors.length_noise_m * self._rng.normal(size=len(self._ends))
            wanted = self._statics.lengths(planned[None])[0] - self._ends
            return np.asarray(wanted - (self._data.ten_length + noise))
        noisy = angles + np.deg2rad(sensors.noise_deg) * self._rng.normal(
            size=angles.size
        )
        grain = np.deg2rad(sensors.resolution_deg)
        seen = np.round(noisy / grain) * grain if grain > 0.0 else noisy
        return np.asarray(planned - seen)

    @property
    def _by_length(self) -> bool:
        return self._settings.controller.regulates == "lengths"

    def _corrected(
        self, planned: FloatArray, correction: FloatArray, time: float
    ) -> FloatArray:
        """What the motors should have paid out, shape (3N,); [m]."""
        if self._by_length:
            return self._rest(planned, time) + correction
        return self._rest(planned + correction, time)

    def _rest(self, angles: FloatArray, time: float) -> FloatArray:
        """Lengths to pay out for these angles under the tensions of a time; [m]."""
        lengths = self._statics.lengths(angles[None])[0] - self._ends
        return np.asarray(lengths - self._feed_forward(time) / self._stiffness)

    def _kicks(self, time: float) -> FloatArray:
        """Disturbing torques at a time, shape (1 + 2N,); [N m]."""
        torque = np.zeros(self._model.nv)
        for kick in self._settings.kicks:
            begins = SETTLE + kick.share * float(self._row_times[-1] - SETTLE)
            if begins <= time < begins + kick.duration_s:
                torque[2 * kick.joint - (kick.axis == "alpha")] += kick.torque_nm
        return torque

    def _recorded(
        self,
        times: FloatArray,
        rows: list[tuple[int, FloatArray]],
        tensions: list[FloatArray],
    ) -> Simulation:
        kept = times[[k for k, _ in rows]]
        plan = self._trajectory
        nearest = np.searchsorted(self._row_times, kept).clip(0, plan.n_samples - 1)
        at = np.linspace(0, len(rows) - 1, min(24, len(rows))).astype(int)
        planned = self._planned(kept)
        held = [(planned[k, 1:], self._feed_forward(float(kept[k]))) for k in at]
        stiffness = [self._statics.least_stiffness(*one) for one in held]
        margin = [self._statics.tension_margin(*one) for one in held]
        return Simulation(
            times=kept,
            planned=planned,
            executed=np.array([row for _, row in rows]),
            tensions=np.array(tensions),
            path_m=plan.path_m[nearest],
            least_stiffness=np.column_stack([kept[at], stiffness]),
            tension_margin=np.column_stack([kept[at], margin]),
            largest_errors=np.zeros(0),
            largest_tension=0.0,
        )
