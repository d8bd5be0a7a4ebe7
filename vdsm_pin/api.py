"""The package from Python: plan, verify, write down. `import vdsm_pin` has all of it.

>>> import vdsm_pin as vp
>>> problem = vp.read_problem("paper/free")
>>> plan = vp.plan(problem, strategy="paper")
>>> result = vp.verify(problem, plan.trajectory)
>>> result.verdict.value
'certified'
"""

from pathlib import Path
from typing import Literal

import numpy as np

from vdsm_pin.errors import InvalidInput
from vdsm_pin.io import trajectory_file
from vdsm_pin.io.atomic import atomic_path
from vdsm_pin.io.problem_file import read_problem as read_problem
from vdsm_pin.planner.records import Plan
from vdsm_pin.problem.error_boxes import ErrorBox as Box
from vdsm_pin.problem.error_boxes import TypedErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.time_limit import Deadline
from vdsm_pin.verification.records import ArmVerification
from vdsm_pin.verification.robot_model import load_robot

PYTHON = "from Python"
"""What a report names as command and problem file where there is none."""


class ErrorBox(TypedErrorBox):  # noqa: D101  has that of its base
    __doc__ = TypedErrorBox.__doc__


def plan(
    problem: PlanningProblem,
    strategy: str = "fewest",
    *,
    time_limit: float | None = None,
) -> Plan:
    """Plan a motion and have it verified.

    Args:
        problem: What is asked.
        strategy: `fewest`, `clearest`, `sturdiest` or `paper`.
        time_limit: Until there is a plan that is proved; None for none; [s].

    Returns:
        A certified plan, with `trajectory`, joint `centres` of shape (n_samples,
        N + 1, 3) in metres, `cable_lengths` of shape (n_samples, N, 3) in metres and
        `notes`. Where it draws less of the path than required it is clear, but
        incomplete: `undrawn` says what is left out, and `verify` gives the verdict.

    Raises:
        UnknownName: If there is no such strategy.
        Infeasible: If no certified plan was found.
        OutOfTime: If none was found in time.

    Example:
        >>> made = plan(read_problem("paper/free"), strategy="paper")
        >>> made.cable_lengths.shape[1:]
        (8, 3)
    """
    from vdsm_pin.refinement import plan_and_verify

    _expect(problem, PlanningProblem, "read_problem(path)")
    _expect(strategy, str, "'fewest'")
    deadline, robot = Deadline.after(time_limit), load_robot(problem.manipulator)
    return plan_and_verify(problem, strategy, robot, deadline=deadline).plan


def _expect(value: object, kind: type, how: str) -> None:
    """Refuse what is of another kind, and say how one is had.

    Raises:
        InvalidInput: If it is.
    """
    if not isinstance(value, kind):
        found = type(value).__name__
        message = f"expected {kind.__name__}, as of {how}; found {found}"
        raise InvalidInput(message)


def verify(
    problem: PlanningProblem,
    trajectory: Trajectory,
    *,
    errors: Box | None = None,
    joint_error: bool = False,
    time_limit: float | None = None,
) -> ArmVerification:
    """Judge a trajectory over continuous time, whoever made it.

    Args:
        problem: What is asked.
        trajectory: Rows of joint values, joined by straight lines in joint space, or
            by smooth pieces where it has velocities.
        errors: The clearance is proved for every motion within it, and within the
            errors that the problem states.
        joint_error: Whether to look for the largest joint error that is certified.
        time_limit: What is not judged by then is undecided; None for none; [s].

    Returns:
        `verdict`, `min_clearance` in metres, `closest(count)`, `checks`.

    Raises:
        InvalidInput: If the trajectory is of another arm, an error is negative, or an
            argument of another kind.

    Example:
        >>> problem = read_problem("paper/obs1")
        >>> made = plan(problem)
        >>> result = verify(problem, made.trajectory, errors=ErrorBox(base_mm=0.1))
        >>> result.verdict.value, result.min_clearance > 0.010
        ('certified', True)
        >>> result.closest(1)[0].pair.obstacle
        'pillar'
    """
    from vdsm_pin.verification.verify import verify as judge

    _expect(problem, PlanningProblem, "read_problem(path)")
    _expect(trajectory, Trajectory, "plan(problem).trajectory")
    if errors is not None:
        _expect(errors, Box, "ErrorBox(base_mm=1.0)")
    robot = load_robot(problem.manipulator)
    return judge(
        problem,
        trajectory,
        robot,
        errors=errors,
        joint_error=joint_error,
        deadline=Deadline.after(time_limit),
    )


