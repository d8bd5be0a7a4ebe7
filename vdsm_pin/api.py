"""The package from Python: plan, verify, repair, write. `import vdsm_pin` has it all.

>>> import vdsm_pin as vp
>>> problem = vp.read_problem("paper/free")
>>> plan = vp.plan(problem, strategy="paper")
>>> result = vp.verify(problem, plan.trajectory)
>>> result.verdict.value
'certified'
"""

from collections.abc import Sequence
from operator import index
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args, overload

from vdsm_pin.app.motions import NO_OPTIONS, Motion, MotionOptions, expect
from vdsm_pin.app.problems import read_problem as read_problem
from vdsm_pin.app.subjects import ProblemOrCell, Subject, subject_of
from vdsm_pin.errors import InvalidInput
from vdsm_pin.io.atomic import atomic_path
from vdsm_pin.io.source import path_of
from vdsm_pin.io.trajectory_file import Interpolation
from vdsm_pin.io.trajectory_file import write_trajectory as write_arm_trajectory
from vdsm_pin.planner.records import Plan
from vdsm_pin.problem.error_boxes import ErrorBox as Box
from vdsm_pin.problem.error_boxes import TypedErrorBox
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.time_limit import Deadline
from vdsm_pin.verification.records import ArmVerification, Verification

if TYPE_CHECKING:  # few need robots or repair
    from vdsm_pin.repair.rounds import Repaired
    from vdsm_pin.robots.cell import Cell
    from vdsm_pin.robots.judgement import RobotVerification

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
    """Plan a motion of a snake arm and have it verified.

    Args:
        problem: What is asked.
        strategy: `fewest`, `clearest`, `sturdiest`, `follow-the-leader`,
            `paper` or `paper-clearest`.
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
        InvalidInput: If the problem asks for what makes no sense.

    Example:
        >>> made = plan(read_problem("paper/free"), strategy="paper")
        >>> made.cable_lengths.shape[1:]
        (8, 3)
    """
    from vdsm_pin.refinement import plan_and_verify

    expect(problem, PlanningProblem, "read_problem(path)")
    expect(strategy, str, "'fewest'")
    deadline = Deadline.after(time_limit)
    return plan_and_verify(problem, strategy, deadline=deadline).plan


@overload
def verify(
    problem: PlanningProblem,
    trajectory: Trajectory,
    *,
    errors: Box | None = None,
    joint_error: bool = False,
    time_limit: float | None = None,
) -> ArmVerification: ...


@overload
def verify(
    problem: "Cell",
    trajectory: JointTrajectory,
    *,
    errors: Box | None = None,
    time_limit: float | None = None,
) -> "RobotVerification": ...


