"""Stage runtime: columns of a Trajectory -> axes of matplotlib, labelled with units."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ..texts import visible
from .near_names import require

if TYPE_CHECKING:
    from .protocols import TrajectoryLike


def plot(trajectory: TrajectoryLike, names: Sequence[str], ax: Any = None) -> Any:
    """Draw columns over time; see :meth:`.trajectory.Trajectory.plot`."""
    rows = {name: trajectory[name] for name in names}  # unknown names fail before a figure opens
    pyplot = require("matplotlib.pyplot", "matplotlib", "plot")
    by_unit: dict[str, list[str]] = {}
    for name in names:
        by_unit.setdefault(trajectory.units.get(name, ""), []).append(name)
    if ax is None:
        _, panels = pyplot.subplots(
            len(by_unit), 1, sharex=True, squeeze=False, figsize=(7.0, 1.0 + 2.4 * len(by_unit)), layout="constrained"
        )
        axes = panels[:, 0]
    else:
        axes = [ax] * len(by_unit)
    for panel, (unit, group) in zip(axes, by_unit.items(), strict=True):
        for name in group:
            panel.plot(trajectory.t, rows[name], label=name if len(group) > 1 or ax is not None else None)
        if ax is None:
            panel.set_ylabel(_label(group[0] if len(group) == 1 else "", unit), parse_math=False)
            panel.grid(alpha=0.3)
            if len(group) > 1:
                panel.legend()
    if ax is not None:
        labels = [_label(name, trajectory.units.get(name, "")) for name in names]
        units = ", ".join(dict.fromkeys(visible(unit, lines=False) for unit in by_unit if unit))
        ax.set_ylabel(labels[0] if len(labels) == 1 else units, parse_math=False)
        if len(names) > 1:
            ax.legend()
    axes[-1].set_xlabel("t (s)")
    return axes if ax is None and len(by_unit) > 1 else axes[0]


def _label(name: str, unit: str) -> str:
    unit = visible(unit, lines=False)
    return f"{name} ({unit})" if name and unit else name or unit
