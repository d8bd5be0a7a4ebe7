"""Modules whose changes are tried, and the tests that shall notice."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[2]
"""Of the checkout."""


@dataclass(frozen=True)
class Group:
    """Modules that are changed and the tests that shall notice.

    Args:
        name: Its name.
        modules: Patterns of their paths.
        tests: Files and folders.
        plain: Whether all of its tests are quick enough without machine code.
    """

    name: str
    modules: tuple[str, ...]
    tests: tuple[str, ...]
    plain: bool = False

    def runs_plain(self, module: str) -> bool:
        """Whether changes of a module are tried without machine code."""
        text = (ROOT / module).read_text(encoding="utf-8")
        return self.plain or "@compiled" in text


GROUPS: Final = (
    Group(
        "checker",
        ("vdsm_pin/certificate_checker/*.py",),
        (
            "tests/certificate_checker",
            "tests/test_certificate_checker.py",
            "tests/verification/test_certificate_accepted.py",
            "tests/verification/test_half_laps.py",
            "tests/verification/test_inside.py",
            "tests/io/test_two_readers.py",
            "tests/robots/test_inside_robots.py",
        ),
    ),
    Group(
        "readers",
        ("vdsm_pin/io/**/*.py",),
        (
            "tests/io",
            "tests/certificate_checker/test_checker_robot_errors.py",
            "tests/planner/paper/test_ratios.py",
            "tests/verification/test_half_laps.py",
            "tests/verification/test_other_arms.py",
            "tests/robots/test_arm_and_robot.py",
            "tests/robots/test_scenes.py",
            "tests/robots/test_trajectories.py",
        ),
    ),
    Group(
        "verification",
        (
            "vdsm_pin/certificate_writer/*.py",
            "vdsm_pin/verification/[!p]*.py",
            "vdsm_pin/verification/p[!a]*.py",
            "vdsm_pin/geometry/closed_meshes.py",
            "vdsm_pin/geometry/mesh_[!i]*.py",
            "vdsm_pin/geometry/winding.py",
        ),
        (
            "tests/verification",
            "tests/geometry/test_closed_meshes.py",
            "tests/geometry/test_mesh_parts.py",
            "tests/geometry/test_winding.py",
            "tests/certificate_checker/test_checker_arm_forgeries.py",
            "tests/certificate_checker/test_checker_robots.py",
            "tests/robots/test_moving_beside_robots.py",
            "tests/robots/test_robot_first_contact.py",
            "tests/robots/test_two_robots.py",
        ),
    ),
    Group(
        "slopes",
        ("vdsm_pin/verification/pair_slopes.py",),
        (
            "tests/verification/test_pair_slopes.py",
            "tests/verification/test_counterexample.py",
        ),
        True,
    ),
    Group(
        "insides",
        ("vdsm_pin/geometry/mesh_insides.py",),
        ("tests/geometry/test_crossings.py",),
        True,
    ),
    Group("proof", ("vdsm_pin/proof/*.py",), ("tests/proof",), True),
    Group(
        "arm",
        (
            "vdsm_pin/arm/kinematics.py",
            "vdsm_pin/arm/cables.py",
            "vdsm_pin/geometry/cable_kernels.py",
            "vdsm_pin/geometry/joint_kernels.py",
        ),
        (
            "tests/arm/test_kinematics.py",
            "tests/arm/test_cables.py",
            "tests/verification/test_cable_check.py",
        ),
        True,
    ),
)


def modules_of(group: Group) -> list[str]:
    """Paths of a group's modules, from the root of the checkout."""
    found = (path for pattern in group.modules for path in sorted(ROOT.glob(pattern)))
    return [str(path.relative_to(ROOT)) for path in found]
