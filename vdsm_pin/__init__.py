"""Planning and proved collision analysis for hyper-redundant manipulators.

    import vdsm_pin as vp

    problem = vp.read_problem("paper/obs1")
    plan = vp.plan(problem, strategy="fewest")
    result = vp.verify(problem, plan.trajectory, errors=vp.ErrorBox(base_mm=0.1))
    vp.write_report(result, "report.html")

Names are imported when they are first used: importing the package costs nothing.
"""

from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from vdsm_pin.api import (
        ErrorBox,
        plan,
        read_problem,
        read_trajectory,
        repair_trajectory,
        verify,
        write_certificate,
        write_problem,
        write_report,
        write_trajectory,
    )
    from vdsm_pin.arm.cable_layout import CableLayout
    from vdsm_pin.arm.manipulator import Manipulator, built_in
    from vdsm_pin.arm.mounted import Feed, LinkBody, Tool
    from vdsm_pin.errors import Infeasible, InvalidInput, VdsmError
    from vdsm_pin.geometry.solids import (
        Box,
        Capsule,
        Cylinder,
        HalfSpace,
        Mesh,
        Prism,
        Sphere,
    )
    from vdsm_pin.problem.desired_path import DesiredPath
    from vdsm_pin.problem.joint_trajectory import JointTrajectory
    from vdsm_pin.problem.planning_problem import PlanningProblem as Problem
    from vdsm_pin.problem.scene import Scene
    from vdsm_pin.problem.trajectory import Trajectory
    from vdsm_pin.robots.cell import Cell, cell_of, read_cell
    from vdsm_pin.robots.files import MeshCover, RobotFiles
    from vdsm_pin.verification.records import Verdict

__version__ = "0.13.0"

__all__ = [
    "Box",
    "CableLayout",
    "Capsule",
    "Cell",
    "Cylinder",
    "DesiredPath",
    "ErrorBox",
    "Feed",
    "HalfSpace",
    "Infeasible",
    "InvalidInput",
    "JointTrajectory",
    "LinkBody",
    "Manipulator",
    "Mesh",
    "MeshCover",
    "Prism",
    "Problem",
    "RobotFiles",
    "Scene",
    "Sphere",
    "Tool",
    "Trajectory",
    "VdsmError",
    "Verdict",
    "built_in",
    "cell_of",
    "plan",
    "read_cell",
    "read_problem",
    "read_trajectory",
    "repair_trajectory",
    "verify",
    "write_certificate",
    "write_problem",
    "write_report",
    "write_trajectory",
]

_HOMES: Final = {
    "errors": ("Infeasible", "InvalidInput", "VdsmError"),
    "arm.cable_layout": ("CableLayout",),
    "arm.manipulator": ("Manipulator", "built_in"),
    "arm.mounted": ("Feed", "LinkBody", "Tool"),
    "geometry.solids": (
        *("Box", "Capsule", "Cylinder", "HalfSpace", "Mesh", "Prism", "Sphere"),
    ),
    "problem.desired_path": ("DesiredPath",),
    "problem.joint_trajectory": ("JointTrajectory",),
    "problem.scene": ("Scene",),
    "problem.trajectory": ("Trajectory",),
    "robots.cell": ("Cell", "cell_of", "read_cell"),
    "robots.files": ("MeshCover", "RobotFiles"),
    "verification.records": ("Verdict",),
}
"""Where names live that are not in `api`."""


def __getattr__(name: str) -> Any:
    if name not in __all__:
        message = f"module {__name__!r} has no attribute {name!r}"
        raise AttributeError(message)
    from importlib import import_module

    homes = (home for home, names in _HOMES.items() if name in names)
    module, wanted = next(homes, "api"), name
    if name == "Problem":
        module, wanted = "problem.planning_problem", "PlanningProblem"
    return getattr(import_module(f"{__name__}.{module}"), wanted)


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
