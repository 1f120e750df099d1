"""The straight-line functions of a model once more, for several states side by side (lanes).

The right-hand side of closed loops has lanes where it is made of straight-line blocks: lanes that need more, such as
pivoting, are left to the function of one state (eomgen_straight.h).

And their Taylor series.
"""

from __future__ import annotations

from collections.abc import Container, Mapping
from math import inf
from typing import Any, NamedTuple

from ..base.operations import CONDITION, OPERATIONS
from .c_text import Printed, helper, literal, used_helpers, with_pieces
from .files import render
from .program import BY_MOTIONS, BY_SYSTEM, Block, Program
from .series import MOST_ORDER, Series, Term, behind, make_series
from .statements import gather_angles, print_angles, references

#: Public functions that have lanes where they are straight-line code.
LANES = ("rhs", "mass_matrix", "bias", "inverse_dynamics", "energy", "outputs")
#: Likewise, in modules that are made of them alone: they are long, and few who have the others in batches want these.
DERIVATIVES = ("inverse_dynamics_derivatives",)

#: Width -> instructions it needs on x86-64 beyond those that every such processor has, and their name in
#: eomgen_calls.h.
WIDTHS: dict[int, tuple[tuple[str, ...], str]] = {
    2: ((), ""),
    4: (("avx2",), "EOMGEN_AVX2"),
    8: (("avx512f", "avx512vl", "avx512dq"), "EOMGEN_AVX512"),
}


#: Blocks of which the right-hand side of loops in lanes is made.
CLOSED = (*BY_SYSTEM, *BY_MOTIONS)


def loops_in_lanes(program: Program) -> bool:
    """Whether there are loops whose right-hand side has lanes."""
    driven = {name for d in program.drivers if d.name == "rhs" for name in d.blocks}
    return driven.issuperset(BY_SYSTEM) and not program.general_rates


def rhs_blocks(program: Program) -> list[str]:
    """Names of the blocks of the right-hand side in lanes; none if it has no lanes."""
    if loops_in_lanes(program):
        return [name for name in CLOSED if name in program.block_names]
    rhs = program.aliases.get("rhs", "rhs")
    return [rhs] if rhs in public_blocks(program) else []


def public_blocks(program: Program) -> set[str]:
    """Names of the blocks behind public functions that are straight-line code and have lanes."""
    made = {k.name for k in program.kernels}
    wanted = {program.aliases.get(name, name) for name in (*LANES, *(DERIVATIVES if made <= {*DERIVATIVES} else ()))}
    return wanted & {program.aliases.get(k.name, k.name) for k in program.kernels if isinstance(k, Block)}


def lane_blocks(program: Program) -> dict[str, Block]:
    """The blocks that have lanes, by name; those of the right-hand side first."""
    first = rhs_blocks(program)
    named = public_blocks(program).union(first)
    result = [b for b in program.blocks if b.name in named]
    return {b.name: b for b in sorted(result, key=lambda b: b.name not in first)}


def lane_kernels(program: Program) -> list[str]:
    """Names of the public functions that have lanes."""
    blocks, aliases, closed = public_blocks(program), program.aliases, loops_in_lanes(program)
    return [k.name for k in program.kernels if aliases.get(k.name, k.name) in blocks or (closed and k.name == "rhs")]


