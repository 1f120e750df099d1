"""Stage emit: a straight-line block -> C99 functions in static single assignment.

Every operation means what :mod:`eomgen.graph.evaluate` makes of it, NaN included.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ..graph.core import Expr
from ..graph.traverse import reachable
from ..program import Block, Program
from .c_functions import c_name
from .straight import CONDITIONS, Piece, Pieces, cut, references

PATTERNS: dict[str, str] = {
    "add": "{} + {}",
    "sub": "{} - {}",
    "mul": "{}*{}",
    "div": "{}/{}",
    "neg": "-{}",
    "pow": "pow({}, {})",
    "atan2": "atan2({}, {})",
    "abs": "fabs({})",
    "sign": "sign_of({})",
    "min": "smaller({}, {})",
    "max": "larger({}, {})",
    **{name: f"{name}({{}})" for name in
       ("sqrt", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh")},
}  # fmt: skip

CONDITION_PATTERNS: dict[str, str] = {
    "lt": "{} < {}",
    "le": "{} <= {}",
    "eq": "{} == {}",
    "not": "{} == 0.0",
    "and": "{} != 0.0 && {} != 0.0",
    "or": "{} != 0.0 || {} != 0.0",
}

#: operation -> definition it needs; NaN wins in smaller and larger, as in numpy.minimum.
HELPERS: dict[str, str] = {
    "sign": "static inline double sign_of(double a)\n"
    "{\n    return a > 0.0 ? 1.0 : a < 0.0 ? -1.0 : a == 0.0 ? 0.0 : a;\n}\n",
    "min": "static inline double smaller(double a, double b)\n{\n    return a <= b || a != a ? a : b;\n}\n",
    "max": "static inline double larger(double a, double b)\n{\n    return a >= b || a != a ? a : b;\n}\n",
}

SIGNATURE = (
    "double t, const double *restrict x, const double *restrict u,\n"
    "    const double *restrict c, double *restrict out, double *restrict w"
)
ARGUMENTS = ("t", "x", "u", "c", "out", "w")
#: A row of at least so many zero results is filled by a loop.
FILLED = 12


def literal(value: float) -> str:
    """A number as a C expression that reads back exactly."""
    text = repr(value)
    return f"({text})" if text.startswith("-") else text


class _Printer:
    """Prints the statements of one block; variables are numbered through all its pieces."""

    def __init__(self, program: Program, references: dict[int, str]) -> None:
        self._nodes, self._calls, self._program = program.graph.nodes, program.graph.calls, program.name
        self._fixed = references
        self._variables: dict[int, str] = {}
        self.used: set[str] = set()  #: arguments read or written since last emptied

    def _name(self, i: int) -> str:
        if i not in self._variables:
            self._variables[i] = f"v{len(self._variables)}"
        return self._variables[i]

    def operand(self, i: int) -> str:
        fixed = self._fixed.get(i)
        if fixed is not None:
            self.used.add(fixed[0])
            return fixed
        node = self._nodes[i]
        return literal(node[1]) if node[0] == "const" else self._name(i)

    def condition(self, i: int, piece: Piece) -> str:
        if i in piece.inlined:
            node = self._nodes[i]
            return CONDITION_PATTERNS[node[0]].format(*map(self.operand, node[1:]))
        return f"{self.operand(i)} != 0.0"

    def failed(self, i: int, piece: Piece | None) -> str:
        """The text of a check that is not passed; NaN passes, and is found in the result."""
        node = self._nodes[i]
        if piece is not None and i in piece.inlined and node[0] == "lt":
            return f"{self.operand(node[1])} >= {self.operand(node[2])}"
        return f"{self.operand(i)} <= 0.0"

    def _value(self, i: int, piece: Piece) -> str:
        node = self._nodes[i]
        kind = node[0]
        if kind == "select":
            return f"{self.condition(node[1], piece)} ? {self.operand(node[2])} : {self.operand(node[3])}"
        if kind in CONDITIONS:
            return CONDITION_PATTERNS[kind].format(*map(self.operand, node[1:])) + " ? 1.0 : 0.0"
        if kind in self._calls:
            function, orders = self._calls[kind]
            return f"{c_name(self._program, function.name, orders)}({', '.join(map(self.operand, node[1:]))})"
        return PATTERNS[kind].format(*map(self.operand, node[1:]))

    def lines(self, piece: Piece) -> list[str]:
        result: list[str] = []
        loaded: set[int] = set()
        for i in piece.statements:
            if i not in piece.inlined:
                self._load(i, piece, loaded, result)
                result.append(f"const double {self._name(i)} = {self._value(i, piece)};")
            if i in piece.checks:
                if i in piece.inlined:
                    self._load(i, piece, loaded, result)
                result.append(f"if ({self.failed(i, piece)}) {{ return 2; }}")
            if i in piece.results:
                self.used.add("out")
                result += [f"out[{k}] = {self._name(i)};" for k in piece.results[i]]
            if i in piece.stores:
                self.used.add("w")
                result.append(f"w[{piece.stores[i]}] = {self._name(i)};")
        return result

    def _load(self, i: int, piece: Piece, loaded: set[int], result: list[str]) -> None:
        """Read values of earlier pieces just before their first use."""
        for k in self._nodes[i][1:]:
            if k in piece.inlined:
                self._load(k, piece, loaded, result)
            elif k in piece.loads and k not in loaded:
                loaded.add(k)
                self.used.add("w")
                result.append(f"const double {self._name(k)} = w[{piece.loads[k]}];")


def _function(head: str, used: set[str], lines: Sequence[str]) -> str:
    unused = [f"(void){a};" for a in ARGUMENTS if a not in used]
    text = "\n".join(f"    {line}" for line in ([" ".join(unused)] if unused else []) + list(lines))
    return f"{head}({SIGNATURE})\n{{\n{text}\n}}\n"


class Printed(NamedTuple):
    """The C text of one straight-line function: the pieces it calls, if it is long, without their linkage."""

    text: str
    pieces: tuple[tuple[str, str], ...]  #: name and text of each
    work: int  #: doubles of work needed


def print_block(program: Program, block: Block) -> Printed:
    """The C functions of a block, ``<name>_block`` and its pieces."""
    pieces = cut(program.graph, block.outputs, block.checks, program.parameter_only, program.limits.statements)
    return print_pieces(program, f"{block.name}_block", pieces, references(program, block.inputs))


def print_pieces(program: Program, name: str, pieces: Pieces, texts: dict[int, str]) -> Printed:
    """Print cut statements as one function, or as several and one that calls them."""
    printer = _Printer(program, texts)
    main = _direct(printer, pieces) + [f"if ({printer.failed(i, None)}) {{ return 2; }}" for i in pieces.checks]
    used = {*printer.used, *(["out"] if pieces.direct else [])}
    functions: list[tuple[str, str]] = []
    if len(pieces.pieces) == 1:
        main += printer.lines(pieces.pieces[0])
        used |= printer.used
    elif pieces.pieces:
        used = set(ARGUMENTS)
        for k, piece in enumerate(pieces.pieces):
            printer.used.clear()
            lines = printer.lines(piece)
            part = f"{program.name}_{name}_{k}"
            functions.append((part, _function(f"int {part}", printer.used, [*lines, "return 0;"])))
            main.append(f"if ({part}(t, x, u, c, out, w) != 0) {{ return 2; }}")
    return Printed(_function(f"static int {name}", used, [*main, "return 0;"]), tuple(functions), pieces.work)


def _direct(printer: _Printer, pieces: Pieces) -> list[str]:
    """Results that need no statement; a long run of zeros becomes a loop that later results overwrite."""
    texts = [(k, printer.operand(i)) for k, i in pieces.direct]
    zeros = [k for k, text in texts if text == "0.0"]
    lines = []
    if len(zeros) >= FILLED:
        lines.append(f"for (int i = {zeros[0]}; i <= {zeros[-1]}; i++) {{ out[i] = 0.0; }}")
        texts = [(k, text) for k, text in texts if text != "0.0"]
    return lines + [f"out[{k}] = {text};" for k, text in texts]


def print_precompute(program: Program) -> Printed:
    """``precompute_block``, which fills the hoisted constants; its work lies behind them."""
    graph = program.graph
    texts = {graph.symbol(name).id: f"x[{k}]" for k, name in enumerate(program.parameters)}
    pieces = cut(graph, program.hoisted, (), frozenset(), program.limits.statements)
    return print_pieces(program, "precompute_block", pieces, texts)


def used_helpers(program: Program, roots: Sequence[Expr]) -> list[str]:
    """Definitions of the helper functions that these expressions need."""
    nodes = program.graph.nodes
    operations = {nodes[i][0] for i in reachable(program.graph, (y.id for y in roots))}
    return [text for operation, text in HELPERS.items() if operation in operations]
