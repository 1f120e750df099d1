"""Stage explain, sections: position, velocity and acceleration of each body; constraints, Jacobian, dead centres."""

from __future__ import annotations

from typing import Any

from ..graph.core import Expr
from .author import Author
from .document import Piece, Section, Sentence

EXPANDED = 3  #: dependent velocities up to which the determinant is written out


def motion(author: Author) -> list[Section]:
    """Sections of position, velocity, acceleration."""
    bodies = [body.name for body in author.mechanism.bodies]
    if not bodies:
        return []
    position: list[Piece] = [
        Sentence(
            "For each body, $\\mathbf{r}$ is the position of its origin in ground axes, and the columns of "
            "$\\mathbf{R}$ are its axes. A point at $\\mathbf{u}$ of the body is at "
            "$\\mathbf{r} + \\mathbf{R} \\mathbf{u}$."
        )
    ]
    velocity: list[Piece] = [
        Sentence(
            "For each body, in ground axes: its angular velocity $\\boldsymbol{\\omega}$, and the velocity "
            "$\\mathbf{v}$ of its centre of mass."
        )
    ]
    acceleration: list[Piece] = [
        Sentence(
            "The rates of these velocities: angular acceleration $\\boldsymbol{\\alpha}$ and the acceleration "
            "$\\mathbf{a}$ of the centre of mass."
        )
    ]
    for name in bodies:
        position += author.quantity(author.of(r"\mathbf{r}", name), "poses", name, lambda pose: pose[:3, 3])
        position += author.quantity(author.of(r"\mathbf{R}", name), "poses", name, lambda pose: pose[:3, :3])
        velocity += author.quantity(author.of(r"\boldsymbol{\omega}", name), "velocities", name, lambda v: v.angular)
        velocity += author.quantity(author.of(r"\mathbf{v}", name), "velocities", name, lambda v: v.center_of_mass)
        acceleration += author.quantity(
            author.of(r"\boldsymbol{\alpha}", name), "accelerations", name, lambda a: a.angular
        )
        acceleration += author.quantity(
            author.of(r"\mathbf{a}", name), "accelerations", name, lambda a: a.center_of_mass
        )
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
    told = Sentence(
        f"The columns of the dependent velocities ({names}) form the square block $\\mathbf{{C}}_d$. Where its "
        "determinant vanishes, the mechanism is at a dead centre: the independent velocities do not determine the "
        "others there, and other coordinates must be chosen as independent."
    )
    if len(dependent) > EXPANDED:
        return [told]

    def choose(quantities: Any) -> list[Expr]:
        block = [[row[k] for k in dependent] for row in quantities.constraint_jacobian]
        return [_determinant(block)]

    named, (value,) = author.form("determinant of the dependent columns", choose, "d_")
    return [told, *author.formulas(r"\mathrm{det} \mathbf{C}_d", value, named)]


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
