"""What a module and a trajectory show of themselves: text, HTML, pictures, animations."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.algebra import Array
from ..base.kernel_table import KERNELS, Kernel
from ..base.picture_data import read_picture
from ..base.results import picture_html, side_by_side
from ..base.texts import aligned_rows, html_table, html_text, quote, visible
from ..errors import MissingDependencyError, ill_shaped, ill_typed, incomplete
from .argument_checks import read_number, require, unknown, with_numbers
from .plotting import choose, height, printed_names, refined, stack, states_at

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from .bound_model import BoundModel

# -- files that draw ---------------------------------------------------------------------------------------------------


#: What is requested by name; a generated package is without them.
PARTS = {
    "animate": "show.animate",
    "draw": "show.draw",
    "mode_shapes": "show.animate",
}


def load_show(part: str) -> ModuleType:
    """A file of ``eomgen.show``."""
    package = __package__.rpartition(".")[0]
    try:
        return import_module(f"{package}.{PARTS[part]}")
    except ModuleNotFoundError as error:
        if error.name != f"{package}.show":
            raise
        raise MissingDependencyError(
            f"{package} does not draw; where eomgen is installed, Module.of({package}) draws and animates"
        ) from None


# -- descriptions ------------------------------------------------------------------------------------------------------


LISTED = 12  #: names listed


def listed(names: Sequence[str]) -> str:
    """Names separated by commas, cut when there are many."""
    text = ", ".join(names[:LISTED])
    return f"{text}, ... ({len(names)})" if len(names) > LISTED else text or "-"


def facts(module: BoundModel) -> list[tuple[str, str]]:
    """Label and value of each line of the report."""
    layout, info = module.layout, module.info
    lines = [
        ("degrees of freedom", str(layout.n_dof - len(layout.states))),
        ("coordinates", listed(layout.q)),
        *([("states", listed(layout.states))] if layout.states else []),
    ]
    if layout.n_c:
        lines.append(("independent", listed([layout.velocity_labels[i] for i in layout.independent_moving])))
        lines.append(("cut joints", listed(info.loop_joint_names)))
        redundant = [layout.constraint_labels[i] for i in info.redundant_rows]
        rows = f"{layout.n_c}" + (f", redundant at the reference: {listed(redundant)}" if redundant else "")
        lines.append(("constraint rows", rows))
    if layout.loops:
        lines.append(("loop coordinates", listed(layout.loops)))
    p = module.kernels.context.p
    values = [f"{name} = {value:.6g}" for name, value in zip(layout.p, p, strict=True)]
    lines += [
        ("bodies", listed(layout.bodies)),
        ("parameters", listed(values)),
        ("inputs", listed(layout.u)),
        ("outputs", listed(layout.y)),
        ("method, target", f"{info.method}, {info.target}"),
    ]
    operations = info.operations
    known = (("rhs",), ("regular_closing", "regular_dynamics"), ("closing", "dynamics"), ("terms",))
    parts = next((p for p in known if operations.get(p[-1])), None)
    if parts:  # terms alone: linear algebra comes on top
        kinds = [kind for kind, n in operations[parts[-1]].items() if isinstance(n, int)]
        totals = {kind: sum(operations[part][kind] for part in parts) for kind in kinds}
        counts = (f"{n} {kind}" for kind, n in totals.items() if n)
        lines.append((f"operations of {'terms' if parts == ('terms',) else 'rhs'}", ", ".join(counts)))
    return lines


def line(module: BoundModel) -> str:
    """One line."""
    n = module.n_dof
    return f"<Module {module.name}: {n} degree{'s' if n != 1 else ''} of freedom, x = [{listed(module.x_names)}]>"


def report(module: BoundModel, /) -> str:
    """Describe the model as a text: its sizes, names, constraints and how it was compiled."""
    head = module.name + (f": {visible(module.doc)}" if module.doc else "")
    return "\n".join([head, *aligned_rows(facts(module))])


def trajectory_facts(trajectory: Any) -> tuple[str, list[tuple[str, str]]]:
    """A title, and label and value of each line, of what a run came to."""
    header, n = trajectory.metadata, len(trajectory)
    lines = [("points", str(n))]
    if n:
        over = f"of {', '.join(header['led'])}" if header.get("led") else ""
        span = f"{trajectory.t[0]:.6g} .. {trajectory.t[-1]:.6g} s"
        lines.append(("range", over) if over and trajectory.t[0] == trajectory.t[-1] else ("time", span))
    method = str(header.get("method"))
    if header.get("rtol") is not None:
        method += (
            f", rtol {header['rtol']:.3g}, atol {header['atol']:.3g}, {trajectory.nfev} calls of the right-hand side"
        )
    elif "missed_steps" in header:
        method += f", {header['steps']} steps of {header['options']['step']:g} s"
    lines.append(("method", method))
    if "missed_steps" in header:
        worst = f"{header['contacts']} at most in one step, {header['penetration']:.1e} m deep at most"
        missed = f"{header['missed_steps']} steps miss the tolerance"
        lines += [("contacts", worst), ("laws", f"residual {header['contact_residual']:.1e} m/s; {missed}")]
    if header.get("loop_names") or trajectory.residuals.raw_position:
        kept = trajectory.residuals
        lines.append(("loop residual", f"{kept.raw_position:.1e} raw, {kept.position:.1e} projected (m, rad)"))
        lines.append(("of velocities", f"{kept.raw_velocity:.1e} raw, {kept.velocity:.1e} projected"))
    counts = [(name, len(times)) for name, times in zip(trajectory.t_events.names, trajectory.t_events, strict=True)]
    if counts:
        lines.append(("events", listed([f"{name}: {count}" for name, count in counts])))
    if trajectory.status:
        lines.append(("ended", visible(trajectory.message)))
    lines.append(("columns", listed(trajectory.names)))
    return f"{type(trajectory).__name__} of {trajectory.name}", lines


# -- motion of bodies --------------------------------------------------------------------------------------------------


def module_of(trajectory: Any, model: BoundModel | None, purpose: str) -> BoundModel:
    """The module of a run with its parameters bound."""
    if model is not None:
        if not hasattr(model, "x_names"):
            raise ill_typed(f"model must be a module, as Model.compile() returns, not {quote(model)}")
        if tuple(trajectory.x_names) != model.x_names:
            raise ill_shaped(
                f"the trajectory of {trajectory.name!r} has states {', '.join(trajectory.x_names)}; module "
                f"{model.name!r} has {', '.join(model.x_names)}: give the module that it was made with"
            )
        return model.bind(p=trajectory.metadata.get("parameters"))
    result: BoundModel | None = getattr(trajectory.columns, "module", None)
    if result is None:
        raise incomplete(f"{purpose} needs the model, which a saved trajectory does not contain; give model=module")
    return result


def poses(trajectory: Any, model: BoundModel | None = None) -> Array:
    """See :meth:`.trajectory.Trajectory.poses`."""
    module = module_of(trajectory, model, "poses")
    names = module.u_names
    u = trajectory.to_numpy(*names) if names else None
    return module.poses(trajectory.q, t=trajectory.t, u=u)


def position(trajectory: Any, name: str, model: BoundModel | None = None) -> Array:
    """See :meth:`.trajectory.Trajectory.position`."""
    module = module_of(trajectory, model, "position")
    data = read_picture(module.metadata, module.p)
    every, name = poses(trajectory, module), module.layout.plain(name)
    if name in data.markers:
        frame = data.markers[name]
        if frame.body < 0:
            return np.repeat(frame.position[:, None], len(trajectory.t), axis=1)
        pose = every[frame.body]
        result: Array = np.einsum("ijk,j->ik", pose[:3, :3], frame.position) + pose[:3, 3]
        return result
    if name not in module.body_names:
        raise unknown("marker or body", name, (*data.markers, *module.body_names))
    return every[module.body_names.index(name), :3, 3]


def animate(trajectory: Any, file: Path | str | None, model: BoundModel | None, options: dict[str, Any]) -> Any:
    """See :meth:`.trajectory.Trajectory.animate`."""
    module = module_of(trajectory, model, "an animation")
    show = load_show("animate")
    numbers = {k: read_number(k, options[k]) for k in ("fps", "speed", "dpi") if isinstance(options.get(k), str)}
    return show.animate(
        trajectory,
        module,
        file,
        states=lambda t: states_at(trajectory, module, t),
        columns=lambda names: refined(trajectory, tuple(map(module.layout.plain, names))),
        **(options | numbers),
    )


# -- pictures ----------------------------------------------------------------------------------------------------------


def draw(
    model: BoundModel,
    /,
    x: Any = None,
    ax: Axes | None = None,
    *,
    t: float = 0.0,
    names: bool | None = None,
    axes: bool = False,
    **named: float | str,
) -> Axes:
    """Draw the mechanism at a configuration, true to scale.

    A mechanism that moves in a plane is drawn in this plane, a spatial one in space.  Bodies are the shapes that their
    ``display`` or ``solids`` give, else bars and plates between their joints and markers; joints, springs, dampers,
    cylinders, gears and cams have their symbols.

    Parameters
    ----------
    x : array (n_x,) or (n_q,), or mapping of str to float, optional
        A state, a position, or values of coordinates, which are assembled as by ``x0``; by default the declared initial
        position.  An array is drawn as given: loops that it leaves open are drawn open.
    ax : matplotlib Axes, optional
        Where to draw; a new figure by default.
    t : float
        Time (s); matters for driven constraints only.
    names : bool, optional
        Whether bodies and joints are named; by default where they are few.
    axes : bool
        Whether the axes of all bodies are drawn.
    **named : float or str
        Values of coordinates by name, as in a mapping x: ``draw(theta=0.3)``.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    MissingDependencyError
        matplotlib is not installed.
    UsageError
        The model has no bodies, or x does not fit.
    AssemblyError
        The loops do not close with these values.
    """
    x, t, layout = with_numbers("x", x), read_number("t", t), model.layout
    known = (*layout.q, *layout.loops, *layout.v, *layout.loop_rates, *layout.y)
    for name in named:
        if name not in (*known, *layout.p) and name.isidentifier():  # a place of a marker is none
            raise unknown("argument of draw or coordinate", name, ("ax", "t", "names", "axes", *known))
    drawn: Axes = load_show("draw").draw(model, x, ax, t=t, names=names, axes=axes, named=named)
    return drawn


def draw_branches(
    model: BoundModel,
    values: Mapping[str, float] | None = None,
    /,
    *,
    t: float = 0.0,
    names: bool | None = None,
    **named: float | str,
) -> NDArray[Any]:
    """Draw all positions in which the loops close with the given values, side by side at the same scale.

    Parameters
    ----------
    values, **named : float
        Coordinates that are held, as for :meth:`branches`; the declared initial ones by default.
    t, names
        As for :func:`draw`.

    Returns
    -------
    array of matplotlib Axes
        In the order of ``module.branches``.
    """
    panels: NDArray[Any] = load_show("draw").draw_branches(model, values, t=t, names=names, named=named)
    return panels


# -- HTML --------------------------------------------------------------------------------------------------------------


CURVES = 12  #: columns of the small plot of a run
QUANTITIES = 100  #: names listed with their symbols
LEFT = "style='text-align:left'"


def module_html(module: BoundModel) -> str:
    """The mechanism, what the module is made of, and what can be called."""
    table = html_table(module.name, facts(module), module.doc)
    return side_by_side(mechanism_html(module), table + _quantities(module) + _calls(module))


def mechanism_html(module: BoundModel) -> str:
    """A small picture of the mechanism at its declared initial position; nothing without bodies."""
    if module.info.picture is None:
        return ""
    return picture_html(lambda: load_show("draw").small_figure(module))


def _quantities(module: BoundModel) -> str:
    """Coordinates, parameters, inputs and outputs: name, symbol, unit, value, doc; folded up."""
    layout, docs = module.layout, module.info.docs
    printed = printed_names(module.metadata, "html")
    values = dict(zip(layout.p, (f"{value:.6g}" for value in module.kernels.context.p), strict=True))
    kinds = {"coordinate": (*layout.q, *layout.loops), "parameter": layout.p, "input": layout.u, "output": layout.y}
    rows = {name: kind for kind, names in kinds.items() for name in names}
    cells = "".join(
        f"<tr><td {LEFT}><code>{html_text(name)}</code></td><td>{printed(name)}</td><td {LEFT}>{kind}</td>"
        f"<td>{values.get(name, '')}</td><td {LEFT}>{html_text(layout.unit(name))}</td>"
        f"<td {LEFT}>{html_text(docs.get(name, ''))}</td></tr>"
        for name, kind in list(rows.items())[:QUANTITIES]
    )
    more = f"<p {LEFT}>and {len(rows) - QUANTITIES} more</p>" if len(rows) > QUANTITIES else ""
    heads = "".join(f"<th {LEFT}>{word}</th>" for word in ("name", "symbol", "kind", "value", "unit", "meaning"))
    return f"<details><summary>names and symbols</summary><table><tr>{heads}</tr>{cells}</table>{more}</details>"


def _calls(module: BoundModel) -> str:
    """Signatures of the calls that can be made, folded up."""
    rows = []
    for kernel in KERNELS:
        if kernel.lazy or kernel.name not in module.core.names:
            continue
        if (getattr(type(module), kernel.name, None) or getattr(module, kernel.name, None)) is None:
            continue
        shape = module.layout.shape(kernel.name)
        size = " x ".join(map(str, shape))
        rows.append((f"{kernel.name}({_arguments(kernel)})", size, kernel.result))
    cells = "".join(
        f"<tr><td {LEFT}><code>{html_text(call)}</code></td><td>{html_text(size)}</td>"
        f"<td {LEFT}>{html_text(result)}</td></tr>"
        for call, size, result in rows
    )
    head = f"<tr><th {LEFT}>call</th><th>shape</th><th {LEFT}>result</th></tr>"
    public = [name for name in dir(type(module)) if not name.startswith("_") and name not in {k.name for k in KERNELS}]
    methods = ", ".join(f"<code>{html_text(n)}</code>" for n in public if _is_call(type(module), n))
    return (
        f"<details><summary>what can be called</summary><table>{head}{cells}</table>"
        f"<p {LEFT}>and {methods}; <code>help(mod.simulate)</code> explains a method.</p></details>"
    )


def _is_call(kind: type, name: str) -> bool:
    result = inspect.getattr_static(kind, name)
    return not isinstance(result, property) and (hasattr(result, "__get__") or callable(result))


def _arguments(kernel: Kernel) -> str:
    """The arguments as they are written in a call."""
    if kernel.inputs == ("q", "v"):
        return "t, x" if kernel.kind == "timed" else "x"
    return ", ".join(name for name in kernel.inputs if name != "q_guess")


def trajectory_html(trajectory: Any) -> str:
    """A small plot of the coordinates and what the run came to."""
    return side_by_side(picture_html(lambda: small_plot(trajectory)), html_table(*trajectory_facts(trajectory)))


def small_plot(trajectory: Any) -> Any:
    """A figure of the coordinates, of the first ones where they are many."""
    figures = require("matplotlib.figure", "matplotlib", "a picture")
    driven = trajectory.metadata.get("led", ())
    over = driven[0] if driven and len(trajectory) and trajectory.t[0] == trajectory.t[-1] else None
    names = [name for name in trajectory.metadata["q_names"] if name != over][:CURVES]
    panels, abscissa = choose(trajectory, names, over, None, "time")
    figure = figures.Figure(figsize=(6.6, max(2.6, 0.75 * sum(map(height, panels)) + 0.5)), layout="constrained")
    stack(figure, None, panels, abscissa)
    return figure
