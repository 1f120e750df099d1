"""Sections -> a page of HTML, Markdown or LaTeX."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Sequence

from ..base.inline_pictures import image_html
from ..base.notation import Notation
from ..base.texts import html_text
from ..expr.printing import given_mathml, latex, latex_lines, mathml, mathml_lines, text
from ..expr.printing.formula import Letter, MatrixOf
from .document import DrawnPicture, Folded, FormulaLine, Piece, Section, Sentence, Table, written

SHORT = 32  #: characters of a side that leaves room for another one in its line


def _is_short(formula: FormulaLine, names: Notation) -> bool:
    """Whether all sides go into one line."""
    trees = [side for side in formula.sides if not isinstance(side, Letter)]
    return all(not isinstance(x, MatrixOf) and len(text(x, names)) <= SHORT for x in trees)


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
    found = [_HEAD, rf"\title{{{_tex_text(title)}}}\date{{}}", r"\begin{document}", r"\maketitle"]
    for section in sections:
        command = "section" if section.level == 1 else "subsection"
        found.append(rf"\{command}*{{{_tex_text(section.title)}}}")
        found += [_tex_piece(piece, names, picture) for piece in section.pieces]
    return "\n".join([*found, r"\end{document}", ""])


def formula_body(formula: FormulaLine, names: Notation) -> str:
    """LaTeX of a formula, in lines where a side is a long sum or a third one follows."""
    first, *others = formula.sides
    rows: list[str] = []
    for side in others:
        lines = latex_lines(side, names)
        rows += [f"= {lines[0]}", *(rf"\quad {line}" for line in lines[1:])]
    left = latex(first, names)
    if len(rows) < 2 or _is_short(formula, names):
        return " ".join([left, *rows])
    inner = " \\\\\n".join(f"{left if k == 0 else ''} & {row}" for k, row in enumerate(rows))
    return f"\\begin{{aligned}}\n{inner}\n\\end{{aligned}}"


def escaped(text: str) -> str:
    """Plain text with the signs of LaTeX taken as letters; characters beyond ASCII as question marks."""
    plain = _TEX_SPECIAL.sub(lambda found: _ESCAPES[found[0]], text)
    return plain.encode("ascii", "replace").decode()


def _tex_text(text: str) -> str:
    return written(text, "${}$".format, lambda name: rf"\texttt{{{escaped(name)}}}", escaped)


def _tex_piece(piece: Piece, names: Notation, picture: str | None) -> str:
    match piece:
        case Sentence():
            return _tex_text(piece.text) + "\n"
        case FormulaLine():
            return rf"\fitted{{{formula_body(piece, names)}}}"
        case Table():
            columns = _columns(piece)
            rows = [" & ".join(map(_tex_text, row)) + r" \\" for row in piece.rows]
            head = " & ".join(map(_tex_text, piece.head)) + r" \\ \hline"
            return "\n".join([rf"\begin{{longtable}}{{{columns}}}", head, *rows, r"\end{longtable}"])
        case DrawnPicture():
            if picture is None:
                return ""
            width = min(1.0, piece.width / 640)
            return rf"\includegraphics[width={width:.2f}\linewidth]{{{picture}}}" + "\n"
        case Folded():
            inner = [_tex_piece(part, names, picture) for part in piece.pieces]
            return "\n".join([rf"\textit{{{_tex_text(piece.title)}}}" + "\n", *inner])


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
body{font:17px/1.5 "Source Serif 4",Georgia,"DejaVu Serif",serif;max-width:52em;margin:2em auto;padding:0 1.2em;
color:#1b1b1b;background:#fff}
h1,h2,h3{font-family:"Source Sans 3","Helvetica Neue",Arial,"DejaVu Sans",sans-serif;line-height:1.25}
h1{font-size:1.7em}
h2{font-size:1.3em;margin:1.8em 0 .5em;border-bottom:1px solid #c8c8c8}
h3{font-size:1.05em;margin:1.3em 0 .3em}
code{font-size:.88em;background:#f2f2f2;padding:0 .2em;border-radius:2px}
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
thead th{border-bottom:1px solid #666}
tbody tr+tr td{border-top:1px solid #e4e4e4}
details{margin:.6em 0;border-left:3px solid #d5d5d5;padding-left:.8em}
summary{cursor:pointer;color:#24527a}
.section{margin:0;border:0;padding:0}
.section>summary>h2{display:inline-block;margin:.3em 0;font-size:1.15em}
nav{columns:2;font-size:.95em}
@media print{details{display:block}}
"""


