"""Stage reading, LaTeX: equations of motion -> formulas in LaTeX, for slides and printed notebooks."""

from __future__ import annotations

from collections.abc import Iterator

from ..base.notation import Notation
from ..printing import latex, sums_in_lines
from ..printing.formula_of import DIGITS, ROUNDED
from ..printing.formula_tree import Formula, MatrixOf, is_group
from .printed_equations import SAMPLED, STILL, PrintedEquations
from .printed_parts import PrintedGroup, PrintedParts, PrintedRow, PrintedSentence
from .readable import Readable


def latex_lines(equations: Readable, digits: int = DIGITS) -> list[str]:
    """Each formula of the equations of motion, without dollars: M v' = f, what its names stand for, what was put in."""
    printed = PrintedEquations(equations, digits)
    if equations.mobility.n_dof == 0:
        lines = [_text(STILL)]
    elif printed.is_long:
        lines = [*_parts(PrintedParts(printed))]
    else:
        lines = [
            *_motion(printed),
            *(_broken(printed.names, printed.names.latex(n), x) for n, x in printed.intermediates),
        ]
    lines += [_broken(printed.names, latex(rate, printed.names), x) for rate, x in printed.states]
    if printed.sampled:
        lines.append(_text(SAMPLED))
        lines += [_broken(printed.names, latex(state, printed.names), x) for state, x in printed.sampled]
    if told := printed.told:
        lines.append(_text(told))
    values = r",\quad ".join(latex(x, printed.names) for x in printed.values)
    return [*lines, rf"\text{{with }} {values}"] if values else lines


def equations_latex(equations: Readable) -> str:
    """The same as Jupyter prints it, each formula in a line of its own."""
    lines = latex_lines(equations, ROUNDED)
    if len(lines) == 1:
        return f"$\\displaystyle {lines[0]}$"
    return "\n\n".join(f"$$\n{line}\n$$" for line in lines)


def _text(words: str) -> str:
    return rf"\text{{{words.replace('_', chr(92) + '_')}}}"


def _motion(printed: PrintedEquations) -> Iterator[str]:
    def shown(formula: Formula) -> str:
        return latex(formula, printed.names)

    rates = [shown(x) for x in printed.accelerations]
    if printed.is_one_equation and printed.fits:
        M, f = printed.mass_matrix[0][0], printed.force[0]
        factor = rf"\left({shown(M)}\right)" if is_group(M) else shown(M)
        yield f"{'' if shown(M) == '1' else factor + ' '}{rates[0]} = {shown(f)}"
        return
    left = shown(MatrixOf(tuple(map(tuple, printed.mass_matrix))))
    right = shown(MatrixOf(tuple((x,) for x in printed.force)))
    v = shown(MatrixOf(tuple((x,) for x in printed.accelerations)))
    if len(rates) > 1 and printed.fits:
        yield f"{left} {v} = {right}"
        return
    mass, _, right = printed.letters
    yield rf"{mass}\, {rates[0] if printed.is_one_equation else v} = {right}"
    whole = len(rates) > 1 and printed.mass_matrix_fits
    if whole:
        yield f"{mass} = {left}"
    for entry in printed.entries():
        if not (whole and entry.letter == mass):
            comma = "," if len(rates) > 9 else ""
            label = f"{entry.letter}_{{{comma.join(map(str, entry.place))}}}" if len(rates) > 1 else entry.letter
            yield _broken(printed.names, label, entry.formula)


def _broken(names: Notation, label: str, formula: Formula) -> str:
    """A formula; a long sum in lines of its terms."""
    lines = sums_in_lines(formula, names)
    shown = [latex(line, names) for line in lines]
    if len(shown) == 1:
        return f"{label} = {shown[0]}"
    others = (line if line.startswith("-") else f"+ {line}" for line in shown[1:])
    body = r" \\ & \quad ".join([shown[0], *others])
    return rf"\begin{{aligned}}{label} & = {body}\end{{aligned}}"


def _parts(parts: PrintedParts) -> Iterator[str]:
    """Large equations: matrices with letters for their entries, and groups of what these are."""

    def shown(formula: Formula) -> str:
        return latex(formula, parts.names)

    def words(sentence: PrintedSentence) -> str:
        return "".join(_text(x) if isinstance(x, str) else shown(x) for x in sentence.pieces)

    for item in parts.items():
        match item:
            case PrintedRow():
                yield r" \qquad ".join(f"{shown(line.left)} = {shown(line.right)}" for line in item.lines)
            case PrintedSentence():
                yield words(item)
            case PrintedGroup():
                yield words(item.title)
                yield from (_broken(parts.names, shown(line.left), line.right) for line in item.lines)
