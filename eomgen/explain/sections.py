"""The mechanism, its motion, its forces, and the formulas line by line at one state."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import sympy

from ..base.results import trimmed_png
from ..base.texts import acceleration_name
from ..elements.constraints.constraint import event_of
from ..elements.frames import GROUND, axis_word
from ..errors import EomgenError, UnavailableError
from ..expr.core import Expr
from ..model.mechanism import JointSpec, Switched
from ..reading.document import DrawnPicture, Folded, FormulaLine, Piece, Section, Sentence, Table
from .author import Author, nodes
from .comparison import Difference, is_rounding, known_values, value_of

# -- mechanism, bodies, coordinates ------------------------------------------------------------------------------------


_AXIS = re.compile(r"\{([xyz])\}")  #: stands in sentences and formulas of joints for an axis of the joint
_UNIT = re.compile(r"\\mathbf\{e\}_\{(\\mathbf\{n\}_[xyz])\}")  #: e along an axis n, which is n itself
MANY = 2  #: bodies beyond which their masses are folded, and parameters beyond which their values are


def mechanism(author: Author, module: Any | None) -> Section:
    """DrawnPicture, topology, joints and loops."""
    m = author.mechanism
    pieces: list[Piece] = []
    if doc := m.presentation.doc:
        pieces.append(Sentence(_plain(doc)))
    if m.bare:
        kind = "a Lagrangian" if m.lagrangian is not None else "equations of motion"
        pieces.append(Sentence(f"The model is {kind}, so there are no bodies to draw."))
        return Section("Mechanism", tuple(pieces))
    pieces.append(_picture(module))
    report = author.source.report
    cut = report.loop_joints
    loops = f"; joint{'s' * (len(cut) > 1)} {_names(cut)} close{'s a loop' if len(cut) == 1 else ' loops'}"
    pieces.append(
        Sentence(
            f"The mechanism has {_count(len(m.bodies), 'body', 'bodies')} beside ground ({_names(report.bodies)}) and "
            f"{_count(len(m.joints), 'joint')}{loops if cut else ', which form an open tree'}."
        )
    )
    rows = tuple(
        (f"`{s.name}`", s.joint.type_name, f"`{s.predecessor.label}`", f"`{s.successor.label}`", _axis(s), allowed)
        for s, allowed in ((spec, str(spec.joint.allows)) for spec in m.joints)
    )
    pieces.append(Table(("joint", "type", "from (P)", "to (S)", "axis", "degrees of freedom"), rows))
    pieces += [Sentence(text) for text in dict.fromkeys(map(_joint, m.joints))]
    return Section("Mechanism", tuple(pieces))


def _joint(spec: JointSpec) -> str:
    """What a joint does, about and along its own axes as P has them."""
    axis_names = dict(zip("xyz", map(axis_word, spec.axes), strict=True))
    names = {
        letter: word if word.strip("-") in axis_names else rf"\mathbf{{n}}_{letter}"
        for letter, word in axis_names.items()
    }
    axes_text = {x: word if names[x] == word else f"${names[x]}$ = {word}" for x, word in axis_names.items()}
    sentence = _AXIS.sub(lambda result: axes_text[result[1]], spec.joint.sentence)
    formula = _AXIS.sub(lambda result: f"{{{names[result[1]]}}}", spec.joint.formula)
    formula = _UNIT.sub(r"\1", formula)
    return f"A {spec.joint.type_name} joint: {sentence} ${formula}$"


def _axis(spec: JointSpec) -> str:
    """The axis of a joint in the axes of P, two of a cross."""
    x, y, z = map(axis_word, spec.axes)
    return f"{x}, {y}" if spec.joint.has_axes else z if spec.joint.has_axis else ""


def _picture(module: Any | None) -> Piece:
    if module is None:
        return Sentence("No picture: it needs the values of all parameters.")
    try:
        from ..show.draw import small_figure

        figure = small_figure(module)
    except EomgenError as error:
        return Sentence(f"No picture: {_plain(str(error).partition(chr(10))[0])}.")
    data, width = trimmed_png(figure)
    return DrawnPicture(data, round(1.1 * width), "the mechanism in its initial position")


def bodies(author: Author) -> Section | None:
    """Masses, centres of mass and inertias, and the parameters."""
    m = author.mechanism
    pieces: list[Piece] = []
    if m.bodies:
        axis, within = author.plane, author.within
        J = r"\mathbf{J}" if axis is None else "J"
        pieces.append(
            Sentence(
                "For each body: mass $m$ (kg), centre of mass $\\mathbf{c}$ (m) from the body's origin, and inertia "
                f"${J}$ (kg m²) about the centre of mass, both in the body's axes."
            )
        )
        formulas: list[Piece] = []
        for body in m.bodies:
            properties = [body.mass, *body.com, *(x for row in body.inertia for x in row)]
            mass, *rest = map(_as_given, author.write("masses and inertias", properties).expressions)
            formulas.append(author.line(author.of("m", body.name), mass))
            if any(x != 0 for x in rest[:3]):
                centre = sympy.Matrix(3, 1, rest[:3])[within, 0]
                formulas.append(author.line(author.of(r"\mathbf{c}", body.name), centre))
            if any(x != 0 for x in rest[3:]):
                inertia = sympy.Matrix(3, 3, rest[3:])
                inertia_term = ("J", inertia[axis, axis]) if axis is not None else (r"\mathbf{J}", inertia)
                formulas.append(author.line(author.of(inertia_term[0], body.name), inertia_term[1]))
        if len(m.bodies) > MANY or not author.full:
            pieces.append(Folded(f"Masses and inertias of {_count(len(m.bodies), 'body', 'bodies')}", tuple(formulas)))
        else:
            pieces += formulas
    symbols = [(p, "parameter") for p in m.parameters] + [(u, "input") for u in m.inputs]
    if symbols:
        rows = tuple(
            (
                f"${author.symbol(p.name)}$",
                f"`{p.name}`",
                _value(author.substituted.get(p.name, p.value)),
                _plain(p.unit),
                (_plain(p.doc) or kind) + (", value put in" if p.name in author.substituted else ""),
            )
            for p, kind in symbols
        )
        table = Table(("symbol", "name", "value", "unit", "meaning"), rows)
        pieces.append(Folded(f"Values of {len(rows)} parameters", (table,)) if m.bodies and len(rows) > MANY else table)
    return Section("Bodies and parameters" if m.bodies else "Parameters", tuple(pieces)) if pieces else None


def _as_given(value: Any) -> Any:
    """A number alone as the decimal that a model file has, 0.4 and not 2/5; all else as it is."""
    ends = value.is_Rational and not value.is_Integer and 10**6 % value.q == 0
    return sympy.Float(float(value)) if ends else value


def _value(value: float | None) -> str:
    return "none" if value is None else f"{value:.6g}"


def coordinates(author: Author) -> Section:
    """Each coordinate: what it measures, and whether it is independent."""
    eqs, m = author.equations, author.mechanism
    free = set(eqs.independent)
    tree, loop = set(eqs.kinematics.names), set(eqs.kinematics.loop_coordinates.names)
    rows: list[tuple[str, ...]] = []
    for spec in m.joints:
        for name, coordinate in zip(spec.coordinates, spec.joint.coordinates, strict=True):
            start, end = (_place(m, marker) for marker in (spec.predecessor, spec.successor))
            kind = {"angle": "angle (rad)", "length": "displacement (m)", "parameter": "Euler parameter"}[
                coordinate.kind
            ]
            role = "independent" if name in free else "dependent" if name in tree else "at a joint that closes a loop"
            rows.append(
                (f"${author.symbol(name)}$", f"`{name}`", role, f"{kind} of {end} against {start}, joint `{spec.name}`")
            )
    known = {row[1] for row in rows}
    for name in (*eqs.kinematics.names, *(n for n in eqs.independent if n not in tree)):
        if f"`{name}`" not in known:
            role = "independent" if name in free else "dependent"
            rows.append((f"${author.symbol(name)}$", f"`{name}`", role, "coordinate of the model"))
    pieces: list[Piece] = [
        Sentence(
            f"The tree has {_count(len(tree), 'coordinate')}"
            + (f", and joints that close loops have {_count(len(loop), 'further one')}" if loop else "")
            + f". The equations of motion are for {_count(len(free), 'independent one')}"
            + (f": {', '.join(f'${author.symbol(n)}$' for n in eqs.independent)}." if free else ".")
        ),
        Table(("symbol", "name", "role", "what it measures"), tuple(rows)),
    ]
    return Section("Coordinates", tuple(pieces))


def _place(m: Any, marker: Any) -> str:
    return "ground" if marker.body == GROUND and not marker.label else f"`{marker.label}`"


def _count(number: int, one: str, many: str = "") -> str:
    return f"{number} {one if number == 1 else many or one + 's'}"


def _names(names: Any) -> str:
    listed = [f"`{name}`" for name in names]
    return ", ".join(listed[:30]) + (f" and {len(listed) - 30} more" if len(listed) > 30 else "")


def _plain(text: str) -> str:
    """Text of a user, without the signs that mark names and formulas."""
    return text.replace("$", "").replace("`", "'")


# -- motion and constraints --------------------------------------------------------------------------------------------


EXPANDED = 3  #: dependent velocities up to which the determinant is written out


def motion(author: Author) -> list[Section]:
    """Sections of position, velocity, acceleration; of a plane mechanism in its plane."""
    bodies = [body.name for body in author.mechanism.bodies]
    if not bodies:
        return []
    axis = author.plane
    within = author.within
    about = [0, 1, 2] if axis is None else [axis]
    omega, alpha = (r"\boldsymbol{\omega}", r"\boldsymbol{\alpha}") if axis is None else (r"\omega", r"\alpha")
    plane = ""
    if axis is not None:
        along, normal = " and ".join(f"${'xyz'[k]}$" for k in within), f"${'xyz'[axis]}$"
        plane = f" All bodies move in one plane: components along {along} of ground and turns about {normal}."
    place = r"\mathbf{r} + \mathbf{R} \mathbf{u}"
    position: list[Piece] = [
        Sentence(
            "For each body, $\\mathbf{r}$ is the position of its origin in ground axes, and the columns of "
            f"$\\mathbf{{R}}$ are its axes. A point at $\\mathbf{{u}}$ of the body is at ${place}$.{plane}"
        )
    ]
    text = f"For each body, in ground axes: angular velocity ${omega}$ and velocity $\\mathbf{{v}}$ of the mass centre."
    velocity: list[Piece] = [Sentence(text)]
    text = f"The rates of these velocities: angular acceleration ${alpha}$, and $\\mathbf{{a}}$ of the centre of mass."
    acceleration: list[Piece] = [Sentence(text)]
    for name in bodies:
        position += author.quantity(author.of(r"\mathbf{r}", name), "poses", name, lambda pose: pose[within, 3])
        position += author.quantity(author.of(r"\mathbf{R}", name), "poses", name, lambda pose: pose[within, within])
        for pieces, what, turning, moving in (
            (velocity, "velocities", omega, r"\mathbf{v}"),
            (acceleration, "accelerations", alpha, r"\mathbf{a}"),
        ):
            pieces += author.quantity(author.of(turning, name), what, name, lambda x: x.angular[about, 0])
            pieces += author.quantity(author.of(moving, name), what, name, lambda x: x.center_of_mass[within, 0])
    return [
        Section("Position of each body", tuple(position)),
        Section("Velocity of each body", tuple(velocity)),
        Section("Acceleration of each body", tuple(acceleration)),
    ]


def constraints(author: Author) -> Section:
    """Constraint equations, their derivatives, degrees of freedom, and where the partition fails."""
    eqs = author.equations
    rows, n = eqs.constraint_names, len(eqs.kinematics.velocity_names)
    free = eqs.mobility.n_dof
    if not rows:
        text = f"There are no constraint equations: all {n} velocities are independent, and the system has "
        return Section("Constraints and degrees of freedom", (Sentence(f"{text}{_freedoms(free)}."),))
    pieces: list[Piece] = [
        Sentence(
            f"{len(rows)} independent equation{' constrains' if len(rows) == 1 else 's constrain'} the {n} velocities "
            f"of the tree, which leaves {n} - {len(rows)} = {_freedoms(free)}. "
            f"{'It is' if len(rows) == 1 else 'They are'} {', '.join(f'`{row}`' for row in rows)}."
        )
    ]
    for element in author.mechanism.constraints:
        pieces.append(Sentence(f"`{element.name}`: {element.sentence} ${element.formula}$"))
    if eqs.mobility.redundant:
        pieces.append(Sentence(f"{len(eqs.mobility.redundant)} further equations follow from these and are left out."))
    if len(eqs.constraints):
        pieces += author.quantity(r"\mathbf{C}", "constraints")
        pieces.append(Sentence("$\\mathbf{C} = \\mathbf{0}$ at every position. Its derivative by the time is"))
    if len(eqs.constraints) < len(rows):
        pieces.append(Sentence("The last equations hold velocities (nonholonomic): they vanish as well."))
    pieces += author.quantity(r"\dot{\mathbf{C}}", "velocity_constraints")
    pieces.append(Sentence("The Jacobian $\\mathbf{C}_q$ is the derivative of $\\dot{\\mathbf{C}}$ by the velocities:"))
    pieces += author.quantity(r"\mathbf{C}_q", "constraint_jacobian")
    pieces.append(Sentence(_second_derivative(eqs.kinematics.constraints.stabilised)))
    pieces += author.quantity(r"\boldsymbol{\gamma}", "gamma")
    pieces += _dead_centres(author)
    if free:
        pieces.append(
            Sentence(
                "All velocities follow from the independent ones: $\\dot{\\mathbf{q}} = \\mathbf{B} "
                "\\dot{\\mathbf{q}}_i + \\mathbf{b}$ with"
            )
        )
        pieces += author.quantity(r"\mathbf{B}", "velocity_transformation")
        if any(x != 0 for x in eqs.velocity_offset):
            pieces += author.quantity(r"\mathbf{b}", "velocity_offset")
    return Section("Constraints and degrees of freedom", tuple(pieces))


def _second_derivative(stabilised: tuple[float, float] | None) -> str:
    """What vanishes, and with Baumgarte's terms what of it is gamma."""
    solved = "\\mathbf{C}_q \\ddot{\\mathbf{q}} + \\boldsymbol{\\gamma} = \\mathbf{0}$ with"
    if stabilised is None:
        return f"$\\ddot{{\\mathbf{{C}}}} = {solved}"
    alpha, beta = (f"{x:.6g}" for x in stabilised)
    terms = f"2 \\cdot {alpha} \\dot{{\\mathbf{{C}}}} + {beta}^2 \\mathbf{{C}}"
    return (
        f"Stabilised after Baumgarte, with $\\alpha = {alpha}$ and $\\beta = {beta}$ per second: "
        f"$\\ddot{{\\mathbf{{C}}}} + {terms} = {solved}"
    )


