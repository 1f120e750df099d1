"""Verbs that analyse a model at a state, or its run with derivatives: each a call of its module, printed."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from ..analysis.linearization import without_noise
from ..base.files import whole_file
from ..base.limits.numbers import SHOWN_FORCE
from ..base.results import ResultTable
from ..errors import at_odds, bad_file, ill_typed, incomplete, no_such
from .options import Count, End, Names, NumberRange, Prepared, Seed, Texts, Time, parse_settings, require_folder, verb
from .output import BREACH, stage

if TYPE_CHECKING:
    from ..module import Module

COMPONENTS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")


@verb()
def linearize(
    work: Prepared,
    t: Time = 0.0,
    equilibrium: Annotated[bool, "Linearize about the equilibrium found from the initial position."] = False,
    full: Annotated[bool, "Use all of x as states, not only the independent ones."] = False,
) -> None:
    """Linearize a model about its initial state, or about an equilibrium.

    States are independent displacements and velocities along the constraints, so constraints add no eigenvalues.
    """
    module = work.module
    x = module.equilibrium(work.position(), t).x if equilibrium else module.x0(work.initial, t=t)
    work.show(t, module.linearize(x, t, form="full" if full else "minimal"))


@verb()
def modes(work: Prepared, t: Time = 0.0) -> None:
    """Find natural frequencies and mode shapes about the equilibrium found from the initial position."""
    rest = work.module.equilibrium(work.position(), t)
    result = work.module.modes(rest.x, t)
    about = {"coordinates": rest.coordinates, "stability": rest.stability}
    work.show(t, rest, result, values=about | result.to_dict())


@verb()
def equilibrium(
    work: Prepared,
    t: Time = 0.0,
    hold: Annotated[Texts, "NAME[=VALUE]: Coordinate that is held; repeat it for more."] = (),
    unknown: Annotated[Texts, "NAME: Parameter or input to solve for; repeat it for more."] = (),
) -> None:
    """Find a static equilibrium from the initial position; --set NAME=VALUE of a coordinate changes the guess."""
    fixed: dict[str, float | None] = dict.fromkeys(word for word in hold if "=" not in word)
    fixed |= parse_settings(tuple(word for word in hold if "=" in word), "--hold", "theta=0.3")
    work.show(t, work.module.equilibrium(work.position(), t, hold=fixed, unknowns=unknown))


@verb()
def sensitivity(
    work: Prepared,
    by: Annotated[Names, "NAME: Parameter, input or initial value; by default all parameters."] = (),
    end: End = None,
    out: Annotated[Path | None, "FILE: Write them to FILE.npz or FILE.csv."] = None,
) -> None:
    """Integrate a model together with its derivatives, and report the derivatives at the end."""
    if out is not None and out.suffix not in (".npz", ".csv"):
        raise bad_file(f"--out {out}: sensitivities are written as .npz or .csv")
    require_folder("--out", out)
    names = by or work.module.p_names
    if not names:
        raise incomplete("the model has no parameters; name an input or an initial value with --by")
    with stage("integrate"):
        result = work.module.sensitivities(names, end, work.initial)
    files = [] if out is None else [result.save(out)]
    fixed = f"held at the start: {', '.join(result.held)}"
    work.show(float(result.t[-1]), *result.tables, fixed, values=result.to_dict(), files=files)


@verb()
def consistent(
    work: Prepared,
    t: Time = 0.0,
    weight: Annotated[Texts, "NAME=W: Weight of a change of a coordinate or rate; default 1."] = (),
    mass: Annotated[bool, "Weight changes by the mass matrix of the tree instead."] = False,
    hold: Annotated[Texts, "NAME: Coordinate or rate that keeps its value exactly."] = (),
) -> None:
    """Bring a rough state (--set, the rest as declared) onto the constraints with the least change."""
    if weight and mass:
        raise at_odds("give either --weight or --mass")
    module, names = work.module, work.module.x_names
    rough = module.x0(t=t)
    for name, value in (work.initial or {}).items():
        if name not in names:
            raise no_such(f"--set {name}: a state has the names {', '.join(names)}")
        rough[names.index(name)] = value
    weights: Any = "mass" if mass else parse_settings(weight, "--weight", "theta=100") or None
    result = module.consistent(rough, t, weights=weights, hold=hold)
    states = {"x": result, "rough": rough, "change": result - rough}
    units = [module.layout.unit(name) for name in names]
    columns = [without_noise(states[key].tolist(), units) for key in ("rough", "x", "change")]
    rows = [[name, a, b, f"{c:.3g}"] for name, a, b, c in zip(names, *columns, strict=True)]
    table = ResultTable(["", "given", "consistent", "change"], rows, "the nearest state on the constraints")
    work.show(t, table, values={key: _by_name(names, x) for key, x in states.items()})


def _by_name(names: Sequence[str], values: Any) -> dict[str, Any]:
    return dict(zip(names, values.tolist(), strict=True))


@verb()
def reactions(
    work: Prepared,
    t: Time = 0.0,
    end: Annotated[
        float | None, "T: Simulate to T and give the largest values; without it those of the initial state."
    ] = None,
    out: Annotated[Path | None, "FILE: With --end: write histories to FILE.csv or .npz."] = None,
) -> None:
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
    result, marks = module.reactions(times, x), module.undetermined_reactions(times, x)
    multipliers = module.multipliers(times, x)
    if out is not None:
        _write_reactions(out, module, times, result)
    title = f"reactions at t = {t:g} s"
    if end is not None:
        title = f"largest reactions up to t = {end:g} s"
        places = np.abs(result).argmax(axis=-1)
        result = np.take_along_axis(result, places[..., None], axis=-1)[..., 0]
        marks = marks.any(axis=-1)
        multipliers = np.take_along_axis(multipliers, np.abs(multipliers).argmax(axis=-1)[:, None], axis=-1)[:, 0]
    values = {"end": end, "joints": module.joint_names, "components": COMPONENTS, "reactions": result}
    values |= {"undetermined": marks, "constraints": module.constraint_labels, "multipliers": multipliers}
    large = np.where(np.abs(result) < SHOWN_FORCE * np.abs(result).max(initial=0.0), 0.0, result)
    rows = [
        [joint, *(f"{value:.6g}{'*' if mark else ''}" for value, mark in zip(row, stars, strict=True))]
        for joint, row, stars in zip(module.joint_names, large, marks, strict=True)
    ]
    notes = ["* not determined by rigid bodies: the constraints are redundant"] if marks.any() else []
    table = ResultTable(["joint", *COMPONENTS], rows, title)
    work.show(t, table, *notes, values=values, files=[] if out is None else [out])


def _write_reactions(out: Path, module: Module, times: Any, result: Any) -> None:
    names = [f"{joint}.{component}" for joint in module.joint_names for component in COMPONENTS]
    flat = result.reshape(len(names), -1)
    with whole_file(out) as file:
        if out.suffix == ".npz":
            np.savez(file, t=times, names=np.array(names), reactions=flat)
        else:
            table, head = np.vstack([times, flat]).T, ",".join(["t", *names])
            np.savetxt(file, table, delimiter=",", header=head, comments="", encoding="utf-8")


@verb()
def inverse(
    work: Prepared,
    t: Time = 0.0,
    actuated: Annotated[Texts, "NAME: Driven coordinate or input; repeat it for more."] = (),
    accelerate: Annotated[Texts, "NAME=VALUE: Acceleration of an independent coordinate, 0 by default."] = (),
) -> None:
    """Find the forces of drives for given accelerations at the initial state; loops stay closed."""
    module, layout = work.module, work.module.layout
    x = module.x0(work.initial, t=t)
    result = module.actuator_forces(t, x, parse_settings(accelerate), actuated=actuated or None)
    forces, accelerations = result.as_dict(), _by_name(layout.a, result.a)
    kinds = {"m": "N", "rad": "N m"}
    units = {name: layout.unit(name) if name in layout.u else kinds.get(layout.unit(name), "") for name in forces}
    more = {"accelerations": accelerations, "constraints": module.constraint_labels, "joints": module.joint_names}
    work.show(
        t,
        _with_units(f"forces of the drives at t = {t:g} s", forces, units),
        _with_units("accelerations", accelerations, {name: layout.unit(name) for name in layout.a}),
        values=result.to_dict() | more,
    )


def _with_units(title: str, values: dict[str, float], units: dict[str, str], sizes: Any = None) -> ResultTable:
    """Values by name, each with its unit; what is nothing beside others of its unit is 0."""
    without = without_noise(list(values.values()), list(units.values()), sizes)
    rows = [(name, f"{x:.6g} {unit}") for (name, unit), x in zip(units.items(), without, strict=True)]
    return ResultTable((), rows, title)


@verb()
def impact(
    work: Prepared,
    t: Time = 0.0,
    gap: Annotated[Texts, "NAME=E: Gap (coordinate or output) that closes, with its restitution."] = (),
    slip: Annotated[
        Texts,
        "NAME=MU:SPEED: Friction of a gap: its coefficient and the output that is the sliding velocity; in space "
        "MU:SPEED:SPEED.",
    ] = (),
    stop: Annotated[Texts, "NAME: Coordinate that is locked suddenly; repeat it for more."] = (),
    closed: Annotated[bool, "Treat the gaps as closed at any value."] = False,
) -> None:
    """Find the state after an impact at the initial state; friction acts with --slip."""
    from ..analysis.impact import check_friction, check_gaps

    if not gap and not stop:
        raise incomplete(
            "give --gap NAME=RESTITUTION for a gap that closes, or --stop NAME for a coordinate that is locked"
        )
    module, layout = work.module, work.module.layout
    gaps, locked = check_gaps(layout, parse_settings(gap, "--gap", "s=0.5"), stop, ("--gap", "--stop"))
    rough = check_friction(layout, dict(map(_read_friction, slip)), gaps, "--slip")
    if rough and locked:
        raise at_odds("give --slip or --stop, not both")
    result = module.impact(t, module.x0(work.initial, t=t), gaps, lock=locked, closed=closed, friction=rough or None)
    rates = _by_name(layout.v, result.x[module.n_q :])
    units = {name: layout.unit(name) for name in layout.v}
    table = _with_units("velocities after it", rates, units, result.before[module.n_q :].tolist())
    more = {"x": _by_name(module.x_names, result.x), "constraints": module.constraint_labels}
    work.show(t, result, table, values=result.to_dict() | more)


def _read_friction(text: str) -> tuple[str, tuple[str, tuple[str, ...]]]:
    """The gap, its coefficient and its sliding velocities, from NAME=MU:SPEED."""
    gap, equals, rest = text.partition("=")
    mu, *names = rest.split(":")
    if not equals or not names:
        raise ill_typed(f"--slip: {text!r} is not NAME=MU:SPEED, such as gap=0.3:vx_tip")
    return gap, (mu, tuple(names))


@verb()
def verify(
    work: Prepared,
    states: Annotated[Count, "Number of random states."] = 6,
    seed: Annotated[Seed, "Seed of the random states."] = 0,
    seconds: Annotated[
        float, NumberRange(min=0.0), "Time limit for all checks in s; variants get what is left."
    ] = 12.0,
) -> None:
    """Check a compiled model against independent computations; exit with 5 if a limit is exceeded."""
    with stage("verify"):
        result = work.module.verify(states=states, seed=seed, seconds=seconds)
    head = {"name": work.equations.name, "method": work.equations.method}
    work.source.show(head | result.as_dict() | {"seconds": round(result.seconds, 3)}, str(result))
    sys.exit(0 if result.ok else BREACH)
