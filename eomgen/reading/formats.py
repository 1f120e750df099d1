"""Equations of motion -> files for other programs, written by SymPy's printers.

Each file holds the named intermediates, M and f of M(q) v' = f, in the symbols of the model.
"""

from __future__ import annotations

import keyword
import re
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import sympy
from sympy.core.function import AppliedUndef
from sympy.printing.c import reserved_words as c_keywords
from sympy.printing.mathematica import MCodePrinter

from ..errors import UnavailableError
from ..expr.printing.formula import DIGITS
from ..runtime.argument_checks import unknown
from ..toolchain.targets import FORMATS
from .readable import Readable
from .writers import COLUMNS, equations_text, latex_formulas

_MATLAB_KEYWORDS = (
    "break case catch classdef continue else elseif end for function global if otherwise parfor persistent return spmd "
    "switch try while pi i j Inf NaN eps ans M f sin cos tan exp log sqrt abs sign min max"
)
_JULIA_KEYWORDS = (
    "baremodule begin break catch const continue do else elseif end export false finally for function global if import "
    "let local macro module quote return struct true try using while pi im M f sin cos tan exp log"
)


class _Mathematica(MCodePrinter):  # type: ignore[misc]  # SymPy has no types
    """SymPy's printer, with what it lacks."""

    def _print_Piecewise(self, expr: Any) -> str:
        pairs = (f"{{{self._print(x)}, {self._print(c)}}}" for x, c in expr.args)
        return f"Piecewise[{{{', '.join(pairs)}}}]"

    def _print_BooleanTrue(self, expr: Any) -> str:
        return "True"


class Language(NamedTuple):
    """How a language is written: its printer, its comment, and names that a quantity may not have."""

    print: Callable[[Any], str]
    comment: str
    reserved: frozenset[str]


LANGUAGES = {
    "sympy": Language(sympy.sstr, "#", frozenset([*keyword.kwlist, *dir(sympy), "sympy", "M", "f"])),
    "matlab": Language(sympy.octave_code, "%", frozenset(_MATLAB_KEYWORDS.split())),
    "octave": Language(sympy.octave_code, "%", frozenset([*_MATLAB_KEYWORDS.split(), "endfunction", "endif", "do"])),
    "julia": Language(sympy.julia_code, "#", frozenset(_JULIA_KEYWORDS.split())),
    "mathematica": Language(
        _Mathematica().doprint, "", frozenset(["C", "D", "E", "I", "K", "N", "O", "Pi", "Sin", "Cos", "M", "f"])
    ),
    "c": Language(
        sympy.ccode, "//", frozenset([*c_keywords, "M", "f", "double", "restrict", "inline", "y0", "y1", "jn"])
    ),
}


def write_format(equations: Readable, form: str) -> str:
    """The equations of motion as the text of a file, in one of :data:`~eomgen.toolchain.targets.FORMATS`.

    ``matlab``, ``octave``, ``julia`` and ``c`` give a function of the symbols, in alphabetical order, for M and f;
    ``sympy`` and ``mathematica`` give statements that define M and f.

    Raises
    ------
    UsageError
        Another format.
    UnavailableError
        The equations hold tables or functions, which no language has.
    """
    if form not in FORMATS:
        raise unknown("format", form, FORMATS)
    if form == "latex":
        return "\n".join(f"\\[\n{line}\n\\]" for line in latex_formulas(equations)) + "\n"
    if form == "text":
        return equations_text(equations, COLUMNS, 1_000_000, DIGITS) + "\n"
    return _Code(equations, LANGUAGES[form], form).file()


