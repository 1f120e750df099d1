"""The mechanism, its motion, its forces, the steps of the method, and the formulas line by line at one state."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial, wraps
from typing import Any, ParamSpec

import sympy

from ..base.results import trimmed_png
from ..base.texts import acceleration_name
from ..elements.constraints.constraint import event_of
from ..elements.frames import GROUND, axis_word
from ..errors import EomgenError, UnavailableError
from ..expr.core import Expr
from ..expr.differentiate import gradient
from ..expr.notation import dotted
from ..model.mechanism import JointSpec, Switched
from ..reading.document import DrawnPicture, Folded, FormulaLine, Piece, Section, Sentence, Table
from ..reading.quantities import Quantities, needed
from .author import Author, nodes
from .comparison import Difference, is_rounding, known_values, value_of

# -- mechanism, bodies, coordinates ------------------------------------------------------------------------------------


_AXIS = re.compile(r"\{([xyz])\}")  #: stands in sentences and formulas of joints for an axis of the joint
_UNIT = re.compile(r"\\mathbf\{e\}_\{(\\mathbf\{n\}_[xyz])\}")  #: e along an axis n, which is n itself
MEASURED = {"angle": "angle (rad)", "length": "displacement (m)", "parameter": "Euler parameter"}
MANY = 2  #: bodies beyond which their masses are folded, and parameters beyond which their values are


P = ParamSpec("P")


def titled(title: str) -> Callable[[Callable[P, Iterator[Piece]]], Callable[P, Section | None]]:
    """A section of the pieces that a function yields, None if there are none."""

    def section(write: Callable[P, Iterator[Piece]]) -> Callable[P, Section | None]:
        @wraps(write)
        def made(*args: P.args, **named: P.kwargs) -> Section | None:
            pieces = tuple(write(*args, **named))
            return Section(title, pieces) if pieces else None

        return made

    return section


@titled("Mechanism")
def mechanism(author: Author, module: Any | None) -> Iterator[Piece]:
    """Picture, topology, joints and loops."""
    m = author.mechanism
    if doc := m.presentation.doc:
        yield Sentence(_plain(doc))
    if m.bare:
        kind = "a Lagrangian" if m.lagrangian is not None else "equations of motion"
        yield Sentence(f"The model is {kind}, so there are no bodies to draw.")
        return
    yield _picture(module)
    report = author.source.report
    cut = report.loop_joints
    loops = f"; joint{'s' * (len(cut) > 1)} {_names(cut)} close{'s a loop' if len(cut) == 1 else ' loops'}"
    yield Sentence(
        f"The mechanism has {_count(len(m.bodies), 'body', 'bodies')} beside ground ({_names(report.bodies)}) and "
        f"{_count(len(m.joints), 'joint')}{loops if cut else ', which form an open tree'}."
    )
    rows = tuple(
        (f"`{s.name}`", s.joint.type_name, f"`{s.predecessor.label}`", f"`{s.successor.label}`", _axis(s), allowed)
        for s, allowed in ((spec, str(spec.joint.allows)) for spec in m.joints)
    )
    yield Table(("joint", "type", "from (P)", "to (S)", "axis", "degrees of freedom"), rows)
    yield from map(Sentence, dict.fromkeys(map(_joint, m.joints)))


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
        text = "For each body: mass $m$ (kg), centre of mass $\\mathbf{c}$ (m) from the body's origin, and inertia "
        pieces.append(Sentence(f"{text}${J}$ (kg m²) about the centre of mass, both in the body's axes."))
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
                formulas.append(author.line(author.of(J, body.name), inertia if axis is None else inertia[axis, axis]))
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


@titled("Coordinates")
def coordinates(author: Author) -> Iterator[Piece]:
    """Each coordinate: what it measures, and whether it is independent."""
    eqs, m = author.equations, author.mechanism
    free = set(eqs.independent)
    tree, loop = set(eqs.kinematics.names), set(eqs.kinematics.loop_coordinates.names)
    rows: list[tuple[str, ...]] = []
    for spec in m.joints:
        for name, coordinate in zip(spec.coordinates, spec.joint.coordinates, strict=True):
            start, end = (_place(m, marker) for marker in (spec.predecessor, spec.successor))
            kind = MEASURED[coordinate.kind]
            role = "independent" if name in free else "dependent" if name in tree else "at a joint that closes a loop"
            rows.append(
                (f"${author.symbol(name)}$", f"`{name}`", role, f"{kind} of {end} against {start}, joint `{spec.name}`")
            )
    known = {row[1] for row in rows}
    for name in (*eqs.kinematics.names, *(n for n in eqs.independent if n not in tree)):
        if f"`{name}`" not in known:
            role = "independent" if name in free else "dependent"
            rows.append((f"${author.symbol(name)}$", f"`{name}`", role, "coordinate of the model"))
    yield Sentence(
        f"The tree has {_count(len(tree), 'coordinate')}"
        + (f", and joints that close loops have {_count(len(loop), 'further one')}" if loop else "")
        + f". The equations of motion are for {_count(len(free), 'independent one')}"
        + (f": {', '.join(f'${author.symbol(n)}$' for n in eqs.independent)}." if free else ".")
    )
    yield Table(("symbol", "name", "role", "what it measures"), tuple(rows))


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


@titled("Constraints and degrees of freedom")
def constraints(author: Author) -> Iterator[Piece]:
    """Constraint equations, their derivatives, degrees of freedom, and where the partition fails."""
    eqs = author.equations
    rows, n = eqs.constraint_names, len(eqs.kinematics.velocity_names)
    freedoms = f"{_count(eqs.mobility.n_dof, 'degree')} of freedom"
    if not rows:
        text = f"There are no constraint equations: all {n} velocities are independent, and the system has "
        yield Sentence(f"{text}{freedoms}.")
        return
    yield Sentence(
        f"{len(rows)} independent equation{' constrains' if len(rows) == 1 else 's constrain'} the {n} velocities "
        f"of the tree, which leaves {n} - {len(rows)} = {freedoms}. "
        f"{'It is' if len(rows) == 1 else 'They are'} {', '.join(f'`{row}`' for row in rows)}."
    )
    for element in author.mechanism.constraints:
        yield Sentence(f"`{element.name}`: {element.sentence} ${element.formula}$")
    if eqs.mobility.redundant:
        yield Sentence(f"{len(eqs.mobility.redundant)} further equations follow from these and are left out.")
    if len(eqs.constraints):
        yield from author.quantity(r"\mathbf{C}", "constraints")
        yield Sentence("$\\mathbf{C} = \\mathbf{0}$ at every position. Its derivative by the time is")
    if len(eqs.constraints) < len(rows):
        yield Sentence("The last equations hold velocities (nonholonomic): they vanish as well.")
    yield from author.quantity(r"\dot{\mathbf{C}}", "velocity_constraints")
    yield Sentence("The Jacobian $\\mathbf{C}_q$ is the derivative of $\\dot{\\mathbf{C}}$ by the velocities:")
    yield from author.quantity(r"\mathbf{C}_q", "constraint_jacobian")
    yield Sentence(_second_derivative(eqs.kinematics.constraints.stabilised))
    yield from author.quantity(r"\boldsymbol{\gamma}", "gamma")
    yield from _dead_centres(author)
    if eqs.mobility.n_dof:
        text = "All velocities follow from the independent ones: $\\dot{\\mathbf{q}} = \\mathbf{B} "
        yield Sentence(text + "\\dot{\\mathbf{q}}_i + \\mathbf{b}$ with")
        yield from author.quantity(r"\mathbf{B}", "velocity_transformation")
        if any(x != 0 for x in eqs.velocity_offset):
            yield from author.quantity(r"\mathbf{b}", "velocity_offset")


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


def _dead_centres(author: Author) -> Iterator[Piece]:
    """The determinant of the columns of dependent velocities, whose zeros are dead centres."""
    eqs = author.equations
    labels = eqs.kinematics.velocity_labels
    dependent = [k for k, label in enumerate(labels) if label not in eqs.independent]
    names = ", ".join(f"${author.symbol(eqs.kinematics.velocity_names[k])}$" for k in dependent)
    if len(dependent) != len(eqs.constraint_names):
        return
    yield Sentence(
        f"The columns of the dependent velocities ({names}) form the square block $\\mathbf{{C}}_d$. Where its "
        "determinant vanishes, the mechanism is at a dead centre: the independent velocities do not determine the "
        "others there, and other coordinates must be chosen as independent."
    )
    if len(dependent) > EXPANDED:
        return

    def choose(quantities: Any) -> list[Expr]:
        block = [[row[k] for k in dependent] for row in quantities.constraint_jacobian]
        return [_determinant(block)]

    named, (value,) = author.form("determinant of the dependent columns", choose, "d_")
    yield from author.formulas(r"\mathrm{det} \mathbf{C}_d", value, named)


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
        pieces = [*(_law(author, elements[name]) if name in elements else _weight(author, name))]
        if not any(x != 0 for x in column):
            pieces.append(Sentence("Its virtual work vanishes: it does not act along the independent coordinates."))
        else:
            left = author.of(r"\delta W", name)
            pieces += author.formulas(left, _work(author, column), named, ("generalized_forces", name))
        result.append(Section(f"`{name}`", tuple(pieces), level=2))
    return result


@titled("First-order states")
def states(author: Author) -> Iterator[Piece]:
    """The rates of the first-order states, None without any."""
    k = author.equations.kinematics
    sampled = k.mechanism.sampled_names
    rates = [(name, x) for name, x in zip(k.state_names, k.state_rates, strict=True) if name not in sampled]
    if not k.state_names:
        return
    lines = [*_lines(author, "rates of first-order states", rates, "S_", "_dot")]
    if rates:
        yield Sentence("Besides coordinates and velocities the model has states with these first-order equations.")
        yield from lines
    if k.sampled:
        text = "These states are sampled: they keep their values until the time t, where they become, one after the "
        yield Sentence(f"{text}other,")
        yield from _lines(author, "new values of sampled states", k.sampled, "D_")
        counters = ", ".join(f"`{clock.counter}`" for clock in k.mechanism.clocks)
        yield Sentence(f"Each time {counters} grows by 1.")


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


def _weight(author: Author, name: str) -> Iterator[Piece]:
    """Gravity, and other parts that are no elements."""
    for switch in author.mechanism.switched:
        if switch.constraint is not None and switch.constraint.name == name:
            yield from _switched(author, name, switch)
            return
    if name != "gravity":
        yield Sentence(f"`{name}` of the model.")
        return
    gravity = author.write("gravity", list(author.mechanism.gravity)).expressions
    text = "The weight of each body acts at its centre of mass, $\\delta W = m \\mathbf{g}^T \\delta \\mathbf{r}_c$, "
    yield Sentence(f"{text}with the field of gravity in ground axes")
    yield author.line(r"\mathbf{g}", sympy.Matrix(3, 1, gravity))


def _switched(author: Author, name: str, switch: Switched) -> Iterator[Piece]:
    """What a constraint that closes and opens demands, and when."""
    assert switch.constraint is not None
    events = {event.name: event for event in author.mechanism.events}
    text = f"{switch.constraint.sentence} This holds for a time, while `{switch.state}` is 1; else its force is 0."
    yield Sentence(text)
    for key, what in (("closes", "It closes by a plastic impact"), ("opens", "It opens")):
        if (event := events.get(event_of(name, key))) is not None:
            (value,) = author.write("events", [event.expression]).expressions
            yield Sentence(f"{what} where this falls to 0:")
            yield author.line(rf"\mathrm{{{what.split()[1]}}}", value)


def _law(author: Author, force: Any) -> Iterator[Piece]:
    """The sentence and the formula of an element's type, and what its letters are."""
    yield Sentence(" ".join([force.sentence, *(f"${formula}$" for formula in force.formulas)]))
    for part in (force, *force.laws):
        for key, value in vars(part).items():
            if isinstance(value, Expr) and not key.startswith("_"):
                (expression,) = author.write("laws of force elements", [value]).expressions
                yield author.line(rf"\mathrm{{{key.replace('_', '.')}}}", expression)


