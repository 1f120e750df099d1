"""Headings, sentences, formulas, tables and pictures: one model of a document, written as HTML, Markdown or LaTeX."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Callable, Sequence
from typing import NamedTuple

from ..base.results import image_html
from ..base.texts import html_text, visible
from ..expr.notation import Notation
from ..expr.printing.formula import Formula, Letter, Matrix
from ..expr.printing.writers import latex, latex_lines, mathml, mathml_lines, row, text

# -- parts of a document -----------------------------------------------------------------------------------------------

# Texts hold names of the model between backquotes and short formulas between dollars, ``the angle $\theta$ of `rod` ``,
# or are pieces of text and trees of formulas side by side.


Text = str | tuple[str | Formula, ...]
_PARTS = re.compile(r"(\$[^$]+\$|`[^`]+`)")


def written(text: Text, math: Callable[[Formula], str], name: Callable[[str], str], plain: Callable[[str], str]) -> str:
    """A text whose formulas, names and other pieces are written so."""
    result = ""
    for piece in (text,) if isinstance(text, str) else text:
        for part in _PARTS.split(visible(piece)) if isinstance(piece, str) else (piece,):
            if not isinstance(part, str):
                result += math(part)
            elif part[:1] == "$" and len(part) > 2:
                result += math(Letter(part[1:-1]))
            elif part[:1] == "`" and len(part) > 2:
                result += name(part[1:-1])
            elif part:
                result += plain(part)
    return result


class Sentence(NamedTuple):
    """A paragraph."""

    text: Text


class FormulaLine(NamedTuple):
    """Sides with signs of equality between them."""

    sides: tuple[Formula, ...]


class Row(NamedTuple):
    """Short formulas that stand side by side where there is room."""

    lines: tuple[FormulaLine, ...]


class Table(NamedTuple):
    """Rows of texts under a head."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


class DrawnPicture(NamedTuple):
    """A picture in the bytes of a PNG file, ``width`` in dots of a page."""

    png: bytes
    width: int
    phrase: str


class Folded(NamedTuple):
    """Pieces that a page shows on request; ``title`` is always seen."""

    title: Text
    pieces: tuple[Piece, ...]


Piece = Sentence | FormulaLine | Row | Table | DrawnPicture | Folded


class Section(NamedTuple):
    """A heading and what stands below it; sections of ``level`` 2 belong to the one of level 1 before.

    A page shows what is ``folded``, with what belongs to it, on request.
    """

    title: str
    pieces: tuple[Piece, ...]
    level: int = 1
    folded: bool = False


SHORT = 32  #: characters of a side that leaves room for another one in its line


def _in_one_line(formula: FormulaLine, rows: Sequence[str], names: Notation) -> bool:
    """Whether all sides go into one line: there is one right side that is no long sum, or all are short."""
    trees = [side for side in formula.sides if not isinstance(side, Letter)]
    return len(rows) < 2 or all(not isinstance(x, Matrix) and len(text(x, names)) <= SHORT for x in trees)


# -- LaTeX -------------------------------------------------------------------------------------------------------------


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
_TEX_SPECIAL = re.compile(r"[\\{}$&#%_^~<>]")


def write_tex(title: str, sections: Sequence[Section], names: Notation, picture: str | None = PICTURE) -> str:
    """A LaTeX document; its pictures are the file ``picture`` beside it, left out where None."""
    result = [_HEAD, rf"\title{{{_tex_text(title, names)}}}\date{{}}", r"\begin{document}", r"\maketitle"]
    for section in sections:
        command = "section" if section.level == 1 else "subsection"
        result.append(rf"\{command}*{{{_tex_text(section.title, names)}}}")
        result += [_tex_piece(piece, names, picture) for piece in section.pieces]
    return "\n".join([*result, r"\end{document}", ""])


def tex_formula(formula: FormulaLine | Row, names: Notation) -> str:
    """LaTeX of a formula, in lines where a side is a long sum or a third one follows; of several side by side."""
    if isinstance(formula, Row):
        return r" \qquad ".join(tex_formula(line, names) for line in formula.lines)
    first, *others = formula.sides
    rows: list[str] = []
    for side in others:
        lines = latex_lines(side, names)
        rows += [f"= {lines[0]}", *(rf"\quad {line}" for line in lines[1:])]
    left = latex(first, names)
    if _in_one_line(formula, rows, names):
        return " ".join([left, *rows])
    inner = " \\\\\n".join(f"{left if k == 0 else ''} & {row}" for k, row in enumerate(rows))
    return f"\\begin{{aligned}}\n{inner}\n\\end{{aligned}}"


def escaped(text: str) -> str:
    """Plain text with the signs of LaTeX taken as letters; characters beyond ASCII as question marks."""
    plain = _TEX_SPECIAL.sub(lambda result: _ESCAPES[result[0]], text)
    return plain.encode("ascii", "replace").decode()


def _tex_text(text: Text, names: Notation) -> str:
    return written(text, lambda x: f"${latex(x, names)}$", lambda name: rf"\texttt{{{escaped(name)}}}", escaped)


