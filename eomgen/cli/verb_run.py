"""Stage cli, run: model file -> simulation, with what was derived, how long it took and how far to trust it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import click

from ..base.limits.numbers import RESTING
from ..base.names import place_of_marker
from ..base.texts import without_noise
from ..errors import bad_file
from ..runtime.near_names import unknown
from ..runtime.storage import RUNS
from .failures import after_integration, reports_failures
from .number_option import NumberRange
from .plot import Picture, check_columns, check_picture, find_paths, picture_options, plot_run
from .screen import finite, print_heading, print_json, print_rows, say, stage
from .sections import verb_command
from .shared_options import (
    baumgarte_option,
    blaming_option,
    independent_option,
    json_option,
    load_model,
    method_option,
    model_argument,
    native_option,
    parse_settings,
    require_folder,
    robot_options,
    solver_options,
    target_option,
)
from .verb_derive import print_operations, summary

if TYPE_CHECKING:
    from ..api.equations import Equations
    from ..api.model import Model
    from ..module import Module
    from ..runtime import Trajectory
    from .energy import EnergyBalance


POINTS = 5  #: change points listed
#: What a run with rigid contacts tells of them.
CONTACT = ("contacts", "contact_iterations", "contact_residual", "missed_steps", "penetration")


@verb_command()
@model_argument
@native_option
@method_option
@baumgarte_option
@independent_option
@target_option("cython", "numpy")
@click.option("--end", type=NumberRange(min=0, min_open=True), metavar="T", help="End time in s.")
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="NAME=VALUE",
    help="Value of a parameter, an input or an initial value; repeat it for more.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Write the run to FILE.npz, .csv, .nc or .parquet.",
)
@click.option("--plot", type=click.Path(path_type=Path), metavar="FILE", help="Draw the run, e.g. to FILE.png.")
@click.option(
    "--animate",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Write an animation: FILE.gif, FILE.mp4 or FILE.html.",
)
@picture_options
@json_option
@solver_options
@robot_options
@reports_failures
def run(
    model: Path,
    allow_native: bool,
    method: str,
    baumgarte: tuple[float, float] | None,
    independent: tuple[str, ...],
    target: str,
    end: float | None,
    settings: tuple[str, ...],
    out: Path | None,
    plot: Path | None,
    picture: Picture,
    animate: Path | None,
    as_json: bool,
    robot: dict[str, Any],
    solver: dict[str, Any],
) -> None:
    """Derive, compile and simulate a model, and report it.

    Integrator, tolerances, end time and initial values are those of the model file where no option gives others.
    """
    chosen = parse_settings(settings)
    if out is not None and out.suffix not in RUNS:
        raise bad_file(f"--out {out}: a run is written as {' or '.join(RUNS)}")
    check_picture(plot, picture)
    if animate is not None:
        from ..show.writers import require_kind

        require_kind(animate)
    require_folder("--out", out)
    require_folder("--animate", animate)
    require_folder("--plot", plot)

    with blaming_option(independent), stage("derive") as parts:
        described = load_model(model, allow_native, robot)
        complete_parameters(described, chosen)
        equations = described.derive(method, independent or None, baumgarte)
        parts |= equations.seconds
    with stage("compile") as parts:
        before = set(equations.seconds)
        module = equations.compile(target=target)
        parts |= {part: seconds for part, seconds in equations.seconds.items() if part not in before}
    initial, parameters, inputs = sort_settings(module, chosen)
    check_columns(module, picture)
    from .energy import balance_energy, counts_work, takes_impulses, uncounted_functions

    start = perf_counter()
    with stage("simulate"):
        trajectory = module.simulate(
            end,
            initial=initial or None,
            parameters=parameters or None,
            inputs=inputs or None,
            dense_output=not takes_impulses(module, solver)
            and (plot is not None or animate is not None or counts_work(equations)),
            **solver,
        )
    seconds = {**equations.seconds, "simulate": perf_counter() - start}
    with after_integration():
        energy = balance_energy(equations, trajectory)
        files = _write(equations, trajectory, out, plot, picture)
        if animate is not None:
            with stage("animate"):
                files.append(str(trajectory.animate(animate)))
        result = to_dict(equations, trajectory, energy) | {"seconds": seconds, "files": files}
    if as_json:
        print_json(result)
        return
    say(str(equations.report))
    print_operations(equations)
    print_trajectory(trajectory, energy, uncounted_functions(equations) if energy and energy.work is None else ())
    for file in files:
        say(f"wrote {file}")


def complete_parameters(model: Model, settings: dict[str, float]) -> None:
    """Give values to parameters that the model leaves open; others change without compiling anew."""
    for entry in model.description.sections["parameters"]:
        if entry.name in settings and entry.values.get("value") is None:
            entry.values["value"] = settings[entry.name]


def sort_settings(
    module: Module, settings: dict[str, float]
) -> tuple[dict[str, float], dict[str, float], dict[str, float]]:
    """Which settings are initial values, parameters and inputs; one namespace holds them all."""
    loops = [*module.loop_names, *(f"{name}_dot" for name in module.loop_names)]
    initial_names = [*module.x_names, *loops, *(name for name in module.y_names if name not in module.p_names)]
    groups = [[*initial_names, *filter(place_of_marker, settings)], module.p_names, module.u_names]
    known = [name for group in groups for name in group]
    settings = {module.layout.plain(name): value for name, value in settings.items()}  # leg1.hip of an instance
    for name in settings:
        if name not in known:
            raise unknown("parameter, input or initial value", name, known)
    initial, parameters, inputs = ({n: v for n, v in settings.items() if n in group} for group in groups)
    return initial, parameters, inputs


def _write(
    equations: Equations, trajectory: Trajectory, out: Path | None, plot: Path | None, picture: Picture
) -> list[str]:
    if out is not None:
        trajectory.save(out)
    if plot is not None:
        plot_run(trajectory, find_paths(equations.kinematics.mechanism), trajectory.name, plot, picture)
    return [str(file) for file in (out, plot) if file is not None]


def final_names(trajectory: Trajectory) -> list[str]:
    """Columns whose last value is reported: state, coordinates of cut joints and their rates, outputs."""
    header = trajectory.metadata
    loops = [name + suffix for suffix in ("", "_dot") for name in header["loop_names"]]
    return list(dict.fromkeys([*header["x_names"], *loops, *header["y_names"]]))


def to_dict(equations: Equations, trajectory: Trajectory, energy: EnergyBalance | None) -> dict[str, Any]:
    """A run as plain values."""
    header, residuals = trajectory.metadata, trajectory.residuals
    final = {name: finite(trajectory[name][-1]) for name in final_names(trajectory)}
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
        "change_points": [point._asdict() for point in trajectory.change_points],
        "energy": energy and {k: None if value is None else finite(value) for k, value in energy._asdict().items()},
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


def print_trajectory(trajectory: Trajectory, energy: EnergyBalance | None, uncounted: Sequence[str] = ()) -> None:
    """Statistics of a run, its residuals, its energy and its final values.

    ``uncounted`` are functions whose work is not known.
    """
    header, residuals = trajectory.metadata, trajectory.residuals
    print_heading(f"simulation from {trajectory.t[0]:g} to {trajectory.t[-1]:g} s")
    if header["method"] == "moreau":
        missed = header["missed_steps"]
        rows = [
            ("integrator", f"moreau, {header['steps']} steps of {header['options']['step']:g} s"),
            ("contacts", f"{header['contacts']} at most in one step, {header['penetration']:.1e} m deep at most"),
            ("laws of contact", f"residual {header['contact_residual']:.1e} m/s; {missed} steps miss the tolerance"),
        ]
    elif header["rtol"] is None:
        rows = [("moved by drivers", f"{len(trajectory)} positions, solved one by one")]
    else:
        rows = [
            ("integrator", f"{header['method']}, rtol {header['rtol']:g}, atol {header['atol']:g}"),
            ("steps", f"{len(trajectory) - 1}, {trajectory.nfev} calls of the right-hand side"),
        ]
    if header["loop_names"] or residuals.raw_position:
        rows += [
            ("loop residual", f"{residuals.raw_position:.1e} raw, {residuals.position:.1e} projected (m, rad)"),
            ("at velocity level", f"{residuals.raw_velocity:.1e} raw, {residuals.velocity:.1e} projected"),
        ]
    points = trajectory.change_points
    if points:
        rows += [("change point" if k == 0 else "", str(point)) for k, point in enumerate(points[:POINTS])]
        rows += [("", f"... ({len(points) - POINTS} more)")] if len(points) > POINTS else []
    print_rows(rows + _energy_rows(energy, uncounted))
    print_heading(f"values at t = {trajectory.t[-1]:g} s")
    names = final_names(trajectory)
    units = [trajectory.units.get(name, "") for name in names]
    sizes = [float(max(trajectory[name].max(), -trajectory[name].min())) for name in names]
    final = without_noise([trajectory[name][-1] for name in names], units, sizes)
    error, states = header["atol"] or 0.0, set(trajectory.x_names)
    for k, name in enumerate(names):  # a state that rests, to the error that the integrator admits
        if name in states and abs(final[k]) <= error and sizes[k] <= RESTING * error:
            final[k] = 0.0
    print_rows([(name, f"{x: .9g} {unit}") for name, x, unit in zip(names, final, units, strict=True)])
