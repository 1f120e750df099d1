"""Kinematics, Mobility and TreeEquations -> SystemTerms and the metadata of model.json."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from math import isfinite
from typing import Any

from ..base.operations import OPERATIONS, operations_with
from ..base.value_rules import RANGE
from ..constraints import RollingDisc
from ..describe.input_names import rate_of, split_rate
from ..describe.mechanism import FirstOrderState, Input, Output, Parameter
from ..describe.requirements import Requirement
from ..equations.tree_equations import TreeEquations
from ..equations.tree_slopes import ForceSlopes, can_differentiate
from ..errors import TO_BE_FINITE, ModelError, UsageError
from ..forces.branches import where
from ..frames import GROUND, Frame, Marker
from ..graph import vectors as vec
from ..graph.core import Expr
from ..graph.differentiate import gradient
from ..graph.evaluate import evaluate
from ..graph.substitute import substitute, symbols_of
from ..graph.tape import record_tape
from ..graph.traverse import reachable
from ..joints.many_degrees import Cylindrical, Planar, Translational
from ..joints.one_degree import Prismatic
from ..joints.turning import Free
from ..kinematics import Kinematics
from ..kinematics.closing_gradients import shortest_rows
from ..kinematics.closing_rates import shortest_gamma
from ..kinematics.inertial_terms import inertial_terms
from ..kinematics.kinematics import ForceTerms
from ..kinematics.loads import drives_cut_joint
from ..kinematics.mobility import Mobility, initial_values
from ..kinematics.near_pairs import describe_contacts, motion_axes, near_pairs
from ..kinematics.row_groups import row_groups, row_velocities
from ..kinematics.row_scales import row_scales
from ..kinematics.state import acceleration_name
from ..kinematics.wrenches import find_wrenches
from .factor import has_long_paths
from .held_constraints import longest_step
from .picture import describe_picture
from .reactions import multiplier_values
from .terms import SystemTerms, with_states


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
        kind, *given = numbers[0].node
        if rule == RANGE and kind == "sym" and given[0] in names:
            ranges.append([names.index(given[0]), path, *data])
            continue
        places = {name: ("p", k) for k, name in enumerate(names)} | {name: ("x", k) for k, name in enumerate(local)}
        used = sorted(names.index(name) for name in symbols_of(numbers) - {*local})
        with suppress(UsageError):
            rules.append([path, rule, list(data), used, list(record_tape(numbers, places.__getitem__))])
    return {**({"ranges": ranges} if ranges else {}), **({"rules": rules} if rules else {})}


LARGEST = 1e300


def flag_forces(kinematics: Kinematics) -> list[tuple[str, Expr]]:
    """Names of the elements whose loads need not be finite, and flags of (t, q, v, u): 1 where they are, else 0."""
    found = []
    for terms in kinematics.forces:
        total = _size(terms)
        if total is not None:
            finite = total.graph.apply("lt", total, LARGEST)  # false for what is not a number
            found.append((terms.force.name, finite))
    return found


def not_finite_where(kinematics: Kinematics) -> dict[str, str]:
    """Elements whose types know where their loads are not finite, and where that is."""
    return {x.force.name: x.force.not_finite_where for x in kinematics.forces if x.force.not_finite_where}


def _size(terms: ForceTerms) -> Expr | None:
    """Sum of the sizes of all entries, None if it is finite wherever the state is."""
    entries: list[Expr] = []
    for load in terms.marker_loads:
        entries += [*load.force, *load.torque]
    entries += [load.value for load in terms.coordinate_loads]
    if not entries:
        return None
    graph = entries[0].graph
    fragile = operations_with(lambda row: row.fragile)
    if not any(graph.nodes[i][0] in fragile for i in reachable(graph, [e.id for e in entries])):
        return None
    total = graph.zero
    for entry in entries:
        total = total + graph.apply("abs", entry)
    return total


def describe_start(kinematics: Kinematics) -> dict[str, Any]:
    """Initial values and guesses as model.json holds them.

    Their numbers are those at the declared parameters.  ``start_terms`` are the tapes of those that follow from
    parameters, by section with their names; ``start_slopes`` the derivatives of initial values that do not vanish, with
    the name and the place of the parameter of each.  ``start_fixed`` are those that call tables or functions of the
    model, which no tape can play, with the places of their parameters.
    """
    m = kinematics.mechanism
    given = {"initial": m.initial, "initial_outputs": m.initial_outputs, "guess": m.guess}
    values = {p.name: p.value for p in m.parameters}
    found: dict[str, Any] = {
        key: initial_values(kinematics, values, key)
        for key, terms in given.items()
        if terms or key != "initial_outputs"
    }
    if bad := [(key, name) for key, of in found.items() for name, x in of.items() if not isfinite(x)]:
        what = "is no number at the declared parameters"
        raise ModelError(
            [m.problem(f"{key.partition('_')[0]}.{name}", what, TO_BE_FINITE, "EG-NOT-FINITE") for key, name in bad]
        )
    places = {name: ("p", k) for k, name in enumerate(kinematics.parameter_names)}
    late = {key: {n: x for n, x in terms.items() if symbols_of([x])} for key, terms in given.items()}
    fixed = {n: x for terms in late.values() for n, x in terms.items() if not _is_of_operations(x)}
    late = {key: {n: x for n, x in terms.items() if n not in fixed} for key, terms in late.items()}
    if fixed:
        found["start_fixed"] = {n: sorted(places[name][1] for name in symbols_of([x])) for n, x in fixed.items()}
    if not any(late.values()):
        return found
    known = [kinematics.graph.symbol(name) for name in places]
    slopes = [
        (name, k, slope)
        for name, x in late["initial"].items()
        for k, slope in enumerate(gradient(x, known))
        if not slope.is_zero
    ]
    terms = {
        key: [list(of), list(record_tape(list(of.values()), places.__getitem__))] for key, of in late.items() if of
    }
    tape = record_tape([slope for *_, slope in slopes], places.__getitem__)
    return found | {"start_terms": terms, "start_slopes": [[[name, k] for name, k, _ in slopes], list(tape)]}


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
    found = {"events": events, "resets": [[i, k] for i, k, _ in resets(kinematics)]}
    return found | ({"clocks": _clocks(kinematics)} if m.clocks else {})


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
    found: list[list[Any]] = []
    outer = {GROUND: -1}  #: by body, the outermost of them so far
    labels = zip(kinematics.velocity_labels, kinematics.velocity_kinds, strict=True)
    lengths = {name: i for i, (name, kind) in enumerate(labels) if kind == "length"}
    for branch in kinematics.topology.branches:
        spec = kinematics.mechanism.joints[branch.joint]
        slides = isinstance(spec.joint, (Prismatic, Cylindrical, Planar, Translational, Free))
        outer[branch.body] = outer[branch.parent]
        if slides:
            places = [lengths[name] for name in spec.coordinates if name in lengths]
            outer[branch.body] = len(found)
            found.append([spec.name, outer[branch.parent], branch.body, places])
    return found


def resets(kinematics: Kinematics) -> list[tuple[int, int, Expr]]:
    """Event, state and its new value, of all resets."""
    names = (*kinematics.names, *kinematics.velocity_names, *kinematics.state_names)
    places = {name: k for k, name in enumerate(names)}
    found: list[tuple[int, int, Expr]] = []
    for i, event in enumerate(kinematics.mechanism.events):
        for name, value in (dict(event.reset) | dict(kinematics.velocities_after.get(event.name, ()))).items():
            if name not in places:
                raise UsageError(
                    f"events.{event.name}.reset: {name!r} belongs to a joint that is cut and follows from the others; "
                    f"reset {', '.join(places)}",
                    code="EG-EVENT",
                )
            found.append((i, places[name], value))
    return found


def collect_terms(
    kinematics: Kinematics, mobility: Mobility, equations: TreeEquations, *, in_c: bool = True
) -> SystemTerms:
    """Put together every expression that functions are generated from.

    Where paths to ground are long the mass matrix of a recursive form is made column by column; with loops only in C.
    """
    c, loop = kinematics.constraints, kinematics.loop_coordinates
    names = kinematics.names
    length = kinematics.length_scale
    in_c = in_c and not kinematics.mechanism.states
    recursive = equations.accelerations is not None or (c.labels and equations.constrained is not None and in_c)
    by_columns = bool(recursive) and has_long_paths(kinematics.parent)
    scale = {"length": length, "angle": kinematics.graph.one}
    near = tuple(near_pairs(kinematics))
    terms = SystemTerms(
        graph=kinematics.graph,
        t="t",
        q=names,
        v=kinematics.velocity_names,
        a=tuple(map(acceleration_name, kinematics.velocity_names)),
        multipliers=tuple(f"lambda[{i}]" for i in range(len(c.labels))),
        u=kinematics.input_names,
        p=kinematics.parameter_names,
        mass_matrix=() if by_columns else equations.mass_matrix,
        bias=equations.bias,
        inverse_dynamics=equations.inverse_dynamics,
        kinetic=equations.kinetic_energy,
        potential=equations.potential_energy,
        constraints=c.values,
        constraint_jacobian=shortest_rows(kinematics),
        constraint_rate=c.time_derivative,
        velocity_constraints=c.velocity,
        gamma=shortest_gamma(kinematics),
        poses=tuple(_poses(kinematics)),
        outputs=tuple(resolved_outputs(kinematics, equations)),
        loop_coordinates=(*loop.values, *loop.rates, *loop.accelerations),
        loop_coordinate_jacobian=loop.jacobian,
        alignment=c.aligned,
        coordinate_scales=tuple(scale[kind] for kind in kinematics.velocity_kinds),
        constraint_scales=row_scales(kinematics),
        row_groups=row_groups(kinematics),
        n_dof=mobility.n_dof,
        preferred=_independent(kinematics, mobility),
        parent=_pattern(kinematics),
        centroidal=tuple(_centroidal(kinematics)),
        quaternion_slots=kinematics.quaternion_slots,
        rates=kinematics.rates if kinematics.quaternion_slots or kinematics.given_rates else (),
        given_rates=kinematics.given_rates,
        paired=kinematics.coordinate_of if kinematics.given_rates else (),
        coordinate_slopes=c.slopes,
        finite_forces=tuple(flag for _, flag in flag_forces(kinematics)),
        meeting_times=tuple(_meeting_times(kinematics)),
        near_pairs=near,
        motion_axes=tuple(motion_axes(kinematics)) if near else (),
        accelerations=equations.accelerations,
        pivots=equations.pivots,
        wrenches=find_wrenches(kinematics),
        inertial=partial(inertial_terms, kinematics),
        system=equations.system,
        turned=equations.turned,
        constrained=equations.constrained if c.labels else None,
        events=tuple(resolved([e.expression for e in kinematics.mechanism.events], kinematics, equations)),
        resets=tuple(resolved([x for _, _, x in resets(kinematics)], kinematics, equations)),
        held_errors=tuple(resolved(list(kinematics.held_errors), kinematics, equations)),
        input_rates=tuple(_rate_pairs(kinematics)),
        impacts=any(e.restitution is not None for e in kinematics.mechanism.events),
        projects=c.stabilised is None,
        canonical=equations.canonical,
        slopes=partial(ForceSlopes, kinematics) if can_differentiate(kinematics) else None,
    )
    return with_states(terms, kinematics.state_names, kinematics.state_rates)


def _contact_shapes(kinematics: Kinematics) -> list[list[str]]:
    """Contact and description of each part of a shape, in the order of their numbers."""
    return [[force.name, shape] for force in kinematics.mechanism.forces for shape in force.met_shapes()]


def _meeting_times(kinematics: Kinematics) -> list[Expr]:
    """How long a step may be that passes over no contact, and the deepest two shapes, if there are such contacts."""
    total: list[Expr] = []
    start = 0
    for force in kinematics.mechanism.forces:
        shapes = force.met_shapes()
        if not shapes:
            continue
        time, depth, thickness, *pair = force.meeting(kinematics.motion)
        mine = [time, depth, thickness, *(start + number for number in pair)]
        start += len(shapes)
        if total:
            deeper = time.graph.apply("lt", total[1], depth)
            rest = [where(deeper, new, old) for new, old in zip(mine[1:], total[1:], strict=True)]
            mine = [time.graph.apply("min", total[0], time), *rest]
        total = mine
    return kinematics.resolve(total)


def _independent(kinematics: Kinematics, mobility: Mobility) -> tuple[int, ...]:
    """Places of the independent velocities."""
    return tuple(kinematics.velocity_labels.index(n) for n in mobility.independent)


def _pattern(kinematics: Kinematics) -> tuple[int, ...]:
    """The tree that says where M is zero: one chain, hence nowhere, if a drive on a cut joint ties its branches."""
    if drives_cut_joint(kinematics):
        return tuple(range(-1, len(kinematics.v) - 1))
    return kinematics.parent


def _centroidal(kinematics: Kinematics) -> list[Expr]:
    """Centre of mass, its Jacobian, momenta and inertia of a mechanism that has mass."""
    total = kinematics.motion.momentum
    if total.mass.is_zero:
        return []
    rows = [*total.jacobian(len(kinematics.v)), total.linear, total.angular, *total.inertia]
    return [*total.centre, *(x for row in rows for x in row)]


def _poses(kinematics: Kinematics) -> list[Expr]:
    """Body frames in ground axes as 4 x 4 matrices, row by row, in the order the bodies were declared."""
    graph = kinematics.graph
    entries: list[Expr] = []
    for k, body in enumerate(kinematics.mechanism.bodies):
        origin = Marker(k, Frame(vec.identity(graph), vec.zero(graph)), body.name)
        pose = kinematics.poses.marker(origin)
        for row, x in zip(pose.rotation, pose.position, strict=True):
            entries += [*row, x]
        entries += [graph.zero, graph.zero, graph.zero, graph.one]
    return entries


def resolved_outputs(kinematics: Kinematics, equations: TreeEquations) -> list[Expr]:
    """Outputs in terms of the tree's q, v, a."""
    return resolved([o.expression for o in kinematics.mechanism.outputs], kinematics, equations)