# -- steps of each method of derivation --------------------------------------------------------------------------------


@titled("Energies")
def energies(author: Author) -> Iterator[Piece]:
    """T and V, of every method."""
    if author.mechanism.written is not None:
        return
    T, V = author.letter("T"), author.letter("V")
    text = f"Kinetic energy ${T}$ and potential energy ${V}$ of gravity and springs (J):"
    if author.mechanism.lagrangian is not None:
        text = f"${T}$ holds the terms of the Lagrangian of second degree in the velocities, ${V}$ those of degree 0 "
        text += "with the other sign (J):"
    yield Sentence(text)
    yield from author.quantity(T, "T")
    yield from author.quantity(V, "V")


def steps(author: Author) -> Section | None:
    """The section of the method by which the equations were derived."""
    method = author.equations.method
    if author.mechanism.lagrangian is not None and method not in ("hamilton", "augmented"):
        method = "lagrange"
    if method not in STEPS or not author.equations.mobility.n_dof:
        return None
    title, tell = STEPS[method]
    return Section(title, tuple(tell(author)))


def _embedding(author: Author) -> Iterator[Piece]:
    axis = author.plane
    kept = range(6) if axis is None else [*author.within, 3 + axis]

    def each(letter: str, what: str, columns: bool) -> Iterator[Piece]:
        for k, body in enumerate(author.mechanism.bodies):
            at = [6 * k + i for i in kept]
            pick = partial(_part, at, at if columns else None)
            yield from author.quantity(author.of(letter, body.name), what, pick=pick)

    yield Sentence(
        "Of each body, $\\mathbf{v}$ holds the velocity of its centre of mass, in ground axes, and its angular "
        f"velocity{' in its own axes' if axis is None else ''}. They are $\\mathbf{{v}} = \\mathbf{{B}} "
        "\\dot{\\mathbf{q}}_i + \\mathbf{b}$ with the velocity transformation of the body"
    )
    yield from each(r"\mathbf{B}", "body_velocity_transformation", False)
    yield Sentence("The mass and the inertia of each body, in the same order, form its mass matrix")
    yield from each(r"\mathbf{M}", "body_mass_matrix", True)
    yield Sentence("The mass matrix of the independent accelerations is the sum over all bodies")
    yield author.line(r"\mathbf{M}", r"\mathbf{B}_1^T \mathbf{M}_1 \mathbf{B}_1 + \ldots")
    yield Sentence(
        "The part of the accelerations of the bodies that holds no $\\ddot{\\mathbf{q}}_i$ and their gyroscopic "
        "moments give the quadratic velocity terms $\\mathbf{Q}_v$. The generalized forces of all elements are "
        "together $\\mathbf{Q}$:"
    )
    yield from _right_side(author)


