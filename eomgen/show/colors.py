"""Stage show, colours: bodies in colours that are told apart, other roles in greys."""

from __future__ import annotations

from typing import NamedTuple

from ..base.picture_data import GROUND
from .scene import Item, Label

#: Okabe and Ito's colours, which colour-blind readers tell apart, without yellow; then darker ones.
BODIES = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#7A5195", "#2F4B7C", "#A05195", "#665191")
DARK = "#333333"


class Style(NamedTuple):
    """How a role is drawn; None: in the colour of the body."""

    color: str | None
    face: str | None = None
    edge: str | None = None
    width: float = 1.2
    alpha: float = 1.0


STYLES = {
    "hatch": Style("#777777", "#BBBBBB", "#777777", 1.1),
    "rail": Style("#888888", "#CCCCCC", "#888888", 1.2),
    "shape": Style(None, None, None, 0.8, 0.75),
    "link": Style(None, None, None, 0.8, 0.85),
    "wheel": Style(DARK, None, DARK, 1.2, 0.45),
    "force": Style("#B22222", "#B22222", "#B22222", 1.3),
    "pull": Style("#B22222", width=1.3),
    "com": Style(DARK, DARK, DARK, 0.5),
    "block": Style(None, None, DARK, 1.0),
    "joint": Style(DARK, "white", DARK, 1.3),
    "frame": Style(None, width=1.2),
    "trace": Style("#999999", width=1.2),
    "arrow": Style("#7B1FA2", width=1.8),
}
AXES = {"x": "#D62728", "y": "#2CA02C", "z": "#1F77B4"}


def style_of(role: str) -> Style:
    """How a role is drawn."""
    return STYLES[role]


def color_of(item: Item | Label) -> str:
    """The colour of lines and, where the role has none of its own, of faces."""
    if isinstance(item, Item) and item.color:
        return item.color
    if item.role == "frame":
        return AXES[item.name] if isinstance(item, Item) else DARK
    own = STYLES[item.role].color if isinstance(item, Item) else None
    if own is not None and not (item.role == "wheel" and isinstance(item, Item) and item.faces is not None):
        return own
    return BODIES[item.body % len(BODIES)] if item.body != GROUND else "#888888"
