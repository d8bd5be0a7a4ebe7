"""HRM-1000 stays as it is, byte for byte."""

import hashlib
from pathlib import Path

import pytest

from benchmarks.hrm1000.families import FAMILIES
from benchmarks.hrm1000.generate import generate

FIRST_FIVE = {
    "prismatic_x": "e3f451f1310aef5e",
    "crossing": "5b0cec4d0a35b6d4",
    "clutter": "6f295c7f765c4a31",
    "wall": "dba68bede7d09902",
    "pipe": "1d435237e2372af4",
    "shelf": "a4d18f58fb2c7d94",
    "mesh": "8de1ffe69c50a915",
    "narrow": "3639ddec8af67991",
    "infeasible": "ac3b82d184e20c2b",
}
"""SHA-256 of the first five problems of each family, as they were published."""


@pytest.mark.parametrize("family", FAMILIES)
def test_published_problems_stay_byte_for_byte(family: str, tmp_path: Path) -> None:
    for number in range(5):
        generate(tmp_path, family, number)
    digest = hashlib.sha256()
    for path in sorted(tmp_path.iterdir()):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    assert digest.hexdigest()[:16] == FIRST_FIVE[family]
