"""The `vdsm` command: arguments, exit codes and nothing else.

Modules are imported inside the commands, so that `vdsm --help` answers at once.
"""

import os
import shlex
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Final, Literal, NoReturn

import typer

from vdsm_pin.errors import Infeasible, InvalidInput, NoPlanFound, OutOfTime, VdsmError
from vdsm_pin.planner.strategies import DEFAULT_STRATEGY, STRATEGIES
from vdsm_pin.startup import live_briefly
from vdsm_pin.text import printable, show_everything
from vdsm_pin.time_limit import Deadline, enforced

PASSED: Final = 0
NOT_PASSED: Final = 1
BAD_INPUT: Final = 2
INTERRUPTED: Final = 130
PIPE_CLOSED: Final = 141
"""As a shell reports whoever is ended by SIGPIPE; all files are written by then."""

MOST_TOLD: Final = 20
"""Errors of a file that are told besides the first."""

# Without rich markup the help page is plain text and opens twice as fast.
app = typer.Typer(
    rich_markup_mode=None,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Plan motions of hyper-redundant arms and prove that they are collision-free.",
    epilog="Exit status: 0 certified; 1 incomplete, refuted, undecided or infeasible; "
    "2 bad input.",
)

Problem = Annotated[
    str, typer.Argument(metavar="PROBLEM", help="A built-in name or a problem file.")
]
OutFolder = Annotated[Path, typer.Option("--out", help="Folder for the results.")]
Strategy = Annotated[str, typer.Option(help=f"How to plan: {', '.join(STRATEGIES)}.")]
JointError = Annotated[
    float, typer.Option(min=0.0, help="Largest error of every joint angle [deg].")
]
BaseError = Annotated[
    float, typer.Option(min=0.0, help="Largest shift of the base, any direction [mm].")
]
BaseTurn = Annotated[
    float,
    typer.Option(min=0.0, help="Largest turn of the base about its origin [deg]."),
]
ObstacleError = Annotated[
    float, typer.Option(min=0.0, help="Largest error of the obstacles [mm].")
]
Quiet = Annotated[bool, typer.Option("--quiet", help="Say nothing but errors.")]
AsJson = Annotated[
    bool, typer.Option("--json", help="Print the result as JSON, for other programs.")
]
Trajectory = Annotated[Path, typer.Option(help="A trajectory.csv.")]
PlanningTime = Annotated[
    float, typer.Option(min=0.001, help="Time limit in seconds; inf for none.")
]
TimeLimit = Annotated[
    float | None,
    typer.Option(min=0.001, help="Time limit in seconds, for each problem."),
]


def _examples(*lines: str) -> str:
    """Examples for a help page; the first line keeps click from joining them."""
    return "\n".join(["\b", "Examples:", *(f"  {line}" for line in lines)])


def _show_version(asked: bool) -> None:
    if asked:
        from vdsm_pin import __version__

        typer.echo(f"vdsm {__version__}")
        raise typer.Exit(PASSED)


@app.callback()
def vdsm(
    version: Annotated[
        bool,
        typer.Option(
            "--version", is_eager=True, callback=_show_version, help="Say it and end."
        ),
    ] = False,
) -> None:
    """Plan motions of hyper-redundant arms and prove that they are collision-free."""


