"""The drawing of whatever was judged: a snake arm, or any other robot."""

from vdsm_pin.report.arm_drawing import ArmDrawing
from vdsm_pin.report.drawing import Drawing
from vdsm_pin.verification.records import ArmVerification, Verification


def drawing_of(verification: Verification) -> Drawing:
    """How a motion that was judged is drawn."""
    if isinstance(verification, ArmVerification):
        return ArmDrawing(verification.problem, verification.trajectory)
    # Whoever draws an arm needs no robots.
    from vdsm_pin.report.robot_drawing import RobotDrawing
    from vdsm_pin.robots.judgement import RobotVerification

    assert isinstance(verification, RobotVerification)
    return RobotDrawing(verification.problem, verification.trajectory)
