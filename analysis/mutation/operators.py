"""What is changed in an expression or a statement, and what to."""

import ast
import copy
from collections.abc import Iterator
from typing import Final

COMPARISONS: Final[dict[type, tuple[type, ...]]] = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
}
OPERATORS: Final[dict[type, tuple[type, ...]]] = {
    ast.Add: (ast.Sub,),
    ast.Sub: (ast.Add,),
    ast.Mult: (ast.Div,),
    ast.Div: (ast.Mult,),
    ast.FloorDiv: (ast.Mult,),
    ast.Mod: (ast.Mult,),
    ast.Pow: (ast.Mult,),
    ast.BitAnd: (ast.BitOr,),
    ast.BitOr: (ast.BitAnd,),
}
NAMES: Final = {"min": "max", "max": "min", "all": "any", "any": "all"}
EITHER_WAY: Final = frozenset(
    "min max fmin fmax minimum maximum array_equal isinstance getattr suppress".split()
)
"""Calls that are the same, or none at all, with arguments in each other's place."""

LEFT_OUT: Final = (ast.Raise, ast.Break, ast.Continue, ast.AugAssign, ast.Delete)
"""Statements without which a module runs; calls, early returns and what is written to
places of objects besides."""


def swapped(node: ast.AST) -> Iterator[ast.AST]:
    """The same node with one thing in it changed."""
    if isinstance(node, ast.Compare):
        for k, operator in enumerate(node.ops):
            for other in COMPARISONS.get(type(operator), ()):
                changed = copy.deepcopy(node)
                changed.ops[k] = other()
                yield changed
    elif isinstance(node, ast.BinOp | ast.AugAssign):
        for other in OPERATORS.get(type(node.op), ()):
            changed = copy.deepcopy(node)
            changed.op = other()
            yield changed
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not):
        yield copy.deepcopy(node.operand)
    elif isinstance(node, ast.BoolOp):
        changed = copy.deepcopy(node)
        changed.op = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        yield changed
    elif isinstance(node, ast.Constant):
        for value in _other_values(node.value):
            yield ast.copy_location(ast.Constant(value), node)
    elif isinstance(node, ast.Call):
        yield from _other_calls(node)
    if _is_left_out(node):
        yield ast.Pass()


def _is_left_out(node: ast.AST) -> bool:
    """Whether a statement is left out by itself; a return only within another one."""
    if isinstance(node, ast.Assign):
        return isinstance(node.targets[0], ast.Subscript)
    called = isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)
    return called or isinstance(node, LEFT_OUT)


def by_place(tree: ast.Module) -> dict[int, ast.AST]:
    """What changes nodes for where they stand, by id: conditions and early returns."""
    found: dict[int, ast.AST] = {}
    for node in ast.walk(tree):
        tests = node.ifs if isinstance(node, ast.comprehension) else []
        if isinstance(node, ast.If | ast.While | ast.IfExp):
            tests = [node.test]
        for test in tests:
            if not isinstance(test, ast.Compare | ast.BoolOp | ast.UnaryOp):
                found[id(test)] = ast.UnaryOp(ast.Not(), copy.deepcopy(test))
        if isinstance(node, ast.FunctionDef):
            inner = (n for s in node.body
                     if not isinstance(s, ast.Return | ast.FunctionDef)
                     for n in ast.walk(s) if isinstance(n, ast.Return))  # fmt: skip
            found |= {id(early): ast.Pass() for early in inner}
    return found


def _other_values(value: object) -> tuple[object, ...]:
    if isinstance(value, bool):
        return (not value,)
    if isinstance(value, int):
        return (value + 1,)
    if isinstance(value, float):
        return (2.0 * value,) if value else (1.0,)
    return ()


def _other_calls(node: ast.Call) -> Iterator[ast.AST]:
    called = node.func
    name = called.id if isinstance(called, ast.Name) else getattr(called, "attr", "")
    if name in NAMES:
        changed = copy.deepcopy(node)
        if isinstance(changed.func, ast.Name):
            changed.func.id = NAMES[name]
        elif isinstance(changed.func, ast.Attribute):
            changed.func.attr = NAMES[name]
        yield changed
    same = name in EITHER_WAY or (name == "clip" and len(node.args) == 3)
    if len(node.args) > 1 and not same:
        first, second = node.args[:2]
        if not isinstance(first, ast.Starred) and not isinstance(second, ast.Starred):
            changed = copy.deepcopy(node)
            changed.args[:2] = changed.args[1::-1]
            yield changed