@app.command(epilog=_examples("vdsm plan paper/obs1 --out out/obs1"))
def plan(
    context: typer.Context,
    problem: Problem,
    out: OutFolder,
    strategy: Strategy = DEFAULT_STRATEGY,
    time_limit: PlanningTime = 60.0,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Plan a motion.

    Writes trajectory.csv, centres.csv, cables.csv, plan.json and report.html, or
    no_plan.html where there is no plan. A plan that draws less of the path than
    required is written, is called incomplete, and ends with status 1.
    """
    from vdsm_pin.io.problem_file import read_problem
    from vdsm_pin.progress import shown
    from vdsm_pin.report.terminal import show_plan
    from vdsm_pin.report.words import outcome
    from vdsm_pin.workflow import NO_PLAN, plan_to_folder

    deadline, begin = Deadline.after(time_limit), time.monotonic()
    page = f"see {out / NO_PLAN}"
    try:
        with enforced(deadline):
            source = read_problem(problem)
            with nullcontext() if quiet else shown():
                file = plan_to_folder(source, strategy, out, context.obj, deadline)
    except OutOfTime as error:  # which tells its time itself
        error.args = (f"no plan found: {error}; {page}",)
        raise
    except NoPlanFound as error:
        spent = time.monotonic() - begin
        error.args = (f"no plan found: {error}; searched for {spent:.1f} s; {page}",)
        raise
    except Infeasible as error:
        error.args = (f"{error}; {page}",)
        raise
    if as_json:
        typer.echo(file.text(), nl=False)
    elif not quiet:
        show_plan(file, out)
    raise typer.Exit(PASSED if outcome(file.verdict).passed else NOT_PASSED)


def _refuse_beside(what: str, options: Mapping[str, object]) -> None:
    """Refuse options that mean nothing beside another one.

    Raises:
        InvalidInput: If one is given.
    """
    for name, value in options.items():
        if value:
            message = f"{name} has no meaning with {what}"
            raise InvalidInput(message)


@app.command(
    epilog=_examples(
        "vdsm verify paper/obs1 --trajectory out/obs1/trajectory.csv --out out/obs1",
        "vdsm verify mine.yaml --trajectory mine.csv --out out/mine "
        "--certificate mine.certificate",
        "vdsm verify --urdf ur5.urdf --srdf ur5.srdf --scene scene.yaml "
        "--trajectory plan.csv --required-clearance-mm 5 --out out/ur5",
    )
)
def verify(
    context: typer.Context,
    trajectory: Trajectory,
    out: OutFolder,
    problem: Annotated[
        str | None,
        typer.Argument(
            metavar="[PROBLEM]",
            help="A built-in name or a problem file; none with --urdf.",
        ),
    ] = None,
    joint_error_deg: JointError = 0.0,
    base_error_mm: BaseError = 0.0,
    base_error_deg: BaseTurn = 0.0,
    obstacle_error_mm: ObstacleError = 0.0,
    certificate: Annotated[
        Path | None, typer.Option(help="Write the proof to this file.")
    ] = None,
    pdf: Annotated[
        Path | None,
        typer.Option(help="Print the report to this file; needs Chromium or Chrome."),
    ] = None,
    time_limit: TimeLimit = None,
    all_pairs: Annotated[
        bool,
        typer.Option(
            "--all-pairs", help="Every pair at every interval in clearance.csv."
        ),
    ] = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
    urdf: Annotated[
        Path | None, typer.Option(help="Any robot, in place of a problem.")
    ] = None,
    srdf: Annotated[
        Path | None, typer.Option(help="Its links that need not be held apart.")
    ] = None,
    scene: Annotated[
        Path | None, typer.Option(help="Its obstacles: ours or a PlanningScene.")
    ] = None,
    package_dir: Annotated[
        list[Path] | None, typer.Option(help="Where package:// is looked for.")
    ] = None,
    lock: Annotated[
        list[str] | None,
        typer.Option(metavar="JOINT=VALUE", help="A joint that stands still [rad, m]."),
    ] = None,
    required_clearance_mm: Annotated[
        float | None,
        typer.Option(min=0.0, help="With --urdf: from obstacles [mm]; 0 by default."),
    ] = None,
    required_self_clearance_mm: Annotated[
        float | None,
        typer.Option(min=0.0, help="With --urdf: between links [mm]; 0 by default."),
    ] = None,
) -> None:
    """Verify a trajectory of any planner.

    Writes report.html, verification.json, clearance.csv, link_angles.csv, centres.csv
    and cables.csv; of a robot by --urdf verification.json alone.
    """
    of_robot = {
        "--srdf": srdf,
        "--scene": scene,
        "--package-dir": package_dir,
        "--lock": lock,
        "--required-clearance-mm": required_clearance_mm,
        "--required-self-clearance-mm": required_self_clearance_mm,
    }
    if urdf is not None:
        of_arm = {
            "PROBLEM": problem,
            "--joint-error-deg": joint_error_deg,
            "--base-error-mm": base_error_mm,
            "--base-error-deg": base_error_deg,
            "--obstacle-error-mm": obstacle_error_mm,
            "--certificate": certificate,
            "--pdf": pdf,
            "--all-pairs": all_pairs,
        }
        _refuse_beside("--urdf", of_arm)
        from vdsm_pin.robots.folder import (
            RobotOrder,
            show_robot,
            verify_robot_to_folder,
        )
        from vdsm_pin.units import MM_PER_M

        deadline = Deadline.after(time_limit)
        with enforced(deadline):
            found = verify_robot_to_folder(
                RobotOrder(
                    urdf=urdf,
                    trajectory=trajectory,
                    folder=out,
                    command=context.obj,
                    srdf=srdf,
                    scene=scene,
                    package_dirs=tuple(package_dir or ()),
                    lock=tuple(lock or ()),
                    required=(required_clearance_mm or 0.0) / MM_PER_M,
                    required_self=(required_self_clearance_mm or 0.0) / MM_PER_M,
                    deadline=deadline,
                )
            )
        if as_json:
            typer.echo((out / "verification.json").read_text("utf-8"), nl=False)
        elif not quiet:
            show_robot(found, out)
        raise typer.Exit(PASSED if found.verdict == "certified" else NOT_PASSED)
    _refuse_beside("a problem", of_robot)
    if problem is None:
        message = "expected a PROBLEM, or --urdf for any other robot"
        raise InvalidInput(message)
    from vdsm_pin.io.problem_file import read_problem
    from vdsm_pin.report.run_record import now
    from vdsm_pin.report.terminal import show_verification
    from vdsm_pin.report.words import outcome
    from vdsm_pin.workflow import VerifyOrder, error_box, verify_to_folder

    deadline = Deadline.after(time_limit)
    errors = error_box(
        joint_error_deg, base_error_mm, obstacle_error_mm, base_error_deg
    )
    with enforced(deadline):
        order = VerifyOrder(
            source=read_problem(problem),
            trajectory=trajectory,
            folder=out,
            command=context.obj,
            errors=errors,
            certificate=certificate,
            pdf=pdf,
            deadline=deadline,
            all_pairs=all_pairs,
            date=now(),
        )
        verified = verify_to_folder(order)
    file = verified.file
    written: list[tuple[str, str]] = []
    if certificate is not None:
        none = verified.no_certificate
        written.append(("certificate", f"none: {none}" if none else str(certificate)))
    if pdf is not None:
        written.append(("report on paper", str(pdf)))
    if as_json:
        typer.echo(file.text(), nl=False)
    elif not quiet:
        show_verification(file, out, *written)
    complete = certificate is None or not verified.no_certificate
    passed = outcome(file.verdict).passed and complete
    raise typer.Exit(PASSED if passed else NOT_PASSED)


@app.command(
    epilog=_examples(
        "vdsm batch --out out/demo",
        "vdsm batch problems/*.yaml --out out/night --jobs 8 --time-limit 60 --resume",
    ),
)
def batch(
    out: OutFolder,
    problems: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="PROBLEM",
            help="Built-in names, problem files or folders of them; the built-in "
            "problems if there is none.",
        ),
    ] = None,
    strategy: Strategy = DEFAULT_STRATEGY,
    jobs: Annotated[int, typer.Option(min=1, help="Processes.")] = 1,
    resume: Annotated[
        bool, typer.Option("--resume", help="Skip what is finished and intact.")
    ] = False,
    time_limit: TimeLimit = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS", help="A Dask scheduler, as tcp://host:8786; no --jobs."
        ),
    ] = None,
    keep: Annotated[
        Literal["all", "failed", "none"],
        typer.Option(help="Whose files stay; every problem keeps its row."),
    ] = "all",
    joint_error_deg: JointError = 0.0,
    base_error_mm: BaseError = 0.0,
    base_error_deg: BaseTurn = 0.0,
    obstacle_error_mm: ObstacleError = 0.0,
    certificate: Annotated[
        bool, typer.Option("--certificate", help="Write a proof of each to its folder.")
    ] = False,
    pdf: Annotated[
        bool, typer.Option("--pdf", help="Print each report to its folder too.")
    ] = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Plan and verify many problems.

    Each gets a folder with its report; summary.csv, junit.xml and index.html show all.
    """
    import json

    from vdsm_pin.batch.run import Batch, Interrupted, run_batch
    from vdsm_pin.batch.task import Proving
    from vdsm_pin.report.words import outcome

    asked = Batch(
        problems=tuple(problems or ()),
        folder=out,
        strategy=strategy,
        jobs=jobs,
        resume=resume,
        time_limit=time_limit,
        scheduler=scheduler,
        keep=keep,
        proving=Proving(
            joint_error_deg=joint_error_deg,
            base_error_mm=base_error_mm,
            obstacle_error_mm=obstacle_error_mm,
            certificate=certificate,
            pdf=pdf,
            base_error_deg=base_error_deg,
        ),
        quiet=quiet or as_json,
    )
    try:
        rows = run_batch(asked)
    except Interrupted as error:
        _fail(error, INTERRUPTED)
    passed = sum(outcome(row.outcome).passed for row in rows)
    if as_json:
        typer.echo(json.dumps([row.model_dump() for row in rows], indent=2))
    elif not quiet:
        typer.echo(f"{passed} of {len(rows)} certified; see {out / 'index.html'}")
    raise typer.Exit(PASSED if passed == len(rows) else NOT_PASSED)


@app.command(
    epilog=_examples(
        "vdsm view paper/obs1 --trajectory out/obs1/trajectory.csv",
        "vdsm view paper/obs1 --html obs1.html",
    ),
)
def view(
    problem: Problem,
    trajectory: Annotated[
        Path | None, typer.Option(help="A trajectory.csv; without it the start.")
    ] = None,
    html: Annotated[Path | None, typer.Option(help="Write a page and end.")] = None,
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port to serve on; 0 for any.")
    ] = 7000,
    watch: Annotated[
        bool, typer.Option("--watch", help="Reload when a file changes.")
    ] = False,
) -> None:
    """Show a motion in 3D in the browser."""
    from vdsm_pin.visualization import serve, write_page

    if html is not None:
        write_page(html, problem, trajectory)
        typer.echo(f"wrote {html}")
        return
    serve(problem, trajectory, port=port, watch=watch, announce=typer.echo)


