"""The steps of each method of derivation, from the motion to the equations."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import sympy

from ..errors import UnavailableError
from ..expr.core import Expr
from ..expr.differentiate import gradient
from ..expr.notation import dotted
from ..reading.document import Piece, Section, Sentence
from ..reading.quantities import Quantities, needed
from .author import Author


def energies(author: Author) -> Section | None:
    """T and V, of every method."""
    if author.mechanism.written is not None:
        return None
    T, V = author.letter("T"), author.letter("V")
    text = f"Kinetic energy ${T}$ and potential energy ${V}$ of gravity and springs (J):"
    if author.mechanism.lagrangian is not None:
        text = f"${T}$ holds the terms of the Lagrangian of second degree in the velocities, ${V}$ those of degree 0 "
        text += "with the other sign (J):"
    return Section("Energies", (Sentence(text), *author.quantity(T, "T"), *author.quantity(V, "V")))


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


def final(author: Author) -> Section:
    """The equations of motion."""
    eqs = author.equations
    rates = [author.symbol(name) for name in eqs.acceleration_names]
    if not rates:
        return Section("Equations of motion", tuple(_prescribed(author)))
    try:
        named, mass, force = eqs.intermediates, eqs.mass_matrix, eqs.force
    except UnavailableError as error:
        return Section("Equations of motion", (Sentence(str(error).partition("\n")[0]),))
    one = len(mass) == 1
    left, right = map(author.letter, "Mf") if one else (r"\mathbf{M}", r"\mathbf{f}")
    text = f"${left} {rates[0]} = {right}$ with"
    if not one:
        listed = ", ".join(f"${x}$" for x in rates)
        text = f"$\\mathbf{{M}} \\ddot{{\\mathbf{{q}}}}_i = \\mathbf{{f}}$ for the accelerations {listed}, with"
    formulas = author.formulas(left, mass, named, ("mass_matrix", None), True)
    known = set() if isinstance(formulas[0], Sentence) else {symbol for symbol, _ in needed(named, mass)}
    formulas += author.formulas(right, force, named, ("force", None), explained=known)
    return Section("Equations of motion", (Sentence(text), *formulas))


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