def _part(rows: list[int], columns: list[int] | None, whole: Any) -> Any:
    """Some rows and columns of a matrix; all columns by default."""
    return whole[rows, :] if columns is None else whole[rows, columns]


def _right_side(author: Author) -> Iterator[Piece]:
    yield from author.quantity(r"\mathbf{Q}_v", "quadratic_velocity")
    yield from author.quantity(r"\mathbf{Q}", "generalized_forces", pick=lambda total: sympy.Matrix(list(total)))
    yield Sentence("The right side of the equations of motion is $\\mathbf{Q} + \\mathbf{Q}_v$.")


def _lagrange(author: Author) -> Iterator[Piece]:
    k = author.equations.kinematics
    T, L, V = map(author.letter, "TLV")
    bare = k.mechanism.lagrangian is not None
    T, rest = (L, "") if bare else (T, f" + \\frac{{\\partial {V}}}{{\\partial q}}")
    yield Sentence(
        "Lagrange's equations, one for each coordinate $q$ of the tree: $\\frac{d}{d\\,t} "
        f"\\frac{{\\partial {T}}}{{\\partial\\dot{{q}}}} - \\frac{{\\partial {T}}}{{\\partial q}}{rest} = "
        "Q_q$, where $Q_q$ holds the forces without a potential"
        + (" and those of the constraints." if author.equations.constraint_names else ".")
    )
    if bare:
        yield from author.quantity(L, "lagrangian")
    for j, name in enumerate(k.names):
        if k.velocity_names[j : j + 1] != (f"{name}_dot",):
            yield Sentence("Coordinates that are no angles or lengths follow from their angular velocities.")
            break
        q = author.symbol(name)
        for left, choose in _derivatives(q, j, T, None if bare else V):
            named, (value,) = author.form("derivatives of energies", choose, "d_")
            yield from author.formulas(left, value, named)
    if k.velocity_names and author.equations.constraint_names:
        yield Sentence("Multiplied by $\\mathbf{B}^T$, these equations lose the forces of the constraints:")
        yield from author.quantity(r"\mathbf{B}", "velocity_transformation")


