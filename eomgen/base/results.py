"""Results of calls: labelled lines, tables, plain values and pictures -> text, HTML, JSON, DataFrames."""

from __future__ import annotations

import io
from base64 import b64encode
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from math import isfinite
from typing import Any, ClassVar, NamedTuple

from ..errors import EomgenError
from .texts import aligned_rows, html_table, html_text

LEFT = "style='text-align:left'"


def plain(value: Any) -> Any:
    """The value as JSON can hold it: arrays as lists, complex numbers as pairs, None for what is not finite."""
    if value is None or isinstance(value, str | bool | int):
        return value
    if isinstance(value, float):
        return float(value) if isfinite(value) else None
    if isinstance(value, complex):
        return [plain(value.real), plain(value.imag)]
    if isinstance(value, Mapping):
        return {str(key): plain(one) for key, one in value.items()}
    if hasattr(value, "_asdict"):
        return plain(value._asdict())
    if is_dataclass(value):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    return [plain(one) for one in value] if isinstance(value, Iterable) else str(value)


class ResultTable(NamedTuple):
    """Rows of labels and numbers under headings; without headings, labels and values."""

    columns: Sequence[str]
    rows: Sequence[Sequence[Any]]
    title: str = ""
    right: Sequence[int] | None = None  #: columns aligned to the right; all but the first by default

    @property
    def cells(self) -> list[list[str]]:
        """The rows as text."""
        return [[_cell(value) for value in row] for row in self.rows]

    def to_html(self, digits: int = 6, printed: bool = False) -> str:
        """For notebooks; headings may be HTML already."""
        head = "".join(f"<th>{name if printed else html_text(name)}</th>" for name in self.columns)
        cells = ((_cell(value, digits) for value in row) for row in self.rows)
        rows = "".join(
            f"<tr><th {LEFT}>{html_text(label)}</th>{''.join(f'<td>{html_text(one)}</td>' for one in more)}</tr>"
            for label, *more in cells
        )
        return f"<table><tr>{head}</tr>{rows}</table>"

    def to_pandas(self) -> Any:
        """As a DataFrame, the first column its index."""
        from pandas import DataFrame

        frame = DataFrame([list(row) for row in self.rows], columns=list(self.columns) or ["", "value"])
        return frame.set_index(frame.columns[0])


def _cell(value: Any, digits: int = 6) -> str:
    """A cell of a table: numbers with so many digits, a dash for none."""
    return value if isinstance(value, str) else "-" if value is None else f"{value:.{digits}g}"


class Result:
    """What an analysis found: a class of results says its ``title``, its ``facts`` and what ``to_dict`` holds.

    Attributes
    ----------
    title : str
    facts : list of (str, str)
        Label and value of each line of its text.
    tables : sequence of ResultTable
        What lines do not hold.
    """

    #: Key of ``to_dict`` -> attribute.
    KEYS: ClassVar[Mapping[str, str]] = {}

    @property
    def title(self) -> str:
        raise NotImplementedError

    @property
    def facts(self) -> list[tuple[str, str]]:
        raise NotImplementedError

    @property
    def tables(self) -> Sequence[ResultTable]:
        return ()

    def to_dict(self) -> dict[str, Any]:
        """The result as plain values, as ``--json`` prints them."""
        return {key: plain(getattr(self, attribute)) for key, attribute in self.KEYS.items()}

    def to_pandas(self) -> Any:
        """The result, or the first of its tables, as a pandas DataFrame."""
        return next(iter(self.tables), ResultTable((), self.facts)).to_pandas()

    def __repr__(self) -> str:
        return "\n".join([self.title, *aligned_rows(self.facts)])

    def _repr_html_(self) -> str:
        return html_table(self.title, self.facts)


def same_keys(*names: str) -> dict[str, str]:
    """Keys of ``to_dict`` that are called as the attributes."""
    return {name: name for name in names}


# -- pictures in HTML, for notebooks -----------------------------------------------------------------------------------


DPI = 110  #: dots of a picture in an inch of its figure
MARGIN = 0.06  #: around what is drawn (inch)
SCREEN_DPI = 72  #: dots in which this inch is shown: sharp on fine screens, and small


def image_html(data: bytes, kind: str, width: int | None = None, alternative: str = "picture") -> str:
    """An image that needs no file, ``width`` dots of the page wide; ``alternative`` for those who do not see it."""
    size = f" width='{width}'" if width else ""
    size += f" alt='{html_text(alternative)}'"
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
    return data, round(SCREEN_DPI / DPI * int.from_bytes(data[16:20], "big"))  # IHDR: width, height


def side_by_side(*parts: str) -> str:
    """Pieces of HTML beside each other; a narrow window shows them one below the other."""
    cells = "".join(f"<div style='max-width:46em'>{part}</div>" for part in parts if part)
    return f"<div style='display:flex;flex-wrap:wrap;gap:1.5em;align-items:flex-start'>{cells}</div>"