def lane_files(program: Program, context: Mapping[str, Any], printed: Mapping[str, Printed]) -> dict[str, str]:
    """The header with the text of the functions, and files for each width; none without such functions.

    A library that stands alone has no ensembles, which take their own ``rhs`` and series.
    """
    blocks, first = lane_blocks(program), rhs_blocks(program)
    if not blocks:
        return {}
    name = program.name
    roots = [y for b in blocks.values() for y in b.roots]
    inside = {
        **context,
        "helpers": [*used_helpers(program, roots), *context["declarations"]],
        "first": with_pieces(printed[b] for b in first),
        "others": with_pieces(printed[b] for b in blocks if b not in first),
        "closed": loops_in_lanes(program),
    }
    call = next((k["call"] for k in context["kernels"] if k["name"] == "rhs"), "")
    ensembles = bool(first) and not context["library"]
    files = {f"{name}_lanes.h": render("c/lanes.h.j2", inside)}
    for width, (tests, feature) in WIDTHS.items():
        values = {"name": name, "width": width, "tests": tests, "feature": feature, "contracted": ensembles}
        values["series"] = ensembles and program.metadata["series"]
        files[f"{name}_lanes{width}.c"] = render("c/lanes.c.j2", values)
        if ensembles:
            fused = {**values, "tests": (*tests, "fma") if tests else (), "call": call}
            files[f"{name}_contracted_lanes{width}.c"] = render("c/contracted.c.j2", {**fused, "series": False})
            if values["series"]:
                files[f"{name}_series_lanes{width}.c"] = render("c/contracted.c.j2", fused)
    return files


#: Doubles of one row of coefficients.  Sums by pairs may take one product too many: of a zero behind a reversed row.
ROW = MOST_ORDER + 2
#: Sums made in one loop: with more, their partial sums no longer fit in the registers.
TOGETHER = 14


def series_files(program: Program) -> dict[str, str]:
    """``<name>_series.h`` with the function over ``real``, and ``<name>_series.c``.

    Raises NoSeriesError (the program has none).
    """
    series = make_series(program)
    block = next(b for b in program.blocks if b.name == "rhs")
    printer = _SeriesPrinter(series, references(program, block))
    used = {t.kind for t in series.terms} & OPERATIONS.keys()
    used |= {"absorb"} if used & {"sqrt", "hypot"} else set()
    context = {
        "name": program.name,
        "n": len(series.rates),
        "first": printer.first(),
        "states": printer.states(),
        "sums": printer.sums(),
        "chain": printer.chain(),
        "rates": printer.rates(),
        "most": MOST_ORDER,
        "n_work": printer.rows * ROW,
        "kept": printer.kept,
        "widths": [(width, tests) for width, (tests, _) in sorted(WIDTHS.items(), reverse=True) if tests],
        "helpers": [text for k in sorted(used) if (text := helper(OPERATIONS[k]))],
    }
    return {f"{program.name}_series.{end}": render(f"c/series.{end}.j2", context) for end in ("h", "c")}


def _signed(parts: list[tuple[int, str]]) -> str:
    text = "".join(f" {'-' if sign < 0 else '+'} {part}" for sign, part in parts)
    return text.removeprefix(" + ") if text.startswith(" + ") else f"-{text[3:]}"


class _Factor(NamedTuple):
    """A number times values by name that stay the same in all orders."""

    number: float = 1.0
    names: tuple[str, ...] = ()

    def __mul__(self, other: _Factor) -> _Factor:  # type: ignore[override]
        return _Factor(self.number * other.number, tuple(sorted(self.names + other.names)))


