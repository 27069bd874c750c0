"""Misreadings of the reference decoder: it is changed in one place, as a reader could err."""

import ast
import signal
from collections.abc import Callable

COMPARISONS = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
}
OPERATORS = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Add, ast.FloorDiv: ast.Mult,
    ast.RShift: ast.LShift, ast.BitXor: ast.BitOr, ast.BitAnd: ast.BitOr, ast.Mod: ast.FloorDiv,
}  # fmt: skip
SECONDS = 10
"""Of processor time after which a decoder that does not end counts as one that fails."""


class Misreading(ast.NodeTransformer):
    """Changes the place with a number, if there is one; counts the places."""

    def __init__(self, wanted: int) -> None:
        self.wanted, self.count, self.told = wanted, 0, ""
        self._name, self._statement, self._in_statement = "", ast.stmt(), 0

    def visit(self, node: ast.AST) -> ast.AST:
        """Visit a node; remember which function and which statement it stands in."""
        outside = self._name
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            self._name = node.name
        if isinstance(node, ast.stmt):
            self._statement, self._in_statement = node, 0
        visited: ast.AST = super().visit(node)
        self._name = outside
        return visited

    def _here(self, node: ast.AST, what: str) -> bool:
        self.count += 1
        self._in_statement += 1
        if self.count - 1 == self.wanted:
            line = ast.unparse(self._statement).splitlines()[0][:60]
            self.told = f"{self._name}: {line} / {self._in_statement} {ast.unparse(node)}: {what}"
            return True
        return False

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        """Change a number by one."""
        if type(node.value) is int and self._here(node, "one more"):
            return ast.Constant(node.value + 1)
        return node

    def visit_Compare(self, node: ast.Compare) -> ast.AST:
        """Move a comparison's border, or negate it."""
        self.generic_visit(node)
        other = COMPARISONS.get(type(node.ops[0]))
        if other is not None and self._here(node, other.__name__):
            node.ops[0] = other()
        return node

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        """Take another operation."""
        self.generic_visit(node)
        other = OPERATORS.get(type(node.op))
        if other is not None and self._here(node, other.__name__):
            node.op = other()
        return node

    def visit_Call(self, node: ast.Call) -> ast.AST:
        """Take the greater instead of the less."""
        self.generic_visit(node)
        swap = {"min": "max", "max": "min"}
        if isinstance(node.func, ast.Name) and node.func.id in swap and self._here(node, "swap"):
            node.func.id = swap[node.func.id]
        return node


def ends(passes: Callable[[], bool], seconds: float = SECONDS) -> bool:
    """Return whether a decoder gives all vectors within some time."""

    def late(*_: object) -> None:
        raise TimeoutError

    signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        return passes()
    except TimeoutError:
        return False
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