def _freedoms(number: int) -> str:
    return f"{number} degree{'' if number == 1 else 's'} of freedom"


def _dead_centres(author: Author) -> list[Piece]:
    """The determinant of the columns of dependent velocities, whose zeros are dead centres."""
    eqs = author.equations
    labels = eqs.kinematics.velocity_labels
    dependent = [k for k, label in enumerate(labels) if label not in eqs.independent]
    names = ", ".join(f"${author.symbol(eqs.kinematics.velocity_names[k])}$" for k in dependent)
    if len(dependent) != len(eqs.constraint_names):
        return []
    axes_text = Sentence(
        f"The columns of the dependent velocities ({names}) form the square block $\\mathbf{{C}}_d$. Where its "
        "determinant vanishes, the mechanism is at a dead centre: the independent velocities do not determine the "
        "others there, and other coordinates must be chosen as independent."
    )
    if len(dependent) > EXPANDED:
        return [axes_text]

    def choose(quantities: Any) -> list[Expr]:
        block = [[row[k] for k in dependent] for row in quantities.constraint_jacobian]
        return [_determinant(block)]

    named, (value,) = author.form("determinant of the dependent columns", choose, "d_")
    return [axes_text, *author.formulas(r"\mathrm{det} \mathbf{C}_d", value, named)]


