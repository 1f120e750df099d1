"""Figures of matplotlib and bytes of images -> HTML that holds them, for notebooks."""

from __future__ import annotations

import io
from base64 import b64encode
from collections.abc import Callable
from typing import Any

from ..errors import EomgenError
from .texts import html_text

DPI = 110  #: dots of a picture in an inch of its figure
MARGIN = 0.06  #: around what is drawn (inch)
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
    data, width = trimmed_png(figure)
    return image_html(data, "png", width)


def trimmed_png(figure: Any) -> tuple[bytes, int]:
    """A figure with all of its names and without empty margins, and the width in which it is shown."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI, bbox_inches="tight", pad_inches=MARGIN)
    data = buffer.getvalue()
    return data, round(SHOWN / DPI * int.from_bytes(data[16:20], "big"))  # IHDR: width, height


def side_by_side(*parts: str) -> str:
    """Pieces of HTML beside each other; a narrow window shows them one below the other."""
    cells = "".join(f"<div style='max-width:46em'>{part}</div>" for part in parts if part)
    return f"<div style='display:flex;flex-wrap:wrap;gap:1.5em;align-items:flex-start'>{cells}</div>"