def _derivatives(q: str, j: int, T: str, V: str | None) -> list[tuple[str, Callable[[Quantities], Sequence[Expr]]]]:
    """Left sides and values of the derivatives of the energies by coordinate j; without V of the Lagrangian T."""
    partial_rate = rf"\frac{{\partial {T}}}{{\partial{dotted(q, 1)}}}"

    def slope(letter: str, of: Callable[[Quantities], Expr]) -> tuple[str, Callable[[Quantities], Sequence[Expr]]]:
        return rf"\frac{{\partial {letter}}}{{\partial {q}}}", lambda s: gradient(of(s), [s.kinematics.q[j]])

    return [
        (partial_rate, lambda s: [s.momenta[j]]),
        (rf"\frac{{d}}{{d\,t}} {partial_rate}", lambda s: s.kinematics.total_derivative([s.momenta[j]])),
        slope(T, lambda s: s.T if V else s.lagrangian),
        *([slope(V, lambda s: s.V)] if V else []),
    ]


def _newton_euler(author: Author) -> Iterator[Piece]:
    yield Sentence(
        "Each body is set free. In ground axes, its mass times the acceleration of its centre of mass is the sum of "
        "all forces on it, and the rate of its angular momentum is the sum of their moments about the centre of mass. "
        "Symbols with the name of a joint are the components of its force and its moment on the body that it carries."
    )
    for name in author.equations.free_bodies:
        yield Sentence(f"`{name}`:")
        yield from author.balances("free_bodies", name, lambda body: [*body.force, *body.moment])
    yield Sentence("Along the directions in which a joint is free, its reaction is what drives and forces give:")
    for name in author.equations.joint_forces:
        yield from author.balances("joint_forces", name)
    yield from _block(author)