def _determinant(rows: list[list[Expr]]) -> Expr:
    """Expansion along the first row."""
    if len(rows) == 1:
        return rows[0][0]
    total = None
    for k, x in enumerate(rows[0]):
        if x.is_zero:
            continue
        term = x * _determinant([row[:k] + row[k + 1 :] for row in rows[1:]])
        term = -term if k % 2 else term
        total = term if total is None else total + term
    return 0 * rows[0][0] if total is None else total


# -- force elements ----------------------------------------------------------------------------------------------------


def forces(author: Author) -> list[Section]:
    """A section of all forces and one of each element."""
    eqs, m = author.equations, author.mechanism
    if m.bare:
        return []
    try:
        named, total = eqs.written("generalized_forces")
    except UnavailableError:
        return []
    parts = total.parts
    if not eqs.mobility.n_dof or not parts:
        text = "There are no degrees of freedom for forces to act on." if parts else "No forces act."
        return [Section("Forces", (Sentence(text),))]
    text = (
        "The virtual work of an element is $\\delta W = \\mathbf{Q}^T \\delta \\mathbf{q}_i$; the factors of the "
        "variations of the independent coordinates are its generalized forces."
    )
    result = [Section("Forces and their virtual work", (Sentence(text),))]
    elements = {force.name: force for force in m.forces}
    for name, column in parts.items():
        pieces = _law(author, elements[name]) if name in elements else _weight(author, name)
        if not any(x != 0 for x in column):
            pieces.append(Sentence("Its virtual work vanishes: it does not act along the independent coordinates."))
        else:
            left = author.of(r"\delta W", name)
            pieces += author.formulas(left, _work(author, column), named, ("generalized_forces", name))
        result.append(Section(f"`{name}`", tuple(pieces), level=2))
    return result