@app.command(
    epilog=_examples(
        "vdsm problems",
        "vdsm problems --show paper/obs1 > mine.yaml",
    ),
)
def problems(
    show: Annotated[
        str | None, typer.Option(metavar="NAME", help="Print this problem's file.")
    ] = None,
) -> None:
    """List the built-in problems, or print one."""
    from vdsm_pin.io.problem_file import built_in_names, built_in_text

    names = "\n".join(built_in_names()) + "\n"
    typer.echo(names if show is None else built_in_text(show), nl=False)


@app.command(epilog=_examples("vdsm new mine", "vdsm new vessel --from port"))
def new(
    folder: Annotated[
        Path, typer.Argument(metavar="NAME", help="Folder to make; names the problem.")
    ],
    kind: Annotated[
        str, typer.Option("--from", help="snake, port or paper.")
    ] = "snake",
) -> None:
    """Make a folder with a problem to start from."""
    from vdsm_pin.new_project import new_project

    files = new_project(folder, kind)
    typer.echo(f"made {folder} with {', '.join(files)}; next:")
    typer.echo(f"  vdsm plan {shlex.quote(str(folder / 'problem.yaml'))} --out out")


@app.command(epilog=_examples("vdsm doctor"))
def doctor() -> None:
    """Say what this installation can do, what it lacks and how to get it.

    Exit status 1 if planning or verification lacks something.
    """
    from vdsm_pin.doctor import examine

    findings = examine()
    for one in findings:
        sign = "✓" if one.works else "✗" if one.needed else "–"
        remedy = f"; {one.remedy}" if one.remedy else ""
        typer.echo(printable(f"{sign} {one.what:<14} {one.found}{remedy}"))
    lacking = any(one.needed and not one.works for one in findings)
    raise typer.Exit(NOT_PASSED if lacking else PASSED)


