"""Stage explain, Markdown: sections -> text with formulas between double dollars, as GitHub and Jupyter show it."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Sequence

from ..base.texts import html_text
from .document import DrawnPicture, Folded, FormulaLine, Piece, Section, Sentence, Table, spans
from .printer import Printer
from .write_tex import formula_body

_SPECIAL = re.compile(r"([\\*_#<>|\[\]$])")


def write_markdown(title: str, sections: Sequence[Section], printer: Printer) -> str:
    """A Markdown document; pictures are in it."""
    found = [f"# {_text(title)}"]
    for section in sections:
        found.append(f"{'#' * (section.level + 1)} {_text(section.title)}")
        found += [_piece(piece, printer) for piece in section.pieces]
    return "\n\n".join(found) + "\n"


def _text(text: str) -> str:
    found = []
    for kind, part in spans(text):
        if kind == "math":
            found.append(f"${part}$")
        else:
            found.append(f"`{part}`" if kind == "name" else _SPECIAL.sub(r"\\\1", part))
    return "".join(found)


def _piece(piece: Piece, printer: Printer) -> str:
    match piece:
        case Sentence():
            return _text(piece.text)
        case FormulaLine():
            return f"$$\n{formula_body(piece, printer)}\n$$"
        case Table():
            rows = [piece.head, tuple("---" for _ in piece.head), *piece.rows]
            return "\n".join("| " + " | ".join(map(_cell, row)) + " |" for row in rows)
        case DrawnPicture():
            data = b64encode(piece.png).decode()
            return f"![{_text(piece.words)}](data:image/png;base64,{data})"
        case Folded():
            inner = "\n\n".join(_piece(part, printer) for part in piece.pieces)
            plain = html_text(piece.title.replace("`", "").replace("$", ""))
            return f"<details><summary>{plain}</summary>\n\n{inner}\n\n</details>"


def _cell(text: str) -> str:
    return text if text == "---" else _text(text).replace("\n", " ")