def states(author: Author) -> Section | None:
    """The rates of the first-order states, None without any."""
    k = author.equations.kinematics
    sampled = k.mechanism.sampled_names
    rates = [(name, x) for name, x in zip(k.state_names, k.state_rates, strict=True) if name not in sampled]
    if not k.state_names:
        return None
    text = "Besides coordinates and velocities the model has states with these first-order equations."
    pieces: list[Piece] = [Sentence(text), *_lines(author, "rates of first-order states", rates, "S_", "_dot")]
    if k.sampled:
        axes_text = (
            "These states are sampled: they keep their values until the time t, where they become, one after the other,"
        )
        pieces = pieces if rates else []
        pieces += [Sentence(axes_text), *_lines(author, "new values of sampled states", k.sampled, "D_")]
        counters = ", ".join(f"`{clock.counter}`" for clock in k.mechanism.clocks)
        pieces.append(Sentence(f"Each time {counters} grows by 1."))
    return Section("First-order states", tuple(pieces))


def _lines(
    author: Author, what: str, pairs: Sequence[tuple[str, Expr]], prefix: str, suffix: str = ""
) -> Iterator[Piece]:
    """Named quantities and their formulas, after what stands in these."""
    written = author.write(what, [x for _, x in pairs], prefix)
    author.names = author.names.with_names(str(symbol) for symbol, _ in written.intermediates)
    yield from (author.line(*pair) for pair in written.intermediates)
    left = (author.symbol(f"{name}{suffix}") for name, _ in pairs)
    yield from (author.line(*pair) for pair in zip(left, written.expressions, strict=True))


