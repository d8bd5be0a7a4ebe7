"""The errors that a certificate states against those that a problem asks for."""

from collections.abc import Mapping, Sequence
from typing import Any

from vdsm_pin.certificate_checker.balls import claim, number
from vdsm_pin.problem.error_boxes import ErrorBox


def grown(
    stated: Any, asked: ErrorBox, joints: Mapping[str, Any], solids: Sequence[Any]
) -> list[float]:
    """How far the surface of each obstacle may be off; [m].

    Args:
        stated: The header's errors.
        asked: Those of the problem.
        joints: What that asks of joints, as a header would state it.
        solids: The obstacles.

    Raises:
        Rejected: If the errors stated are of other things than the problem's, or do
            not cover what it asks for.
    """
    least = {one.name: [asked.obstacle, 0.0] for one in solids}
    for off in asked.obstacles:
        shift, turn = least[off.name]
        least[off.name] = [max(shift, off.shift), max(turn, off.turn)]
    base = [asked.base, asked.base_turn]
    reject_less(stated, {**joints, "base": base, "obstacles": least})
    each = [(one, *stated["obstacles"][one.name]) for one in solids]
    return [shift + (turn * one.size() if turn else 0.0) for one, shift, turn in each]


def reject_less(stated: Any, asked: Any) -> None:
    """Reject numbers smaller than those asked for, and numbers of other things."""
    if isinstance(asked, list):
        stated, asked = (dict(enumerate(values)) for values in (stated, asked))
    if not isinstance(asked, dict):
        claim(number(stated) >= asked, "errors: less than the problem asks for")
        return
    same = isinstance(stated, dict) and stated.keys() == asked.keys()
    claim(same, f"errors: expected numbers of each of {[*asked]} alone")
    for key in asked:
        reject_less(stated[key], asked[key])
