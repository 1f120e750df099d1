"""Kinematics, Mobility and TreeEquations -> the metadata of model.json."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict
from math import isfinite
from typing import Any

from ..base.limits.constraints import HELD_STEP
from ..base.operations import OPERATIONS
from ..base.texts import acceleration_name
from ..base.value_rules import RANGE
from ..elements.constraints.rolling import RollingDisc
from ..elements.frames import GROUND, Marker
from ..elements.joints import Cylindrical, Free, Planar, Prismatic, Translational
from ..errors import TO_BE_FINITE, ModelError, UsageError
from ..expr.core import Expr, reachable, symbols_of
from ..expr.differentiate import gradient
from ..expr.evaluate import Evaluator, evaluate
from ..expr.notation import split_rate
from ..expr.schedule import record_tape
from ..mechanics import Kinematics
from ..mechanics.constraint_functions import row_groups, row_scales, row_velocities
from ..mechanics.methods.tree_equations import TreeEquations
from ..mechanics.mobility import Mobility, initial_values
from ..mechanics.wrenches import describe_contacts, find_wrenches
from ..model.mechanism import FirstOrderState, Input, Output, Parameter
from ..model.requirements import Requirement
from .picture import describe_picture
from .terms import flag_forces, independent_places, resets, resolved


def describe_discs(kinematics: Kinematics) -> list[list[Any]]:
    """Per disc: constraint, body and axle of the wheel, body (-1: ground) and normal of the plane, in body axes.

    They are those at the declared values of parameters.
    """
    mechanism = kinematics.mechanism
    values = {p.name: p.value for p in mechanism.parameters}

    def axis(marker: Marker) -> list[Any]:
        return [marker.body, [float(x) for x in evaluate([row[2] for row in marker.frame.rotation], values)]]

    return [[c.name, *axis(c.wheel), *axis(c.plane)] for c in mechanism.constraints if isinstance(c, RollingDisc)]


def keep_rules(requirements: Sequence[Requirement], names: Sequence[str]) -> dict[str, Any]:
    """What parameters must keep whatever their values are: ranges of single ones, and rules of numbers made of them.

    A range has the place of its parameter; a rule has the places of all that it depends on, and a tape, whose x are the
    points at which it looks.  A number that comes through a function of the model has no tape: it is judged where the
    model is read, and not here.
    """
    ranges: list[list[Any]] = []
    rules: list[list[Any]] = []
    for path, rule, numbers, data, local in requirements:
        kind, *operands = numbers[0].node
        if rule == RANGE and kind == "sym" and operands[0] in names:
            ranges.append([names.index(operands[0]), path, *data])
            continue
        places = {name: ("p", k) for k, name in enumerate(names)} | {name: ("x", k) for k, name in enumerate(local)}
        used = sorted(names.index(name) for name in symbols_of(numbers) - {*local})
        with suppress(UsageError):
            rules.append([path, rule, list(data), used, list(record_tape(numbers, places.__getitem__))])
    return {"ranges": ranges, "rules": rules}


def describe_start(kinematics: Kinematics) -> dict[str, Any]:
    """Initial values and guesses as model.json holds them.

    Their numbers are those at the declared parameters.  ``start_terms`` are the tapes of those that follow from
    parameters, by section with their names; ``start_slopes`` the derivatives of initial values that do not vanish, with
    the name and the place of the parameter of each.  ``start_fixed`` are those that call tables or functions of the
    model, which no tape can play, with the places of their parameters.
    """
    m = kinematics.mechanism
    sources = {key: getattr(m.defaults, key) for key in ("initial", "initial_outputs", "guess")}
    values = {p.name: p.value for p in m.parameters}
    result: dict[str, Any] = {key: initial_values(kinematics, values, key) for key in sources}
    if bad := [(key, name) for key, of in result.items() for name, x in of.items() if not isfinite(x)]:
        what = "is no number at the declared parameters"
        raise ModelError(
            [m.problem(f"{key.partition('_')[0]}.{name}", what, TO_BE_FINITE, "EG-NOT-FINITE") for key, name in bad]
        )
    places = {name: ("p", k) for k, name in enumerate(kinematics.parameter_names)}
    unbound = {key: {n: x for n, x in terms.items() if symbols_of([x])} for key, terms in sources.items()}
    fixed = {n: x for terms in unbound.values() for n, x in terms.items() if not _is_of_operations(x)}
    unbound = {key: {n: x for n, x in terms.items() if n not in fixed} for key, terms in unbound.items()}
    if fixed:
        result["start_fixed"] = {n: sorted(places[name][1] for name in symbols_of([x])) for n, x in fixed.items()}
    if not any(unbound.values()):
        return result
    known = [kinematics.graph.symbol(name) for name in places]
    slopes = [
        (name, k, slope)
        for name, x in unbound["initial"].items()
        for k, slope in enumerate(gradient(x, known))
        if not slope.is_zero
    ]
    terms = {
        key: [list(of), list(record_tape(list(of.values()), places.__getitem__))] for key, of in unbound.items() if of
    }
    tape = record_tape([slope for *_, slope in slopes], places.__getitem__)
    return result | {"start_terms": terms, "start_slopes": [[[name, k] for name, k, _ in slopes], list(tape)]}


def _is_of_operations(x: Expr) -> bool:
    """Whether a tape can play it."""
    return {x.graph.nodes[i][0] for i in reachable(x.graph, [x.id])} <= {"sym", "const", *OPERATIONS}


def describe_events(kinematics: Kinematics) -> dict[str, Any]:
    """Events, the states that they reset and the clocks of sampled states, as model.json holds them."""
    m = kinematics.mechanism
    if not m.events:
        return {}
    events = [
        {
            "name": e.name,
            "terminal": e.terminal,
            "direction": e.direction,
            "resets": bool(e.reset),
            "restitution": e.restitution,
            "doc": e.doc,
            **({} if e.friction is None else {"friction": e.friction, "slip": list(e.slip)}),
        }
        for e in m.events
    ]
    return {
        "events": events,
        "resets": [[i, k] for i, k, _ in resets(kinematics)],
        "clocks": _clocks(kinematics) if m.clocks else [],
    }


def _clocks(kinematics: Kinematics) -> list[dict[str, Any]]:
    """Of each clock its event, the place of its counter in x, and the states that it renews."""
    events = [event.name for event in kinematics.mechanism.events]
    states = (*kinematics.names, *kinematics.velocity_names, *kinematics.state_names)
    lawless = {s.name for s in kinematics.mechanism.states if s.sampled == kinematics.graph.symbol(s.name)}
    return [
        {
            "event": events.index(c.event),
            "counter": states.index(c.counter),
            "states": list(c.states),
            "open": [name for name in c.states if name in lawless],
        }
        for c in kinematics.mechanism.clocks
    ]


def find_translations(kinematics: Kinematics) -> list[list[Any]]:
    """Joints of the tree that move bodies without turning them.

    Of each its name, the place here of the next of them towards the ground, or -1, the body, and the velocities.
    """
    result: list[list[Any]] = []
    outer = {GROUND: -1}  #: by body, the outermost of them so far
    labels = zip(kinematics.velocity_labels, kinematics.velocity_kinds, strict=True)
    lengths = {name: i for i, (name, kind) in enumerate(labels) if kind == "length"}
    for branch in kinematics.topology.branches:
        spec = kinematics.mechanism.joints[branch.joint]
        slides = isinstance(spec.joint, (Prismatic, Cylindrical, Planar, Translational, Free))
        outer[branch.body] = outer[branch.parent]
        if slides:
            places = [lengths[name] for name in spec.coordinates if name in lengths]
            outer[branch.body] = len(result)
            result.append([spec.name, outer[branch.parent], branch.body, places])
    return result


def collect_metadata(kinematics: Kinematics, mobility: Mobility, equations: TreeEquations) -> dict[str, Any]:
    """Entries of :class:`~eomgen.runtime.layout.ModelInfo`; sizes and kernels are added by the program."""
    m, c, loop = kinematics.mechanism, kinematics.constraints, kinematics.loop_coordinates
    names = kinematics.names
    velocities, states = list(kinematics.velocity_names), list(kinematics.state_names)
    units: dict[str, str] = {}
    for name, kind in (*zip(names, kinematics.kinds, strict=True), *zip(loop.names, loop.kinds, strict=True)):
        unit = {"angle": "rad", "turn": "rad", "length": "m", "parameter": "1"}[kind]
        units |= {name: unit, f"{name}_dot": f"{unit}/s", f"{name}_ddot": f"{unit}/s^2"}
        if kind == "parameter":
            del units[name]
    for _, j in kinematics.quaternion_slots:
        for name in velocities[j : j + 3]:
            units |= {name: "rad/s", acceleration_name(name): "rad/s^2"}
    if m.bare:
        units = {}
    docs: dict[str, str] = {}
    described: list[Parameter | Input | FirstOrderState | Output] = [*m.parameters, *m.inputs, *m.states, *m.outputs]
    for item in described:
        if item.unit:
            units[item.name] = item.unit
        if item.doc:
            docs[item.name] = item.doc
    rows, n, forces = mobility.independent_rows, len(velocities), [terms.force for terms in kinematics.forces]
    used = symbols_of([*c.values, *c.velocity])
    starts = [*c.aligned, *loop.values, *loop.rates, kinematics.length_scale, *row_scales(kinematics)]
    starts += [*m.defaults.initial.values(), *m.defaults.initial_outputs.values(), *m.defaults.guess.values()]
    names_of_start = used | symbols_of(starts)
    shapes = [[force.name, shape] for force in m.forces for shape, _ in force.met_shapes()]
    independent = [*independent_places(kinematics, mobility), *range(n, n + len(states))]
    return {
        "name": m.name,
        "doc": m.presentation.doc,
        "method": equations.method,
        "q_names": list(names),
        "v_names": [*velocities, *states],
        "x_names": [*names, *velocities, *states],
        "states": states,
        "u_names": list(kinematics.input_names),
        "p_names": list(kinematics.parameter_names),
        "y_names": [o.name for o in m.outputs],
        "velocity_outputs": [o.name for o in m.outputs if o.of_velocities],
        "body_names": [b.name for b in m.bodies],
        **keep_rules(m.requirements, kinematics.parameter_names),
        "joint_names": [j.name for j in m.joints],
        "euler_angles": _euler_angles(kinematics),
        "rolling_discs": describe_discs(kinematics),
        "wrenches": wrenches.metadata() if (wrenches := find_wrenches(kinematics)) else None,
        "loop_joint_names": [m.joints[k].name for k in kinematics.topology.cut],
        "loop_names": list(loop.names),
        "loop_kinds": list(loop.kinds),
        "coordinate_kinds": list(kinematics.kinds),
        "velocity_kinds": [*kinematics.velocity_kinds, *("state" for _ in states)],
        "quaternion_slots": [list(slot) for slot in kinematics.quaternion_slots],
        "coordinate_of": list(kinematics.coordinate_of) if m.written is not None else None,
        "independent_places": list(mobility.places),
        "energy_known": m.written is None or not m.written.kinetic_energy.is_zero,
        "constraint_labels": list(c.labels),
        "constraint_kinds": list(c.kinds),
        "constraint_scales": list(mobility.row_scales),
        "row_groups": list(groups) if any(groups := row_groups(kinematics)) else [],
        "row_velocities": [list(row) for row in row_velocities(kinematics) or ()] or None,
        "alignment_labels": list(c.aligned_joints),
        "fragile_forces": [name for name, _ in flag_forces(kinematics)],
        "not_finite_where": {x.name: x.not_finite_where for x in forces if x.not_finite_where},
        "reaction_laws": list(kinematics.reaction_laws),
        "switched": {s.constraint.name: s.state for s in m.switched if s.constraint is not None},
        "rows_to_hold": [list(row) for row in kinematics.rows_to_hold],
        "p_values": [p.value for p in m.parameters],
        "u_values": [u.value for u in m.inputs],
        "units": units,
        "docs": docs,
        "latex": dict(m.presentation.latex),
        "instances": dict(m.presentation.instances),
        "independent": independent,
        "independent_rows": list(rows),
        "redundant_rows": [i for i in range(len(c.labels)) if i not in rows],
        "q_reference": list(mobility.q_reference),
        **describe_start(kinematics),
        "length_scale": mobility.length_scale,
        "limits_told": m.defaults.limits_told,
        "limits": {name: dict(of) for j in m.joints for name, of in zip(j.coordinates, j.limits, strict=False) if of},
        "system": _system(equations),
        "baumgarte": None if c.stabilised is None else list(c.stabilised),
        "dry_friction": {j.coordinates[0]: j.dry_friction for j in m.joints if j.dry_friction},
        **describe_events(kinematics),
        "translations": find_translations(kinematics),
        **_signals(kinematics, equations),
        "input_rates": _input_rates(kinematics),
        "constraint_inputs": [name for name in kinematics.input_names if name in used],
        "start_parameters": [k for k, name in enumerate(kinematics.parameter_names) if name in names_of_start],
        "contact_shapes": shapes,
        **(describe_contacts(kinematics) if shapes else {}),
        "picture": describe_picture(m),
        "simulation": {k: x for k, x in asdict(m.defaults.simulation).items() if x is not None}
        | _longest_step(kinematics),
    }


def _signals(kinematics: Kinematics, equations: TreeEquations) -> dict[str, Any]:
    """Inputs over time as tapes, by name, and their derivatives by t, x and p that do not vanish."""
    signals = {u.name: u.signal for u in kinematics.mechanism.inputs if u.signal is not None}
    if not signals:
        return {}
    states = (*kinematics.names, *kinematics.velocity_names, *kinematics.state_names)
    places = {name: ("x", k) for k, name in enumerate(states)}
    places |= {name: ("p", k) for k, name in enumerate(kinematics.parameter_names)} | {"t": ("t", 0)}
    known = [kinematics.graph.symbol(name) for name in ("t", *states, *kinematics.parameter_names)]
    result = dict(zip(signals, resolved(list(signals.values()), kinematics, equations), strict=True))
    slopes: dict[str, Any] = {}
    for name, x in result.items():
        kept = {k: slope for k, slope in enumerate(gradient(x, known)) if not slope.is_zero}
        slopes[name] = [list(kept), list(record_tape(list(kept.values()), places.__getitem__))]
    return {
        "signals": {name: list(record_tape([x], places.__getitem__)) for name, x in result.items()},
        "signal_slopes": slopes,
    }


def _input_rates(kinematics: Kinematics) -> dict[str, list[tuple[str, int]]]:
    """Inputs whose rates are inputs too: name -> (rate, how many times the input is derived), in order.

    Also of what stands in the equations by its rates only, such as the lift of a pivot by its acceleration.
    """
    known = {*kinematics.names, *kinematics.velocity_names, *kinematics.parameter_names}
    known |= {output.name for output in kinematics.mechanism.outputs}
    orders: dict[str, list[tuple[str, int]]] = {}
    for name in kinematics.input_names:
        stem, order = split_rate(name)
        orders.setdefault(stem, []).append((name, order))
    result: dict[str, list[tuple[str, int]]] = {}
    for stem, of in orders.items():
        of.sort(key=lambda pair: pair[1])
        (first, lowest), rest = (of[0], of[1:]) if of[0][1] == 0 or stem in known else ((stem, 0), of)
        if rest:
            result[first] = [(name, order - lowest) for name, order in rest]
    return result


def _system(equations: TreeEquations) -> dict[str, Any] | None:
    """Where the entries of the linear system of a method stand, if it solves one."""
    system = equations.system
    if system is None:
        return None
    return {
        "size": len(system.unknowns),
        "rows": [i for i, _ in system.places],
        "columns": [j for _, j in system.places],
        "relaxed": [list(place) for place in system.relaxed],
    }


def _euler_angles(kinematics: Kinematics) -> list[list[Any]]:
    """Tree joints in Euler angles: name, middle angle's place in q, and where it is singular: cos or sin = 0."""
    result: list[list[Any]] = []
    for branch in kinematics.topology.branches:
        spec = kinematics.mechanism.joints[branch.joint]
        sequence = getattr(spec.joint, "sequence", None)
        if sequence is not None and not spec.joint.quaternion_slots:
            vanishing = "sin" if sequence[0] == sequence[2] else "cos"
            result.append([spec.name, kinematics.names.index(spec.coordinates[-2]), vanishing])
    return result


def _longest_step(kinematics: Kinematics) -> dict[str, float]:
    """``max_step`` (s) of runs of a model whose constraints close and open; empty without any."""
    values = {p.name: p.value for p in kinematics.mechanism.parameters}
    rates = kinematics.resolve([s.stabilisation for s in kinematics.mechanism.switched])
    if not rates or any(values.get(name) is None for name in symbols_of(rates)):
        return {}
    return {"max_step": HELD_STEP / max(Evaluator(rates, tuple(values))(list(values.values())))}
