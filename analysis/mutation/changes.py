"""One change in a module.

Of a comparison, a sign, an operator, a constant or a condition; two arguments in each
other's place; a statement left out: a raise, an early return, a call, an assignment.
"""

import ast
from collections import Counter
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from analysis.mutation.operators import by_place, swapped


@dataclass(frozen=True)
class Change:
    """One change.

    Args:
        module: Path from the root of the checkout.
        line: Its line, from 1.
        function: Dotted name of what it stands in; "" at the module's top.
        before: The changed expression as it is.
        after: The same, changed.
        content: The module with the change.
        lines: Where it has an effect: its own, the first of its statement; of what
            runs at import alone, the lines that use the name it gives a value.
        names: What it gives a value, where that runs at import.
        number: Which it is of those alike in its function, from 1.
    """

    module: str
    line: int
    function: str
    before: str
    after: str
    content: str
    lines: tuple[int, ...] = ()
    names: tuple[str, ...] = ()
    number: int = 1

    @property
    def key(self) -> str:
        """What stays the same when lines move."""
        which = f" (no. {self.number})" if self.number > 1 else ""
        return f"{self.module}:{self.function}: {self.before} -> {self.after}{which}"


class _Places(ast.NodeVisitor):
    """Finds the nodes that compute something, and the function each stands in."""

    def __init__(self) -> None:
        self.found: list[tuple[ast.AST, str]] = []
        self._within: list[str] = []
        self._left: set[ast.AST] = set()

    def visit(self, node: ast.AST) -> None:
        """Note a node and go on below it, where it is no annotation and no text."""
        if isinstance(node, ast.JoinedStr | ast.Import | ast.ImportFrom):
            return
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "zip":
            self._left |= {*node.keywords}  # strict: what is alike is known to be
        if isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "reshape":
            # The size left open is -1 or any other below 0.
            self._left |= {arg.operand for arg in node.args
                           if isinstance(arg, ast.UnaryOp)}  # fmt: skip
        if node in self._left:
            return
        self.found.append((node, ".".join(self._within)))
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            self._within.append(node.name)
            if isinstance(node, ast.FunctionDef):
                for default in (*node.args.defaults, *node.args.kw_defaults):
                    if default is not None:
                        self.visit(default)
            for child in node.body:
                self.visit(child)
            self._within.pop()
        elif isinstance(node, ast.AnnAssign):
            if node.value is not None:
                self.visit(node.value)
        elif isinstance(node, ast.Subscript):
            self.visit(node.value)
            self.visit(node.slice)
        else:
            self.generic_visit(node)


def changes(root: Path, module: str) -> list[Change]:
    """Every change of a module.

    Args:
        root: Of the checkout.
        module: Path from there.

    Returns:
        In the order of the source.
    """
    source = (root / module).read_text(encoding="utf-8")
    tree = ast.parse(source)
    effects, names, placed = _effects(tree), _names(tree), by_place(tree)
    places = _Places()
    places.visit(tree)
    found = []
    for node, function in places.found:
        if not hasattr(node, "lineno"):
            continue
        more = [placed[id(node)]] if id(node) in placed else []
        before = ast.unparse(node)
        for changed in [*swapped(node), *more]:
            after = ast.unparse(ast.fix_missing_locations(changed))
            if before == after:  # two arguments that are alike
                continue
            found.append(
                Change(
                    module=module,
                    line=node.lineno,
                    function=function,
                    before=before,
                    after=after,
                    content=_with(source, node, changed),
                    lines=effects.get(id(node), (node.lineno,)),
                    names=names.get(id(node), ()),
                )
            )
    return _numbered(found)


def _numbered(found: list[Change]) -> list[Change]:
    """Changes, those alike in one function told apart."""
    seen: Counter[str] = Counter()
    told = []
    for one in found:
        seen[one.key] += 1
        told.append(replace(one, number=seen[one.key]))
    return told