@app.command(epilog=_examples("vdsm schema verification"))
def schema(
    name: Annotated[
        str,
        typer.Argument(
            help="problem, certificate, verification, plan, manifest or timing."
        ),
    ] = "problem",
) -> None:
    """Print the JSON Schema of a file, or of each line of a certificate."""
    from vdsm_pin.report.files import schema, schema_text

    typer.echo(schema_text(schema(name)), nl=False)


@app.command(
    epilog=_examples(
        "vdsm urdf hrm8 --out hrm8.urdf", "vdsm urdf mine.yaml --out a.urdf"
    )
)
def urdf(
    name: Annotated[
        str,
        typer.Argument(metavar="ARM", help="A built-in arm, or a problem for its arm."),
    ],
    out: Annotated[Path, typer.Option("--out", help="The URDF file.")],
) -> None:
    """Write the URDF of an arm."""
    from vdsm_pin.io.atomic import atomic_path
    from vdsm_pin.io.problem_file import built_in_names, read_problem
    from vdsm_pin.manipulator import BUILT_IN, built_in
    from vdsm_pin.report.folder import check_output_file
    from vdsm_pin.report.solids import obj_text
    from vdsm_pin.urdf_writer import mesh_names, urdf_text

    known = name in BUILT_IN or name in built_in_names() or Path(name).exists()
    if not known:
        built_in(name)  # which says what arms there are
    arm = BUILT_IN.get(name) or read_problem(name).problem.manipulator
    text = urdf_text(arm)
    check_output_file(out)
    shapes = {solid.name: solid for _, solid in arm.carried}
    files = {
        out.with_name(file): obj_text(shapes[body])
        for body, file in mesh_names(arm).items()
    }
    for file in files:
        check_output_file(file)
    for file, content in {**files, out: text}.items():
        with atomic_path(file) as path:
            path.write_text(content, encoding="utf-8")
    typer.echo(f"wrote {', '.join(map(str, (out, *files)))}")


