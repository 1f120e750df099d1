"""A straight-line block -> C99 functions in static single assignment.

Every operation means what :mod:`eomgen.expr.evaluate` makes of it, NaN included.  The text is written over the type
``real`` of eomgen_real.h, so that it serves for one state and for several side by side (lanes).  A value that is used
once stands in the expression that uses it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from ..base.operations import ARITHMETIC, CONDITION, OPERATIONS, Operation, operations_with
from ..expr.core import Expr, Node, reachable
from ..expr.texts import comment_text
from .c_functions import each_definition, each_name
from .c_layout import places_again
from .pair_sums import CopiedRun, PairLists, copied_runs
from .program import Block, Program
from .statements import CIRCULAR, FindPairs, Pieces, PrintedFunction, cut, gather_angles, print_angles, references

#: Characters of an expression at most.
LONGEST = 88
#: How tightly an operation binds its operands in C; all others are calls.
BINDING = {"add": 1, "sub": 1, "mul": 2, "div": 2, "neg": 3}
CALL = 4
#: A row of at least so many zero results is filled by a loop.
FILLED = 12
NOWHERE: Mapping[str, str] = MappingProxyType({})  #: where no sum over pairs keeps anything


def literal(value: float) -> str:
    """A number as a C expression that reads back exactly."""
    text = repr(value)
    return f"({text})" if text.startswith("-") else text


class BlockPrinter:
    """Prints the statements of one block; variables are numbered through all its pieces."""

    def __init__(self, program: Program, references: dict[int, str], pieces: Pieces) -> None:
        every = (i for piece in pieces.pieces for i in piece.statements)
        self.lists = PairLists(program.graph, every, pieces.work)
        self.pairs = pieces.pairs
        self._graph, self._nodes, self._calls = program.graph, program.graph.nodes, program.graph.calls
        self.zero = program.graph.zero.id
        self._angles: dict[int, int] = {}  #: angles whose sin and cos are there -> their places
        self._fixed = references
        self._beside_numbers = operations_with(lambda row: row.takes_numbers)
        self._variables: dict[int, str] = {}
        self._uses: Counter[int] = Counter()  #: by statements of this piece; two by one that takes names alone
        self._waiting: dict[int, tuple[str, int]] = {}  #: expressions without a name, in order, and how they bind
        self.named: frozenset[int] = frozenset()  #: statements that have a name in any case
        self.labels: Mapping[object, str] = {}  #: what results are, by place

    def _name(self, i: int) -> str:
        if i not in self._variables:
            self._variables[i] = f"v{len(self._variables)}"
        return self._variables[i]

    def operand(self, i: int) -> str:
        fixed = self._fixed.get(i)
        if fixed is not None:
            return fixed
        node = self._nodes[i]
        return literal(node[1]) if node[0] == "const" else self._name(i)

    def real(self, i: int) -> str:
        """An operand as a ``real`` even if it is a number."""
        node = self._nodes[i]
        return f"same({self.operand(i)})" if node[0] == "const" else self.operand(i)

    def operands(self, node: Node) -> list[str]:
        """The operands of an operation; beside a value, arithmetic takes a number as it is."""
        if node[0] in self._beside_numbers and not all(self._nodes[k][0] == "const" for k in node[1:]):
            return [self.operand(k) for k in node[1:]]
        return [self.real(k) for k in node[1:]]

    def condition(self, i: int, piece: PrintedFunction) -> str:
        if i in piece.inlined:
            node = self._nodes[i]
            return OPERATIONS[node[0]].c.format(*self.operands(node))
        return f"({self.real(i)} != 0.0)"

    def failed(self, i: int, piece: PrintedFunction | None) -> str:
        """The text of a check that is not passed; NaN passes, and is found in the result."""
        node = self._nodes[i]
        if piece is not None and i in piece.inlined and node[0] == "lt":
            return "{} >= {}".format(*self.operands(node))
        return f"{self.real(i)} <= 0.0"

    def _value(self, i: int, piece: PrintedFunction) -> str:
        node = self._nodes[i]
        kind = node[0]
        if self.lists.call(i) is not None:
            return f"w[{self.lists.place(i)}]"
        if kind in self._calls:
            function, orders = self._calls[kind]
            return f"{each_name(function.name, orders)}({', '.join(map(self.real, node[1:]))})"
        if kind in CIRCULAR and node[1] in self._angles:
            return f"{'sines' if kind == 'sin' else 'cosines'}[{self._angles[node[1]]}]"
        row = OPERATIONS[kind]
        if row.kind != ARITHMETIC and row.chooses:
            return row.c.format(self.condition(node[1], piece), *map(self.real, node[2:]))
        text = row.c.format(*self.operands(node))
        return f"choose({text}, same(1.0), same(0.0))" if row.kind == CONDITION else text

    def lines(self, piece: PrintedFunction) -> list[str]:
        result: list[str] = []
        loaded: set[int] = set()
        angles = gather_angles(piece.statements, self._nodes.__getitem__, self.pairs)
        self._angles = {}
        self._uses = self._count_uses(piece)
        first = frozenset(angles.first)
        for i in angles.first:
            self._statement(i, piece, loaded, result)
        if angles.arguments:
            for i in angles.arguments:
                self._read(i, piece, loaded, result)
            self._name_waiting(result)
            result += print_angles([self.real(i) for i in angles.arguments])
            self._angles = {i: k for k, i in enumerate(angles.arguments)}
        for i in piece.statements:
            if i not in first:
                self._statement(i, piece, loaded, result)
        self._name_waiting(result)
        return result

    def _count_uses(self, piece: PrintedFunction) -> Counter[int]:
        """How often statements use each value; one that is used as a name counts twice."""
        paired = () if self.pairs is None else (*self.pairs.second, *self.pairs.second.values())
        by_name, uses = {*piece.inlined, *paired}, Counter[int]()
        for i in piece.statements:
            nests = self._nodes[i][0] in BINDING and i not in by_name
            uses.update(k for k in self._nodes[i][1:] for _ in range(1 if nests else 2))
        uses.update(k for i in (*piece.results, *piece.stores, *piece.checks, *paired, *self.named) for k in (i, i))
        return uses

    def _nested(self, i: int) -> str:
        """The expression of an operation around those that wait for it; empty where none does, or it is too long."""
        kind, *operands = self._nodes[i]
        if kind not in BINDING or self._waiting.keys().isdisjoint(operands):
            return ""
        texts = []
        for place, k in enumerate(operands):
            text, binding = self._waiting.get(k) or (self.operand(k), CALL)
            least = CALL if kind == "neg" or (place and binding == BINDING["neg"]) else BINDING[kind] + place
            texts.append(text if binding >= least else f"({text})")
        text = OPERATIONS[kind].c.format(*texts)
        if len(text) > LONGEST:
            return ""
        for k in operands:
            self._waiting.pop(k, None)
        return text

    def _name_waiting(self, result: list[str], operands: Sequence[int] | None = None) -> None:
        """Give expressions that wait a name: all, or those among the operands of a statement."""
        for i in list(self._waiting) if operands is None else [k for k in operands if k in self._waiting]:
            result.append(f"const real {self._name(i)} = {self._waiting.pop(i)[0]};")

    def _statement(self, i: int, piece: PrintedFunction, loaded: set[int], result: list[str]) -> None:
        self._load(i, piece, loaded, result)
        if self.lists.is_list(i):
            self._name_waiting(result)
            result += self.lists.lines(i, [f"w[{place}] = {self.real(x)};" for place, x in self.lists.fills(i)])
            return
        if i not in piece.inlined:
            text = self._nested(i)
            if not text:
                self._name_waiting(result, self._nodes[i][1:])
                text = self._value(i, piece)
            if self._uses[i] == 1 and self.lists.call(i) is None:
                self._waiting[i] = (text, BINDING.get(self._nodes[i][0], CALL))
                return
            places = piece.results.get(i, ())
            if places and self._uses[i] == 2:  # by the result alone
                result.append(self.result(places, text))
                return
            result.append(f"const real {self._name(i)} = {text};")
            if places:
                result.append(self.result(places, self._name(i)))
        if i in piece.checks:
            self._name_waiting(result)
            result.append(f"EOMGEN_REJECT({self.failed(i, piece)})")
        if i in piece.stores:
            result.append(f"w[{piece.stores[i]}] = {self._name(i)};")

    def result(self, places: Sequence[object], value: str) -> str:
        """The statement that sets a result, with what it is."""
        labels = ", ".join(self.labels[k] for k in places if k in self.labels)
        return "".join(f"out[{k}] = " for k in places) + f"{value};" + (f" /* {labels} */" if labels else "")

    def _load(self, i: int, piece: PrintedFunction, loaded: set[int], result: list[str]) -> None:
        """Read values of earlier pieces just before their first use."""
        for k in self._nodes[i][1:]:
            if k in piece.inlined:
                self._load(k, piece, loaded, result)
            else:
                self._read(k, piece, loaded, result)

    def _read(self, i: int, piece: PrintedFunction, loaded: set[int], result: list[str]) -> None:
        """Read a value of an earlier piece, if it is one."""
        if i not in piece.loads or i in loaded or self.lists.is_list(i):
            return
        loaded.add(i)
        if self._uses[i] == 1:
            self._waiting[i] = (f"w[{piece.loads[i]}]", CALL)
        else:
            self._name_waiting(result)
            result.append(f"const real {self._name(i)} = w[{piece.loads[i]}];")


def function_text(head: str, lines: Sequence[str]) -> str:
    """A C function of the arguments of all blocks."""
    text = "".join(f"    {line}\n" for line in lines)
    return f"{head}(EOMGEN_ARGUMENTS)\n{{\n    EOMGEN_BEGIN\n{text}    EOMGEN_RETURN\n}}\n"


class Printed(NamedTuple):
    """The C text of one straight-line function: the pieces it calls, if it is long, without their linkage."""

    text: str
    pieces: tuple[tuple[str, str], ...]  #: name and text of each
    work: int  #: doubles of work needed
    in_pairs: bool = False  #: whether statements of alike branches are vectors, so that the text has no lanes


def with_pieces(printed: Iterable[Printed]) -> list[str]:
    """The functions of one file, each behind its pieces."""
    return [text for p in printed for text in (*(f"static EOMGEN_APART {piece}" for _, piece in p.pieces), p.text)]


def print_block(
    program: Program, block: Block, printing: type[BlockPrinter] = BlockPrinter, find: FindPairs | None = None
) -> Printed:
    """The C functions of a block, ``<name>_block`` and its pieces; ``find`` is that of :func:`~.statements.cut`."""
    graph, outputs = program.graph, list(block.outputs)
    runs = copied_runs(graph, outputs)
    for run in runs:
        outputs[run.first : run.first + run.length] = [graph.zero] * run.length
    lists = [Expr(graph, made) for made in dict.fromkeys(run.made for run in runs)]
    pieces = cut(
        graph, outputs, block.checks, program.made_before(block), program.limits.statements, lists, find, block.guards
    )
    texts = references(program, block)
    again, labels = places_again(program, block), _label_results(program, block.name)
    return print_pieces(program, f"{block.name}_block", pieces, texts, runs, again, printing, labels)


def _label_results(program: Program, block: str) -> dict[object, str]:
    """What results of a block are, by their places: names of velocities, constraints, outputs and bodies."""
    facts, v, rows = program.metadata, program.velocities, program.metadata.get("constraint_labels", ())
    rates = [f"rate of {name}" for name in (*program.coordinates, *v)]
    known: dict[str, Sequence[str]] = {
        **dict.fromkeys(("bias", "inverse_dynamics"), v),
        **dict.fromkeys(("constraints", "velocity_constraints"), rows),
        **dict.fromkeys(("dynamics", "short_dynamics"), (*v, *rates[len(program.coordinates) :])),
        **dict.fromkeys(("outputs", "motion_outputs", "accelerated_outputs"), facts.get("y_names", ())),
        "position": rows[: program.sizes.n_h],
        "energy": ("kinetic", "potential"),
        "rhs": rates,
    }
    if block == "poses":
        return {16 * k: comment_text(name) for k, name in enumerate(facts.get("body_names", ()))}
    return {k: comment_text(name) for k, name in enumerate(known.get(block, ()))}


def print_pieces(
    program: Program,
    name: str,
    pieces: Pieces,
    texts: dict[int, str],
    runs: Sequence[CopiedRun] = (),
    again: Mapping[str, str] = NOWHERE,
    printing: type[BlockPrinter] = BlockPrinter,
    labels: Mapping[object, str] = MappingProxyType({}),
) -> Printed:
    """Print cut statements as one function, or as several and one that calls them.

    ``runs`` are copied at the end; ``again`` is that of :class:`~.pair_sums.PairLists`; ``labels`` name results.
    """
    printer = printing(program, texts, pieces)
    printer.labels = labels
    printer.lists.again = again
    main = direct_results(printer, pieces) + [f"EOMGEN_REJECT({printer.failed(i, None)})" for i in pieces.checks]
    functions: list[tuple[str, str]] = []
    if len(pieces.pieces) == 1:
        main += printer.lines(pieces.pieces[0])
    else:
        for k, piece in enumerate(pieces.pieces):
            part = f"{program.name}_{name}_{k}"
            functions.append((part, function_text(f"flag {part}", printer.lines(piece))))
            main.append(f"EOMGEN_REJECT({part}(t, x, u, c, out, w))")
    main += printer.lists.copies(runs)
    text = function_text(f"static flag {name}", main)
    return Printed(text, tuple(functions), printer.lists.end, pieces.pairs is not None)


def direct_results(printer: BlockPrinter, pieces: Pieces) -> list[str]:
    """Results that need no statement; a long run of zeros is cleared at once, and later results overwrite."""
    zero, direct = printer.zero, pieces.direct
    zeros = [k for k, i in direct if i == zero]
    lines = []
    if len(zeros) >= FILLED:
        lines.append(f"memset(out + {zeros[0]}, 0, {zeros[-1] - zeros[0] + 1} * sizeof *out);")
        direct = tuple((k, i) for k, i in direct if i != zero)
    return lines + [printer.result([k], printer.real(i)) for k, i in direct]


def helper(row: Operation) -> str:
    """The definition that the C text of an operation needs, in every lane; empty where headers have it."""
    letters = "abc"[: row.arity]
    name = row.c.partition("(")[0]
    if row.body:
        arguments = ", ".join(f"real {x}" for x in letters)
        return f"EOMGEN_SHARED inline real {name}({arguments})\n{{\n    return {row.body};\n}}\n"
    if not name.startswith("each_"):
        return ""
    return f"EOMGEN_EACH({name}, {row.name})\n" if row.arity == 1 else each_definition(name, letters, row.name)


def used_helpers(program: Program, roots: Sequence[Expr]) -> list[str]:
    """Definitions of the helper functions that these expressions need."""
    nodes = program.graph.nodes
    operations = {nodes[i][0] for i in reachable(program.graph, (y.id for y in roots))}
    return [text for name, row in OPERATIONS.items() if name in operations and (text := helper(row))]