def resolved(given: list[Expr], kinematics: Kinematics, equations: TreeEquations) -> list[Expr]:
    """Expressions in terms of the tree's q, v, a."""
    expressions = kinematics.resolve(given)
    graph = kinematics.graph
    energies = {
        graph.symbol("kinetic_energy()"): equations.kinetic_energy,
        graph.symbol("potential_energy()"): equations.potential_energy,
        graph.symbol("total_energy()"): equations.kinetic_energy + equations.potential_energy,
    }
    return substitute(expressions, energies | multiplier_values(kinematics, equations))


def collect_metadata(kinematics: Kinematics, mobility: Mobility, equations: TreeEquations) -> dict[str, Any]:
    """What a module knows of itself without any expression; sizes and kernels are added by the program."""
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
    rows = mobility.independent_rows
    return {
        "name": m.name,
        "doc": m.doc,
        "method": equations.method,
        "q_names": list(names),
        "v_names": [*velocities, *states],
        "x_names": [*names, *velocities, *states],
        **({"states": states} if states else {}),
        "u_names": list(kinematics.input_names),
        "p_names": list(kinematics.parameter_names),
        "y_names": [o.name for o in m.outputs],
        **({"velocity_outputs": moved} if (moved := [o.name for o in m.outputs if o.of_velocities]) else {}),
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
        **({"coordinate_of": list(kinematics.coordinate_of)} if m.given is not None else {}),
        **({"independent_places": list(mobility.places)} if mobility.places else {}),
        **({"energy_known": False} if m.given is not None and m.given.kinetic_energy.is_zero else {}),
        "constraint_labels": list(c.labels),
        "constraint_kinds": list(c.kinds),
        "constraint_scales": list(mobility.row_scales),
        **({"row_groups": list(groups)} if any(groups := row_groups(kinematics)) else {}),
        **({"row_velocities": [list(row) for row in known]} if (known := row_velocities(kinematics)) else {}),
        "alignment_labels": list(c.aligned_joints),
        "fragile_forces": [name for name, _ in flag_forces(kinematics)],
        **({"not_finite_where": where} if (where := not_finite_where(kinematics)) else {}),
        **({"reaction_laws": list(kinematics.reaction_laws)} if kinematics.reaction_laws else {}),
        **({"switched": [s.constraint.name for s in m.switched if s.constraint is not None]} if m.switched else {}),
        **({"held_rows": [list(row) for row in kinematics.held_rows]} if kinematics.held_rows else {}),
        "p_values": [p.value for p in m.parameters],
        "u_values": [u.value for u in m.inputs],
        "units": units,
        "docs": docs,
        **({"latex": dict(m.latex)} if m.latex else {}),
        **({"instances": dict(m.instances)} if m.instances else {}),
        "independent": [*_independent(kinematics, mobility), *range(len(velocities), len(velocities) + len(states))],
        "independent_rows": list(rows),
        "redundant_rows": [i for i in range(len(c.labels)) if i not in rows],
        "q_reference": list(mobility.q_reference),
        **describe_start(kinematics),
        "length_scale": mobility.length_scale,
        **({} if m.limits_told else {"limits_told": False}),
        "limits": {
            name: dict(limits)
            for j in m.joints
            for name, limits in zip(j.coordinates, j.limits, strict=False)
            if limits
        },
        "system": _system(equations),
        "baumgarte": None if c.stabilised is None else list(c.stabilised),
        "dry_friction": {j.coordinates[0]: j.dry_friction for j in m.joints if j.dry_friction},
        **describe_events(kinematics),
        **({"translations": found} if (found := find_translations(kinematics)) else {}),
        **_signals(kinematics, equations),
        **({"input_rates": rates} if (rates := _input_rates(kinematics)) else {}),
        **({"constraint_inputs": used} if (used := _constraint_inputs(kinematics)) else {}),
        **(
            {"contact_shapes": shapes, **describe_contacts(kinematics)}
            if (shapes := _contact_shapes(kinematics))
            else {}
        ),
        "picture": describe_picture(m),
        "simulation": {
            "end": m.simulation.end,
            "method": m.simulation.method,
            "rtol": m.simulation.rtol,
            "atol": m.simulation.atol,
            **({} if m.simulation.step is None else {"step": m.simulation.step}),
            **longest_step(kinematics),
        },
    }


