"""Kinematics -> TreeEquations by the equations of Gibbs and Appell.

dS/da = Q with the energy of acceleration S = sum (m a_c . a_c + alpha . J alpha) / 2 + alpha . (omega x J omega) over
the bodies, terms without accelerations left out (P. Appell, Sur une forme generale des equations de la dynamique, 1900;
Shabana, Computational Dynamics, sec. 4.9).  a may be the rates of any velocities v, those of coordinates or not, which
is why S needs neither derivatives of T by q nor structure constants.  Accelerations of the bodies are total derivatives
of their velocities, S has one reverse gradient, and M is its Hessian: no recursion of another method is shared.
"""

from __future__ import annotations

from ...elements.forces.force import Load
from ...expr import vectors as vec
from ...expr.core import Expr, substitute
from ...expr.differentiate import gradient, hessian
from .. import Kinematics
from ..wrenches import gravity_on_links, virtual_power
from .lagrange import form_energies
from .tree_equations import TreeEquations


def derive(kinematics: Kinematics) -> TreeEquations:
    """Gibbs-Appell equations of the spanning tree."""
    slopes = gradient(energy_of_acceleration(kinematics), list(kinematics.a))
    loads: list[Load] = []
    for terms in kinematics.forces:
        loads += [*terms.marker_loads, *terms.coordinate_loads]
    inverse = [s - f for s, f in zip(slopes, virtual_power(kinematics, loads), strict=True)]
    rest = dict.fromkeys(kinematics.a, kinematics.graph.zero)
    kinetic, potential = form_energies(kinematics)
    return TreeEquations(
        method="gibbs_appell",
        mass=hessian(slopes, kinematics.a),
        bias=tuple(substitute(inverse, rest)),
        inverse_dynamics=tuple(inverse),
        kinetic_energy=kinetic,
        potential_energy=potential,
    )


def energy_of_acceleration(kinematics: Kinematics) -> Expr:
    """S (W^2 kg), gravity taken as an acceleration of the ground; terms without accelerations left out."""
    twists = zip(kinematics.links, kinematics.twists, strict=True)
    velocities = [(omega, vec.add(linear, vec.cross(omega, link.com))) for link, (omega, linear) in twists]
    rates = kinematics.total_derivative([x for pair in velocities for part in pair for x in part])
    total = kinematics.graph.zero
    bodies = zip(kinematics.links, velocities, gravity_on_links(kinematics), strict=True)
    for k, (link, (omega, centre), (_, gravity)) in enumerate(bodies):
        alpha, slide = ((rates[i], rates[i + 1], rates[i + 2]) for i in (6 * k, 6 * k + 3))
        push = vec.sub(vec.add(slide, vec.cross(omega, centre)), gravity)
        momentum = vec.times(link.inertia, omega)
        spin = 0.5 * vec.dot(alpha, vec.times(link.inertia, alpha)) + vec.dot(alpha, vec.cross(omega, momentum))
        total = total + (0.5 * link.mass * vec.dot(push, push) + spin)
    return total
