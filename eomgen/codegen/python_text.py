"""A straight-line block -> Python functions of NumPy operations, for one state or k states at once.

Every operation means what :mod:`eomgen.expr.evaluate` makes of it on arrays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..base.operations import CONDITION, OPERATIONS
from ..contact.pairs import PairCall, PairFunction, PairPart, pair_call
from ..expr.core import symbols_of
from ..expr.differentiate import square_under_root
from ..expr.functions import Curve, Function, Surface
from .program import Block, Program
from .statements import Pieces, PrintedFunction, cut, references


class _NumpyPrinter:
    def __init__(self, program: Program, references: dict[int, str], traced: bool = False) -> None:
        self._traced = traced  #: the library differentiates the text itself
        self._graph, self._nodes, self._calls = program.graph, program.graph.nodes, program.graph.calls
        self._fixed = references
        self._variables: dict[int, str] = {}

    def _name(self, i: int) -> str:
        return self._variables.setdefault(i, f"v{len(self._variables)}")

    def operand(self, i: int) -> str:
        node = self._nodes[i]
        if node[0] == "const":
            text = repr(node[1])
            return f"({text})" if text.startswith("-") else text
        return self._fixed.get(i) or self._name(i)

    def condition(self, i: int, piece: PrintedFunction) -> str:
        if i in piece.inlined:
            node = self._nodes[i]
            return OPERATIONS[node[0]].numpy.format(*map(self.operand, node[1:]))
        return f"np.not_equal({self.operand(i)}, 0.0)"

    def check(self, i: int, piece: PrintedFunction | None) -> str:
        """What is noted of a check: whether it is passed, or in text for NumPy whether it fails, which NaN does not."""
        inlined = piece is not None and i in piece.inlined
        if not self._traced:
            node = self._nodes[i]
            if inlined and node[0] == "lt":
                return f"lost.append(np.greater_equal({', '.join(map(self.operand, node[1:]))}))"
            return f"lost.append(np.less_equal({self.operand(i)}, 0.0))"
        if inlined:
            assert piece is not None
            return f"good.append({self.condition(i, piece)})"
        return f"good.append(np.less(0.0, {self.operand(i)}))"

    def _value(self, i: int, piece: PrintedFunction) -> str:
        node = self._nodes[i]
        summed = pair_call(self._graph, node[0])
        if summed is not None:
            return _print_pair_node(summed, [self.operand(k) for k in node[1:]])
        if node[0] in self._calls:
            function, orders = self._calls[node[0]]
            return f"call_{function.name}({', '.join([*map(self.operand, node[1:]), *map(str, orders)])})"
        row = OPERATIONS[node[0]]
        if self._traced and square_under_root(self._graph, i):
            a, *b = map(self.operand, node[1:])
            if row.name == "hypot":
                a = f"{a} * {a} + {b[0]} * {b[0]}"
            root = f"lambda s: np.power(s, {b[0]})" if row.name == "pow" else "np.sqrt"
            return f"of_squares({a}, {root})"
        if row.chooses:
            return row.numpy.format(self.condition(node[1], piece), *map(self.operand, node[2:]))
        return row.numpy.format(*map(self.operand, node[1:])) + " * 1.0" * (row.kind == CONDITION)

    def lines(self, piece: PrintedFunction) -> list[str]:
        result = [f"{self._name(i)} = w[{slot}]" for i, slot in sorted(piece.loads.items(), key=lambda pair: pair[1])]
        for i in piece.statements:
            if i not in piece.inlined:
                result.append(f"{self._name(i)} = {self._value(i, piece)}")
            if i in piece.checks:
                result.append(self.check(i, piece))
            result += [f"out[{k}] = {self._name(i)}" for k in piece.results.get(i, ())]
            if i in piece.stores:
                result.append(f"w[{piece.stores[i]}] = {self._name(i)}")
        return result


def _print_pair_node(call: PairCall, operands: Sequence[str]) -> str:
    name = f"pairs_{call.function.name}"
    if call.part == "given":
        return f"[{', '.join(operands)}]"
    if call.part == "sum":
        return f"{name}({operands[0]})"
    if call.part == "slope":
        return f"{name}.slope_along({operands[0]}, {call.numbers}, [{', '.join(operands[1:])}])"
    if call.part == "witnesses":
        return f"{name}.witnesses({operands[0]})"
    if call.part == "meeting":
        return f"{name}.meeting({operands[0]}, [{', '.join(operands[1:])}])"
    return f"{operands[0]}[{call.numbers[0]}]"


def print_pair_sum(program: Program, function: PairFunction) -> str:
    """``pairs_<name>``, the loops over the pairs of a sum, after the functions of one pair."""
    texts, kinds = list[str](), list[str]()
    for kind in function.kinds:
        names = []
        parts: list[tuple[PairPart, str]] = [("outputs", ""), ("slopes", "_slope")]
        parts += [("touch", "_touch"), ("witness", "_witness")]
        for part, ending in parts:
            name = f"_pairs_{function.name}_{kind.name}{ending}"
            outputs = kind.expressions(part)
            graph = outputs[0].graph
            places = {graph.symbol(symbol).id: f"x[{k}]" for k, symbol in enumerate(kind.symbols)}
            pieces = cut(graph, outputs, (), frozenset(), program.limits.statements)
            printer = _NumpyPrinter(replace(program, graph=graph), places)
            start = ["t = u = c = None", f"out = [0.0] * {len(outputs)}"]
            text = _print_pieces(printer, name, f"A pair {kind.name}.", pieces, start, ["return out"], by_entry=True)
            texts.append(text.replace(f"def {name}(t, x, u, c):", f"def {name}(x):"))
            sloped = ", True" if part == "slopes" else ""
            if len(kind.corners) == 1:
                name = f"nearest({name}, {kind.corners[0]}{sloped})"
            names.append(f"facing({name}, {kind.corners!r}{sloped})" if len(kind.corners) > 1 else name)
        row = (kind.first, kind.second, kind.extent, kind.thin, kind.law)
        kinds.append(f"        ({', '.join([*map(repr, row), *names, *map(repr, kind.beside)])}),\n")
    tables = "".join(f"        {table!r},\n" for table in function.tables)
    listed = f"(\n{tables}    ),\n    (\n{''.join(kinds)}    ),"
    states = f"    {function.states},\n" if function.states else ""
    made = f"PairSum(\n    {function.bodies},\n    {listed}\n    {function.capacity},\n{states})"
    return "\n\n".join([*texts, f"pairs_{function.name} = {made}"])


def _function(name: str, arguments: str, doc: str, lines: Sequence[str]) -> str:
    body = "\n".join(f"    {line}" for line in [f'"""{doc}"""', *lines])
    return f"def {name}({arguments}):\n{body}\n"


def print_block(program: Program, block: Block, lists: bool = False) -> str:
    """The functions of a block, the last of them ``<name>(t, x, u, c)``.

    ``lists``: on lists of numbers of any library that has ``np``, the last is ``block_<name>(t, x, u, c)`` -> list;
    where there are checks the text calls ``checked(out, good)``.
    """
    known = program.made_before(block)
    pieces = cut(program.graph, block.outputs, block.checks, known, program.limits.statements)
    printer = _NumpyPrinter(program, references(program, block), traced=lists)
    start = [f"out = [0.0] * {block.n_out}" if lists else f"out = np.empty(({block.n_out}, *x.shape[1:]))"]
    if not lists and program.time in symbols_of((*block.outputs, *block.checks)):
        start.append("t = np.asarray(t, dtype=float)[()]")  # never a Python float, whose division by zero raises
    noted = "good" if lists else "lost"
    start += [f"{noted} = []"] if block.checks else []
    end = [f"return checked(out, {noted})" if block.checks else "return out"]
    ports = " ".join(port.name for port in block.ports)
    doc = f"[{ports}] -> {block.n_out} values" if lists else f"[{ports}] -> ({block.n_out}, ...)"
    return _print_pieces(printer, "block_" * lists + block.name, doc, pieces, start, end, by_entry=lists)


def print_table(function: Function, curve: str, surface: str) -> str:
    """``call_<name>``, a table of the model, as these two make it."""
    table, head = function.evaluator, f"call_{function.name}"
    if isinstance(table, Curve):
        return f"{head} = {curve}({table.knots.tolist()}, {table.coefficients.tolist()}, {table.period!r})"
    assert isinstance(table, Surface)
    nodes = table.nodes.reshape(-1, 4).tolist()
    return f"{head} = {surface}({table.x.tolist()}, {table.y.tolist()}, {nodes}, {table.slope!r})"


def _print_pieces(
    printer: _NumpyPrinter,
    name: str,
    doc: str,
    pieces: Pieces,
    start: Sequence[str],
    end: Sequence[str],
    by_entry: bool = False,
) -> str:
    main = [*start, *_direct(printer, pieces, by_entry)]
    main += [printer.check(i, None) for i in pieces.checks]
    functions = []
    if len(pieces.pieces) == 1:
        main += printer.lines(pieces.pieces[0])
    elif pieces.pieces:
        good = next((f", {line[:4]}" for line in start if line in ("good = []", "lost = []")), "")
        main.append(f"w = [None] * {pieces.work}")
        for k, piece in enumerate(pieces.pieces):
            arguments = f"t, x, u, c, out, w{good}"
            functions.append(_function(f"_{name}_{k}", arguments, f"Part {k} of {name}.", printer.lines(piece)))
            main.append(f"_{name}_{k}({arguments})")
    functions.append(_function(name, "t, x, u, c", doc, [*main, *end]))
    return "\n\n".join(functions)


def _direct(printer: _NumpyPrinter, pieces: Pieces, by_entry: bool) -> list[str]:
    """Results that need no statement; entries of lists are 0.0 from the beginning."""
    texts = [(k, printer.operand(i)) for k, i in pieces.direct]
    lines = [f"out[{k}] = {text}" for k, text in texts if text != "0.0"]
    if by_entry:
        return lines
    return ["out[...] = 0.0", *lines] if len(lines) < len(texts) else lines