def verify(
    problem: ProblemOrCell,
    trajectory: Motion,
    *,
    errors: Box | None = None,
    joint_error: bool = False,
    time_limit: float | None = None,
) -> Verification:
    """Judge a trajectory over continuous time, whoever made it.

    Args:
        problem: What is asked of a snake arm, or of any other robot.
        trajectory: Rows of joint values, joined by straight lines in joint space, or
            by smooth pieces where it has velocities: a `Trajectory` of an arm, a
            `JointTrajectory` of any other robot.
        errors: The clearance is proved for every motion within it, and within the
            errors that the problem states.
        joint_error: Whether to look for the largest joint error that is certified; of
            arms alone.
        time_limit: What is not judged by then is undecided; None for none; [s].

    Returns:
        `verdict`, `min_clearance` in metres, `closest(count)`, `checks`.

    Raises:
        InvalidInput: If the trajectory is of another robot, an error is negative, or an
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
    subject = _subject(problem, MotionOptions(Deadline.after(time_limit)), errors)
    if joint_error and not isinstance(problem, PlanningProblem):
        message = "joint_error is looked for of snake arms alone"
        raise InvalidInput(message)
    return subject.judge(subject.checked(trajectory), joint_error=joint_error)


def _subject(
    problem: Any, options: MotionOptions = NO_OPTIONS, errors: Box | None = None
) -> Subject:
    """The subject of a problem, its clearances asked for under more errors.

    Raises:
        InvalidInput: If the problem is neither `PlanningProblem` nor `Cell`, the errors
            are no error box, or an option is of problems of the other kind.
    """
    if options.interpolation not in get_args(Interpolation):
        known = ", ".join(get_args(Interpolation))
        message = f"interpolation is {options.interpolation!r}, expected one of {known}"
        raise InvalidInput(message)
    if isinstance(problem, PlanningProblem):
        if options.topic is not None:
            message = "topic is of a robot's motion, in a bag; this is a snake arm"
            raise InvalidInput(message)
    else:
        from vdsm_pin.robots.cell import Cell

        expect(problem, Cell, "read_cell(path); or a Problem, as of read_problem(path)")
    if errors is not None:
        problem = problem.under(expect(errors, Box, "ErrorBox(base_mm=1.0)"))
    return subject_of(problem, options)


@overload
def repair_trajectory(
    problem: PlanningProblem,
    trajectory: Trajectory,
    pinned: Sequence[int] = (),
    *,
    time_limit: float | None = None,
) -> "Repaired[Trajectory, ArmVerification]": ...


@overload
def repair_trajectory(
    problem: "Cell",
    trajectory: JointTrajectory,
    pinned: Sequence[int] = (),
    *,
    time_limit: float | None = None,
) -> "Repaired[JointTrajectory, RobotVerification]": ...


def repair_trajectory(
    problem: ProblemOrCell,
    trajectory: Motion,
    pinned: Sequence[int] = (),
    *,
    time_limit: float | None = None,
) -> "Repaired[Any, Any]":
    """A certified trajectory near one that is not.

    Args:
        problem: What is asked of a snake arm, or of any other robot.
        trajectory: Straight lines between rows of joint values.
        pinned: Numbers of rows, from 0, that stay besides the first and the last.
        time_limit: When to give up; None for never; [s].

    Returns:
        `trajectory`, the motion that was found; `verification` of it, certified;
        `given`, the number of the row that each of its rows was, -1 for a new one;
        `moved`, how far each was moved, shape (n_rows,); [rad], [m].

    Raises:
        Infeasible: If none was found; the message says why and where.
        OutOfTime: If none was found in time.
        InvalidInput: If the trajectory is of another robot, or has no such row.

    Example:
        >>> problem = read_problem("paper/obs1")
        >>> found = repair_trajectory(problem, plan(problem).trajectory)
        >>> float(found.moved.max())
        0.0
    """
    subject = _subject(problem, MotionOptions(Deadline.after(time_limit)))
    try:
        rows = tuple(map(index, pinned))
    except TypeError:
        message = f"pinned is {pinned!r}, expected numbers of rows, such as [3, 4]"
        raise InvalidInput(message) from None
    return subject.repair(subject.checked(trajectory), rows)


def write_report(result: Verification, path: str | Path) -> None:
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

    urdf, problem = _judged(result).urdf_sha256, result.problem
    record = RunRecord(PYTHON, problem.sha256, urdf_sha256=urdf)
    check_kept([path_of(path)], problem.files)
    with atomic_path(path) as temporary:
        write(temporary, result, verification_file(result, record))


def _judged(result: Any, options: MotionOptions = NO_OPTIONS) -> Subject:
    """The subject of the problem that a verification is about.

    Raises:
        InvalidInput: If the result is no `Verification`.
    """
    expect(result, Verification, "verify(problem, trajectory)")
    return _subject(result.problem, options)


def write_problem(problem: PlanningProblem, path: str | Path) -> PlanningProblem:
    """Write a problem that was built in Python as a problem file.

    Args:
        problem: Of a snake arm. Its meshes and clouds are written beside the file.
        path: The file; it appears whole or not at all.

    Returns:
        The problem as it is read from that file, which is the one to plan and verify
        since certificates are bound to it. Degrees and frames may change the last digit
        of a value.

    Raises:
        InvalidInput: If it has what no problem file says, as obstacles that are carried
            by another robot or a prism that is not along an axis.
        InvalidFile: If a file cannot be written, or what is written makes no problem,
            as where links that are too short always touch.

    Example:
        >>> import numpy as np
        >>> import vdsm_pin as vp
        >>> ball = vp.Sphere("ball", np.array([2.0, 0.5, 0.0]), 0.1)
        >>> path = vp.DesiredPath(np.array([3.126, 0, 0]), np.array([[3.1, 0.4, 0.2]]))
        >>> arm, scene = vp.built_in("hrm8"), vp.Scene((ball,))
        >>> problem = vp.Problem(arm, scene, path, 0.01, name="one")
        >>> problem = write_problem(problem, "out/api/one.yaml")
        >>> problem.source.path.name
        'one.yaml'
    """
    from vdsm_pin.io.problem_writer import write_problem as write
    from vdsm_pin.report.folder import check_kept

    file = path_of(path)
    expect(problem, PlanningProblem, "Problem(...)")
    check_kept([file], problem.files)
    write(file, problem)
    return read_problem(file)


def write_certificate(
    result: Verification,
    path: str | Path,
    trajectory: str | Path | None = None,
    *,
    topic: str | None = None,
) -> None:
    """Write the proof of a certified motion, for `vdsm check-certificate`.

    Args:
        result: What `verify` returned, of a problem that was read from a file
            (`write_problem` makes one).
        path: The certificate; it appears whole or not at all.
        trajectory: The file that holds the motion that was judged, to whose bytes the
            certificate is bound. Default: it is written beside the certificate, as
            NAME.csv.
        topic: Of the motion, in a bag.

    Raises:
        InvalidInput: If the problem has no file, or the trajectory file holds another
            motion.
        VerificationFailed: If the motion is not certified.
        InvalidFile: If a file cannot be read or written.

    Example:
        >>> problem = read_problem("paper/free")
        >>> result = verify(problem, plan(problem, strategy="paper").trajectory)
        >>> write_certificate(result, "out/api/free.certificate")
        >>> Path("out/api/free.csv").exists()
        True
    """
    from vdsm_pin.certificate_writer.certificate import write_certificate as write
    from vdsm_pin.certificate_writer.lines import Hashes, check_certified
    from vdsm_pin.io.source import check_unchanged, readable, sha256_of_file
    from vdsm_pin.report.folder import check_kept

    joined = result.trajectory.interpolation
    subject = _judged(result, MotionOptions(interpolation=joined, topic=topic))
    source = result.problem.source
    if source is None or not source.is_whole:
        message = (
            "a certificate is bound to a problem file; this problem has none "
            "(write_problem writes one of a snake arm's)"
        )
        raise InvalidInput(message)
    certificate = path_of(path)
    file = (
        certificate.with_suffix(".csv") if trajectory is None else path_of(trajectory)
    )
    if trajectory is None and not file.exists():
        check_certified(result)
        check_kept([certificate, file], source.files)
        subject.write(file, result.trajectory)
    with readable(file):
        digest = sha256_of_file(file)
    same = subject.is_of(result, subject.read(file))
    check_unchanged(file, digest)
    if not same:
        message = f"{file}: is another motion than the verified one"
        raise InvalidInput(message)
    check_kept([certificate], [*source.files, file])
    hashes = Hashes(problem=source.sha256, trajectory=digest)
    write(certificate, result, hashes, topic=topic)


@overload
def read_trajectory(
    path: str | Path, problem: PlanningProblem, interpolation: Interpolation = "auto"
) -> Trajectory: ...


@overload
def read_trajectory(
    path: str | Path,
    problem: "Cell",
    interpolation: Interpolation = "auto",
    *,
    topic: str | None = None,
) -> JointTrajectory: ...


def read_trajectory(
    path: str | Path,
    problem: ProblemOrCell,
    interpolation: Interpolation = "auto",
    *,
    topic: str | None = None,
) -> Motion:
    """The trajectory of a file: CSV, of robots messages and bags too (docs/files.md).

    Args:
        path: The file.
        problem: Whose arm or robot moves.
        interpolation: What joins the rows: straight lines, cubic pieces by the file's
            velocities, quintic ones by its accelerations too, or whichever it has.
        topic: Of a robot's motion, in a bag.

    Returns:
        A `Trajectory` of an arm, a `JointTrajectory` of any other robot; its `notes`
        say what was not read.

    Raises:
        InvalidFile: If the file breaks its contract or is of another robot.

    Example:
        >>> problem = read_problem("paper/free")
        >>> write_trajectory(plan(problem, "paper").trajectory, "out/api/t.csv")
        >>> read_trajectory("out/api/t.csv", problem).n_links
        8
    """
    options = MotionOptions(interpolation=interpolation, topic=topic)
    motion: Motion = _subject(problem, options).read(path_of(path))
    return motion


def write_trajectory(
    trajectory: Motion, path: str | Path, problem: "ProblemOrCell | None" = None
) -> None:
    """Write a trajectory as CSV, with digits that read back as the same doubles.

    Args:
        trajectory: What to write.
        path: The file; it appears whole or not at all.
        problem: Of a robot's trajectory: its joints have the units.

    Raises:
        InvalidInput: If it is of a robot, and no problem is given.
        InvalidFile: If the file cannot be written.

    Example:
        >>> made = plan(read_problem("paper/free"), strategy="paper")
        >>> write_trajectory(made.trajectory, "out/api/free_again.csv")
    """
    if problem is None:
        how = "plan(problem).trajectory; or with problem=, of a robot"
        write_arm_trajectory(expect(trajectory, Trajectory, how), path_of(path))
    else:
        subject = _subject(problem)
        subject.write(path_of(path), subject.checked(trajectory))