@app.command(
    "check-certificate",
    epilog=_examples("vdsm check-certificate mine.certificate mine.yaml mine.csv"),
)
def check_certificate(
    certificate: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="What vdsm verify --certificate wrote."),
    ],
    problem: Problem,
    trajectory: Annotated[
        Path,
        typer.Argument(metavar="TRAJECTORY", help="The trajectory.csv it is about."),
    ],
) -> None:
    """Recheck a certificate.

    The checker is a second program that shares only the reading of files with the
    verifier.
    """
    from vdsm_pin.certificate_checker import main as check

    raise typer.Exit(check([str(certificate), problem, str(trajectory)]))


@app.command(
    epilog=_examples(
        "vdsm simulate paper/obs3 --trajectory out/obs3/trajectory.csv --out out/loop"
    )
)
def simulate(
    problem: Problem,
    trajectory: Trajectory,
    out: OutFolder,
    settings: Annotated[
        Path | None,
        typer.Option(help="A YAML file of masses, cables, motors, gains, kicks."),
    ] = None,
) -> None:
    """Run a plan in closed loop: elastic cables, motors, encoders, PID.

    Needs MuJoCo (extra `simulation`). Writes executed.csv, simulation.csv,
    simulation.json and simulation.html. Status 1 where the executed motion is not
    proved clear.
    """
    from vdsm_pin.io.problem_file import read_problem
    from vdsm_pin.simulation.folder import SimulationOrder, simulate_to_folder
    from vdsm_pin.simulation.settings import Settings, read_settings
    from vdsm_pin.simulation.terminal import show_simulation

    assumed = Settings() if settings is None else read_settings(settings)
    order = SimulationOrder(read_problem(problem), trajectory, out, assumed)
    file = simulate_to_folder(order)
    show_simulation(file, out)
    passed = file.executed.verdict == "certified"
    raise typer.Exit(PASSED if passed else NOT_PASSED)