def _work(author: Author, column: Any) -> Any:
    """Q^T delta q_i as a sum."""
    total = zip(column, author.equations.independent, strict=True)
    return sympy.Add(*(x * author.variation(name) for x, name in total))


def _weight(author: Author, name: str) -> list[Piece]:
    """Gravity, and other parts that are no elements."""
    for switch in author.mechanism.switched:
        if switch.constraint is not None and switch.constraint.name == name:
            return _switched(author, name, switch)
    if name != "gravity":
        return [Sentence(f"`{name}` of the model.")]
    gravity = author.write("gravity", list(author.mechanism.gravity)).expressions
    return [
        Sentence(
            "The weight of each body acts at its centre of mass, $\\delta W = m \\mathbf{g}^T \\delta \\mathbf{r}_c$, "
            "with the field of gravity in ground axes"
        ),
        author.line(r"\mathbf{g}", sympy.Matrix(3, 1, gravity)),
    ]


def _switched(author: Author, name: str, switch: Switched) -> list[Piece]:
    """What a constraint that closes and opens demands, and when."""
    assert switch.constraint is not None
    events = {event.name: event for event in author.mechanism.events}
    axes_text = f"{switch.constraint.sentence} This holds for a time, while `{switch.state}` is 1; else its force is 0."
    pieces: list[Piece] = [Sentence(axes_text)]
    for key, what in (("closes", "It closes by a plastic impact"), ("opens", "It opens")):
        if (event := events.get(event_of(name, key))) is not None:
            (value,) = author.write("events", [event.expression]).expressions
            pieces += [
                Sentence(f"{what} where this falls to 0:"),
                author.line(rf"\mathrm{{{what.split()[1]}}}", value),
            ]
    return pieces


def _law(author: Author, force: Any) -> list[Piece]:
    """The sentence and the formula of an element's type, and what its letters are."""
    pieces: list[Piece] = [Sentence(" ".join([force.sentence, *(f"${formula}$" for formula in force.formulas)]))]
    for part in (force, *force.laws):
        for key, value in vars(part).items():
            if isinstance(value, Expr) and not key.startswith("_"):
                (expression,) = author.write("laws of force elements", [value]).expressions
                pieces.append(author.line(rf"\mathrm{{{key.replace('_', '.')}}}", expression))
    return pieces


# -- numbers -----------------------------------------------------------------------------------------------------------


LONG = 60  #: nodes of an expression up to which its numbers are put in
MOST = 400  #: lines of the calculation


