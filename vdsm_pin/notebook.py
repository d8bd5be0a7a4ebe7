"""How results show themselves in a console and in a notebook."""

from collections.abc import Mapping
from html import escape
from types import MappingProxyType
from typing import Final

_KNOWN_AS: Final[Mapping[str, str]] = MappingProxyType({"PlanningProblem": "Problem"})
"""Classes that the package hands out by another name."""


def known_as(kind: type[object]) -> str:
    """The name by which `import vdsm_pin` has a class."""
    return _KNOWN_AS.get(kind.__name__, kind.__name__)


class Summarised:
    """A value whose `repr` and notebook view are a few lines, not its arrays."""

    def summary(self) -> tuple[tuple[str, str], ...]:
        """What a reader asks first: names and values in words."""
        raise NotImplementedError

    def __repr__(self) -> str:
        """The class, then a name and value a line."""
        rows = self.summary()
        width = max(len(name) for name, _ in rows)
        lines = (f"  {name.ljust(width)}  {value}" for name, value in rows)
        return "\n".join([known_as(type(self)), *lines])

    def _repr_html_(self) -> str:
        """The same as a table."""
        cells = (
            f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>"
            for name, value in self.summary()
        )
        return f"<table>{''.join(cells)}</table>"
