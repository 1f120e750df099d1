"""Equations of motion -> text of 80 columns, HTML with MathML, or LaTeX."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from ..base.texts import fold, html_text, visible
from ..expr.latex import SUPERSCRIPTS, read_latex, text_form
from ..expr.notation import Notation
from ..expr.printing.formula import DIGITS, ROUNDED, Matrix, times
from ..expr.printing.writers import TIGHT, latex, text
from .document import Folded, FormulaLine, Look, Piece, Row, Sentence, Table, Text, html, tex_formula, written
from .printed import (
    FOLDED,
    SHORT,
    STILL,
    PrintedEntry,
    PrintedEquations,
    PrintedParts,
    listed,
    plain,
)
from .readable import Readable

# -- text --------------------------------------------------------------------------------------------------------------


COLUMNS = 80
HIGH = "".join(map(chr, SUPERSCRIPTS.values()))  #: digits of a power between a function and its argument
LINES = 60  #: of formulas; how to get the others is said
ENTRIES = (SHORT, 8, 5, 2)  #: characters of entries of a matrix, tried until the matrix fits
DEEP = 9  #: parentheses in parentheses
SHORT_GROUP = re.compile(r"\([^()]{1,16}\)")  #: parentheses that stay in one line
#: Where lines end, the best first: the kind of space, and within how many parentheses, and of arguments among them.
#: Between terms, between terms within parentheses, the outer ones first, between factors, and within arguments at last.
BREAKS = (*((" ", deep, 0) for deep in range(DEEP)), (TIGHT, DEEP, 0), (TIGHT, DEEP, DEEP))


def equations_text(equations: Readable, columns: int = COLUMNS, lines: int = LINES, digits: int = ROUNDED) -> str:
    """Coordinates and equations, in matrix form where it fits, else entry by entry, of at most so many columns.

    Formulas beyond ``lines`` are left out, and how to get them is said; long numbers have so many digits.
    """
    printed = PrintedEquations(equations, digits)
    name = visible(equations.kinematics.mechanism.name, lines=False)
    result = [f"equations of motion of {name}", f"  {printed.title}"]
    result += [*_values(printed, columns), *_coordinates(printed, columns)]
    if equations.mobility.n_dof == 0:
        result.append(f"  {STILL}")
    else:
        printed_lines = [*(_large(printed, columns) if printed.is_long else _equations(printed, columns))]
        result += ["", *printed_lines[:lines]]
        if len(printed_lines) > lines:
            where = "eqs.tree_system" if printed.of_loops else "eqs.mass_matrix, eqs.force, eqs.intermediates"
            rest = f"... and {len(printed_lines) - lines} lines more: {where}"
            result += [rest, "or in a shell: eomgen derive MODEL --format text"]
        if remark := printed.remark:
            result += ["", *fold(remark, columns, "", "  ")]
    for title, pairs in printed.titled_states:
        result += ["", title]
        result += [x for a, f in pairs for x in _wrapped(f"{printed.text(a)} = ", printed.text(f), columns)]
    result += ["", *fold(", ".join(f"eqs.{name}" for name in printed.attributes), columns, "read next: ", "  ")]
    return "\n".join(result)


def _values(printed: PrintedEquations, columns: int) -> list[str]:
    """What was substituted."""
    listed = ", ".join(printed.text(x).replace(" ", TIGHT) for x in printed.values)
    return [plain(line) for line in fold(listed, columns, "  with ", "    ")] if listed else []


def _coordinates(printed: PrintedEquations, columns: int) -> Iterator[str]:
    rows = [(printed.names.text(name), name, *others) for name, *others in printed.coordinates]
    if not rows:
        return
    sizes = [max(map(len, column)) for column in zip(*rows, strict=True)]
    yield "coordinates"
    for symbol, name, joint, unit, role in rows[:20]:
        of = f"of joint {joint:<{sizes[2]}}" if joint else ""
        same = "" if symbol == name and all(entries[0] == entries[1] for entries in rows) else f"{name:<{sizes[1]}}  "
        yield f"  {symbol:<{sizes[0]}}  {same}{of}  {unit:<{sizes[3]}}  {role}".rstrip()[:columns]
    if len(rows) > 20:
        yield f"  and {len(rows) - 20} more: eqs.q"


def _equations(printed: PrintedEquations, columns: int) -> Iterator[str]:
    rates = [printed.text(x) for x in printed.accelerations]
    M = [[printed.text(x) for x in entries] for entries in printed.mass_matrix]
    f = [printed.text(x) for x in printed.force]
    if printed.is_one_equation:
        whole = f"  {printed.text(times(printed.mass_matrix[0][0], printed.accelerations[0]))} = {f[0]}"
        if len(whole) <= columns:
            yield plain(whole)
            yield from _where(printed, columns)
            return
    whole_rows = [*_matrix_equation(M, rates, f)]
    if len(rates) > 1 and max(map(len, whole_rows)) <= columns:
        yield from map(plain, whole_rows)
        yield from _where(printed, columns)
        return
    mass, v, right = (letter_text(letter) for letter in printed.letters)
    short = f"{mass} {rates[0]} = {right}" if printed.is_one_equation else f"{mass} {v} = {right}"
    listed = f"{short} with {v} = ({', '.join(rates)})"
    yield short if printed.is_one_equation or len(listed) > columns else listed
    if remark := ", ".join(f"{letter_text(letter)} is {what}" for letter, what in printed.renamed_letters):
        yield from fold(f"{remark}; the usual letters are names of the model", columns, "  ", "  ")
    yield ""
    rows = [*_matrix(M, f"{mass} = ")]
    small = len(rates) > 1 and max(map(len, rows)) <= columns
    if small:
        yield from map(plain, rows)
        yield ""
    for entry in printed.entries():
        if not (small and entry.letter == printed.letters.mass):
            yield from _wrapped(f"{_label(entry, len(rates))} = ", printed.text(entry.formula), columns)
    if not small and len(rates) > 1:
        yield f"{mass} is symmetric{'; its other entries are 0' if printed.vanishing else ''}"
    yield from _where(printed, columns)


def _large(printed: PrintedEquations, columns: int) -> Iterator[str]:
    """Large equations: matrices with letters for their entries, and groups of what these are."""
    for short in ENTRIES:
        parts = PrintedParts(printed, short)
        items = list(parts.items())
        rows = [each for item in items if isinstance(item, Row) for x in item.lines for each in _rows(parts, x)]
        if max(map(len, rows), default=0) <= columns:
            break

    def in_text(sentence: Text) -> str:
        return written(sentence, lambda x: text(x, parts.names), str, str)

    def equation(line: FormulaLine) -> Iterator[str]:
        left, right = line.sides
        rows = _rows(parts, line)
        if not isinstance(right, Matrix):
            yield from _wrapped(f"{text(left, parts.names)} = ", text(right, parts.names), columns)
        elif max(map(len, rows)) <= columns:
            yield from ("", *map(plain, rows))
        else:
            size = f"{len(right.rows)} rows and {len(right.rows[0])} columns"
            yield f"  {text(left, parts.names)} has {size}: eqs.tree_system"

    mass, v, right = (letter_text(letter) for letter in printed.letters)
    rates = ", ".join(map(printed.text, printed.accelerations))
    one = printed.is_one_equation
    yield from fold(
        f"{mass} {rates} = {right}" if one else f"{mass} {v} = {right} with {v} = ({rates})", columns, "", "  "
    )
    for item in items[1:]:
        match item:
            case Row():
                yield from (line for one in item.lines for line in equation(one))
            case Sentence():
                yield from fold(in_text(item.text), columns, "", "  ")
    groups = [item for item in items if isinstance(item, Folded)]
    yield from (
        "",
        "In groups:",
        *(line for group in groups for line in fold(in_text(group.title), columns, "  ", "    ")),
    )
    for group in groups:
        yield from ("", *fold(in_text(group.title), columns, "", "  "))
        yield from (line for one in group.pieces if isinstance(one, FormulaLine) for line in equation(one))


def _rows(parts: PrintedParts, line: FormulaLine) -> list[str]:
    """A matrix in rows; none of what is no matrix."""
    left, right = line.sides
    if not isinstance(right, Matrix):
        return []
    before = f"  {text(left, parts.names)} = "
    return _matrix([[text(x, parts.names) for x in entries] for entries in right.rows], before)


def letter_text(latex: str) -> str:
    """A letter of a display in text."""
    return text_form(read_latex(latex))


def _label(entry: PrintedEntry, n: int) -> str:
    letter = letter_text(entry.letter)
    return f"{letter}_{(',' if n > 9 else '').join(map(str, entry.place))}" if n > 1 else letter


def _where(printed: PrintedEquations, columns: int) -> Iterator[str]:
    if printed.intermediates:
        yield "where"
        for name, formula in printed.intermediates:
            yield from _wrapped(f"{printed.names.text(name)} = ", printed.text(formula), columns)


def _matrix(rows: Sequence[Sequence[str]], before: str = "") -> list[str]:
    sizes = [max(map(len, column)) for column in zip(*rows, strict=True)]
    middle = (len(rows) - 1) // 2
    result = []
    for k, entries in enumerate(rows):
        left, right = _brackets(k, len(rows))
        cells = "  ".join(cell.center(size) for cell, size in zip(entries, sizes, strict=True))
        result.append(f"{before if k == middle else ' ' * len(before)}{left}{cells}{right}")
    return result


def _brackets(k: int, n: int) -> tuple[str, str]:
    if n == 1:
        return "[", "]"
    return ("⎡", "⎤") if k == 0 else ("⎣", "⎦") if k == n - 1 else ("⎢", "⎥")


def _matrix_equation(M: list[list[str]], rates: list[str], f: list[str]) -> Iterator[str]:
    parts = (_matrix(M), _matrix([[x] for x in rates]), _matrix([[x] for x in f]))
    middle = (len(f) - 1) // 2
    for k, (a, b, c) in enumerate(zip(*parts, strict=True)):
        yield f"  {a} {b} {'=' if k == middle else ' '} {c}"


def _wrapped(label: str, text: str, columns: int) -> Iterator[str]:
    """A formula in lines that end where ``BREAKS`` says."""
    margin = " " * min(len(label) + 2, 12)
    line = f"  {label}"
    together = SHORT_GROUP.sub(lambda group: group[0].replace(" ", TIGHT), text)
    for part in _fitting(together, columns - len(margin), BREAKS):
        if len(line) + len(part) > columns and line.strip():
            yield plain(line.rstrip())
            line = margin
        line += part + " "
    yield plain(line.rstrip())


def _fitting(text: str, width: int, ways: Sequence[tuple[str, int, int]]) -> Iterator[str]:
    """Parts between which a line may end, each cut no further than it has to be to fit."""
    if not ways:
        yield from (text[k : k + width] for k in range(0, len(text), width))
        return
    for part in _parts(text, *ways[0]):
        if len(part) <= width:
            yield part
        else:
            yield from _fitting(part, width, ways[1:])


def _parts(text: str, space: str, deep: int, in_calls: int) -> Iterator[str]:
    """The parts between spaces of one kind, a sign with what comes after it.

    Spaces count within at most ``deep`` parentheses, ``in_calls`` of which are those of arguments.
    """
    piece, before = "", ""
    opened: list[str] = []  # what each open parenthesis is
    for word in text.split(space):
        for letter in word:
            if letter == "|":
                opened = opened[:-1] if opened[-1:] == ["bar"] else [*opened, "bar"]
            elif letter in "({":
                opened.append("call" if before.isalnum() or (before != "" and before in HIGH) else "group")
            elif letter in ")}":
                opened = opened[:-1]
            before = letter
        before = space
        piece += word
        if (
            word in ("+", "-", "if", "otherwise")
            or len(opened) > deep
            or len(opened) - opened.count("group") > in_calls
        ):
            piece += TIGHT if word in ("+", "-", "if") else space
        else:
            yield piece
            piece = ""
    if piece:
        yield piece.rstrip(space)


# -- HTML --------------------------------------------------------------------------------------------------------------


#: Fonts with brackets that grow, of the usual systems.
_FONT = "font-family:Latin Modern Math,STIX Two Math,Cambria Math,TeX Gyre Termes Math,DejaVu Math TeX Gyre,math"
#: A notebook has no style sheet of ours: cells of its tables are not spaced, and formulas are set small.
NOTEBOOK = Look(
    text=" style='text-align:left'",
    math=f" style='{_FONT}'",
    formula=" style='margin:0.5em 0;padding:0.2em 0;overflow-x:auto;overflow-y:hidden;font-size:1.15em'",
    first=" style='text-align:right;padding:0.2em 0'",
    others=" style='text-align:left;padding:0.2em 0'",
    cell=" style='text-align:left;padding:0.15em 1.2em 0.15em 0'",
    folded=" style='display:flex;flex-wrap:wrap;column-gap:2.5em;margin-left:1em'",
)


def equations_html(equations: Readable) -> str:
    """Formulas of the equations of motion."""
    printed = PrintedEquations(equations, ROUNDED)
    return "".join(html(item, printed.page_names, NOTEBOOK) for item in printed.items())


def facts_html(equations: Readable) -> str:
    """What the equations are, their coordinates and the attributes to read next."""
    printed = PrintedEquations(equations)
    name = html_text(equations.kinematics.mechanism.name)
    head = f"<p style='margin:0 0 0.6em 0'><b>{name}</b>: equations of motion, {html_text(printed.title)}</p>"
    return head + "".join(html(piece, printed.names, NOTEBOOK) for piece in _facts(printed))


def _facts(printed: PrintedEquations) -> Iterator[Piece]:
    if values := printed.values:
        whole = Sentence(("with ", *listed(values)))
        yield whole if len(values) <= FOLDED else Folded(f"with {len(values)} values", (whole,))
    if coordinates := printed.coordinates:
        roles = any(role for *_, role in coordinates)
        rows = ((f"${printed.names.latex(name)}$", f"`{name}`", *others) for name, *others in coordinates)
        heads = ("coordinate", "name", "joint", "unit", "")
        table = Table(heads[: 4 + roles], tuple(one[: 4 + roles] for one in rows))
        yield table if len(coordinates) <= FOLDED else Folded(f"{len(coordinates)} coordinates", (table,))
    yield Folded("read next", (Sentence(", ".join(f"`eqs.{name}`" for name in printed.attributes)),))


# -- LaTeX -------------------------------------------------------------------------------------------------------------


def latex_formulas(equations: Readable, digits: int = DIGITS) -> list[str]:
    """Each formula of the equations of motion, without dollars: M v' = f, its names, and substituted values."""
    printed = PrintedEquations(equations, digits)
    lines = [line for item in printed.items() for line in _latex(item, printed.page_names)]
    values = r",\quad ".join(latex(x, printed.names) for x in printed.values)
    return [*lines, rf"\text{{with }} {values}"] if values else lines


def equations_latex(equations: Readable) -> str:
    """The same as Jupyter prints it, each formula in a line of its own."""
    lines = latex_formulas(equations, ROUNDED)
    if len(lines) == 1:
        return f"$\\displaystyle {lines[0]}$"
    return "\n\n".join(f"$$\n{line}\n$$" for line in lines)


def _text(text: str) -> str:
    return rf"\text{{{text.replace('_', chr(92) + '_')}}}"


def _latex(item: Piece, names: Notation) -> Iterator[str]:
    match item:
        case FormulaLine() | Row():
            yield tex_formula(item, names)
        case Sentence():
            yield written(item.text, lambda x: latex(x, names), _text, _text)
        case Folded():
            yield from (line for one in (Sentence(item.title), *item.pieces) for line in _latex(one, names))