def _tex_piece(piece: Piece, names: Notation, picture: str | None) -> str:
    match piece:
        case Sentence():
            return _tex_text(piece.text, names) + "\n"
        case FormulaLine() | Row():
            return rf"\fitted{{{tex_formula(piece, names)}}}"
        case Table():
            head, *rows = (" & ".join(_tex_text(cell, names) for cell in one) for one in (piece.head, *piece.rows))
            lines = (rf"{one} \\" for one in rows)
            return "\n".join(
                [rf"\begin{{longtable}}{{{_columns(piece)}}}", rf"{head} \\ \hline", *lines, r"\end{longtable}"]
            )
        case DrawnPicture():
            if picture is None:
                return ""
            width = min(1.0, piece.width / 640)
            return rf"\includegraphics[width={width:.2f}\linewidth]{{{picture}}}" + "\n"
        case Folded():
            inner = [_tex_piece(part, names, picture) for part in piece.pieces]
            return "\n".join([rf"\textit{{{_tex_text(piece.title, names)}}}" + "\n", *inner])


def _columns(table: Table) -> str:
    """Columns as wide as their cells; the last one of a wide table gets the rest of the line."""
    *sizes, last = (max(map(len, column)) + 2 for column in zip(table.head, *table.rows, strict=True))
    others = ["l"] * len(sizes)
    if sum(sizes) + last <= LINE:
        return " ".join([*others, "l"])
    rest = max(1 - sum(sizes) / LINE, LEAST)
    return " ".join([*others, rf">{{\raggedright\arraybackslash}}p{{{rest:.2f}\linewidth}}"])


# -- HTML --------------------------------------------------------------------------------------------------------------


_STYLE = """
:root{color-scheme:light dark}
body{font:17px/1.5 "Source Serif 4",Georgia,"DejaVu Serif",serif;max-width:52em;margin:2em auto;padding:0 1.2em;
color:CanvasText;background:Canvas}
h1,h2,h3{font-family:"Source Sans 3","Helvetica Neue",Arial,"DejaVu Sans",sans-serif;line-height:1.25}
h1{font-size:1.7em}
h2{font-size:1.3em;margin:1.8em 0 .5em;border-bottom:1px solid #8886}
h3{font-size:1.05em;margin:1.3em 0 .3em}
code{font-size:.88em;background:#8882;padding:0 .2em;border-radius:2px}
.formula{overflow-x:auto;overflow-y:hidden;margin:.55em 0;padding:.25em 0 .25em 1.5em}
math{font-family:"STIX Two Math","Cambria Math","Latin Modern Math","Libertinus Math",math,serif}
.formula math{font-size:1.1em}
mi[mathvariant=bold]{font-weight:bold;font-style:normal;text-transform:none}
mover>mo:last-child{padding-bottom:.09em}
mtd{padding:.18em .45em}
.matrix>mo{display:none}
.matrix>mtable{margin:0 .15em;padding:.1em 0;vertical-align:middle;
background:linear-gradient(currentColor,currentColor) left top/.35em 1px,
linear-gradient(currentColor,currentColor) left bottom/.35em 1px,
linear-gradient(currentColor,currentColor) right top/.35em 1px,
linear-gradient(currentColor,currentColor) right bottom/.35em 1px;background-repeat:no-repeat;
border-left:1px solid;border-right:1px solid}
mtable.lines>mtr>mtd{text-align:left;padding:.12em .15em}
mtable.lines>mtr>mtd:first-child{text-align:right}
.scroll{overflow-x:auto}
table{border-collapse:collapse;margin:.6em 0;font-size:.95em}
th,td{padding:.2em .8em .2em 0;text-align:left;vertical-align:top}
thead th{border-bottom:1px solid #888}
tbody tr+tr td{border-top:1px solid #8883}
details{margin:.6em 0;border-left:3px solid #8885;padding-left:.8em}
summary{cursor:pointer;color:LinkText}
.section{margin:0;border:0;padding:0}
.section>summary>h2{display:inline-block;margin:.3em 0;font-size:1.15em}
nav{font-size:.95em}
nav ol{columns:2}
@media print{details{display:block}}
"""


class Look(NamedTuple):
    """Attributes of elements of HTML: none on a page with a style sheet, styles where a notebook has its own."""

    text: str = ""
    math: str = ""
    formula: str = " class='formula'"
    first: str = ""  #: cell of a left side
    others: str = ""  #: cell of what stands right of it
    cell: str = ""
    folded: str = ""


