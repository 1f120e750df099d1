"""Verbs that analyse a model at a state, or its run with derivatives: each a call of its module, reported."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from ..base.files import whole_file
from ..base.limits.numbers import SHOWN_FORCE
from ..base.texts import without_noise
from ..errors import at_odds, bad_file, ill_typed, incomplete, no_such
from .options import (
    Number,
    NumberRange,
    Prepared,
    analysis_verb,
    end_option,
    file_option,
    parse_settings,
    require_folder,
)
from .output import BREACH, finite, print_heading, print_json, print_rows, print_table, say, stage

if TYPE_CHECKING:
    from ..module import Module

COMPONENTS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")

time_option = click.option("--time", "t", type=Number(), default=0.0, show_default=True, metavar="T", help="Time in s.")


def _pairs(values: Any) -> list[list[float]]:
    """Complex numbers as JSON has them: real and imaginary parts."""
    return [[float(value.real), float(value.imag)] for value in values]


def _by_name(names: Sequence[str], values: Any) -> dict[str, Any]:
    return dict(zip(names, values.tolist(), strict=True))


@analysis_verb
@time_option
@click.option(
    "--equilibrium", "at_rest", is_flag=True, help="Linearize about the equilibrium found from the initial position."
)
@click.option("--full", is_flag=True, help="Use all of x as states, not only the independent ones.")
def linearize(work: Prepared, t: float, at_rest: bool, full: bool, as_json: bool) -> None:
    """Linearize a model about its initial state, or about an equilibrium.

    States are independent displacements and velocities along the constraints, so that these add no eigenvalues.
    """
    module = work.module
    if at_rest:
        x = module.equilibrium(work.position(), t).x
    else:
        x = module.x0(work.initial, t=t)
    found = module.linearize(x, t, form="full" if full else "minimal")
    if as_json:
        matrices = {key: getattr(found, key) for key in ("A", "B", "C", "D", "mass", "damping", "stiffness", "drift")}
        print_json(
            work.heading(t)
            | {"x": _by_name(module.x_names, found.x)}
            | {"states": found.states, "inputs": found.inputs, "outputs": found.outputs, **matrices}
            | {"velocities": found.velocity_names, "positions": found.position_names}
            | {"equilibrium": found.is_equilibrium, "steady": found.is_steady}
            | {"eigenvalues": _pairs(found.eigenvalues), "stability": found.stability}
        )
        return
    say(repr(found))
    for label, matrix, columns, rows in (
        ("A", found.A, found.states, found.states),
        ("B", found.B, found.inputs, found.states),
        ("C", found.C, found.states, found.outputs),
        ("D", found.D, found.inputs, found.outputs),
    ):
        if matrix.size:
            print_heading(label)
            entries = iter(without_noise(matrix.ravel().tolist()))
            lines = [[name, *(f"{next(entries):.6g}" for _ in columns)] for name in rows]
            print_table(["", *columns], lines, right=range(1, len(columns) + 1))


@analysis_verb
@time_option
def modes(work: Prepared, t: float, as_json: bool) -> None:
    """Find natural frequencies and mode shapes about the equilibrium found from the initial position."""
    module = work.module
    rest = module.equilibrium(work.position(), t)
    found = module.modes(rest.x, t)
    if as_json:
        damped = [
            {
                "eigenvalue": [mode.eigenvalue.real, mode.eigenvalue.imag],
                "frequency": mode.frequency,
                "damped_frequency": mode.damped,
                "ratio": mode.ratio,
            }
            for mode in found.damped
        ]
        print_json(
            work.heading(t)
            | {"coordinates": rest.coordinates, "stability": rest.stability, "names": found.names}
            | {"squares": found.squares, "frequencies": found.frequencies, "hertz": found.hertz}
            | {"shapes": found.shapes, "rigid": found.rigid, "diverging": found.diverging, "damped": damped}
        )
        return
    say(repr(rest))
    say(repr(found))


@analysis_verb
@time_option
@click.option("--hold", multiple=True, metavar="NAME[=VALUE]", help="Coordinate that is held; repeat it for more.")
@click.option("--unknown", multiple=True, metavar="NAME", help="Parameter or input to solve for; repeat it for more.")
def equilibrium(work: Prepared, t: float, hold: tuple[str, ...], unknown: tuple[str, ...], as_json: bool) -> None:
    """Find a static equilibrium from the initial position; --set NAME=VALUE of a coordinate changes the guess."""
    module = work.module
    held: dict[str, float | None] = dict.fromkeys(word for word in hold if "=" not in word)
    held |= parse_settings(tuple(word for word in hold if "=" in word), "--hold", "theta=0.3")
    found = module.equilibrium(work.position(), t, hold=held, unknowns=unknown)
    if as_json:
        print_json(
            work.heading(t)
            | {"coordinates": found.coordinates, "unknowns": found.unknowns, "supports": found.supports}
            | {"forces": found.forces, "steps": found.steps}
            | {"eigenvalues": _pairs(found.eigenvalues), "stability": found.stability}
        )
        return
    say(repr(found))


@analysis_verb
@click.option(
    "--by", multiple=True, metavar="NAME", help="Parameter, input or initial value; by default all parameters."
)
@end_option
@file_option("--out", "Write them to FILE.npz or FILE.csv.")
def sensitivity(work: Prepared, by: tuple[str, ...], end: float | None, out: Path | None, as_json: bool) -> None:
    """Integrate a model together with its derivatives, and report the derivatives at the end."""
    if out is not None and out.suffix not in (".npz", ".csv"):
        raise bad_file(f"--out {out}: sensitivities are written as .npz or .csv")
    require_folder("--out", out)
    module = work.module
    names = [name for words in by for name in words.split(",") if name] or list(module.p_names)
    if not names:
        raise incomplete("the model has no parameters; name an input or an initial value with --by")
    with stage("integrate"):
        found = module.sensitivities(names, end, work.initial)
    if out is not None:
        found.save(out)
    rows = dict.fromkeys((*module.x_names, *module.y_names))
    final = {row: {name: finite(found[row, name][-1]) for name in found.names} for row in rows}
    events = [
        {"event": e.name, "t": e.t, "by": {name: finite(x) for name, x in zip(found.names, e.dt, strict=True)}}
        for e in found.events
    ]
    if as_json:
        end_time = float(found.t[-1])
        print_json(
            work.heading(end_time) | {"names": found.names, "held": found.held, "steps": len(found.t) - 1} |
            {"final": final, "events": events, "files": [] if out is None else [str(out)]}
        )  # fmt: skip
        return
    print_heading(f"derivatives at t = {found.t[-1]:g} s, by")
    lines = [[row, *("-" if x is None else f"{x:.6g}" for x in values.values())] for row, values in final.items()]
    print_table(["", *found.names], lines, right=range(1, len(found.names) + 1))
    if events:
        print_heading("times of events, by")
        shown = [[f"{e.name}, t = {e.t:.6g} s", *(f"{x:.6g}" for x in e.dt)] for e in found.events]
        print_table(["", *found.names], shown, right=range(1, len(found.names) + 1))
    say(f"held at the start: {', '.join(found.held)}")
    if out is not None:
        say(f"wrote {out}")


@analysis_verb
@time_option
@click.option(
    "--weight", multiple=True, metavar="NAME=W", help="Weight of a change of a coordinate or rate; default 1."
)
@click.option("--mass", is_flag=True, help="Weight changes by the mass matrix of the tree instead.")
@click.option("--hold", multiple=True, metavar="NAME", help="Coordinate or rate that keeps its value exactly.")
def consistent(
    work: Prepared, t: float, weight: tuple[str, ...], mass: bool, hold: tuple[str, ...], as_json: bool
) -> None:
    """Bring a rough state (--set, the rest as declared) onto the constraints with the least change."""
    if weight and mass:
        raise at_odds("give either --weight or --mass")
    module = work.module
    rough = module.x0(t=t)
    for name, value in (work.initial or {}).items():
        if name not in module.x_names:
            raise no_such(f"--set {name}: the names of a rough state are {', '.join(module.x_names)}")
        rough[module.x_names.index(name)] = value
    weights: Any = "mass" if mass else parse_settings(weight, "--weight", "theta=100") or None
    found = module.consistent(rough, t, weights=weights, hold=hold)
    change = found - rough
    if as_json:
        states = {"x": found, "rough": rough, "change": change}
        print_json(work.heading(t) | {key: _by_name(module.x_names, row) for key, row in states.items()})
        return
    print_heading("the nearest state on the constraints")
    units = [module.layout.unit(name) for name in module.x_names]
    columns = rough.tolist(), found.tolist(), change.tolist()
    rows = [
        [name, f"{a:.6g}", f"{b:.6g}", f"{c:.3g}"]
        for name, a, b, c in zip(module.x_names, *(without_noise(x, units) for x in columns), strict=True)
    ]
    print_table(["", "given", "consistent", "change"], rows, right=range(1, 4))


@analysis_verb
@time_option
@click.option(
    "--end",
    type=Number(),
    metavar="T",
    help="Simulate to T and give the largest values; without it those of the initial state.",
)
@file_option("--out", "With --end: write histories to FILE.csv or .npz.")
def reactions(work: Prepared, t: float, end: float | None, out: Path | None, as_json: bool) -> None:
    """Find the force and moment that each joint's predecessor exerts on its successor, in ground axes (N, N m).

    Components that redundant constraints leave undetermined are marked with *; the smallest reactions are given.
    """
    if out is not None and (end is None or out.suffix not in (".npz", ".csv")):
        raise bad_file(f"--out {out}: histories need --end and are written as .npz or .csv")
    require_folder("--out", out)
    module = work.module
    x = module.x0(work.initial, t=t)
    times: Any = t
    if end is not None:
        with stage("integrate"):
            run = module.simulate((t, end), x)
        times, x = run.t, run.x
    found, marks = module.reactions(times, x), module.undetermined_reactions(times, x)
    multipliers = module.multipliers(times, x)
    names = [f"{joint}.{component}" for joint in module.joint_names for component in COMPONENTS]
    if out is not None:
        flat = found.reshape(len(names), -1)
        with whole_file(out) as file:
            if out.suffix == ".npz":
                np.savez(file, t=times, names=np.array(names), reactions=flat)
            else:
                table, head = np.vstack([times, flat]).T, ",".join(["t", *names])
                np.savetxt(file, table, delimiter=",", header=head, comments="", encoding="utf-8")
    if end is not None:
        places = np.abs(found).argmax(axis=-1)
        found = np.take_along_axis(found, places[..., None], axis=-1)[..., 0]
        marks = marks.any(axis=-1)
        multipliers = np.take_along_axis(multipliers, np.abs(multipliers).argmax(axis=-1)[:, None], axis=-1)[:, 0]
    if as_json:
        print_json(
            work.heading(t)
            | {"end": end, "joints": module.joint_names, "components": COMPONENTS}
            | {"reactions": found, "undetermined": marks}
            | {"constraints": module.constraint_labels, "multipliers": multipliers}
            | {"files": [] if out is None else [str(out)]}
        )
        return
    print_heading(f"reactions at t = {t:g} s" if end is None else f"largest reactions up to t = {end:g} s")
    found = np.where(np.abs(found) < SHOWN_FORCE * np.abs(found).max(initial=0.0), 0.0, found)
    lines = [
        [joint, *(f"{value:.6g}{'*' if mark else ''}" for value, mark in zip(row, stars, strict=True))]
        for joint, row, stars in zip(module.joint_names, found, marks, strict=True)
    ]
    print_table(["joint", *COMPONENTS], lines, right=range(1, 7))
    if marks.any():
        say("* not determined by rigid bodies: the constraints are redundant")
    if out is not None:
        say(f"wrote {out}")


@analysis_verb
@time_option
@click.option("--actuated", multiple=True, metavar="NAME", help="Driven coordinate or input; repeat it for more.")
@click.option(
    "--accelerate", multiple=True, metavar="NAME=VALUE", help="Acceleration of an independent coordinate, 0 by default."
)
def inverse(work: Prepared, t: float, actuated: tuple[str, ...], accelerate: tuple[str, ...], as_json: bool) -> None:
    """Find the forces of drives for given accelerations at the initial state; loops stay closed."""
    module = work.module
    x = module.x0(work.initial, t=t)
    found = module.actuator_forces(t, x, parse_settings(accelerate), actuated=actuated or None)
    if as_json:
        print_json(
            work.heading(t)
            | {"forces": found.as_dict(), "accelerations": dict(zip(module.layout.a, found.a, strict=True))}
            | {"constraints": module.constraint_labels, "multipliers": found.multipliers}
            | {"joints": module.joint_names, "reactions": found.reactions}
        )
        return
    print_heading(f"forces of the drives at t = {t:g} s")
    forces = found.as_dict()
    _print_values(list(forces), list(forces.values()), [_unit(module, name) for name in forces])
    print_heading("accelerations")
    _print_values(module.layout.a, found.a.tolist(), [module.layout.unit(name) for name in module.layout.a])


def _print_values(names: Sequence[str], values: Sequence[float], units: Sequence[str]) -> None:
    settled = zip(names, without_noise(values, units), units, strict=True)
    print_rows([(name, f"{value:.6g} {unit}") for name, value, unit in settled])


def _unit(module: Module, name: str) -> str:
    """Unit of the force along a coordinate, or of an input."""
    layout = module.layout
    if name in layout.u:
        return str(layout.unit(name))
    return {"m": "N", "rad": "N m"}.get(layout.unit(name), "")


@analysis_verb
@time_option
@click.option(
    "--gap", multiple=True, metavar="NAME=E", help="Gap (coordinate or output) that closes, with its restitution."
)
@click.option(
    "--slip",
    multiple=True,
    metavar="NAME=MU:SPEED",
    help="Friction of a gap: its coefficient and the output that is the sliding velocity; in space MU:SPEED:SPEED.",
)
@click.option("--stop", multiple=True, metavar="NAME", help="Coordinate that is locked suddenly; repeat it for more.")
@click.option("--closed", is_flag=True, help="Treat the gaps as closed at any value.")
def impact(
    work: Prepared,
    t: float,
    gap: tuple[str, ...],
    slip: tuple[str, ...],
    stop: tuple[str, ...],
    closed: bool,
    as_json: bool,
) -> None:
    """Find the state after an impact at the initial state, without friction unless it is given."""
    from ..simulation.impact import check_friction, check_gaps

    if not gap and not stop:
        raise incomplete("give --gap NAME=RESTITUTION for what closes, or --stop NAME for a coordinate that is locked")
    module = work.module
    gaps, locked = check_gaps(module.layout, parse_settings(gap, "--gap", "s=0.5"), stop, ("--gap", "--stop"))
    rough = check_friction(module.layout, dict(map(_read_friction, slip)), gaps, "--slip")
    if rough and locked:
        raise at_odds("give --slip or --stop, not both")
    start = module.x0(work.initial, t=t)
    found = module.impact(t, start, gaps, lock=locked, closed=closed, friction=rough or None)
    after = _by_name(module.x_names, found.x)
    if as_json:
        rubbed = {
            "friction": found.friction,
            "sliding_before": found.sliding_before,
            "sliding_after": found.sliding_after,
        }
        print_json(
            work.heading(t)
            | {"names": found.names, "impulses": found.impulses, "energy_lost": found.energy_lost, "x": after}
            | {"rates_before": found.rates_before, "rates_after": found.rates_after}
            | {"constraints": module.constraint_labels, "constraint_impulses": found.constraint_impulses}
            | (rubbed if rough else {})
        )
        return
    say(repr(found))
    print_heading("velocities after it")
    units = [module.layout.unit(name) for name in module.layout.v]
    before = found.before[module.n_q :].tolist()
    rates = without_noise([after[name] for name in module.layout.v], units, before)
    print_rows([(n, f"{x:.6g} {unit}") for n, x, unit in zip(module.layout.v, rates, units, strict=True)])


def _read_friction(text: str) -> tuple[str, tuple[str, tuple[str, ...]]]:
    """The gap, its coefficient and its sliding velocities, from NAME=MU:SPEED."""
    gap, equals, rest = text.partition("=")
    mu, *names = rest.split(":")
    if not equals or not names:
        raise ill_typed(f"--slip: {text!r} is not NAME=MU:SPEED, such as gap=0.3:vx_tip")
    return gap, (mu, tuple(names))


@analysis_verb
@click.option("--states", type=click.IntRange(min=1), default=6, show_default=True, help="Number of random states.")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the random states.")
@click.option(
    "--seconds",
    type=NumberRange(min=0.0),
    default=12.0,
    show_default=True,
    help="Time limit for all checks in s; variants get what is left.",
)
def verify(work: Prepared, states: int, seed: int, seconds: float, as_json: bool) -> None:
    """Check a compiled model against independent computations; exit with 5 if a limit is broken."""
    with stage("verify"):
        found = work.module.verify(states=states, seed=seed, seconds=seconds)
    if as_json:
        heading = {"name": work.equations.name, "method": work.equations.method}
        print_json(heading | found.as_dict() | {"seconds": round(found.seconds, 3)})
    else:
        say(str(found))
    sys.exit(0 if found.ok else BREACH)
