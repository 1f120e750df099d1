"""Stage explain, LaTeX: sections -> a document that pdflatex compiles with the packages of every installation."""

from __future__ import annotations

import re
from collections.abc import Sequence

from .document import DrawnPicture, Folded, FormulaLine, Piece, Section, Sentence, Table, spans
from .printer import Printer

PICTURE = "mechanism.png"  #: the file that a document with a picture takes it from
LINE = 84  #: characters of a line of the document
LEAST = 0.25  #: part of a line that the last column of a table has at least
_HEAD = r"""\documentclass[11pt,a4paper]{article}
\usepackage[T1]{fontenc}
\usepackage[utf8]{inputenc}
\usepackage[margin=22mm]{geometry}
\usepackage{amsmath,amssymb,graphicx,longtable,array}
\setcounter{MaxMatrixCols}{100}
\setlength{\parindent}{0pt}
\setlength{\parskip}{5pt}
\allowdisplaybreaks
\providecommand{\dddot}[1]{\overset{...}{#1}}
\newcommand{\fitted}[1]{\par\smallskip\noindent
\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{$\displaystyle #1$}\par\smallskip}
"""
_ESCAPES = {
    "\\": r"\textbackslash{}", "{": r"\{", "}": r"\}", "$": r"\$", "&": r"\&", "#": r"\#", "%": r"\%", "_": r"\_",
    "^": r"\textasciicircum{}", "~": r"\textasciitilde{}", "<": r"\textless{}", ">": r"\textgreater{}",
}  # fmt: skip
_SPECIAL = re.compile(r"[\\{}$&#%_^~<>]")


def write_tex(title: str, sections: Sequence[Section], printer: Printer, picture: str | None = PICTURE) -> str:
    """A LaTeX document; its pictures are the file ``picture`` beside it, left out where None."""
    found = [_HEAD, rf"\title{{{_text(title)}}}\date{{}}", r"\begin{document}", r"\maketitle"]
    for section in sections:
        command = "section" if section.level == 1 else "subsection"
        found.append(rf"\{command}*{{{_text(section.title)}}}")
        found += [_piece(piece, printer, picture) for piece in section.pieces]
    return "\n".join([*found, r"\end{document}", ""])


def formula_body(formula: FormulaLine, printer: Printer) -> str:
    """LaTeX of a formula, in lines where a side is a long sum or a third one follows."""
    first, *others = formula.sides
    rows: list[str] = []
    for side in others:
        lines = printer.latex_lines(side)
        rows += [f"= {lines[0]}", *(rf"\quad {line}" for line in lines[1:])]
    left = printer.latex(first)
    if len(rows) < 2 or printer.is_short(formula):
        return " ".join([left, *rows])
    inner = " \\\\\n".join(f"{left if k == 0 else ''} & {row}" for k, row in enumerate(rows))
    return f"\\begin{{aligned}}\n{inner}\n\\end{{aligned}}"


def escaped(text: str) -> str:
    """Plain text with the signs of LaTeX taken as letters; characters beyond ASCII as question marks."""
    plain = _SPECIAL.sub(lambda found: _ESCAPES[found[0]], text)
    return plain.encode("ascii", "replace").decode()


def _text(text: str) -> str:
    found = []
    for kind, part in spans(text):
        if kind == "math":
            found.append(f"${part}$")
        else:
            found.append(rf"\texttt{{{escaped(part)}}}" if kind == "name" else escaped(part))
    return "".join(found)


def _piece(piece: Piece, printer: Printer, picture: str | None) -> str:
    match piece:
        case Sentence():
            return _text(piece.text) + "\n"
        case FormulaLine():
            return rf"\fitted{{{formula_body(piece, printer)}}}"
        case Table():
            columns = _columns(piece)
            rows = [" & ".join(map(_text, row)) + r" \\" for row in piece.rows]
            head = " & ".join(map(_text, piece.head)) + r" \\ \hline"
            return "\n".join([rf"\begin{{longtable}}{{{columns}}}", head, *rows, r"\end{longtable}"])
        case DrawnPicture():
            if picture is None:
                return ""
            width = min(1.0, piece.width / 640)
            return rf"\includegraphics[width={width:.2f}\linewidth]{{{picture}}}" + "\n"
        case Folded():
            inner = [_piece(part, printer, picture) for part in piece.pieces]
            return "\n".join([rf"\textit{{{_text(piece.title)}}}" + "\n", *inner])


def _columns(table: Table) -> str:
    """Columns as wide as their cells; the last one of a wide table gets the rest of the line."""
    *sizes, last = (max(map(len, column)) + 2 for column in zip(table.head, *table.rows, strict=True))
    others = ["l"] * len(sizes)
    if sum(sizes) + last <= LINE:
        return " ".join([*others, "l"])
    rest = max(1 - sum(sizes) / LINE, LEAST)
    return " ".join([*others, rf">{{\raggedright\arraybackslash}}p{{{rest:.2f}\linewidth}}"])
