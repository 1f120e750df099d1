"""Stage runtime: a module, a trajectory -> a short description of it, as text and in labels and values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ..base.texts import visible

if TYPE_CHECKING:
    from .bound_model import BoundModel

SHOWN = 12  #: names listed


def listed(names: Sequence[str]) -> str:
    """Names separated by commas, cut when there are many."""
    text = ", ".join(names[:SHOWN])
    return f"{text}, ... ({len(names)})" if len(names) > SHOWN else text or "-"


def facts(module: BoundModel) -> list[tuple[str, str]]:
    """Label and value of each line of the report."""
    layout, data = module.layout, module.metadata
    lines = [
        ("degrees of freedom", str(layout.n_dof - len(layout.states))),
        ("coordinates", listed(layout.q)),
        *([("states", listed(layout.states))] if layout.states else []),
    ]
    if layout.n_c:
        lines.append(("independent", listed([layout.velocity_labels[i] for i in layout.independent_moving])))
        lines.append(("cut joints", listed(data.get("loop_joint_names", ()))))
        redundant = [layout.constraint_labels[i] for i in data.get("redundant_rows", ())]
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
        ("method, target", f"{data.get('method', '-')}, {data.get('target', '-')}"),
    ]
    operations = data.get("operations", {})
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
    lines = facts(module)
    width = max(len(label) for label, _ in lines)
    head = module.name + (f": {visible(module.doc)}" if module.doc else "")
    return "\n".join([head, *(f"  {label:<{width}}  {value}" for label, value in lines)])


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
        method += f", rtol {header['rtol']:.3g}, atol {header['atol']:.3g}, {trajectory.nfev} calls"
    lines.append(("method", method))
    if header.get("loop_names") or trajectory.residuals.raw_position:
        kept = trajectory.residuals
        lines.append(("loop residual", f"{kept.raw_position:.1e} raw, {kept.position:.1e} stored (m, rad)"))
    counts = [(name, len(times)) for name, times in zip(trajectory.t_events.names, trajectory.t_events, strict=True)]
    if counts:
        lines.append(("events", listed([f"{name}: {count}" for name, count in counts])))
    if trajectory.status:
        lines.append(("ended", visible(trajectory.message)))
    lines.append(("columns", listed(trajectory.names)))
    return f"{type(trajectory).__name__} of {trajectory.name}", lines