def _block(author: Author) -> Iterator[Piece]:
    """The linear system of a method that keeps reactions as unknowns."""
    named, system = author.equations.written("block_system")
    unknowns = ", ".join(f"${author.symbol(str(x))}$" for x in system.unknowns)
    yield Sentence(
        f"Together they are one linear system $\\mathbf{{K}} \\mathbf{{x}} = \\mathbf{{k}}$ for the "
        f"{len(system.unknowns)} unknowns {unknowns}:"
    )
    yield from author.formulas(r"\mathbf{K}", system.matrix, named, ("block_system", "matrix"))
    yield from author.formulas(r"\mathbf{k}", system.right, named, ("block_system", "right"))


def _augmented(author: Author) -> Iterator[Piece]:
    yield Sentence(
        "The accelerations of the tree and the multipliers $\\boldsymbol{\\lambda}$ of the constraints are the "
        "unknowns: $\\mathbf{M}_t \\ddot{\\mathbf{q}} + \\mathbf{C}_q^T \\boldsymbol{\\lambda} = \\mathbf{Q} + "
        "\\mathbf{Q}_v$ and $\\mathbf{C}_q \\ddot{\\mathbf{q}} = -\\boldsymbol{\\gamma}$."
    )
    yield from _block(author)


def _gibbs_appell(author: Author) -> Iterator[Piece]:
    S = author.letter("S")
    yield Sentence(
        f"The Gibbs function ${S}$ is half the sum of mass times the square of acceleration over all bodies; what is "
        "free of accelerations is left out, because only derivatives by accelerations are needed:"
    )
    yield from author.quantity(S, "gibbs_function")
    yield Sentence(
        "Its derivatives by the accelerations are the generalized forces: "
        f"$\\frac{{\\partial {S}}}{{\\partial\\ddot{{q}}}} = Q_q$."
    )
    yield from _right_side(author)


