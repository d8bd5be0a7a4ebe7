"""XML of unknown origin."""

import xml.etree.ElementTree as ET
from pathlib import Path

from vdsm_pin.errors import InvalidFile


def read_xml(content: str | bytes, path: Path) -> ET.Element:
    """The root element of a document.

    Args:
        content: The document; bytes in the encoding that it states.
        path: Its file, for messages.

    Raises:
        InvalidFile: If it is no XML, or in an encoding that is not known.
    """
    try:
        return ET.fromstring(content)
    except (ET.ParseError, ValueError, LookupError) as error:
        problem = f"is not XML: {' '.join(str(error).split())[:100]}"
        raise InvalidFile(file=path, problem=problem) from None
