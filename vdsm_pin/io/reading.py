"""What the parts of a problem file are converted with."""

from collections.abc import Sized
from dataclasses import dataclass
from pathlib import Path

from vdsm_pin.errors import InvalidFile
from vdsm_pin.io.frames import Frame
from vdsm_pin.io.source import Digest
from vdsm_pin.io.yaml_reader import Location, YamlDocument
from vdsm_pin.tolerances import TOLERANCES


@dataclass(frozen=True)
class Reading:
    """The file that is read.

    Args:
        document: The file, for messages.
        frame: Its unit and base.
        folder: Where relative paths start.
        digest: Gets the bytes of the files that it names, in their order.
    """

    document: YamlDocument
    frame: Frame
    folder: Path
    digest: Digest

    def invalid(self, at: Location, problem: str) -> InvalidFile:
        """The error that names a value by its field and line."""
        return self.document.invalid(at, problem)

    def check_count(self, at: Location, rows: Sized, count: int, each: str) -> None:
        """Refuse a list of another length.

        Raises:
            InvalidFile: If it has other than `count` rows, such as `values, one per
                link`.
        """
        if len(rows) != count:
            noun, _, what = each.partition(", ")
            problem = f"has {len(rows)} {noun}, expected {count}, {what}"
            raise self.invalid(at, problem)

    def check_extent(self, at: Location, reach: float, what: str, origin: str) -> None:
        """Distances are exact to a stated bound only within a stated extent.

        Args:
            at: The value.
            reach: How far it goes; [m].
            what: What is said of that before the length.
            origin: From where.

        Raises:
            InvalidFile: If that is too far.
        """
        limit = TOLERANCES.scene_extent
        if not reach <= limit:
            far, most = self.frame.shown(reach), self.frame.shown(limit)
            problem = f"{what} {far} from {origin}, expected at most {most}"
            raise self.invalid(at, problem)