def calculation(author: Author, state: Mapping[str, float], reason: str, moved: bool = False) -> Section:
    """One state, and every formula that was shown with its numbers; without numbers the reason.

    ``moved`` tells that the independent velocities are 1 in place of the declared ones, which all are 0.
    """
    title = "Numbers: one state, line by line"
    if not state:
        return Section(title, (Sentence(f"No numbers: {reason}"),))
    eqs = author.equations
    k = eqs.kinematics
    names = [*k.names, *k.velocity_names, *k.state_names, *k.parameter_names, *k.input_names]
    rows = tuple(
        (f"${author.symbol(name)}$", f"{state[name]:.6g}")
        for name in names
        if name in state and name not in author.substituted
    )
    numbers = dict(state)
    pieces: list[Piece] = [
        Sentence(
            (
                "The declared initial position and the declared parameters. The declared velocities are all 0, which "
                "would hide most terms; here the independent velocities are 1. "
                if moved
                else "The declared initial state, with closed loops and consistent velocities, and the declared "
                "parameters. "
            )
            + "Each line repeats the left side of a formula, then the formula with its numbers, then its value. A "
            "value that is no more than the rounding of the numbers in it is written as 0."
        ),
        Table(("symbol", "value"), rows),
    ]
    lines: list[Piece] = []
    left_out = 0
    for part in author.printed:
        try:
            known = known_values(part.named, numbers)
            result = []
            here = {str(symbol): float(value) for symbol, value in known.items() if isinstance(symbol, sympy.Symbol)}
            for symbol, expression in part.named:
                result.append(_line(author, author.symbol(str(symbol)), expression, part.named, here, known, numbers))
            entries = [entry for entry in part.entries if entry[1].free_symbols]
            result += [_line(author, left, x, part.named, here, known, numbers) for left, x in entries]
        except (TypeError, ValueError):  # reactions, variations and momenta have no number of their own
            continue
        space = max(0, MOST - len(lines))
        left_out += max(0, len(result) - space)
        lines += result[:space]
    lines += _accelerations(author, state)
    if left_out:
        lines.append(Sentence(f"{left_out} further lines are left out; the formulas are evaluated all the same below."))
    if len(lines) > 120:
        pieces.append(Folded(f"{len(lines)} lines of the calculation", tuple(lines)))
    else:
        pieces += lines
    return Section(title, tuple(pieces))


def _line(
    author: Author,
    left: str,
    expression: Any,
    named: Sequence[tuple[Any, Any]],
    here: dict[str, float],
    known: dict[Any, Any],
    numbers: dict[str, float],
) -> FormulaLine:
    value = float(value_of(expression, known))
    if is_rounding(expression, value, named, numbers):
        value = 0.0
    if nodes(expression) > LONG:
        return author.line(left, value)
    return author.in_numbers(left, expression, here, value)


def _accelerations(author: Author, state: Mapping[str, float]) -> list[Piece]:
    """The accelerations that the compiled module finds at the state."""
    eqs = author.equations
    names = [n for n in map(acceleration_name, eqs.kinematics.velocity_names) if n in state]
    if not names:
        return []
    axes_text = Sentence("The equations of motion then give the accelerations")
    return [axes_text, *(author.line(author.symbol(name), state[name]) for name in names)]


def counts(author: Author) -> Section:
    """Operations of each part of the equations."""
    rows = tuple(
        (name, str(c.multiplications), str(c.additions), str(c.divisions), str(c.total))
        for name, c in author.source.operations.items()
    )
    text = f"Operations of each part of the equations of the tree, derived by method `{author.equations.method}`."
    head = ("part", "multiplications", "additions", "divisions", "together")
    return Section("Operations", (Sentence(text), Table(head, rows)))


def difference(result: Difference | None, reason: str) -> Section:
    """How far the shown formulas are from the compiled module, folded where they agree."""
    title = "Formulas and compiled code"
    if result is None:
        return Section(title, (Sentence(f"Not compared: {reason}"),))
    if not result.each:
        return Section(title, (Sentence("There is no formula here that the compiled module has too."),))
    title += f": largest difference {result.largest:.1e}"
    rows = tuple((f"`{name}`", f"{value:.1e}") for name, value in result.each.items())
    text = (
        f"Each of these formulas was evaluated through SymPy at {result.states} random consistent states and compared "
        "with the module that is generated from the same equations or, where that has no such function, with the "
        f"expressions of the derivation. The largest difference, as a share of the largest entry or term, is "
        f"{result.largest:.1e}. Numbers of more digits than are printed are compared with all of them."
    )
    return Section(title, (Sentence(text), Table(("formula", "largest difference"), rows)), folded=True)