def _hamilton(author: Author) -> Iterator[Piece]:
    symbols = ", ".join(f"${author.symbol(str(p))}$" for p in author.equations.momentum_symbols)
    L, H = map(author.letter, "LH")
    yield Sentence(f"The momenta {symbols} are the derivatives of ${L}$ by the velocities:")
    yield from author.quantity(r"\mathbf{p}", "momenta")
    text = f"The Hamiltonian is ${H} = \\mathbf{{p}}^T \\dot{{\\mathbf{{q}}}} - {L}$, in coordinates and momenta:"
    yield Sentence(text)
    yield from author.quantity(H, "hamiltonian")
    text = f"The rates of the momenta are $\\dot{{p}} = -\\frac{{\\partial {H}}}{{\\partial q}} + Q_q$; written in "
    yield Sentence(f"{text}velocities:")
    yield from author.quantity(r"\dot{\mathbf{p}}", "momentum_rates")


def _recursive(author: Author) -> Iterator[Piece]:
    k = author.equations.kinematics
    yield Sentence(
        "From ground outwards, the velocity of each link is that of the link that carries it plus that of its joint, "
        "$\\mathbf{v}_j = \\mathbf{X}_j \\mathbf{v}_p + \\mathbf{S}_j \\dot{q}_j$, each in the axes of the link; its "
        "wrench is $\\mathbf{f}_j = \\mathbf{I}_j \\mathbf{a}_j + \\mathbf{v}_j^{\\ast} \\mathbf{I}_j \\mathbf{v}_j$. "
        "From the last link inwards, wrenches and inertias of the links that a link carries are added to its own."
    )
    for place, branch in enumerate(k.topology.branches):
        body, joint = k.mechanism.bodies[branch.body].name, k.mechanism.joints[branch.joint]
        below = "ground" if branch.parent < 0 else f"`{k.mechanism.bodies[branch.parent].name}`"
        yield Sentence(f"Link {place + 1} is `{body}`, carried by {below} through joint `{joint.name}`:")
        named, flat = author.form("velocities of links", partial(_twist, place), "w_")
        yield from author.formulas(author.of(r"\mathbf{v}", body), sympy.Matrix(6, 1, flat), named)
    if author.equations.constraint_names:
        yield Sentence("The equations of the tree are then multiplied by $\\mathbf{B}^T$ of the constraints:")
        yield from author.quantity(r"\mathbf{B}", "velocity_transformation")
    yield from _right_side(author)


def _twist(place: int, quantities: Quantities) -> list[Expr]:
    """Angular velocity and velocity of the origin of a link, in its axes."""
    return [x for part in quantities.kinematics.twists[place] for x in part]


#: Method -> title of its section, and what tells it.
STEPS: dict[str, tuple[str, Callable[[Author], Iterator[Piece]]]] = {
    "embedding": ("Embedding technique", _embedding),
    "lagrange": ("Lagrange's equations", _lagrange),
    "newton_euler": ("Newton's and Euler's equations of the free bodies", _newton_euler),
    "amalgamated": ("Equations of the free bodies in one system", _newton_euler),
    "gibbs_appell": ("Equations of Gibbs and Appell", _gibbs_appell),
    "hamilton": ("Hamilton's equations", _hamilton),
    "augmented": ("Augmented system with multipliers", _augmented),
    "recursive": ("Recursion along the links", _recursive),
}


@titled("Equations of motion")
def final(author: Author) -> Iterator[Piece]:
    """The equations of motion."""
    eqs = author.equations
    rates = [author.symbol(name) for name in eqs.acceleration_names]
    if not rates:
        yield from _prescribed(author)
        return
    try:
        named, mass, force = eqs.intermediates, eqs.mass_matrix, eqs.force
    except UnavailableError as error:
        yield Sentence(str(error).partition("\n")[0])
        return
    one = len(mass) == 1
    left, right = map(author.letter, "Mf") if one else (r"\mathbf{M}", r"\mathbf{f}")
    text = f"${left} {rates[0]} = {right}$ with"
    if not one:
        listed = ", ".join(f"${x}$" for x in rates)
        text = f"$\\mathbf{{M}} \\ddot{{\\mathbf{{q}}}}_i = \\mathbf{{f}}$ for the accelerations {listed}, with"
    formulas = author.formulas(left, mass, named, ("mass_matrix", None), True)
    known = set() if isinstance(formulas[0], Sentence) else {symbol for symbol, _ in needed(named, mass)}
    formulas += author.formulas(right, force, named, ("force", None), explained=known)
    yield Sentence(text)
    yield from formulas