def _names(tree: ast.Module) -> dict[int, tuple[str, ...]]:
    """What each expression that runs at import gives a value, by the id of its node.

    Of a field's default it is the class.
    """
    found: dict[int, tuple[str, ...]] = {}
    for statement in tree.body:
        if isinstance(statement, ast.ClassDef):
            for field in statement.body:
                if isinstance(field, ast.Assign | ast.AnnAssign):
                    nodes = map(id, ast.walk(field))
                    found |= dict.fromkeys(nodes, (statement.name,))
        if isinstance(statement, ast.Assign | ast.AnnAssign):
            names = tuple(n.id for n in ast.walk(statement) if isinstance(n, ast.Name)
                          and isinstance(n.ctx, ast.Store))  # fmt: skip
            found |= dict.fromkeys(map(id, ast.walk(statement)), names)
    return found


@lru_cache(maxsize=4096)
def uses(path: Path, origin: str, names: tuple[str, ...]) -> tuple[int, ...]:
    """Lines of a module that use names which it imports from another one."""
    every = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    imported = {one.name for node in every if isinstance(node, ast.ImportFrom)
                and node.module == origin for one in node.names}  # fmt: skip
    wanted = imported.intersection(names)
    used = (n for n in every if isinstance(n, ast.Name) and n.id in wanted)
    return tuple(sorted({node.lineno for node in used}))


def _effects(tree: ast.Module) -> dict[int, tuple[int, ...]]:
    """Lines where each expression has an effect, by the id of its node."""
    users: dict[str, list[int]] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
            users.setdefault(node.id, []).append(node.lineno)
    found: dict[int, tuple[int, ...]] = {}
    for statement in ast.walk(tree):  # outer statements first: inner ones have the word
        if isinstance(statement, ast.stmt):
            for node in ast.walk(statement):
                if hasattr(node, "lineno"):
                    found[id(node)] = (node.lineno, statement.lineno)
    for statement in tree.body:
        if isinstance(statement, ast.ClassDef):  # what its methods run, too
            methods = [m for m in statement.body if isinstance(m, ast.FunctionDef)]
            within = [k for m in methods for k in
                      range(m.body[0].lineno, (m.end_lineno or 0) + 1)]  # fmt: skip
            users.setdefault(statement.name, []).extend(within)
    for statement in reversed(tree.body):  # what is made of a name is used later
        if isinstance(statement, ast.ClassDef):
            parts = [s for s in statement.body if not isinstance(s, ast.FunctionDef)]
            given: tuple[str, ...] = (statement.name,)
            used = [n for part in (*statement.bases, *parts) for n in ast.walk(part)]
        elif isinstance(statement, ast.Assign | ast.AnnAssign):
            used = [*ast.walk(statement)]
            given = tuple(n.id for n in used if isinstance(n, ast.Name)
                          and isinstance(n.ctx, ast.Store))  # fmt: skip
        else:
            continue
        lines = {line for name in given for line in users.get(name, [])}
        for node in used:
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
                users[node.id].extend(lines)
    for node_id, names in _names(tree).items():
        found[node_id] = tuple(line for name in names for line in users.get(name, []))
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef):
            within = range(function.body[0].lineno, (function.end_lineno or 0) + 1)
            for default in filter(
                None, [*function.args.defaults, *function.args.kw_defaults]
            ):
                found |= dict.fromkeys(map(id, ast.walk(default)), tuple(within))
    return found


def _with(source: str, node: ast.AST, changed: ast.AST) -> str:
    """The source with a node's text replaced; every other line keeps its number."""
    assert isinstance(node, ast.expr | ast.stmt)
    assert node.end_lineno is not None
    assert node.end_col_offset is not None
    lines = source.encode().split(b"\n")
    first, last = node.lineno - 1, node.end_lineno - 1
    head = lines[first][: node.col_offset]
    tail = lines[last][node.end_col_offset :]
    text = ast.unparse(changed)
    if isinstance(node, ast.expr):
        text = f"({text})"
    middle = head + text.encode() + tail
    # An expression of several lines stands in brackets, where blank lines are free.
    padding = [b""] * (last - first)
    return b"\n".join([*lines[:first], middle, *padding, *lines[last + 1 :]]).decode()