class _Code:
    """Equations with names that a language takes."""

    def __init__(self, equations: Readable, language: Language, form: str) -> None:
        self.language, self.form, self.model = language, form, equations.kinematics.mechanism.name
        named = equations.intermediates
        rates = equations.written("state_rates") if equations.states else ([], sympy.Matrix())
        named = [*named, *rates[0]]
        whole = [*(x for _, x in named), *equations.mass_matrix, *equations.force, *rates[1]]
        unknown = {str(f.func) for x in whole for f in x.atoms(AppliedUndef)}
        if unknown:
            raise UnavailableError(
                f"format {form!r} cannot hold the tables or functions of this model: {', '.join(sorted(unknown))}; "
                "latex and text show them by name, and eomgen generate writes code for them"
            )
        infinite = form not in ("sympy", "mathematica") and any(x.has(sympy.zoo) for x in whole)
        if infinite and form not in ("c", "julia"):
            raise UnavailableError(
                f"format {form!r} writes pieces as masked sums, in which the infinite values of this model become NaN; "
                "formats c, julia, sympy and mathematica hold them"
            )
        symbols = set().union(*(x.free_symbols for x in whole), {symbol for symbol, _ in named})
        self.renamed = _renamed((str(s) for s in symbols), language.reserved | {"state_rates", "stateRates"}, form)
        put = {s: sympy.Symbol(self.renamed[str(s)]) for s in symbols}
        changed = {**put, sympy.zoo: sympy.oo} if infinite else put  # 1/0
        self.named = [(put[symbol], x.xreplace(changed)) for symbol, x in named]
        self.mass, self.force = equations.mass_matrix.xreplace(changed), equations.force.xreplace(changed)
        self.states = [x.xreplace(changed) for x in rates[1]]
        self.state_names = equations.kinematics.state_names
        inner = {symbol for symbol, _ in self.named}
        self.arguments = sorted(str(symbol) for symbol in put.values() if symbol not in inner)
        self.rates = equations.acceleration_names
        self.function = re.sub(r"\W", "_", f"{self.model}_equations")

    def file(self) -> str:
        notes = [f"M * [{', '.join(self.rates)}] = f of {self.model}"]
        notes += [f"[{', '.join(f'{n}_dot' for n in self.state_names)}] = state_rates"] if self.states else []
        notes += [f"{new} is {old} of the model" for old, new in sorted(self.renamed.items()) if old != new]
        if self.form == "mathematica":
            return "\n".join([*(f"(* {note} *)" for note in notes), *self._mathematica(), ""])
        body = {"sympy": self._sympy, "julia": self._julia, "c": self._c}.get(self.form, self._matlab)
        return "\n".join([*(f"{self.language.comment} {note}" for note in notes), *body(), ""])

    def _statements(self, named: str, whole: str, brackets: str, states: str) -> list[str]:
        """Definitions of named parts, of M, of f and of the rates of states."""

        def write(x: Any) -> str:  # one by one: in a list, printers write numbers otherwise
            return brackets.format(", ".join(map(write, x))) if isinstance(x, list) else self.language.print(x)

        lists = {"M": self.mass.tolist(), "f": [*self.force]} | ({states: self.states} if self.states else {})
        lines = [named.format(symbol, write(x)) for symbol, x in self.named]
        return lines + [whole.format(name, write(entries)) for name, entries in lists.items()]

    def _sympy(self) -> list[str]:
        """Statements that define the symbols too."""
        lines, names = ["import sympy", "from sympy import *"], ", ".join(self.arguments)
        lines += [f"{names}, = symbols({' '.join(self.arguments)!r}, seq=True)"] if names else []
        return lines + self._statements("{} = {}", "{} = sympy.Matrix({})", "[{}]", "state_rates")

    def _body(
        self, line: str, place: Callable[[tuple[int, ...]], str], start: int, zeros: str = "", named: str = ""
    ) -> Iterator[str]:
        """Lines of named parts, then of the entries of M, f and the rates of states; ``zeros`` makes these arrays."""
        n, write = self.mass.rows, self.language.print
        yield from ((named or line).format(symbol, write(x)) for symbol, x in self.named)
        for name, entries, sizes in (
            ("M", {(i, j): self.mass[i, j] for i in range(n) for j in range(n)}, (n, n)),
            ("f", {(i,): x for i, x in enumerate(self.force)}, (n,)),
            ("state_rates", {(i,): x for i, x in enumerate(self.states)}, (len(self.states),)),
        ):
            if zeros and entries:
                both = (*sizes, 1)[:2] if self.form != "julia" else sizes
                yield line.format(name, zeros.format(", ".join(map(str, both))))
            for where, x in entries.items():
                yield line.format(name + place(tuple(k + start for k in where)), write(x))

    def _matlab(self) -> list[str]:
        head = f"function [M, f{', state_rates' * bool(self.states)}] = {self.function}({', '.join(self.arguments)})"
        return [head, *self._body("  {} = {};", lambda at: f"({', '.join(map(str, at))})", 1, "zeros({})"), "end"]

    def _julia(self) -> list[str]:
        body = self._body("    {} = {}", lambda at: f"[{', '.join(map(str, at))}]", 1, "zeros({})")
        end = f"    return M, f{', state_rates' * bool(self.states)}"
        return [f"function {self.function}({', '.join(self.arguments)})", *body, end, "end"]

    def _c(self) -> list[str]:
        n = self.mass.rows
        arguments = "".join(f"double {name}, " for name in self.arguments)
        more = f", double state_rates[{len(self.states)}]" if self.states else ""
        head = f"void {self.function}({arguments}double M[{n}][{n}], double f[{n}]{more})"
        body = [*self._body("  {} = {};", lambda at: "".join(f"[{k}]" for k in at), 0, named="  const double {} = {};")]
        logic = ["#include <stdbool.h>"] * any(re.search(r"\b(true|false)\b", line) for line in body)
        return ["#include <math.h>", *logic, head, "{", *body, "}"]

    def _mathematica(self) -> list[str]:
        return self._statements("{} = {};", "{} = {};", "{{{}}}", "stateRates")


def _renamed(names: Iterable[str], reserved: frozenset[str], form: str) -> dict[str, str]:
    """Names -> names that the language takes and no two of which are the same."""
    result: dict[str, str] = {}
    listed = sorted(names)
    used = set(listed) - reserved
    for name in listed:
        new = re.sub(r"\W", "_", name)
        if form == "mathematica":  # no underscores there
            first, *others = new.split("_")
            new = first + "".join(part[:1].upper() + part[1:] for part in others)
        if new != name or new in reserved:
            while new in used or new in reserved:
                new += "X" if form == "mathematica" else "_"
            used.add(new)
        result[name] = new
    return result