def write_html(title: str, sections: Sequence[Section], names: Notation) -> str:
    """A page that stands alone."""
    look = Look()
    body = [f"<h1>{_html_text(title, names, look)}</h1>"]
    heads = [_html_text(section.title, names, look) for section in sections]
    links = (f"<li><a href='#s{k}'>{heads[k - 1]}</a></li>" for k, s in enumerate(sections, 1) if s.level == 1)
    body.append(f"<nav><details><summary>Contents</summary><ol>{''.join(links)}</ol></details></nav>")
    opened = False
    for k, section in enumerate(sections, 1):
        tag = f"h{section.level + 1}"
        heading = f"<{tag} id='s{k}'>{heads[k - 1]}</{tag}>"
        if section.level == 1:
            body += ["</details>"] * opened
            opened = section.folded
        body.append(f"<details class='section'><summary>{heading}</summary>" if section.folded else heading)
        body += [html(piece, names, look) for piece in section.pieces]
    body += ["</details>"] * opened
    plain = html_text(title.replace("`", "").replace("$", ""))
    head = (
        "<!DOCTYPE html>\n<html lang='en'><head><meta charset='utf-8'><meta name='viewport' "
        f"content='width=device-width,initial-scale=1'><title>{plain}</title><style>{_STYLE}</style></head>\n<body>"
    )
    return "\n".join([head, *body, "</body></html>", ""])


def _html_text(text: Text, names: Notation, look: Look) -> str:
    return written(
        text,
        lambda x: f"<math{look.math}>{mathml(x, names)}</math>",
        lambda x: f"<code>{html_text(x)}</code>",
        html_text,
    )


def html(piece: Piece, names: Notation, look: Look) -> str:
    """Elements of HTML with formulas in MathML, which needs neither a script nor a network."""
    match piece:
        case Sentence():
            return f"<p{look.text}>{_html_text(piece.text, names, look)}</p>"
        case FormulaLine() | Row():
            formula = _formula(piece, names, look)
            return f"<div{look.formula}><math displaystyle='true'{look.math}>{formula}</math></div>"
        case Table():
            head = "".join(f"<th{look.cell}>{_html_text(cell, names, look)}</th>" for cell in piece.head)
            rows = "".join(
                f"<tr>{''.join(f'<td{look.cell}>{_html_text(cell, names, look)}</td>' for cell in one)}</tr>"
                for one in piece.rows
            )
            return f"<div class='scroll'><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>"
        case DrawnPicture():
            return f"<p>{image_html(piece.png, 'png', piece.width, piece.phrase)}</p>"
        case Folded():
            inner = "\n".join(html(part, names, look) for part in piece.pieces)
            title = _html_text(piece.title, names, look)
            return f"<details><summary>{title}</summary>\n<div{look.folded}>{inner}</div>\n</details>"


def _formula(formula: FormulaLine | Row, names: Notation, look: Look) -> str:
    """One row of sides, or several lines where a side is a long sum or a third one follows."""
    if isinstance(formula, Row):
        return "<mspace width='2em'></mspace>".join(_formula(line, names, look) for line in formula.lines)
    first, *others = formula.sides
    left = row(mathml(first, names))
    rows: list[str] = []
    for side in others:
        lines = mathml_lines(side, names)
        rows.append(f"<mo>=</mo>{row(lines[0])}")
        rows += [f"<mspace width='1.2em'/>{row(line)}" for line in lines[1:]]
    if _in_one_line(formula, rows, names):
        return row(left, *rows)
    cells = (
        f"<mtr><mtd{look.first}>{left if k == 0 else ''}</mtd><mtd{look.others}>{one}</mtd></mtr>"
        for k, one in enumerate(rows)
    )
    return f"<mtable class='lines' displaystyle='true'>{''.join(cells)}</mtable>"


# -- Markdown ----------------------------------------------------------------------------------------------------------


_MARKDOWN_SPECIAL = re.compile(r"([\\*_#<>|\[\]$])")


def write_markdown(title: str, sections: Sequence[Section], names: Notation) -> str:
    """A Markdown document; pictures are in it."""
    result = [f"# {_markdown_text(title, names)}"]
    for section in sections:
        result.append(f"{'#' * (section.level + 1)} {_markdown_text(section.title, names)}")
        result += [_markdown_piece(piece, names) for piece in section.pieces]
    return "\n\n".join(result) + "\n"


def _markdown_text(text: Text, names: Notation) -> str:
    return written(text, lambda x: f"${latex(x, names)}$", "`{}`".format, lambda x: _MARKDOWN_SPECIAL.sub(r"\\\1", x))


def _markdown_piece(piece: Piece, names: Notation) -> str:
    match piece:
        case Sentence():
            return _markdown_text(piece.text, names)
        case FormulaLine() | Row():
            return f"$$\n{tex_formula(piece, names)}\n$$"
        case Table():
            cells = [
                [_markdown_text(cell, names).replace("\n", " ") for cell in one] for one in (piece.head, *piece.rows)
            ]
            cells.insert(1, ["---"] * len(piece.head))
            return "\n".join(f"| {' | '.join(one)} |" for one in cells)
        case DrawnPicture():
            data = b64encode(piece.png).decode()
            return f"![{_markdown_text(piece.phrase, names)}](data:image/png;base64,{data})"
        case Folded():
            inner = "\n\n".join(_markdown_piece(part, names) for part in piece.pieces)
            title = written(piece.title, lambda x: html_text(latex(x, names)), html_text, html_text)
            return f"<details><summary>{title}</summary>\n\n{inner}\n\n</details>"
