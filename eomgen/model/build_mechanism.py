"""Description (raw) -> Mechanism, or ModelError with every problem at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from ..base.texts import place_of_marker
from ..elements import kinds
from ..elements.constraints import CONSTRAINTS
from ..elements.forces import FORCES
from ..elements.forces.force import Force
from ..elements.frames import GROUND, Frame, Marker
from ..errors import ModelError
from ..expr import vectors as vec
from ..expr.core import Expr, Graph
from .bodies import check_bodies, read_body, read_display
from .build_elements import (
    build_elements,
    build_joints,
    check_turns,
    declare_contacts,
    declare_coordinates,
    element_states,
    with_locks,
)
from .build_functions import build_functions, read_table
from .build_quantities import (
    Outputs,
    build_states,
    build_switches,
    check_resets,
    declare_states,
    declare_switches,
    events_of_switches,
    read_event,
    read_input,
    read_parameter,
    with_signal,
)
from .check_dimensions import check_dimensions, with_units
from .checks import check_connected, check_keys, check_names
from .description import GROUND_NAME, DescribedEntry, Description, Faults, items
from .equations import (
    add_rates,
    build_equations,
    build_lagrangian,
    check_energies,
    clock,
    declare_equations,
    declare_lagrangian,
    differentiate,
    list_differentiated,
    require_quadratic,
)
from .fields import BODY, FIXED_STEP, MODEL, SIMULATION
from .fields import GROUND as GROUND_FIELDS
from .mechanism import Body, Mechanism, Presentation, RunDefaults, Simulation
from .names import Namespace, fault_of_model_name
from .quantities import OF_ELEMENTS, SUMS, Measure
from .sympy_face import in_order, name_of
from .values import Reader
from .visit import undotted


def build(description: Description) -> Mechanism:
    """Check a description and lower it to one graph; raises ModelError with all of its faults."""
    description = with_locks(undotted(description))
    faults = Faults(description)
    if description.incomplete:
        raise ModelError(faults.sorted())
    names = Namespace(faults)
    graph = Graph()
    reader = Reader(graph, names, faults, description)
    values, sections = description.values, description.sections

    name = values.get("name")
    fault = ("is missing", "give the model a name") if name is None else fault_of_model_name(name)
    if fault:
        faults.add("name", *fault, "EG-MISSING" if name is None else "EG-NAME-FORM")
    if values.get("attachments"):
        remedy = "add this model to that one as a component, which gives a marker for each attachment"
        faults.add("attachments", "attachments stand for markers of another model", remedy, "EG-CONFLICT")
    parameters = tuple(read_parameter(reader, entry) for entry in sections["parameters"])
    inputs = tuple(read_input(reader, entry) for entry in sections["inputs"])
    reader.requirements.declare({p.name: p.value for p in parameters})
    build_functions(reader, sections["functions"])
    reader.joints = declare_coordinates(reader, sections["joints"])
    declare_contacts(reader, sections["constraints"])
    has_bodies = bool(sections["bodies"] or sections["joints"])
    lagrangian_values = declare_lagrangian(reader, values.get("lagrangian"), has_bodies)
    equation_values = declare_equations(reader, values.get("equations"), has_bodies or lagrangian_values is not None)
    bare = lagrangian_values is not None or equation_values is not None
    declared, by_clock = declare_states(reader, sections["states"], bare)
    element_values, state_rates = element_states(reader, sections["forces"])
    switching = declare_switches(reader, sections["constraints"])
    read_outputs = Outputs(reader, sections["outputs"]).all
    inputs = tuple(with_signal(reader, *pair) for pair in zip(inputs, sections["inputs"], strict=True))
    reader.mass_data = bodies = _bodies(reader, sections["bodies"])
    reader.specs = joints = build_joints(reader, reader.joints)
    reader.table = partial(read_table, reader)
    forces = build_elements(reader, "force", sections["forces"], FORCES)
    lagrangian = build_lagrangian(reader, lagrangian_values)
    raw = build_equations(reader, equation_values)
    if lagrangian is not None:
        raw = differentiate(graph, lagrangian, clock(graph, inputs))
        require_quadratic(reader, raw)
    constraints = build_elements(reader, "constraint", sections["constraints"], CONSTRAINTS)
    gravity = reader.vector("gravity", values["gravity"]) if "gravity" in values else vec.zero(graph)
    states, begun, clocks, samplings = build_states(reader, declared, by_clock)
    outputs = read_outputs()
    switched = build_switches(reader, switching, constraints)
    constraints = tuple(c for c in constraints if all(c is not s.constraint for s in switched))
    declared_events = tuple(read_event(reader, entry) for entry in sections["events"])
    check_resets(reader, declared_events, clocks, switched)
    events = (*declared_events, *samplings, *events_of_switches(reader, switching, switched))
    differentiated = list_differentiated(reader, lagrangian, raw, constraints, switched, events, outputs)
    inputs = add_rates(reader, inputs, differentiated)
    moves = ("coordinate", "velocity", *(("state",) if declared or element_values or switching else ()))
    starts = _initial(reader, "initial", values.get("initial", {}), (*moves, "output"))
    moving = set(reader.names.of(*moves))
    guess = _initial(reader, "guess", values.get("guess", {}), ("coordinate",))
    independent = _independent(reader, values.get("independent", ()))
    simulation = _simulation(reader, values.get("simulation", {}))
    doc = reader.text("doc", values.get("doc", ""))
    limits_told = _limit_notes(reader, values.get("limits"))
    check_inertia = reader.check_word("check_inertia", values.get("check_inertia", True))

    if not (bare or bodies or faults.under("bodies")):
        faults.add("bodies", "the model has no bodies", "add a body and a joint, or give a Lagrangian", "EG-MISSING")
    _check_mass(reader, bodies)
    negative, inertia_notes = check_bodies(bodies, joints, reader.requirements)
    check_turns(constraints, reader.requirements)
    if lagrangian is None:
        check_energies(raw, outputs, faults)
    _check_path_quantities(reader, forces)
    check_dimensions(reader, joints)
    if len(joints) == len(sections["joints"]):
        check_connected(bodies, joints, faults)
    if faults:
        raise ModelError(faults.sorted())
    outputs = with_units(reader, joints, outputs)
    initial = begun | {s.state: graph.one if s.closed else graph.zero for s in switched}
    initial |= {name: value for name, value in starts.items() if name in moving}
    others = {name: value for name, value in starts.items() if name not in moving}
    described = len(bodies)
    bodies, joints = (*bodies, *reader.added[0]), (*joints, *reader.added[1])
    return Mechanism(
        name=str(name),
        graph=graph,
        parameters=parameters,
        inputs=inputs,
        gravity=gravity,
        bodies=bodies,
        joints=joints,
        forces=forces,
        outputs=outputs,
        states=(*states, *element_values, *(switch.discrete_state for switch in switched)),
        clocks=clocks,
        events=events,
        quantities=reader.quantities | state_rates,
        independent=independent,
        lagrangian=lagrangian,
        given=raw,
        constraints=constraints,
        switched=switched,
        lines=dict(description.lines),
        written_paths=dict(description.written_paths),
        check_inertia=check_inertia,
        negative=negative,
        requirements=tuple(reader.requirements.all),
        defaults=RunDefaults(initial, others, guess, simulation, limits_told),
        presentation=Presentation(
            doc=doc,
            latex=dict(reader.latex),
            instances=dict(description.instances),
            notes=inertia_notes,
            default_gravity="gravity" not in values,
            named_markers=tuple(marker for label, marker in reader.markers.items() if "." in label),
            body_shapes=tuple(
                shape
                for entry in sections["bodies"]
                for shape in reader.drawn["display", entry.name] or reader.drawn["solids", entry.name]
            ),
            added_bodies=tuple(range(described, len(bodies))),
        ),
    )


def _limit_notes(reader: Reader, raw: Any) -> bool:
    if raw == "stop":
        remedy = "add a force of type stop for each joint; allowed here: note, off"
        reader.fault("limits", "'stop' is an option of robot files: eg.load(file, limits='stop')", remedy, "EG-CHOICE")
        return True
    return raw is None or reader.choice("limits", raw, MODEL["limits"]) != "off"


def _bodies(reader: Reader, entries: list[DescribedEntry]) -> tuple[Body, ...]:
    """Bodies, with all markers taken in before anything refers to them."""
    faults, graph = reader.faults, reader.graph
    ground = [entry for entry in entries if entry.name == GROUND_NAME]
    usable = check_names([entry for entry in entries if entry.name != GROUND_NAME], "body", faults)
    for k, entry in enumerate(usable):
        reader.bodies[entry.name] = k
    for entry in usable + ground:
        if not faults.under(entry.path):
            check_keys(entry.path, entry.values, GROUND_FIELDS if entry.name == GROUND_NAME else BODY, faults)
        if "display" in entry.values:
            read_display(reader, entry.name, f"{entry.path}.display", entry.values["display"])
    origin = Frame(reader.identity, vec.zero(graph))
    for name, index in reader.bodies.items():
        reader.markers[name] = Marker(index, origin, name)
    for entry in usable + ground:
        index = GROUND if entry.name == GROUND_NAME else reader.bodies[entry.name]
        for marker in check_names(_marker_entries(reader, entry), "marker", faults):
            label = f"{entry.name}.{marker.name}"
            reader.markers[label] = Marker(index, reader.named_frame(marker.path, marker.values["placed"]), label)
    check = reader.check_word("check_inertia", reader.description.values.get("check_inertia", True))
    return tuple(read_body(reader, entry, check) for entry in usable)


def _marker_entries(reader: Reader, entry: DescribedEntry) -> list[DescribedEntry]:
    """Markers of a body: a mapping from a file, a list of (name, placement) from Python."""
    path = f"{entry.path}.markers"
    raw: Any = entry.values.get("markers", ())
    if isinstance(raw, Mapping):
        raw = list(raw.items())
    if not isinstance(raw, list | tuple) or not all(isinstance(one, list | tuple) and len(one) == 2 for one in raw):
        reader.wrong(path, raw, kinds.Markers)
        return []
    return [DescribedEntry(name, {"placed": placed}, f"{path}.{name}") for name, placed in raw]


def _check_mass(reader: Reader, bodies: tuple[Body, ...]) -> None:
    """Note centres of mass and momenta asked of a mechanism without mass."""
    requested = [n for n, q in reader.quantities.items() if not q.element and (q.marker is None or q.measure in SUMS)]
    if requested and all(body.mass.is_zero for body in bodies) and not reader.faults.under("bodies"):
        what = ", ".join(name.removesuffix("()") for name in requested)
        message = f"{what}: {'no body has a mass' if bodies else 'the model has no bodies'}"
        reader.fault("outputs", message, "a centre of mass and a momentum need mass", "EG-NO-INERTIA")


def _check_path_quantities(reader: Reader, forces: tuple[Force, ...]) -> None:
    """Report faults: quantities such as ``length(k1)`` of force elements that do not act along a path."""
    known = {force.name: force for force in forces}
    for quantity in reader.quantities.values():
        word, name, path = quantity.measure.word, quantity.element, quantity.place
        if name not in known or word not in OF_ELEMENTS:
            continue
        if known[name].is_rigid:
            fault = f"the contacts {name!r} have the law rigid, which exerts impulses, not forces"
            columns = f"read the columns normal({name}) and friction({name}) of a run by method moreau, means of steps"
            reader.fault(path, fault, f"{columns}; run.contact_forces.on(BODY) has forces on bodies", "EG-UNSUPPORTED")
        elif quantity.measure is not Measure.POWER and not known[name].acts_along:
            remedy = f"power({name}) is known of every element; force, length and rate of elements along a path "
            message = f"{name!r} does not act along a path"
            reader.fault(path, message, remedy + "or a coordinate, and of single contacts", "EG-UNSUPPORTED")


def _initial(reader: Reader, section: str, raw: Any, whats: tuple[str, ...]) -> dict[str, Expr]:
    """Values by coordinate (or rate, or output): expressions in parameters."""
    if not isinstance(raw, Mapping):
        reader.wrong(section, raw, kinds.Table)
        return {}
    known = list(dict.fromkeys(reader.names.of(*whats)))
    result: dict[str, Expr] = {}
    for name, value in in_order(raw, known):
        path = f"{section}.{name}"
        if name in known:
            result[name] = reader.expression(path, value)
        elif section == "initial" and (place := place_of_marker(name)):
            result[f"{place[0]}({place[1]})"] = reader.expression(path, value)
            _check_place(reader, path, *place)
        else:
            listed = _listed([_PLURAL[what] for what in whats], "and")
            reader.unknown(path, _listed(whats, "or"), name, known, listed)
    return result


def _check_place(reader: Reader, path: str, what: str, label: str) -> None:
    """Note what is wrong with a marker whose place or velocity is an initial value."""
    marker = reader.markers.get(label)
    if marker is None:
        named = [known for known, marker in reader.markers.items() if marker.body != GROUND]
        reader.unknown(path, "marker", label, named, "markers")
    elif marker.body == GROUND:
        kind = "velocity" if what.startswith("v") else "position"
        reader.fault(
            path, f"is a {kind} on the ground, which does not move", "name a marker of another body", "EG-REFERENCE"
        )


def _listed(names: Sequence[str], last: str) -> str:
    return f"{', '.join(names[:-1])} {last} {names[-1]}" if names[1:] else names[0]


_PLURAL = {"coordinate": "coordinates", "velocity": "velocities", "state": "states", "output": "outputs"}


def _independent(reader: Reader, raw: Any) -> tuple[str, ...]:
    listed = [raw] if isinstance(raw, str) else items(raw)
    if listed is None:
        reader.wrong("independent", raw, kinds.Names)
        return ()
    coordinates = list(reader.names.of("coordinate"))
    rates = [name + "_dot" for name in coordinates]
    known = [*coordinates, *(name for name in reader.names.of("velocity") if name not in rates)]
    result: list[str] = []
    for k, item in enumerate(listed):
        name = name_of(item)
        if name not in known and name not in rates:
            reader.unknown(f"independent[{k}]", "coordinate", name, known, "coordinates")
        elif name in result:
            reader.fault(f"independent[{k}]", f"{name!r} is named twice", "name each coordinate once", "EG-CONFLICT")
        else:
            result.append(name)
    return tuple(result)


def _simulation(reader: Reader, raw: Any) -> Simulation:
    if not isinstance(raw, Mapping):
        reader.wrong("simulation", raw, kinds.Table)
        return Simulation()
    check_keys("simulation", raw, SIMULATION, reader.faults)
    settings = {key: x.read(reader, f"simulation.{key}", raw[key]) for key, x in SIMULATION.items() if key in raw}
    if (settings.get("method") in FIXED_STEP) != ("step" in settings):
        remedy = "give step, in s" if "step" not in settings else "remove it, or set method to RK4 or moreau"
        fault = "only methods RK4 and moreau take steps of one size, and they need their size"
        reader.fault("simulation.step", fault, remedy, "EG-CONFLICT")
    return Simulation(**settings)
