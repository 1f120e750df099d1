"""Stage explain, HTML: sections -> one page that needs no network; formulas are MathML, which browsers draw."""

from __future__ import annotations

from collections.abc import Sequence

from ..base.inline_pictures import image_html
from ..base.texts import html_text
from ..printing import given_mathml
from .document import DrawnPicture, Folded, FormulaLine, Piece, Section, Sentence, Table, spans
from .printer import Printer

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
nav{columns:2;font-size:.95em}
@media print{details{display:block}}
"""


def write_html(title: str, sections: Sequence[Section], printer: Printer) -> str:
    """A page that stands alone."""
    body = [f"<h1>{_text(title)}</h1>"]
    links = [f"<li><a href='#s{k}'>{_text(s.title)}</a></li>" for k, s in enumerate(sections, 1) if s.level == 1]
    body.append(f"<nav><ol>{''.join(links)}</ol></nav>")
    for k, section in enumerate(sections, 1):
        tag = f"h{section.level + 1}"
        body.append(f"<{tag} id='s{k}'>{_text(section.title)}</{tag}>")
        body += [_piece(piece, printer) for piece in section.pieces]
    plain = html_text(title.replace("`", "").replace("$", ""))
    head = (
        "<!DOCTYPE html>\n<html lang='en'><head><meta charset='utf-8'>"
        "<meta name='viewport' content='width=device-width,initial-scale=1'>"
        f"<title>{plain}</title><style>{_STYLE}</style></head>\n<body>"
    )
    return "\n".join([head, *body, "</body></html>", ""])


def _text(text: str) -> str:
    found = []
    for kind, part in spans(text):
        if kind == "math":
            found.append(f"<math>{given_mathml(part)}</math>")
        else:
            found.append(f"<code>{html_text(part)}</code>" if kind == "name" else html_text(part))
    return "".join(found)


def _piece(piece: Piece, printer: Printer) -> str:
    match piece:
        case Sentence():
            return f"<p>{_text(piece.text)}</p>"
        case FormulaLine():
            return f"<div class='formula'><math displaystyle='true'>{_formula(piece, printer)}</math></div>"
        case Table():
            head = "".join(f"<th>{_text(cell)}</th>" for cell in piece.head)
            rows = "".join("<tr>" + "".join(f"<td>{_text(cell)}</td>" for cell in row) + "</tr>" for row in piece.rows)
            return f"<div class='scroll'><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>"
        case DrawnPicture():
            return f"<p>{image_html(piece.png, 'png', piece.width, piece.words)}</p>"
        case Folded():
            inner = "\n".join(_piece(part, printer) for part in piece.pieces)
            return f"<details><summary>{_text(piece.title)}</summary>\n{inner}\n</details>"


def _formula(formula: FormulaLine, printer: Printer) -> str:
    """One row of sides, or several lines where a side is a long sum or a third one follows."""
    first, *others = formula.sides
    left = f"<mrow>{printer.mathml(first)}</mrow>"
    rows: list[str] = []
    for side in others:
        lines = printer.mathml_lines(side)
        rows.append(f"<mo>=</mo><mrow>{lines[0]}</mrow>")
        rows += [f"<mspace width='1.2em'/><mrow>{line}</mrow>" for line in lines[1:]]
    if len(rows) == 0:
        return left
    if len(rows) == 1 or printer.is_short(formula):
        return f"<mrow>{left}{''.join(rows)}</mrow>"
    cells = [f"<mtr><mtd>{left if k == 0 else ''}</mtd><mtd>{row}</mtd></mtr>" for k, row in enumerate(rows)]
    return f"<mtable class='lines' displaystyle='true'>{''.join(cells)}</mtable>"
