"""Stage reading, HTML: equations of motion -> a page's part with coordinates and formulas in MathML.

MathML needs neither a script nor a network: a saved notebook shows the formulas too.
"""

from __future__ import annotations

from collections.abc import Iterator

from ..base.notation import Notation
from ..base.texts import html_text
from ..printing import given_mathml, mathml, sums_in_lines
from ..printing.formula_mathml import fenced, row, sum_line
from ..printing.formula_of import ROUNDED
from ..printing.formula_tree import Formula, MatrixOf, Name, is_group
from .printed_equations import SAMPLED, STILL, PrintedEntry, PrintedEquations
from .printed_parts import PrintedGroup, PrintedLine, PrintedParts, PrintedRow, PrintedSentence
from .readable import Readable

FOLDED = 12  #: formulas more than which are folded up
MOST = 1_000  #: intermediates that are shown
LEFT = "style='text-align:left'"
CELL = "style='text-align:left;padding:0.15em 1.2em 0.15em 0'"  #: of tables, on pages that do not space cells
_STYLE = "margin:0.5em 0;padding:0.2em 0;overflow-x:auto;overflow-y:hidden;font-size:1.15em"
_FLOW = "display:flex;flex-wrap:wrap;column-gap:2.5em;margin-left:1em"  #: short formulas side by side
#: Fonts with brackets that grow, of the usual systems.
_FONT = "font-family:Latin Modern Math,STIX Two Math,Cambria Math,TeX Gyre Termes Math,DejaVu Math TeX Gyre,math"


def equations_html(equations: Readable) -> str:
    """Formulas of the equations of motion."""
    printed = PrintedEquations(equations, ROUNDED)
    if equations.mobility.n_dof == 0:
        return "".join([f"<p>{STILL.capitalize()}.</p>", *_states(printed)])
    motion = parts_html(PrintedParts(printed)) if printed.is_long else [*_motion(printed), *_intermediates(printed)]
    told = f"<p {LEFT}>{printed.told}</p>" if printed.told else ""
    return "".join([*motion, *_states(printed), told])


def facts_html(equations: Readable) -> str:
    """What the equations are, their coordinates and the attributes to read next."""
    printed = PrintedEquations(equations)
    name = html_text(equations.kinematics.mechanism.name)
    head = f"<p style='margin:0 0 0.6em 0'><b>{name}</b>: equations of motion, {html_text(printed.title)}</p>"
    attributes = ", ".join(f"<code>eqs.{name}</code>" for name in printed.attributes)
    further = f"<details><summary>read next</summary><p {LEFT}>{attributes}</p></details>"
    return f"{head}{_values(printed)}{_coordinates(printed)}{further}"


def _values(printed: PrintedEquations) -> str:
    """What was put in."""
    shown = [_math(mathml(x, printed.names)) for x in printed.values]
    whole = f"with {', '.join(shown)}"
    if not shown:
        return ""
    if len(shown) <= FOLDED:
        return f"<p {LEFT}>{whole}</p>"
    return f"<details><summary>with {len(shown)} values</summary><p {LEFT}>{whole}</p></details>"


def _coordinates(printed: PrintedEquations) -> str:
    shown = printed.coordinates
    if not shown:
        return ""
    dependent = any(c.role for c in shown)
    heads = ["coordinate", "name", "joint", "unit", *([""] if dependent else [])]
    rows = "".join(
        f"<tr><td {CELL}>{_math(printed.names.mathml(c.name))}</td><td {CELL}><code>{html_text(c.name)}</code></td>"
        f"<td {CELL}>{html_text(c.joint)}</td><td {CELL}>{html_text(c.unit)}</td>"
        + (f"<td {CELL}>{c.role}</td>" if dependent else "")
        + "</tr>"
        for c in shown
    )
    whole = f"<table><tr>{''.join(f'<th {CELL}>{head}</th>' for head in heads)}</tr>{rows}</table>"
    return whole if len(shown) <= FOLDED else f"<details><summary>{len(shown)} coordinates</summary>{whole}</details>"


def _math(inside: str) -> str:
    return f"<math style='{_FONT}'>{inside}</math>"


def _block(inside: str) -> str:
    return f"<div style='{_STYLE}'><math displaystyle='true' style='{_FONT}'>{inside}</math></div>"