def write_report(result: ArmVerification, path: str | Path) -> None:
    """Write the report page of a verification: one file that works offline.

    Args:
        result: What `verify` returned.
        path: The HTML file; it appears whole or not at all.

    Raises:
        InvalidFile: If the file cannot be written.

    Example:
        >>> problem = read_problem("paper/free")
        >>> made = plan(problem, strategy="paper")
        >>> write_report(verify(problem, made.trajectory), "out/api/report.html")
    """
    from vdsm_pin.report.facts import verification_file
    from vdsm_pin.report.folder import check_kept
    from vdsm_pin.report.html import write_report as write
    from vdsm_pin.report.run_record import RunRecord

    _expect(result, ArmVerification, "verify(problem, trajectory)")
    problem = result.problem
    urdf_sha256 = load_robot(problem.manipulator).urdf_sha256
    record = RunRecord.of(PYTHON, problem.source, urdf_sha256)
    check_kept([Path(path)], problem.files)
    with atomic_path(path) as temporary:
        write(temporary, result, verification_file(result, record))


def write_certificate(
    result: ArmVerification, path: str | Path, trajectory: str | Path
) -> None:
    """Write the proof of a certified motion, for `vdsm check-certificate`.

    Args:
        result: What `verify` returned, of a problem that was read from a file.
        path: The certificate; it appears whole or not at all.
        trajectory: The file that holds `result.trajectory`, to whose bytes the
            certificate is bound; `write_trajectory` writes it.

    Raises:
        InvalidInput: If the problem has no file, or the trajectory file holds another
            motion.
        VerificationFailed: If the motion is not certified.
        InvalidFile: If a file cannot be read or written.

    Example:
        >>> problem = read_problem("paper/free")
        >>> made = plan(problem, strategy="paper")
        >>> write_trajectory("out/api/free.csv", made.trajectory)
        >>> result = verify(problem, made.trajectory)
        >>> write_certificate(result, "out/api/free.certificate", "out/api/free.csv")
    """
    from vdsm_pin.io.source import sha256_of_file
    from vdsm_pin.report.folder import check_kept
    from vdsm_pin.verification import certificate_lines, certificate_writer

    _expect(result, ArmVerification, "verify(problem, trajectory)")
    problem, source = result.problem, result.problem.source
    if source is None:
        message = "a certificate is bound to a problem file; this problem has none"
        raise InvalidInput(message)
    joined = result.trajectory.interpolation
    if not _same(read_trajectory(trajectory, problem, joined), result.trajectory):
        message = f"{trajectory}: is another motion than the verified one"
        raise InvalidInput(message)
    check_kept([Path(path)], [*source.files, Path(trajectory)])
    hashes = certificate_lines.Hashes(
        problem=source.sha256,
        trajectory=sha256_of_file(Path(trajectory)),
    )
    certificate_writer.write_certificate(Path(path), result, hashes)


def _same(one: Trajectory, other: Trajectory) -> bool:
    """Whether two motions are the same: rows, when they are passed, what joins them."""
    parts = ("on_path", "path_m", "joints", "times", "rates", "changes")
    both = ((getattr(one, name), getattr(other, name)) for name in parts)
    return all(a is b or np.array_equal(a, b) for a, b in both)


def read_trajectory(
    path: str | Path,
    problem: PlanningProblem,
    interpolation: Literal["linear", "cubic", "quintic", "auto"] = "auto",
) -> Trajectory:
    """The trajectory of a CSV file (docs/files.md).

    Args:
        path: The file.
        problem: Whose arm moves.
        interpolation: What joins the rows: straight lines, cubic pieces by the file's
            velocities, quintic ones by its accelerations too, or what it has columns
            for.

    Raises:
        InvalidFile: If the file breaks its contract or is of another arm.

    Example:
        >>> problem = read_problem("paper/free")
        >>> write_trajectory("out/api/t.csv", plan(problem, "paper").trajectory)
        >>> read_trajectory("out/api/t.csv", problem).n_links
        8
    """
    return trajectory_file.read_trajectory(path, problem.manipulator, interpolation)


def write_trajectory(path: str | Path, trajectory: Trajectory) -> None:
    """Write a trajectory as CSV, with digits that read back as the same doubles.

    Args:
        path: The file; it appears whole or not at all.
        trajectory: What to write.

    Raises:
        InvalidFile: If the file cannot be written.
    """
    trajectory_file.write_trajectory(path, trajectory)
