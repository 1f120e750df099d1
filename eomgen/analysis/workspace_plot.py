"""Analysis: a Workspace -> axes of matplotlib: outputs and grid, coloured by a measure, singular positions marked."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from ..base.notation import Notation, label
from ..errors import ill_typed
from ..runtime.near_names import require

MARKS = {"stop": ("x", "tab:red"), "change point": ("^", "tab:orange"), "outputs": (".", "black")}


class Coloured(Protocol):
    """What a :class:`~.workspace.Workspace` is drawn from."""

    name: str
    of: tuple[str, ...]
    over: Any
    units: Any
    singularities: Any
    notation: Notation

    @property
    def reached(self) -> Any: ...

    def __getitem__(self, name: str) -> Any: ...


def plot_workspace(ws: Coloured, by: str, ax: Any = None, figure: Any = None) -> Any:
    """Draw a workspace; see :meth:`.workspace.Workspace.plot`."""
    colour = ws[by]
    if colour.dtype.kind not in "fb":
        raise ill_typed(f"by={by!r}: a workspace can be coloured only by a column of numbers")
    if ax is None and figure is None:
        pyplot = require("matplotlib.pyplot", "matplotlib", "plot")
        figure = pyplot.figure(figsize=(11.0, 4.8), layout="constrained")
    spaces = (ws.of, tuple(ws.over)) if ax is None else (ws.of,)
    seen = colour[ws.reached & np.isfinite(colour)].astype(float)
    top = float(np.quantile(seen, 0.98)) if seen.size else 1.0  # a few points near a singular one tell nothing
    colour = np.where(np.isfinite(colour), np.minimum(colour, top), np.nan)
    drawn, panels = None, []
    for k, names in enumerate(spaces):
        shown = names[:3] if len(names) > 1 else (next(iter(ws.over)), names[0]) if k == 0 else (names[0], by)
        panel = ax or figure.add_subplot(1, 2, k + 1, projection="3d" if len(shown) == 3 else None)
        drawn = _draw(ws, panel, [ws[name] for name in shown], colour, cells=k == 1 and len(names) == 2)
        for axis, name in zip(("x", "y", "z"), shown, strict=False):
            getattr(panel, f"set_{axis}label")(label(ws.notation.mathtext(name), ws.units.get(name, "")))
        if k == 1 and len(shown) <= 3 and by not in shown:
            _mark(ws, panel, shown)
        units = {ws.units.get(name, "") for name in shown}
        if k == 0 and len(units) == 1 and len(names) == 2:
            panel.set_aspect("equal", adjustable="datalim")
        panels.append(panel)
    if ax is not None:
        return ax
    figure.suptitle(ws.name)
    if drawn is not None:
        figure.colorbar(drawn, ax=panels, label=ws.notation.mathtext(by))
    return np.array(panels)


def _draw(ws: Coloured, panel: Any, places: list[Any], colour: Any, cells: bool) -> Any:
    """Points, or cells of the grid itself, in colour."""
    reached = ws.reached
    if cells:
        panel.scatter(*(x[~reached] for x in places), s=4, color="0.85", marker="s", linewidths=0)
        return panel.pcolormesh(*places, np.where(reached, colour, np.nan), shading="nearest")
    size = float(np.clip(20_000.0 / max(1, int(reached.sum())), 2.0, 30.0))
    order = np.flatnonzero(reached)
    flat = [x.ravel()[order] for x in places]
    return panel.scatter(*flat, c=colour.ravel()[order].astype(float), s=size, linewidths=0)


def _mark(ws: Coloured, panel: Any, names: tuple[str, ...]) -> None:
    """Singular positions on the grid."""
    for kind, (marker, colour) in MARKS.items():
        same = [one for one in ws.singularities if one.kind == kind]
        if same:
            places = [[one.values[name] for one in same] for name in names]
            panel.scatter(*places, marker=marker, s=14, color=colour, linewidths=0.8, label=f"singular: {kind}")
    if panel.get_legend_handles_labels()[0]:
        panel.legend(fontsize="small", loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, frameon=False)
