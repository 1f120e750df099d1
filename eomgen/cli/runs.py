"""Verbs that move a model: a run, a range of positions without forces, and the film of either."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from ..analysis.linearization import without_noise
from ..base.limits.numbers import RESTING
from ..base.results import ResultTable
from ..errors import ModelError, ToolchainError, at_odds, ill_shaped, incomplete
from .options import WANTED, End, Integration, Names, Positive, Source, Span, Texts, parse_spans, require_folder, verb
from .output import after_integration, operations_of, say, stage, summary
from .plot import Output

if TYPE_CHECKING:
    from ..api.equations import Equations
    from ..module import Module
    from ..runtime.prescribed.kinematic import KinematicAnalysis
    from ..runtime.trajectory import Trajectory
    from .energy import EnergyBalance

#: Options of a model whose positions alone matter.
POSITIONS = ("settings", "allow_native", "independent", "target")
POINTS = 5  #: change points listed
#: What a run with rigid contacts tells of them.
CONTACT = ("contacts", "contact_iterations", "contact_residual", "missed_steps", "penetration")

# -- run ---------------------------------------------------------------------------------------------------------------


@verb((*WANTED, "baumgarte"))
def run(
    source: Source,
    output: Output,
    solver: Integration,
    end: End = None,
    animate: Annotated[Path | None, "FILE: Write an animation: FILE.gif, FILE.mp4 or FILE.html."] = None,
) -> None:
    """Derive, compile and simulate a model, and report the run.

    Integrator, tolerances, end time and initial values are those of the model file unless an option sets them.
    """
    output.check()
    require_folder("--animate", animate)
    if animate is not None:
        from ..show.writers import require_kind

        require_kind(animate)
    work = source.compile()
    equations, module = work.equations, work.module
    output.check_columns(module)
    from .energy import MOREAU, Power, balance_energy

    power = Power(equations)
    impulses = solver.keywords.get("method", module.info.simulation["method"]) == MOREAU
    start = perf_counter()
    with stage("simulate"):
        trajectory = module.simulate(
            end,
            initial=work.initial,
            parameters=work.parameters,
            inputs=work.inputs,
            dense_output=not impulses and (output.plot is not None or animate is not None or power.counts),
            **solver.keywords,
        )
    seconds = {**equations.seconds, "simulate": perf_counter() - start}
    with after_integration():
        energy = balance_energy(power, trajectory)
        files = output.write(equations.kinematics.mechanism, trajectory)
        if animate is not None:
            with stage("animate"):
                files.append(trajectory.animate(animate))
        values = _run_to_dict(equations, trajectory, energy) | {"seconds": seconds}
        uncounted = power.uncounted if energy and energy.work is None else ()
        tables = tables_of(trajectory, energy, uncounted)
    source.show(values, str(equations.report), *operations_of(equations), *tables, files=files)


def _final_names(trajectory: Trajectory) -> list[str]:
    """Columns whose last value is reported: state, coordinates of cut joints and their rates, outputs."""
    header = trajectory.metadata
    loops = [name + suffix for suffix in ("", "_dot") for name in header["loop_names"]]
    return list(dict.fromkeys([*header["x_names"], *loops, *header["y_names"]]))


def _run_to_dict(equations: Equations, trajectory: Trajectory, energy: EnergyBalance | None) -> dict[str, Any]:
    header, residuals = trajectory.metadata, trajectory.residuals
    final = {name: trajectory[name][-1] for name in _final_names(trajectory)}
    return summary(equations) | {
        "integration": {
            "method": header["method"],
            "rtol": header["rtol"],
            "atol": header["atol"],
            "end": float(trajectory.t[-1]),
            "steps": len(trajectory) - 1,
            "calls": trajectory.nfev,
            "jacobians": trajectory.njev,
            "options": header.get("options", {}),
            **({"contact": {name: header[name] for name in CONTACT}} if header["method"] == "moreau" else {}),
        },
        "origin": header["origin"],
        "parameters": header["parameters"],
        "inputs": header.get("inputs", {}),
        "loop_residual": {
            "raw": residuals.raw_position,
            "projected": residuals.position,
            "correction": residuals.correction_position,
            "raw_velocity": residuals.raw_velocity,
            "projected_velocity": residuals.velocity,
            "correction_velocity": residuals.correction_velocity,
        },
        "change_points": trajectory.change_points,
        "energy": energy,
        "final": {"t": float(trajectory.t[-1]), **final},
    }


def _energy_rows(energy: EnergyBalance | None, uncounted: Sequence[str]) -> list[tuple[str, str]]:
    if energy is None:
        return [("energy", "not known: the equations have no kinetic_energy")]
    change = f"{energy.initial:.9g} J to {energy.final:.9g} J"
    if energy.work is not None and energy.power_balance not in (None, energy.drift):
        work = without_noise([energy.work, energy.initial, energy.final])[0]
        rows = [("energy", f"{change}; work of forces and inputs {work:.9g} J")]
        left_out = ""
        if energy.jumps:
            rows.append(("impacts, resets", f"added {energy.jumps:.9g} J at their instants"))
            left_out = ", impacts and resets left out"
        return [*rows, ("power balance", f"{energy.power_balance:.1e} of the largest kinetic energy{left_out}")]
    kept = f"; kept to {energy.drift:.1e} of the largest kinetic energy" if energy.work is not None else ""
    rows = [("energy", f"{change}{kept}")]
    if uncounted:
        names = ", ".join(uncounted)
        rows.append(("power balance", f"not computed: {names} is C code without a Python version (key python)"))
    return rows


def tables_of(
    trajectory: Trajectory, energy: EnergyBalance | None, uncounted: Sequence[str] = ()
) -> tuple[ResultTable, ...]:
    """Statistics of a run, its residuals, its energy and its final values.

    ``uncounted`` are functions whose work is not known.
    """
    from ..runtime.drawing import trajectory_facts

    title, (*facts, _) = trajectory_facts(trajectory)  # without all columns
    points = trajectory.change_points
    more = [("change point" if k == 0 else "", str(point)) for k, point in enumerate(points[:POINTS])]
    more += [("", f"... ({len(points) - POINTS} more)")] if len(points) > POINTS else []
    names = _final_names(trajectory)
    units = [trajectory.units.get(name, "") for name in names]
    sizes = [float(max(trajectory[name].max(), -trajectory[name].min())) for name in names]
    final = without_noise([trajectory[name][-1] for name in names], units, sizes)
    error, states = trajectory.metadata["atol"] or 0.0, set(trajectory.x_names)
    for k, name in enumerate(names):  # a state that rests, to the error that the integrator admits
        if name in states and abs(final[k]) <= error and sizes[k] <= RESTING * error:
            final[k] = 0.0
    values = [(name, f"{x: .9g} {unit}") for name, x, unit in zip(names, final, units, strict=True)]
    run = ResultTable((), [*facts, *more, *_energy_rows(energy, uncounted)], title)
    return run, ResultTable((), values, f"values at t = {trajectory.t[-1]:g} s")


# -- kinematics --------------------------------------------------------------------------------------------------------

COUNT = 201  #: points of a range unless it says
ROWS = 9  #: of them on the screen


@verb(POSITIONS)
def kinematics(
    source: Source,
    output: Output,
    ranges: Annotated[
        Texts,
        "NAME=START:END[:COUNT]: Values of a coordinate, or of t for drivers, e.g. theta=0:2*pi:361; all ranges must "
        "have the same count.",
    ] = (),
    limits: Annotated[Texts, "NAME: Find how far a coordinate can move from the start."] = (),
    partial: Annotated[bool, "If the range cannot be reached completely, return the part that can."] = False,
) -> None:
    """Analyse the motion of a model over a range of time or coordinates, without forces.

    Without --range, drivers move the model from t = 0 to the end given in its file.
    """
    requested = parse_spans("--range", ranges, "NAME=START:END[:COUNT]", "theta=0:2*pi:361")
    output.check()
    work = source.compile("embedding")
    equations, module = work.equations, work.bound().module
    output.check_columns(module)
    named = _range_values(module, requested) if requested or not limits else {}
    start = perf_counter()
    with stage("kinematics"):
        motion = module.kinematic_analysis(initial=work.initial, partial=partial, **named) if named else None
        result = [module.motion_range(name, initial=work.initial) for name in limits]
    seconds = {**equations.seconds, "analysis": perf_counter() - start}
    files = [] if motion is None else output.write(equations.kinematics.mechanism, motion)
    values = {"name": module.name, "report": summary(equations)["report"], "seconds": seconds}
    values |= {"motion": None if motion is None else _motion_to_dict(motion), "limits": [r.to_dict() for r in result]}
    tables = [
        *([] if motion is None else _tables_of_motion(motion)),
        *(ResultTable((), r.facts, r.title) for r in result),
    ]
    source.show(values, str(equations.report), *tables, files=files)


def _range_values(module: Module, requested: list[Span]) -> dict[str, Any]:
    """Arrays over the ranges requested, by name; of the time where drivers leave nothing free."""
    if not requested:
        if module.n_dof:
            free = ", ".join(module.layout.velocity_labels[i] for i in module.layout.independent)
            raise incomplete(f"give --range: {_left(module.n_dof)}, for example of {free}")
        requested = [Span("t", 0.0, float(module.info.simulation.get("end") or 10.0), None)]
    counts = {count for *_, count in requested if count is not None} or {COUNT}
    if len(counts) > 1:
        raise ill_shaped(f"--range: the counts {', '.join(map(str, sorted(counts)))} must be equal")
    (count,) = counts
    values: dict[str, Any] = {name: np.linspace(start, end, count) for name, start, end, _ in requested}
    if "t" in values and len(requested) > 1 and count > 1:  # coordinates that are led over time have their rates
        span = values["t"][-1] - values["t"][0]
        values |= {f"{name}_dot": (end - start) / span for name, start, end, _ in requested if name != "t" and span}
    return values


def _left(n: int) -> str:
    return "1 degree of freedom is left" if n == 1 else f"{n} degrees of freedom are left"


def _motion_to_dict(motion: KinematicAnalysis) -> dict[str, Any]:
    names = ("t", *_final_names(motion))
    return {
        "points": len(motion),
        "complete": motion.complete,
        "led": motion.led,
        "singular": [one.facts for one in motion.singular],
        "residual": {"position": motion.residuals.position, "velocity": motion.residuals.velocity},
        **{where: {n: motion[n][k] for n in names} for where, k in (("first", 0), ("last", -1))},
    }


def _tables_of_motion(motion: KinematicAnalysis) -> tuple[ResultTable, ResultTable]:
    """Points, residuals and singular positions of an analysis, and some of its rows."""
    rows = [("loop residual", f"{motion.residuals.position:.1e} (m, rad), {motion.residuals.velocity:.1e} of rates")]
    for result in motion.singular[:20]:
        place, _, text = str(result).removeprefix(f"{result.kind} at ").partition(": ")
        rows.append((result.kind, f"{place}: {text}"))
    if len(motion.singular) > 20:
        rows.append(("", f"and {len(motion.singular) - 20} more singular positions"))
    names = [n for n in _final_names(motion) if not n.endswith("_dot")][:8]
    header = [n + (f" ({motion.units[n]})" if n in motion.units else "") for n in ("t", *names)]
    picked = np.unique(np.linspace(0, len(motion) - 1, ROWS).round().astype(int))
    if len(picked) < len(motion):
        rows.append(("shown", f"{len(picked)} of {len(motion)} points; --out FILE writes all"))
    units = [motion.units.get(n, n) for n in ("t", *names)]
    sizes = [float(np.nanmax(np.abs(motion[n]), initial=0.0)) for n in ("t", *names)]
    rounded = [without_noise([motion[n][k] for n in ("t", *names)], units, sizes) for k in picked]
    title = f"kinematics over {', '.join(motion.led) if motion.led else 't'}: {len(motion)} points"
    return ResultTable((), rows, title), ResultTable(header, rounded, right=range(len(header)))


# -- view --------------------------------------------------------------------------------------------------------------


@verb((*POSITIONS, "robot"))
def view(
    source: Source,
    solver: Integration,
    ranges: Annotated[
        Texts,
        "NAME=START:END[:COUNT]: Move a coordinate over a range without forces, e.g. theta=0:2*pi; t for drivers.",
    ] = (),
    end: End = None,
    out: Annotated[
        Path | None, "FILE: Write FILE.html, .gif, .mp4, or a folder of PNG frames, instead of opening a browser."
    ] = None,
    trace: Annotated[Names, "MARKER: Draw the path of a marker."] = (),
    plot: Annotated[Names, "NAME: Draw columns along the animation."] = (),
    forces: Annotated[bool, "Draw arrows of the forces in the joints."] = False,
    speed: Annotated[Positive | None, "X: Seconds of motion shown in one second."] = None,
    fps: Annotated[Positive | None, "N: Frames in one second; 25 by default."] = None,
) -> None:
    """Show how a mechanism moves: over a range of its coordinates, or in a run.

    Without --out a browser opens a page in the folder of temporary files, which needs no network.  With a compiler for
    WebAssembly (pip install ziglang) the model itself runs there, with sliders; with --range or an option of the
    picture the page is an animation.
    """
    import webbrowser
    from tempfile import gettempdir

    from ..show.writers import require_kind

    requested = parse_spans("--range", ranges, "NAME=START:END[:COUNT]", "theta=0:2*pi:361")
    if requested and (end is not None or solver.keywords):
        raise at_odds("--range moves the model without forces; leave out --end and options of the integrator")
    if any(count == 1 for *_, count in requested):
        raise incomplete("an animation needs two positions: give --range a COUNT of at least 2")
    file = out if out is not None else Path(gettempdir()) / f"eomgen_{source.model.stem}.html"
    require_kind(file)
    require_folder("--out", None if out is None or not out.suffix else out)
    work = source.compile("embedding" if requested else "auto")
    if requested:
        with stage("kinematics"):
            module, values = work.bound().module, _range_values(work.module, requested)
            motion: Any = module.kinematic_analysis(initial=work.initial, **values)
    else:
        with stage("simulate"):
            motion = work.module.simulate(end, work.initial, work.parameters, work.inputs, **solver.keywords)
    look = {key: value for key, value in (("speed", speed), ("fps", fps)) if value is not None}
    with after_integration(), stage("animate"):
        film = requested or trace or plot or forces or look or work.inputs or file.suffix != ".html"
        written = None if film else _live_page(work.bound().module, motion, file)
        written = written or motion.animate(file, trace=trace, plot=plot, forces=forces, **look)
    opened = out is None and webbrowser.open(Path(written).absolute().as_uri())
    source.show({"name": work.module.name, "points": len(motion), "opened": opened}, files=[written])
    if not source.as_json and out is None and not opened:
        say("no browser was found; open that file in a browser, or give --out FILE")


def _live_page(module: Any, motion: Any, file: Path) -> Path | None:
    """The page in which the model runs; None, and a note, where it cannot."""
    try:
        return Path(module.page(file, motion))
    except (ModelError, ToolchainError) as error:
        say(f"note: the page shows only the run: {error}", err=True)
        return None
