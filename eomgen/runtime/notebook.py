"""Stage runtime, notebooks: a module, a trajectory -> HTML with a picture, and what can be called."""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING, Any

from ..base.inline_pictures import picture_html, side_by_side
from ..base.kernel_table import KERNELS
from ..base.notation import Notation
from ..base.texts import html_table, html_text
from .near_names import require
from .plotting import choose, height, stack
from .show_parts import load_show
from .summary import facts, trajectory_facts

if TYPE_CHECKING:
    from .bound_model import BoundModel

CURVES = 12  #: columns of the small plot of a run
QUANTITIES = 100  #: names listed with their symbols
LEFT = "style='text-align:left'"


def module_html(module: BoundModel) -> str:
    """The mechanism, what the module is made of, and what can be called."""
    table = html_table(module.name, facts(module), module.doc)
    return side_by_side(mechanism_html(module), table + _quantities(module) + _calls(module))


def mechanism_html(module: BoundModel) -> str:
    """A small picture of the mechanism at its declared initial position; nothing without bodies."""
    if module.metadata.get("picture") is None:
        return ""
    return picture_html(lambda: load_show("draw").small_figure(module))


def _quantities(module: BoundModel) -> str:
    """Coordinates, parameters, inputs and outputs: name, symbol, unit, value, doc; folded up."""
    layout, docs = module.layout, module.metadata.get("docs", {})
    printed = Notation.of(module.metadata).html
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
        if kernel.late or kernel.name not in module.core.names:
            continue
        if (getattr(type(module), kernel.name, None) or getattr(module, kernel.name, None)) is None:
            continue
        shape = module.layout.shape(kernel.name)
        size = " x ".join(map(str, shape))
        rows.append((f"{kernel.name}({_arguments(kernel.name, kernel.inputs)})", size, kernel.result))
    cells = "".join(
        f"<tr><td {LEFT}><code>{html_text(call)}</code></td><td>{html_text(size)}</td>"
        f"<td {LEFT}>{html_text(result)}</td></tr>"
        for call, size, result in rows
    )
    head = f"<tr><th {LEFT}>call</th><th>shape</th><th {LEFT}>result</th></tr>"
    own = [name for name in dir(type(module)) if not name.startswith("_") and name not in {k.name for k in KERNELS}]
    methods = ", ".join(f"<code>{html_text(n)}</code>" for n in own if _is_call(type(module), n))
    return (
        f"<details><summary>what can be called</summary><table>{head}{cells}</table>"
        f"<p {LEFT}>and {methods}; <code>help(mod.simulate)</code> explains a method.</p></details>"
    )


def _is_call(kind: type, name: str) -> bool:
    found = inspect.getattr_static(kind, name)
    return not isinstance(found, property) and (hasattr(found, "__get__") or callable(found))


def _arguments(name: str, inputs: tuple[str, ...]) -> str:
    """The arguments as they are written in a call."""
    if name == "kinematics":
        return "q_i, v_i, a_i"
    if inputs == ("q", "v"):
        return "t, x" if name in _TIMED else "x"
    return ", ".join(inputs)


_TIMED = ("rhs", "jacobian", "bias", "outputs", "input_jacobian", "parameter_jacobian")


def trajectory_html(trajectory: Any) -> str:
    """A small plot of the coordinates and what the run came to."""
    return side_by_side(picture_html(lambda: small_plot(trajectory)), html_table(*trajectory_facts(trajectory)))


def small_plot(trajectory: Any) -> Any:
    """A figure of the coordinates, of the first ones where they are many."""
    figures = require("matplotlib.figure", "matplotlib", "a picture")
    led = trajectory.metadata.get("led", ())
    over = led[0] if led and len(trajectory) and trajectory.t[0] == trajectory.t[-1] else None
    names = [name for name in trajectory.metadata["q_names"] if name != over][:CURVES]
    panels, across = choose(trajectory, names, over, None, "time")
    figure = figures.Figure(figsize=(6.6, max(2.6, 0.75 * sum(map(height, panels)) + 0.5)), layout="constrained")
    stack(figure, None, panels, across)
    return figure