def write_html(title: str, sections: Sequence[Section], names: Notation) -> str:
    """A page that stands alone."""
    body = [f"<h1>{_html(title)}</h1>"]
    links = [f"<li><a href='#s{k}'>{_html(s.title)}</a></li>" for k, s in enumerate(sections, 1) if s.level == 1]
    body.append(f"<nav><ol>{''.join(links)}</ol></nav>")
    opened = False
    for k, section in enumerate(sections, 1):
        tag = f"h{section.level + 1}"
        heading = f"<{tag} id='s{k}'>{_html(section.title)}</{tag}>"
        if section.level == 1:
            body += ["</details>"] * opened
            opened = section.folded
        body.append(f"<details class='section'><summary>{heading}</summary>" if section.folded else heading)
        body += [_html_piece(piece, names) for piece in section.pieces]
    body += ["</details>"] * opened
    plain = html_text(title.replace("`", "").replace("$", ""))
    head = (
        "<!DOCTYPE html>\n<html lang='en'><head><meta charset='utf-8'><meta name='viewport' "
        f"content='width=device-width,initial-scale=1'><title>{plain}</title><style>{_STYLE}</style></head>\n<body>"
    )
    return "\n".join([head, *body, "</body></html>", ""])


def _html(text: str) -> str:
    return written(
        text, lambda x: f"<math>{given_mathml(x)}</math>", lambda x: f"<code>{html_text(x)}</code>", html_text
    )


def _html_piece(piece: Piece, names: Notation) -> str:
    match piece:
        case Sentence():
            return f"<p>{_html(piece.text)}</p>"
        case FormulaLine():
            return f"<div class='formula'><math displaystyle='true'>{_formula(piece, names)}</math></div>"
        case Table():
            head = "".join(f"<th>{_html(cell)}</th>" for cell in piece.head)
            rows = "".join("<tr>" + "".join(f"<td>{_html(cell)}</td>" for cell in row) + "</tr>" for row in piece.rows)
            return f"<div class='scroll'><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>"
        case DrawnPicture():
            return f"<p>{image_html(piece.png, 'png', piece.width, piece.words)}</p>"
        case Folded():
            inner = "\n".join(_html_piece(part, names) for part in piece.pieces)
            return f"<details><summary>{_html(piece.title)}</summary>\n{inner}\n</details>"


def _formula(formula: FormulaLine, names: Notation) -> str:
    """One row of sides, or several lines where a side is a long sum or a third one follows."""
    first, *others = formula.sides
    left = f"<mrow>{mathml(first, names)}</mrow>"
    rows: list[str] = []
    for side in others:
        lines = mathml_lines(side, names)
        rows.append(f"<mo>=</mo><mrow>{lines[0]}</mrow>")
        rows += [f"<mspace width='1.2em'/><mrow>{line}</mrow>" for line in lines[1:]]
    if len(rows) == 0:
        return left
    if len(rows) == 1 or _is_short(formula, names):
        return f"<mrow>{left}{''.join(rows)}</mrow>"
    cells = [f"<mtr><mtd>{left if k == 0 else ''}</mtd><mtd>{row}</mtd></mtr>" for k, row in enumerate(rows)]
    return f"<mtable class='lines' displaystyle='true'>{''.join(cells)}</mtable>"


# -- Markdown ----------------------------------------------------------------------------------------------------------


_MARKDOWN_SPECIAL = re.compile(r"([\\*_#<>|\[\]$])")


def write_markdown(title: str, sections: Sequence[Section], names: Notation) -> str:
    """A Markdown document; pictures are in it."""
    found = [f"# {_markdown_text(title)}"]
    for section in sections:
        found.append(f"{'#' * (section.level + 1)} {_markdown_text(section.title)}")
        found += [_markdown_piece(piece, names) for piece in section.pieces]
    return "\n\n".join(found) + "\n"


def _markdown_text(text: str) -> str:
    return written(text, "${}$".format, "`{}`".format, lambda x: _MARKDOWN_SPECIAL.sub(r"\\\1", x))


def _markdown_piece(piece: Piece, names: Notation) -> str:
    match piece:
        case Sentence():
            return _markdown_text(piece.text)
        case FormulaLine():
            return f"$$\n{formula_body(piece, names)}\n$$"
        case Table():
            rows = [piece.head, tuple("---" for _ in piece.head), *piece.rows]
            return "\n".join("| " + " | ".join(map(_cell, row)) + " |" for row in rows)
        case DrawnPicture():
            data = b64encode(piece.png).decode()
            return f"![{_markdown_text(piece.words)}](data:image/png;base64,{data})"
        case Folded():
            inner = "\n\n".join(_markdown_piece(part, names) for part in piece.pieces)
            plain = html_text(piece.title.replace("`", "").replace("$", ""))
            return f"<details><summary>{plain}</summary>\n\n{inner}\n\n</details>"


def _cell(text: str) -> str:
    return text if text == "---" else _markdown_text(text).replace("\n", " ")
