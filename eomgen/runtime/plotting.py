"""Columns of a Trajectory -> axes of matplotlib: over time, against each other, phases."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base.algebra import Array
from ..base.limits.runs import SPECTRUM
from ..base.splines import cubic_piece
from ..base.texts import TIME, html_text, label
from ..errors import at_odds, cannot, incomplete
from .argument_checks import check_names, plain_name, read_names, require, unknown

if TYPE_CHECKING:
    from .bound_model import BoundModel

# -- states between steps ----------------------------------------------------------------------------------------------


FINE = 1000  #: points of a smooth curve, about
#: Error of the trapezoidal rule, in sizes of its terms, above which points are too far apart for a curve.  For a sine
#: it is 0.05 at most over one radian and 0.22 over two; beyond that a curve is a guess.
APART = 0.5
ENERGIES = ("T", "V", "energy")  #: columns of every run, unless the model has these names for its own


def cubic_between(t: Array, x: Array, slopes: Array | None, times: Array) -> Array:
    """States (n, k) at times (k,) within a run: cubics through the states x (n, m) and slopes of its steps at t (m,).

    Without slopes straight lines, and likewise where the slopes say nothing of what is between two points that are far
    apart (``t_eval=[0, 60]``): where they are not those of a curve from one state to the other.  Where a time stands
    twice, as at an event that resets the state, the second state begins the next piece.
    """
    way = 1.0 if t[-1] >= t[0] else -1.0
    k = np.clip(np.searchsorted(way * t, way * times, side="right") - 1, 0, len(t) - 2)
    h = t[k + 1] - t[k]
    s = np.where(h == 0.0, 1.0, (times - t[k]) / np.where(h == 0.0, 1.0, h))
    if slopes is None:
        straight: Array = x[:, k] + s * (x[:, k + 1] - x[:, k])
        return straight
    cubic = cubic_piece(x[:, k], x[:, k + 1], h * slopes[:, k], h * slopes[:, k + 1], s)
    gone, predicted = x[:, k + 1] - x[:, k], 0.5 * h * (slopes[:, k] + slopes[:, k + 1])
    far = abs(gone - predicted) > APART * (abs(gone) + 0.5 * abs(h) * (abs(slopes[:, k]) + abs(slopes[:, k + 1])))
    return np.where(far, x[:, k] + s * gone, cubic)


def states_at(trajectory: Any, module: BoundModel, times: Array) -> tuple[Array, Array | None]:
    """States (n_x, k) of a run at times within it, on the constraints, and inputs (n_u, k) or None without any.

    The dense output of the run serves where it was kept.
    """
    names = module.u_names
    if trajectory.has_dense_output:
        dense = trajectory.at(times)
        return dense.x, dense.to_numpy(*names) if names else None
    slopes = getattr(trajectory.columns, "slopes", None)
    u = cubic_between(trajectory.t, trajectory.to_numpy(*names), None, times) if names else None
    states = cubic_between(trajectory.t, trajectory.x, slopes, times)
    if module.n_rows or module.layout.space:
        states = module.project(states, t=times, u=u)
    return states, u


def _columns_at(trajectory: Any, module: BoundModel, times: Array) -> Any:
    """All columns of a run at times within it."""
    states, u = states_at(trajectory, module, times)
    return type(trajectory.columns)(module, times, states, np.empty((0, len(times))) if u is None else u)


def monotone_slopes(t: Array, y: Array) -> Array:
    """Slopes (m,) of a cubic through values (m,) that has no extremes between them (Fritsch and Butland 1984).

    A constant stays constant and a drift shows at the steps only.  Where a time stands twice a new curve begins.
    """
    h = np.diff(t)
    secants = np.where(h == 0.0, 0.0, np.diff(y) / np.where(h == 0.0, 1.0, h))
    before, after = np.append(secants[0], secants), np.append(secants, secants[-1])
    first, last = np.append(True, h == 0.0), np.append(h == 0.0, True)
    same = before * after > 0.0
    mean = np.where(same, 2.0 * before * after / np.where(same, before + after, 1.0), 0.0)
    slopes: Array = np.where(first, after, np.where(last, before, mean))
    return slopes


def refined_energies(trajectory: Any, times: Array, columns: Any) -> Array:
    """Kinetic, potential and total energy (3, k) at times between the steps of a run.

    States between the steps have the error of their cubics, which is far above what the integrator lets the energy
    drift.  The total is taken at the steps; the potential energy, which needs positions only, at all times.
    """
    total = trajectory.energies[2]
    slopes = monotone_slopes(trajectory.t, total)
    E = cubic_between(trajectory.t, total[None], slopes[None], times)[0]
    V = columns.energies[1]
    return np.array([E - V, V, E])


def refined(trajectory: Any, names: tuple[str, ...]) -> tuple[Array, dict[str, Array]]:
    """Times and columns of a run, with points between its steps where they are few and the model is at hand."""
    t, columns, _ = _between_steps(trajectory, names, False)
    return t, columns


def refined_energy(trajectory: Any) -> tuple[Array, Array]:
    """Times and kinetic, potential and total energy (3, k) of a run, likewise."""
    t, _, energies = _between_steps(trajectory, (), True)
    assert energies is not None
    return t, energies


def _between_steps(
    trajectory: Any, names: tuple[str, ...], energies: bool
) -> tuple[Array, dict[str, Array], Array | None]:
    from ..errors import EvaluationError

    t = trajectory.t
    parts = -(-FINE // max(1, len(t) - 1))
    module = getattr(trajectory.columns, "module", None)
    if (
        module is not None
        and type(trajectory.columns).__name__ == "Columns"
        and parts > 1
        and len(t) > 1
        and t[0] != t[-1]
    ):
        steps = np.arange(parts) / parts
        times = np.append((t[:-1, None] + np.diff(t)[:, None] * steps).ravel(), t[-1])
        times = times[np.append(True, np.diff(times) != 0.0)]
        layout = module.layout
        computed = [n for n in names if n in ENERGIES and n not in layout.x + layout.loops + layout.y + layout.u]
        try:
            columns = _columns_at(trajectory, module, times)
            result = {name: columns[name] if name != "t" else times for name in names if name not in computed}
            three = refined_energies(trajectory, times, columns) if energies or computed else None
            if three is not None:
                result |= {name: three[ENERGIES.index(name)] for name in computed}
            return times, result, three
        except EvaluationError:  # the cubic left what the model allows: its steps are drawn
            pass
    return t, {name: trajectory[name] for name in names}, trajectory.energies if energies else None


# -- axes --------------------------------------------------------------------------------------------------------------


ROW = 0.165  #: height of a line of a legend (inch)
LOWEST = 1.9  #: height of a panel (inch)
DASHES = ("-", "--", ":", "-.")
ALIKE = 20.0  #: ratio of the extents of a path of a point, at most
COLOURS = 10  #: of matplotlib's cycle
IN_A_COLUMN = 20  #: names of a legend


class Curves(NamedTuple):
    """One panel: curves of one unit.

    Attributes
    ----------
    label : str
        Of the vertical axis.
    curves : list of (str, x, y)
        The name of each, as Matplotlib prints it, and its points.
    points : list of (float, float)
        Places to be marked by a dot, such as where curves begin.
    """

    label: str
    curves: list[tuple[str, Array, Array]]
    points: Sequence[tuple[float, float]] = ()
    logarithmic: bool = False
    equal: bool = False  #: one scale for both axes
    x_label: str = ""  #: label of a horizontal axis of its own


def plot(
    trajectory: Any,
    names: Sequence[str | Sequence[str]],
    ax: Any = None,
    x: str | None = None,
    y: str | Sequence[str] | None = None,
    kind: str = "time",
) -> Any:
    """Draw columns; see :meth:`.trajectory.Trajectory.plot`."""
    return _show(*choose(trajectory, names, x, y, kind), ax)


def choose(
    trajectory: Any,
    raw: Sequence[str | Sequence[str]],
    x: str | None,
    y: str | Sequence[str] | None,
    kind: str,
) -> tuple[list[Curves], str]:
    """Panels of what is requested, and the label of their horizontal axis."""
    known = ("t", *trajectory.names)
    requested = [one for name in raw for one in read_names("a column", name)]  # a list of names is taken too
    instances = trajectory.metadata.get("instances", {})
    names: tuple[str, ...] = tuple(
        plain_name(name, instances) for name in (*requested, *(() if y is None else read_names("y", y)))
    )
    x = plain_name(x, instances)
    check_names("column", (*names, *(() if x is None else (x,))), known)  # before a figure opens
    if kind not in KINDS:
        raise unknown("kind of plot", kind, KINDS)
    if y is not None and x is None:
        raise incomplete("y= needs x=, for example plot(x='x', y='y'); for columns over time give their names alone")
    if x is not None and kind != "time":
        raise at_odds(f"x= and kind={kind!r} cannot be used together; leave out one of them")
    if x is not None and not names:
        raise incomplete(f"plot(x={x!r}) names no column to draw against it; give y= or names of columns")
    panels, abscissa = KINDS[kind](trajectory, tuple(dict.fromkeys(names)), x)
    if not panels:
        raise cannot(f"there is nothing to plot of kind {kind!r}: the run has no coordinates")
    return panels, abscissa


def _show(panels: list[Curves], abscissa: str, ax: Any) -> Any:
    pyplot = require("matplotlib.pyplot", "matplotlib", "plot")
    if ax is None:
        figure = pyplot.figure(figsize=(8.2, sum(map(height, panels)) + 0.6), layout="constrained")
        axes = stack(figure, None, panels, abscissa)
        return axes[0] if len(axes) == 1 else np.array(axes, dtype=object)
    names = [name for panel in panels for name, _, _ in panel.curves]
    for panel in panels:
        draw_panel(ax, panel._replace(curves=[]))
        for name, x, y in panel.curves:
            ax.plot(x, y, label=name if len(names) > 1 else None, linewidth=1.2)
    labels = [panel.label for panel in panels if panel.label]
    units = list(dict.fromkeys(label for label in labels))
    ax.set_ylabel(labels[0] if len(names) == 1 and labels else ", ".join(units))
    ax.set_xlabel(abscissa)
    if len(names) > 1:
        ax.legend(fontsize="small")
    return ax


def height(panel: Curves) -> float:
    """Height that a panel wants, with room for its legend (inch)."""
    if panel.equal:
        return 5.0
    return max(LOWEST, ROW * min(len(panel.curves), IN_A_COLUMN) + 0.3)


def stack(figure: Any, grid: Any, panels: Sequence[Curves], abscissa: str) -> list[Any]:
    """Panels one above the other, sharing their horizontal axis and a part of the figure, all of it by default."""
    heights = [height(panel) for panel in panels]
    if grid is None:
        cells = figure.add_gridspec(len(panels), 1, height_ratios=heights)
    else:
        cells = grid.subgridspec(len(panels), 1, height_ratios=heights)
    axes: list[Any] = []
    for k, panel in enumerate(panels):
        labelled = panel.x_label or k == 0
        ax = figure.add_subplot(cells[k], sharex=None if labelled else axes[0])
        draw_panel(ax, panel)
        axes.append(ax)
        if panel.x_label or k + 1 == len(panels):
            ax.set_xlabel(panel.x_label or abscissa)
        else:
            ax.tick_params(labelbottom=False)
    figure.align_ylabels(axes)
    return axes


def draw_panel(ax: Any, panel: Curves, below: bool = False) -> None:
    """Draw one panel, its names outside: on the right, or below."""
    several = len(panel.curves) > 1
    for k, (name, x, y) in enumerate(panel.curves):
        dash = DASHES[k // COLOURS % len(DASHES)]
        ax.plot(x, y, dash, color=f"C{k % COLOURS}", linewidth=1.2, label=name if several else None)
    for k, point in enumerate(panel.points):
        ax.plot([point[0]], [point[1]], "o", markersize=4, color=f"C{k % COLOURS}")
    if panel.logarithmic:
        ax.set_yscale("log")
    if panel.equal:
        ax.set_aspect("equal", adjustable="datalim")
    ax.set_ylabel(panel.label)
    ax.grid(alpha=0.3)
    if several:
        columns = min(3, len(panel.curves)) if below else -(-len(panel.curves) // IN_A_COLUMN)
        place = ("upper center", (0.5, -0.08)) if below else ("upper left", (1.005, 1.03))
        look = {"fontsize": 8.5, "frameon": False, "labelspacing": 0.25, "handlelength": 1.8, "columnspacing": 1.0}
        ax.legend(ncols=columns, loc=place[0], bbox_to_anchor=place[1], **look)


def printed_names(metadata: Mapping[str, Any], form: str = "mathtext") -> Callable[[str], str]:
    """How names are printed: for Matplotlib, or as ``html``; a generated package brings these forms of its names.

    A package that reads a run of eomgen prints its names as they are.
    """
    known = metadata.get("printed")
    if known is None:
        with suppress(ModuleNotFoundError):
            notation = import_module("..expr.notation", __package__).Notation.of(metadata)
            result: Callable[[str], str] = getattr(notation, form)
            return result
        known = {form: {}}
    return lambda name: str(known[form].get(name, html_text(name) if form == "html" else name))


def by_unit(trajectory: Any, names: Sequence[str]) -> list[list[str]]:
    """Names in groups of one unit, in the order in which they come."""
    groups: dict[str, list[str]] = {}
    for name in names:
        groups.setdefault(trajectory.units.get(name, ""), []).append(name)
    return list(groups.values())


def _grouped(trajectory: Any, names: Sequence[str], x: Array, columns: dict[str, Array]) -> list[Curves]:
    printed = printed_names(trajectory.metadata)
    return [
        Curves(
            label(printed(group[0]) if len(group) == 1 else "", trajectory.units.get(group[0], "")),
            [(printed(name), x, columns[name]) for name in group],
        )
        for group in by_unit(trajectory, names)
    ]


def over_time(trajectory: Any, names: tuple[str, ...], x: str | None = None) -> tuple[list[Curves], str]:
    """Columns over time or over another column; all coordinates by default."""
    names = names or tuple(trajectory.metadata["q_names"])
    t, columns = refined(trajectory, (*names, *(() if x is None else (x,))))
    if x is None:
        return _grouped(trajectory, names, t, columns), TIME
    panels = _grouped(trajectory, names, columns[x], columns)
    unit = trajectory.units.get(x, "")
    others = [trajectory.units.get(group[0], "") for group in by_unit(trajectory, names)]
    alike = [_one_scale(columns[x], unit, panel, other) for panel, other in zip(panels, others, strict=True)]
    abscissa = label(printed_names(trajectory.metadata)(x), unit)
    return [panel._replace(equal=same) for panel, same in zip(panels, alike, strict=True)], abscissa


def _one_scale(x: Array, unit: str, panel: Curves, other: str) -> bool:
    """Whether both axes are lengths, or may be: one has no unit, and both run over about as much."""
    if unit == other == "m":
        return True
    y = np.concatenate([values for _, _, values in panel.curves])
    wide, high = float(np.ptp(x)), float(np.ptp(y))
    return {unit, other} <= {"m", ""} and max(wide, high) <= ALIKE * min(wide, high)


def _phases(trajectory: Any, names: tuple[str, ...], _: str | None) -> tuple[list[Curves], str]:
    """Rates over coordinates, with a dot where each begins; two panels where angles and lengths are drawn."""
    chosen = names or tuple(n for n in trajectory.metadata["q_names"] if f"{n}_dot" in trajectory.names)
    for name in chosen:
        if f"{name}_dot" not in trajectory.names:
            raise cannot(f"{name!r} has no rate among the columns, so there is no phase portrait of it")
    columns = refined(trajectory, (*chosen, *(f"{name}_dot" for name in chosen)))[1]
    panels, printed = [], printed_names(trajectory.metadata)
    for group in by_unit(trajectory, chosen):
        rates = [f"{name}_dot" for name in group]
        curves = [(printed(name), columns[name], columns[rate]) for name, rate in zip(group, rates, strict=True)]
        starts = [(float(x[0]), float(y[0])) for _, x, y in curves]
        rate = label(printed(rates[0]) if len(group) == 1 else "rate", trajectory.units.get(rates[0], ""))
        abscissa = label(printed(group[0]) if len(group) == 1 else "coordinate", trajectory.units.get(group[0], ""))
        panels.append(Curves(rate, curves, starts, x_label=abscissa))
    return panels, panels[0].x_label if panels else ""


def _energy(trajectory: Any, names: tuple[str, ...], x: str | None) -> tuple[list[Curves], str]:
    """Kinetic, potential and total energy, and the change of the total."""
    t, (T, V, E) = refined_energy(trajectory)
    parts = [("kinetic", t, T), ("potential", t, V), ("total", t, E)]
    return [Curves("energy (J)", parts), Curves("change of total (J)", [("total", t, E - E[0])])], TIME


def _residuals(trajectory: Any, _: tuple[str, ...], __: str | None) -> tuple[list[Curves], str]:
    """Largest violation of the constraints over time, of the stored states, and the raw one's largest."""
    module = getattr(trajectory.columns, "module", None)
    if module is None:
        raise cannot(
            "residuals over time need the model: plot the trajectory of simulate itself, not one read from a file"
        )
    if not module.n_rows:
        raise cannot(f"model {module.name!r} has no constraints, so there are no residuals")
    t, x = trajectory.t, trajectory.x
    u = trajectory.to_numpy(*module.u_names) if module.u_names else None
    position = np.abs(module.kernels.constraints(x[: module.n_q], t=t, u=u)).max(axis=0, initial=0.0)
    velocity = np.abs(module.kernels.velocity_constraints(x, t=t, u=u)).max(axis=0, initial=0.0)
    panels = []
    for name, result, raw in (
        ("residual (m, rad)", position, trajectory.residuals.raw_position),
        ("of velocities (m/s, rad/s)", velocity, trajectory.residuals.raw_velocity),
    ):
        positive = np.maximum(result, np.finfo(float).eps)  # a logarithm has no 0
        curves = [("stored states", t, positive)]
        if raw > 0.0:
            curves.append(("raw, largest", t, np.full(len(t), raw)))
        panels.append(Curves(name, curves, logarithmic=True))
    return panels, TIME


