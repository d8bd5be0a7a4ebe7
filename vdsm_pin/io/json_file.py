"""JSON files that are equal for equal content, and never hold NaN or infinity."""

import json
import math
from collections.abc import Mapping
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from vdsm_pin.io.atomic import write_text


def json_text(value: object, *, indent: int | None = 2) -> str:
    """Deterministic JSON: keys sorted, floats as short as they read back exactly.

    A number that is not finite becomes null, and the map around it says why under the
    same key with `_reason` appended.

    Args:
        value: Maps with text keys, sequences, arrays, numbers, text, paths, None.
        indent: Spaces per level, or None for one line.

    Returns:
        The text, ending in a line end.

    Raises:
        TypeError: If a value is of another kind.
        ValueError: If a reason would overwrite a key, or has no map to stand in.
    """
    reasons: list[str] = []
    plain = _plain(value, reasons)
    if reasons:
        message = f"a number is {reasons[0]} and no map around it can say so"
        raise ValueError(message)
    separators = (",", ": ") if indent is not None else (",", ":")
    return (
        json.dumps(
            plain,
            indent=indent,
            sort_keys=True,
            separators=separators,
            allow_nan=False,
            ensure_ascii=False,
        )
        + "\n"
    )


def write_json(path: str | Path, value: object) -> None:
    """Write deterministic JSON, whole or not at all.

    Raises:
        InvalidFile: If the file cannot be written.
    """
    write_text(path, json_text(value))


def _plain(value: object, reasons: list[str]) -> Any:
    """The value in JSON's own types; why numbers were left out goes to `reasons`."""
    match value:
        case None | bool() | int():
            return value
        case str():
            return str(value)
        case float():
            if math.isfinite(value):
                return float(value)
            reasons.append(
                "undefined" if math.isnan(value) else f"{value:+} (unbounded)"
            )
            return None
        case np.generic():
            return _plain(value.item(), reasons)
        case PurePath():
            return value.as_posix()
        case np.ndarray():
            return _plain(value.tolist(), reasons)
        case Mapping():
            return _plain_map(value)
        case list() | tuple():
            return [_plain(item, reasons) for item in value]
    message = f"cannot write {type(value).__name__} as JSON"
    raise TypeError(message)


def _plain_map(value: Mapping[Any, object]) -> dict[str, Any]:
    plain: dict[str, Any] = {}
    for key, item in value.items():
        if not isinstance(key, str):
            message = f"JSON key {key!r} is not text"
            raise TypeError(message)
        reasons: list[str] = []
        plain[str(key)] = _plain(item, reasons)
        if reasons:
            name = f"{key}_reason"
            if name in value:
                message = f"the reason for {key!r} would overwrite {name!r}"
                raise ValueError(message)
            plain[name] = "; ".join(dict.fromkeys(reasons))
    return plain
