"""Figures of matplotlib and bytes of images -> HTML that holds them, for notebooks."""

from __future__ import annotations

import io
from base64 import b64encode
from collections.abc import Callable
from typing import Any

from ..errors import EomgenError
from ..texts import html_text

DPI = 110  #: dots of a picture in an inch of its figure
SHOWN = 72  #: dots in which this inch is shown: sharp on fine screens, and small


def image_html(data: bytes, kind: str, width: int | None = None, words: str = "picture") -> str:
    """An image that needs no file.

    Parameters
    ----------
    data : bytes
    kind : {'png', 'gif'}
    width : int, optional
        In dots of the page.
    words : str
        What is to be seen, for those who do not see it.
    """
    size = f" width='{width}'" if width else ""
    size += f" alt='{html_text(words)}'"
    return f"<img{size} style='max-width:100%;height:auto' src='data:image/{kind};base64,{b64encode(data).decode()}'>"


def picture_html(make: Callable[[], Any]) -> str:
    """The figure that a call makes, as an image; in a few words why there is none where eomgen refuses it.

    Parameters
    ----------
    make : callable
        Gives a matplotlib Figure.
    """
    try:
        figure = make()
    except EomgenError as error:
        first = str(error).partition("\n")[0]
        return f"<p><i>no picture: {html_text(first)}</i></p>"
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI)
    return image_html(buffer.getvalue(), "png", round(SHOWN * figure.get_size_inches()[0]))


def side_by_side(*parts: str) -> str:
    """Pieces of HTML beside each other; a narrow window shows them one below the other."""
    cells = "".join(f"<div style='max-width:46em'>{part}</div>" for part in parts if part)
    return f"<div style='display:flex;flex-wrap:wrap;gap:1.5em;align-items:flex-start'>{cells}</div>"
