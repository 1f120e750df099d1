"""Pairs of statements of alike branches -> C statements over the type ``both`` of eomgen_real.h."""

from __future__ import annotations

from functools import partial

from .c_text import BlockPrinter, Printed, print_block
from .program import Block, Program
from .statements import CIRCULAR, Operand, Pairs, Pieces, PrintedFunction, find_pairs

NONE = Pairs({}, {}, {})
FORMS = {"add": "both_plus", "sub": "both_minus", "mul": "both_times", "div": "both_over", "neg": "both_negated"}


class BranchPrinter(BlockPrinter):
    """Prints statements of pairs as one, the others as they are."""

    def __init__(self, program: Program, references: dict[int, str], pieces: Pieces) -> None:
        super().__init__(program, references, pieces)
        pairs = pieces.pairs or NONE
        self._second, self._sign, self._operands = pairs.second, pairs.sign, pairs.operands
        self._first = {b: a for a, b in pairs.second.items()}
        self._both: dict[Operand, str] = {}  #: vectors of this piece
        self._count = 0
        self._alone: set[int] = set()  #: elements that have a variable of their own in this piece

    def lines(self, piece: PrintedFunction) -> list[str]:
        self._both, self._alone = {}, set()
        return super().lines(piece)

    def _new(self, key: Operand, text: str, result: list[str]) -> str:
        name = self._both[key] = f"b{self._count}"
        self._count += 1
        result.append(f"const both {name} = {text};")
        return name

    def _own(self, a: int) -> Operand:
        return (a, self._second[a], self._sign[a])

    def _vector(self, operand: Operand, piece: PrintedFunction, loaded: set[int], result: list[str]) -> str:
        """The name of a vector of two operands, or two numbers."""
        x, y, sign = operand
        if self._nodes[x][0] == "const":
            return f"both_of({self._nodes[x][1]!r}, {sign * self._nodes[y][1]!r})"
        if operand in self._both:
            return self._both[operand]
        if x in self._second:
            own = self._own(x)
            if own not in self._both:
                self._new(own, f"both_at(w + {piece.loads[x]})", result)
            return self._both[own] if own == operand else self._new(operand, f"both_turned({self._both[own]})", result)
        for k in (x, y):
            self._read(k, piece, loaded, result)
        minus = "-" if sign < 0 else ""
        return self._new(operand, f"both_of({self.real(x)}, {minus}{self.real(y)})", result)

    def _read(self, i: int, piece: PrintedFunction, loaded: set[int], result: list[str]) -> None:
        a = self._first.get(i, i)
        if a not in self._second:
            super()._read(i, piece, loaded, result)
        elif i not in self._alone:
            self._alone.add(i)
            self._name_waiting(result)
            minus = "-" if i != a and self._sign[a] < 0 else ""
            if self._own(a) in self._both:
                text = f"{'first' if i == a else 'second'}_of({self._both[self._own(a)]})"
            else:
                text = f"w[{piece.loads[i]}]"
            result.append(f"const real {self._name(i)} = {minus}{text};")

    def _statement(self, i: int, piece: PrintedFunction, loaded: set[int], result: list[str]) -> None:
        if i in self._first:
            return  # printed with the first
        if i not in self._second:
            super()._statement(i, piece, loaded, result)
            return
        self._name_waiting(result)
        kind = self._nodes[i][0]
        b = self._second[i]
        if kind in CIRCULAR:
            name = self._new(self._own(i), self._circular(kind, *self._operands[i][0][:2]), result)
        else:
            texts = [self._vector(operand, piece, loaded, result) for operand in self._operands[i]]
            name = self._new(self._own(i), f"{FORMS[kind]}({', '.join(texts)})", result)
        minus = "-" if self._sign[i] < 0 else ""
        for k, text in ((i, f"first_of({name})"), (b, f"{minus}second_of({name})")):
            if k in piece.checks:
                self._read(k, piece, loaded, result)
                result.append(f"EOMGEN_REJECT({self.failed(k, piece)})")
            if k in piece.results:
                result += [f"out[{at}] = {text};" for at in piece.results[k]]
        if i in piece.stores:
            result.append(f"both_put(w + {piece.stores[i]}, {name});")

    def _circular(self, kind: str, x: int, y: int) -> str:
        name, at, to = "sines" if kind == "sin" else "cosines", self._angles[x], self._angles[y]
        return f"both_at({name} + {at})" if to == at + 1 else f"both_of({name}[{at}], {name}[{to}])"


def print_block_of_branches(program: Program, block: Block) -> Printed:
    """The C functions of a block, with vectors where that takes clearly fewer instructions."""
    return print_block(program, block, BranchPrinter, partial(find_pairs, program))