class _SeriesPrinter:
    """Statements of the order 0 and of order k; ``a3`` is the value of term 3, ``b3`` its coefficient of order k."""

    def __init__(self, series: Series, texts: dict[int, str]) -> None:
        self._series, self._terms, self._texts = series, series.terms, texts
        self._places: dict[tuple[str, int], int] = {}  #: forward, weighted or reversed row of a term -> its place
        self._pairs: dict[tuple[tuple[str, int], int], str] = {}  #: rows multiplied -> name of the sum
        self._depth: dict[int, int] = {}  #: how many operations a coefficient waits for
        self.kept: list[str] = []  #: statements before the orders: reciprocals and factors
        self._shared: set[int] = set()  #: terms whose row serves several multiples of them
        states = {i for i, t in enumerate(self._terms) if t.kind == "state"}
        needed = sorted(states | behind(self._terms, series.rates, changing=True))
        for i in needed:
            self._rule(i, self._terms[i])
        users: dict[int, set[int]] = {}
        for _, i in self._places:
            users.setdefault(self._multiple(i)[0], set()).add(i)
        self._shared = {base for base, result in users.items() if len(result) > 1}
        for made in (self._places, self._pairs, self.kept):
            made.clear()
        self._lines = {i: self._rule(i, self._terms[i]) for i in needed}
        self.rows = len(self._places)

    # what the recurrences are written with

    def _row(self, kind: str, i: int) -> int:
        return self._places.setdefault((kind, i), len(self._places))

    def _sum(self, left: int, right: int, weighted: bool = False) -> str:
        """Sum of left_j right_(k-j) for 0 < j < k, times j if weighted."""
        (left, first), (right, second) = (self._multiple(i, among=self._shared) for i in (left, right))
        row = ("weighted" if weighted else "forward", left)
        if not weighted and (("forward", right), left) in self._pairs:
            row, right = ("forward", right), left
        self._row(*row)
        self._row("reversed", right)
        name = self._pairs.setdefault((row, right), f"s{len(self._pairs)}")
        return self._scaled(name, first * second)

    def _multiple(self, i: int, among: Container[int] | None = None) -> tuple[int, _Factor]:
        """The term of which a term is a multiple but for order 0, the furthest or one of these, and the factor."""
        result, factor = (i, _Factor()), _Factor()
        while True:
            term = self._terms[i]
            kind, (p, q) = term.kind, (*term.operands, -1, -1)[:2]
            if kind == "neg":
                i, by = p, _Factor(-1.0)
            elif kind in ("add", "sub", "mul") and self._changes(p) != self._changes(q):
                i, still = (p, q) if self._changes(p) else (q, p)
                by = _Factor(-1.0 if kind == "sub" and i == q else 1.0)
                if kind == "mul":
                    number = self._terms[still].kind == "number"
                    by = _Factor(self._terms[still].value) if number else _Factor(1.0, (self._zero(still),))
            else:
                return result
            factor = factor * by
            if not 0.0 < abs(factor.number) < inf:
                return result
            if among is None or i in among:
                result = i, factor

    def _scaled(self, name: str, factor: _Factor) -> str:
        if not factor.names:
            return name if factor.number == 1.0 else f"{literal(factor.number)}*{name}"
        product = "*".join([*([] if factor.number == 1.0 else [literal(factor.number)]), *factor.names])
        if "*" not in product:
            return f"{product}*{name}"
        made = f" = {product};"
        line = next((line for line in self.kept if line.endswith(made)), None)
        if line is None:
            line = f"const real g{len(self.kept)}{made}"
            self.kept.append(line)
        return f"{line.split()[2]}*{name}"

    def _reciprocal(self, i: int) -> str:
        """One over a term, made once."""
        line = f"const real r{i} = 1.0 / {self._real(i)};"
        self.kept += [line] if line not in self.kept else []
        return f"r{i}"

    def _zero(self, i: int) -> str:
        """The value of a term."""
        term = self._terms[i]
        if term.kind == "number":
            return literal(term.value)
        if term.kind == "time":
            return "t"
        return f"x[{int(term.value)}]" if term.kind == "state" else self._texts.get(term.node, f"a{i}")

    def _rule(self, i: int, term: Term) -> str:
        """The coefficient of order k of a term as a C expression; sums and rows it needs are noted."""
        self._depth[i] = 1 + max((self._depth.get(k, 0) for k in term.operands), default=0)
        rule = getattr(self, f"_{term.kind}", self._by_rate)
        return str(rule(i, term, *term.operands))

    def _changes(self, i: int) -> bool:
        return self._terms[i].varies

    def _time(self, i: int, term: Term) -> str:
        return "same(k == 1 ? 1.0 : 0.0)"

    def _state(self, i: int, term: Term) -> str:
        return f"f{int(term.value)}*inverse"

    def _add(self, i: int, term: Term, p: int, q: int) -> str:
        return " + ".join(f"b{k}" for k in (p, q) if self._changes(k))

    def _sub(self, i: int, term: Term, p: int, q: int) -> str:
        return f"b{p} - b{q}" if self._changes(p) and self._changes(q) else f"b{p}" if self._changes(p) else f"-b{q}"

    def _neg(self, i: int, term: Term, p: int) -> str:
        return f"-b{p}"

    def _mul(self, i: int, term: Term, p: int, q: int) -> str:
        if not (self._changes(p) and self._changes(q)):
            return f"{self._zero(q)}*b{p}" if self._changes(p) else f"{self._zero(p)}*b{q}"
        if p == q:
            return f"{self._sum(p, p)} + 2.0*{self._zero(p)}*b{p}"
        early, later = (p, q) if self._depth[p] <= self._depth[q] else (q, p)
        return f"{self._sum(p, q)} + {self._zero(later)}*b{early} + {self._zero(early)}*b{later}"

    _absorb = _mul

    def _div(self, i: int, term: Term, p: int, q: int) -> str:
        inverse = self._reciprocal(q)
        if not self._changes(q):
            return f"b{p}*{inverse}"
        rest, last = self._sum(i, q), f"a{i}*b{q}"
        if not self._changes(p):
            return f"-({rest} + {last})*{inverse}"
        later = self._depth[q] > self._depth[p]
        return f"(b{p} - {rest} - {last})*{inverse}" if later else f"(b{p} - ({rest} + {last}))*{inverse}"

    def _sqrt(self, i: int, term: Term, p: int) -> str:
        return f"absorbing(b{p} - {self._sum(i, i)}, 0.5*{self._reciprocal(i)})"  # 0 where what is under it stays 0

    def _pow(self, i: int, term: Term, p: int, q: int) -> str:
        inverse, e = self._reciprocal(p), self._zero(q)
        weighted, plain = self._sum(p, i, True), self._sum(p, i)
        return f"(({e} + 1.0)*inverse*{weighted} - {plain} + {e}*b{p}*a{i})*{inverse}"

    def _by_rate(self, i: int, term: Term, *operands: int) -> str:
        """A function whose rate is a sum of operands' rates times other terms, or that divided by a term."""
        inverse = f"*{self._reciprocal(term.divisor)}" if term.divisor >= 0 else ""
        last = [(-1, self._sum(i, term.divisor, True))] if inverse else []
        sums, ends = [], []
        moving = [(p, *by) for p, by in zip(operands, term.numerators, strict=True) if self._changes(p)]
        turned = -1 if not inverse and all(sign < 0 for _, sign, _ in moving) else 1
        for p, sign, n in moving:
            ends.append((sign * turned, f"b{p}*{self._zero(n)}" if n >= 0 else f"b{p}"))
            sums += [(sign * turned, self._sum(p, n, True))] if n >= 0 and self._changes(n) else []
        lower = _signed([*sums, *last])
        if sums:
            ends = [(1, f"inverse*({lower})" if len(sums + last) > 1 else f"inverse*{lower}"), *ends]
        elif last:
            ends.append((-1, f"inverse*{last[0][1]}"))
        text = _signed(ends)
        if term.kind == "hypot":
            return f"absorbing({text}, {inverse[1:]})"
        return f"({text}){inverse}" if inverse else text if turned > 0 else f"-({text})"

    # the statements

    def first(self) -> list[str]:
        """Values of all terms, the angles' sin and cos together, and the beginnings of the rows."""
        made = [i for i, t in enumerate(self._terms) if self._zero(i) == f"a{i}"]
        early, arguments = gather_angles(made, lambda i: (self._terms[i].kind, *self._terms[i].operands))
        angles = {i: k for k, i in enumerate(arguments)}
        lines = [self._value(i, {}) for i in early]
        lines += print_angles([self._zero(i) for i in angles]) if angles else []
        lines += [self._value(i, angles) for i in made if i not in early]
        lines += [f"EOMGEN_REJECT({self._zero(i)} <= 0.0)" for i in self._series.checks]
        behind_last = (place * ROW + MOST_ORDER for (kind, _), place in self._places.items() if kind == "reversed")
        lines += [f"w[{at}] = same(0.0);" for at in behind_last]
        return [*lines, *(f"real f{k} = {self._real(i)};" for k, i in enumerate(self._series.rates))]

    def _real(self, i: int) -> str:
        text = self._zero(i)
        return f"same({text})" if self._terms[i].kind == "number" else text

    def _value(self, i: int, angles: dict[int, int]) -> str:
        kind, operands = self._terms[i].kind, self._terms[i].operands
        if kind in ("sin", "cos") and operands[0] in angles:
            return f"const real a{i} = {'sines' if kind == 'sin' else 'cosines'}[{angles[operands[0]]}];"
        numbers = all(self._terms[k].kind == "number" for k in operands)
        row = OPERATIONS[kind]
        show = self._zero if row.takes_numbers and not numbers else self._real
        first, *rest = map(show, operands)
        value = row.c.format(f"{first} != 0.0" if row.chooses else first, *rest)
        value = f"choose({value}, same(1.0), same(0.0))" if row.kind == CONDITION else value
        return f"const real a{i} = {value};"

    def states(self) -> list[str]:
        """Coefficients of order k of the states and of time."""
        lines = []
        for i, term in enumerate(self._terms):
            if i in self._lines and term.kind in ("state", "time"):
                lines.append(f"const real b{i} = {self._lines[i]};")
                lines += (
                    [f"out[k*{len(self._series.rates)} + {int(term.value)}] = b{i};"] if term.kind == "state" else []
                )
        return lines

    def sums(self) -> list[list[str]]:
        """Loops over lower orders, some sums in each: the statement of one j, and what follows."""
        pairs = list(self._pairs.items())
        groups = []
        for start in range(0, len(pairs), TOGETHER):
            chosen = pairs[start : start + TOGETHER]
            rows = dict.fromkeys(row for (left, right), _ in chosen for row in (left, ("reversed", right)))
            names = {row: f"{row[0]}{row[1]}" for row in rows}
            lines = [f"part p{name} = EMPTY;" for _, name in chosen]
            lines.append("for (int j = 1; j < k; j += PARTS) {")
            for row, name in names.items():
                at = self._places[row] * ROW
                where = f"{at + MOST_ORDER} - k + j" if row[0] == "reversed" else f"{at} + j"
                lines.append(f"    const part {name} = PART(w + {where});")
            lines += [f"    p{name} += {names[left]}*{names['reversed', right]};" for (left, right), name in chosen]
            lines.append("}")
            groups.append(lines + [f"const real {name} = TOTAL(p{name});" for _, name in chosen])
        return groups

    def chain(self) -> list[str]:
        """Coefficients of order k of all other terms."""
        lines = []
        for i, text in self._lines.items():
            if self._terms[i].kind not in ("state", "time"):
                lines.append(f"const real b{i} = {text};")
            lines += self._stores(i)
        return lines

    def _stores(self, i: int) -> list[str]:
        """A coefficient of order k into its rows."""
        lines = []
        for kind, text in (("forward", f"b{i}"), ("weighted", f"(double)k*b{i}"), ("reversed", f"b{i}")):
            at = self._places.get((kind, i), -1) * ROW
            if at >= 0 and kind == "reversed":
                lines.append(f"w[{at + MOST_ORDER} - k] = {text};")
            elif at >= 0:
                lines.append(f"w[{at} + k] = {text};")
        return lines

    def rates(self) -> list[str]:
        """Coefficients of order k of x'."""
        terms = self._terms
        return [f"f{k} = {f'b{i}' if terms[i].varies else 'same(0.0)'};" for k, i in enumerate(self._series.rates)]
