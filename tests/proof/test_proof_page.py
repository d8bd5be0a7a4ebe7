"""The example of docs/proof.md runs."""

import re
from pathlib import Path

PAGE = Path(__file__).parents[2] / "docs" / "proof.md"


def test_the_example_holds() -> None:
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    assert len(blocks) == 1
    exec(blocks[0], {})