def _spectrum(trajectory: Any, names: tuple[str, ...], _: str | None) -> tuple[list[Curves], str]:
    """Amplitudes over frequency: a Hann window over even times, the mean taken away first.

    Of a sine whose period goes into the run without remainder the peak is its amplitude.
    """
    names = names or tuple(trajectory.metadata["q_names"])
    t = trajectory.t
    span = float(t[-1] - t[0]) if len(t) else 0.0
    if len(t) < 8 or span <= 0.0:
        raise cannot("a spectrum needs a run forward in time of at least 8 points")
    count = max(FINE, len(t))
    times = t[0] + span * np.arange(count) / count
    module = getattr(trajectory.columns, "module", None)
    if module is not None and type(trajectory.columns).__name__ == "Columns":
        columns = _columns_at(trajectory, module, times)
        values = [columns[name] for name in names]
    else:
        keep = np.append(True, np.diff(t) > 0.0)
        values = [np.interp(times, t[keep], trajectory[name][keep]) for name in names]
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(count) / count)
    frequencies = np.arange(count // 2 + 1) / span
    rows = {}
    for name, value in zip(names, values, strict=True):
        amplitude = np.abs(np.fft.rfft(window * (value - value.mean()))) * 2.0 / window.sum()
        rows[name] = np.maximum(amplitude, np.finfo(float).tiny)[1:]
    panels = []
    for panel in _grouped(trajectory, names, frequencies[1:], rows):
        top = max(float(y.max()) for _, _, y in panel.curves)
        curves = [(name, f, np.maximum(y, top * SPECTRUM)) for name, f, y in panel.curves]
        panels.append(panel._replace(curves=curves, logarithmic=True))
    return panels, "frequency (Hz)"


Panels = Callable[[Any, tuple[str, ...], str | None], tuple[list[Curves], str]]

#: What can be plotted of a run.
KINDS: dict[str, Panels] = {
    "time": over_time,
    "phase": _phases,
    "energy": _energy,
    "residuals": _residuals,
    "spectrum": _spectrum,
}