def _motion(printed: PrintedEquations) -> Iterator[str]:
    def shown(formula: Formula) -> str:
        return mathml(formula, printed.names)

    rates = [shown(x) for x in printed.accelerations]
    M, f = printed.mass_matrix, printed.force
    equals = "<mo>=</mo>"
    if printed.is_one_equation and printed.fits:
        factor = "" if printed.text(M[0][0]) == "1" else fenced(shown(M[0][0])) if is_group(M[0][0]) else shown(M[0][0])
        yield _block(row(factor, "<mspace width='0.17em'></mspace>", rates[0], equals, shown(f[0])))
        return
    v = shown(MatrixOf(tuple((x,) for x in printed.accelerations)))
    right, left = shown(MatrixOf(tuple((x,) for x in f))), shown(MatrixOf(tuple(map(tuple, M))))
    if len(rates) > 1 and printed.fits:
        yield _block(row(left, v, equals, right))
        return
    mass, _, force = map(given_mathml, printed.letters)
    yield _block(row(mass, rates[0] if printed.is_one_equation else v, equals, force))
    if told := ", ".join(f"{_math(given_mathml(letter))} is {what}" for letter, what in printed.letters_told):
        yield f"<p {LEFT}>{told}; the usual letters are names of the model.</p>"
    whole = len(rates) > 1 and printed.mass_matrix_fits
    if whole:
        yield _block(row(mass, equals, left))
    elif len(rates) > 1:
        zeros = "; entries that are not shown are 0" if printed.vanishing else ""
        yield f"<p {LEFT}>The mass matrix is symmetric{zeros}.</p>"
    entries = [
        _line(printed.names, _label(entry, len(rates)), entry.formula)
        for entry in printed.entries()
        if not (whole and entry.letter == printed.letters.mass)
    ]
    if len(entries) <= FOLDED:
        yield from entries
    else:
        yield f"<details><summary>the {len(entries)} entries of M and f</summary>{''.join(entries)}</details>"


def _label(entry: PrintedEntry, n: int) -> str:
    if n == 1:
        return given_mathml(entry.letter)
    comma = "," if n > 9 else ""
    return f"<msub>{given_mathml(entry.letter)}<mn>{comma.join(map(str, entry.place))}</mn></msub>"


def _line(names: Notation, label: str, formula: Formula) -> str:
    """A formula; a long sum in lines of its terms, below each other."""
    lines = [sum_line(part, names, first=k == 0) for k, part in enumerate(sums_in_lines(formula, names))]
    if len(lines) == 1:
        return _block(row(label, "<mo>=</mo>", lines[0]))
    cells = [
        f"<mtr><mtd style='text-align:right;padding:0.2em 0'>{row(label, '<mo>=</mo>') if k == 0 else ''}</mtd>"
        f"<mtd style='text-align:left;padding:0.2em 0 0.2em {0 if k == 0 else 1.5}em'>{row(line)}</mtd></mtr>"
        for k, line in enumerate(lines)
    ]
    return _block(f"<mtable displaystyle='true'>{''.join(cells)}</mtable>")


def _intermediates(printed: PrintedEquations) -> Iterator[str]:
    if printed.intermediates:
        yield f"<p {LEFT}>where</p>"
        yield from (_line(printed.names, mathml(Name(name), printed.names), x) for name, x in printed.intermediates)


def _states(printed: PrintedEquations) -> Iterator[str]:
    if printed.states:
        yield f"<p {LEFT}>first-order states</p>"
        yield from (_line(printed.names, mathml(rate, printed.names), x) for rate, x in printed.states)
    if printed.sampled:
        yield f"<p {LEFT}>{SAMPLED}</p>"
        yield from (_line(printed.names, mathml(state, printed.names), x) for state, x in printed.sampled)


def parts_html(parts: PrintedParts) -> Iterator[str]:
    """Large equations: matrices with letters for their entries, and groups of what these are."""

    def words(sentence: PrintedSentence) -> str:
        return "".join(html_text(x) if isinstance(x, str) else _math(mathml(x, parts.names)) for x in sentence.pieces)

    def equation(line: PrintedLine) -> str:
        return row(mathml(line.left, parts.names), "<mo>=</mo>", mathml(line.right, parts.names))

    for item in parts.items():
        match item:
            case PrintedRow():
                yield _block("<mspace width='2em'></mspace>".join(map(equation, item.lines)))
            case PrintedSentence():
                yield f"<p {LEFT}>{words(item)}</p>"
            case PrintedGroup():
                lines = "".join(
                    _line(parts.names, mathml(line.left, parts.names), line.right) for line in item.lines[:MOST]
                )
                yield f"<details><summary>{words(item.title)}</summary><div style='{_FLOW}'>{lines}</div></details>"
