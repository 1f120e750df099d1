"""Stage show, panels: columns of a run -> panels beside an animation, one for each unit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from ..base.algebra import Array
from ..base.notation import label
from .shown_motion import ShownMotion


class ShownColumn(NamedTuple):
    """A column of the run that is drawn along: its name as it is printed, its unit, its values over what goes on."""

    name: str
    unit: str
    over: Array
    values: Array


def by_unit(curves: Sequence[ShownColumn]) -> list[list[ShownColumn]]:
    """Columns in groups of one unit, in the order in which they come."""
    groups: dict[str, list[ShownColumn]] = {}
    for curve in curves:
        groups.setdefault(curve.unit, []).append(curve)
    return list(groups.values())


def draw_curves(axes: Sequence[Any], panels: Sequence[Sequence[ShownColumn]], motion: ShownMotion) -> None:
    """Columns over time, or over what is led; each panel on its own axes, one above the other."""
    for ax, panel in zip(axes, panels, strict=True):
        for curve in panel:
            ax.plot(curve.over, curve.values, linewidth=1.1, label=label(curve.name, curve.unit))
        ax.legend(fontsize=7, loc="upper left", bbox_to_anchor=(1.0, 1.05), frameon=False)
        ax.tick_params(labelsize=7, labelbottom=ax is axes[-1])
        ax.grid(alpha=0.3)
        if len(axes) > 1:
            ax.set_ylabel(label("", panel[0].unit), fontsize=8)
            ax.sharex(axes[0])
    axes[-1].set_xlabel(motion.across, fontsize=8)