@app.command(
    epilog=_examples(
        "vdsm explain paper/obs1 --out out/explain",
        "vdsm explain paper/obs3 --waypoint 300 --out out/explain",
    )
)
def explain(
    problem: Problem,
    out: OutFolder,
    waypoint: Annotated[
        int | None,
        typer.Option(
            min=0, help="Waypoint, from 0; the one with the largest link angle if none."
        ),
    ] = None,
) -> None:
    """Follow the paper's seven steps at one waypoint.

    Plans by the strategy `paper` and writes explain.html: numbers and a picture of
    every step.
    """
    from vdsm_pin.explanation.folder import explain_to_folder
    from vdsm_pin.io.problem_file import read_problem

    page, row = explain_to_folder(read_problem(problem), waypoint, out)
    typer.echo(f"waypoint {row}: wrote {page}")


@app.command(
    epilog=_examples(
        "vdsm convert paper/obs1 --trajectory out/obs1/trajectory.csv --out out/all",
        "vdsm convert mine.yaml --cables measured.csv --out out/mine",
    )
)
def convert(
    problem: Problem,
    out: OutFolder,
    trajectory: Annotated[
        Path | None, typer.Option(help="Joint angles, as trajectory.csv.")
    ] = None,
    centres: Annotated[
        Path | None, typer.Option(help="Joint centres, as centres.csv.")
    ] = None,
    cables: Annotated[
        Path | None, typer.Option(help="Cable lengths, as cables.csv.")
    ] = None,
) -> None:
    """Convert angles, joint centres and cable lengths into one another.

    Takes one of them and writes all: trajectory.csv, centres.csv and cables.csv.
    Nothing is judged.
    """
    from vdsm_pin.conversion import Given, convert_to_folder
    from vdsm_pin.io.problem_file import read_problem

    given = Given(trajectory, centres, cables)
    rows = convert_to_folder(read_problem(problem), given, out)
    typer.echo(f"wrote {rows.n_samples} waypoints to {out}")


@app.command(epilog=_examples("vdsm diff out/monday out/tuesday"))
def diff(
    old: Annotated[
        Path, typer.Argument(metavar="OLD", help="A folder of vdsm batch or verify.")
    ],
    new: Annotated[Path, typer.Argument(metavar="NEW", help="Another one.")],
) -> None:
    """Compare two result folders.

    Exit status 1 if anything got worse.
    """
    from vdsm_pin.report.diff import compare_folders, diff_lines

    changes = compare_folders(old, new)
    typer.echo("\n".join(diff_lines(changes)))
    raise typer.Exit(NOT_PASSED if any(one.worse for one in changes) else PASSED)


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command; every error raised on purpose becomes one message."""
    live_briefly()
    show_everything()
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        try:
            app(given, prog_name="vdsm", obj=shlex.join(["vdsm", *given]))
        finally:
            sys.stdout.flush()  # here a closed pipe is heard, later it is not
    except SystemExit as ended:
        if isinstance(ended.__context__, BrokenPipeError):  # as typer says it
            _nobody_reads()
        raise
    except InvalidInput as error:
        _fail(error, BAD_INPUT)
    except VdsmError as error:
        _fail(error, NOT_PASSED)
    except BrokenPipeError:
        _nobody_reads()
    except OSError as error:
        _fail(error, BAD_INPUT)
    sys.exit(PASSED)


def _nobody_reads() -> NoReturn:
    """End because the reader of our output has gone, which is no verdict."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())  # for what Python flushes at its end
    sys.exit(PIPE_CLOSED)


def _fail(error: Exception, status: int) -> NoReturn:
    others = getattr(error, "others", ())
    for one in (error, *others[:MOST_TOLD]):
        typer.echo(printable(f"vdsm: {one}"), err=True)
    if len(others) > MOST_TOLD:
        typer.echo(f"vdsm: and {len(others) - MOST_TOLD} more", err=True)
    sys.exit(status)
