"""Pages that are files of the repository, and links that are right on both sides: in the repository and in the site.

``{include}`` of a file outside of docs takes its text with its links turned to the pages of the site.  A link of a page
to such a file leads to the page that includes it; one to any other file of the repository offers the file.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parents[1]
ROOT = DOCS.parent
LINK = re.compile(r"(\]\()([^)#:\s]+)((?:#[^)\s]*)?\))")
INCLUDE = re.compile(r"^```\{include\} (\S+)\n```$", re.MULTILINE)


def included_files() -> dict[Path, Path]:
    """File of the repository -> the page that includes it."""
    return {
        (page.parent / name).resolve(): page
        for page in DOCS.glob("project/*.md")
        for name in INCLUDE.findall(page.read_text(encoding="utf-8"))
    }


def turn_links(text: str, home: Path, page: Path, pages: dict[Path, Path]) -> str:
    """The text of a file in the folder ``home`` with links as a page at the path ``page`` needs them."""

    def turned(found: re.Match[str]) -> str:
        target = (home / found[2]).resolve()
        if not target.exists():
            return found[0]  # Sphinx tells
        target = pages.get(target, target)
        return f"{found[1]}{Path(os.path.relpath(target, page.parent)).as_posix()}{found[3]}"

    return LINK.sub(turned, text)


def read_source(app: Any, name: str, source: list[str]) -> None:
    """Take in what a page includes, and turn its links."""
    page = Path(app.env.doc2path(name))
    if page.suffix != ".md":
        return
    pages = included_files()

    def taken(found: re.Match[str]) -> str:
        path = (page.parent / found[1]).resolve()
        app.env.note_dependency(str(path))
        return turn_links(path.read_text(encoding="utf-8"), path.parent, page, pages)

    text = turn_links(source[0], page.parent, page, pages)
    source[0] = INCLUDE.sub(taken, text)


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("source-read", read_source)
    return {"parallel_read_safe": True}