def _prescribed(author: Author) -> Iterator[Piece]:
    """What is left where no degree of freedom is: the forces of the constraints, those of drivers among them."""
    opening = "The motion is prescribed: no acceleration is unknown."
    named, system = author.equations.written("tree_system")
    if not any(x != 0 for x in (*system.mass_matrix, *system.force)):
        yield Sentence(f"{opening} Nothing has mass and no forces act, so that the constraints exert none.")
        return
    yield Sentence(
        f"{opening} The constraints exert the forces $-\\mathbf{{C}}_q^T \\boldsymbol{{\\lambda}} = \\mathbf{{M}} "
        "\\ddot{\\mathbf{q}} - \\mathbf{f}$. Of $\\boldsymbol{\\lambda}$, one component belongs to each constraint "
        "equation; that of a driver, with the opposite sign, is the force or torque with which it drives its "
        "coordinate."
    )
    yield from author.formulas(r"\mathbf{M}", system.mass_matrix, named, ("tree_system", None), True)
    known = {symbol for symbol, _ in needed(named, system.mass_matrix)}
    yield from author.formulas(r"\mathbf{f}", system.force, named, ("tree_system", None), explained=known)


# -- numbers -----------------------------------------------------------------------------------------------------------


LONG = 60  #: nodes of an expression up to which its numbers are substituted
MOST = 400  #: lines of the calculation


@titled("Numbers: one state, line by line")
def calculation(author: Author, state: Mapping[str, float], reason: str, moved: bool = False) -> Iterator[Piece]:
    """One state, and every formula that was shown with its numbers; without numbers the reason.

    ``moved`` tells that the independent velocities are 1 in place of the declared ones, which all are 0.
    """
    if not state:
        yield Sentence(f"No numbers: {reason}")
        return
    eqs = author.equations
    k = eqs.kinematics
    names = [*k.names, *k.velocity_names, *k.state_names, *k.parameter_names, *k.input_names]
    rows = tuple(
        (f"${author.symbol(name)}$", f"{state[name]:.6g}")
        for name in names
        if name in state and name not in author.substituted
    )
    numbers = dict(state)
    text = "The declared initial state, with closed loops and consistent velocities, and the declared parameters. "
    if moved:
        text = "The declared initial position and the declared parameters. The declared velocities are all 0, which "
        text += "would hide most terms; here the independent velocities are 1. "
    yield Sentence(
        f"{text}Each line repeats the left side of a formula, then the formula with its numbers, then its value. A "
        "value that is no more than the rounding of the numbers in it is written as 0."
    )
    yield Table(("symbol", "value"), rows)
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
    yield from lines if len(lines) <= 120 else [Folded(f"{len(lines)} lines of the calculation", tuple(lines))]


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


def _accelerations(author: Author, state: Mapping[str, float]) -> Iterator[Piece]:
    """The accelerations that the compiled module finds at the state."""
    names = [n for n in map(acceleration_name, author.equations.kinematics.velocity_names) if n in state]
    if names:
        yield Sentence("The equations of motion then give the accelerations")
    yield from (author.line(author.symbol(name), state[name]) for name in names)


@titled("Operations")
def counts(author: Author) -> Iterator[Piece]:
    """Operations of each part of the equations."""
    rows = tuple(
        (name, str(c.multiplications), str(c.additions), str(c.divisions), str(c.total))
        for name, c in author.source.operations.items()
    )
    method = author.equations.method
    yield Sentence(f"Operations of each part of the equations of the tree, derived by method `{method}`.")
    yield Table(("part", "multiplications", "additions", "divisions", "together"), rows)


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