def _signals(kinematics: Kinematics, equations: TreeEquations) -> dict[str, Any]:
    """Inputs over time as tapes, by name, and their derivatives by t, x and p that do not vanish."""
    given = {u.name: u.signal for u in kinematics.mechanism.inputs if u.signal is not None}
    if not given:
        return {}
    states = (*kinematics.names, *kinematics.velocity_names, *kinematics.state_names)
    places = {name: ("x", k) for k, name in enumerate(states)}
    places |= {name: ("p", k) for k, name in enumerate(kinematics.parameter_names)} | {"t": ("t", 0)}
    known = [kinematics.graph.symbol(name) for name in ("t", *states, *kinematics.parameter_names)]
    found = dict(zip(given, resolved(list(given.values()), kinematics, equations), strict=True))
    slopes: dict[str, Any] = {}
    for name, x in found.items():
        kept = {k: slope for k, slope in enumerate(gradient(x, known)) if not slope.is_zero}
        slopes[name] = [list(kept), list(record_tape(list(kept.values()), places.__getitem__))]
    return {
        "signals": {name: list(record_tape([x], places.__getitem__)) for name, x in found.items()},
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
    found: dict[str, list[tuple[str, int]]] = {}
    for stem, of in orders.items():
        of.sort(key=lambda pair: pair[1])
        (first, lowest), rest = (of[0], of[1:]) if of[0][1] == 0 or stem in known else ((stem, 0), of)
        if rest:
            found[first] = [(name, order - lowest) for name, order in rest]
    return found


def _rate_pairs(kinematics: Kinematics) -> list[tuple[str, str]]:
    """Inputs with the input that is their rate."""
    names = kinematics.input_names
    return [(name, rate_of(name)) for name in names if rate_of(name) in names]


def _constraint_inputs(kinematics: Kinematics) -> list[str]:
    """Inputs on which the constraints depend."""
    c = kinematics.constraints
    used = symbols_of([*c.values, *c.velocity])
    return [name for name in kinematics.input_names if name in used]


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
    found: list[list[Any]] = []
    for branch in kinematics.topology.branches:
        spec = kinematics.mechanism.joints[branch.joint]
        sequence = getattr(spec.joint, "sequence", None)
        if sequence is not None and not spec.joint.quaternion_slots:
            vanishing = "sin" if sequence[0] == sequence[2] else "cos"
            found.append([spec.name, kinematics.names.index(spec.coordinates[-2]), vanishing])
    return found
