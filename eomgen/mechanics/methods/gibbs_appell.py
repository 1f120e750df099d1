"""Kinematics -> TreeEquations by the equations of Gibbs and Appell.

dS/da = Q with the energy of acceleration S = sum (m a_c . a_c + alpha . J alpha) / 2 + alpha . (omega x J omega) over
the bodies, terms without accelerations left out (P. Appell, Sur une forme generale des equations de la dynamique, 1900;
Shabana, Computational Dynamics, sec. 4.9).  a may be the rates of any velocities v, those of coordinates or not, which
is why S needs neither derivatives of T by q nor structure constants.  Accelerations of the bodies are total derivatives
of their velocities, S has one reverse gradient, and M is its Hessian: no recursion of another method is shared.
"""

from __future__ import annotations

from ...elements.forces import CoordinateLoad, MarkerLoad
from ...elements.frames import GROUND
from ...expr import vectors as vec
from ...expr.core import Expr, substitute
from ...expr.differentiate import gradient, hessian
from ...expr.vectors import Vec3
from .. import Kinematics
from ..wrenches import potential_energy, virtual_power
from .tree_equations import TreeEquations


def derive(kinematics: Kinematics) -> TreeEquations:
    """Gibbs-Appell equations of the spanning tree."""
    slopes = gradient(energy_of_acceleration(kinematics), list(kinematics.a))
    loads: list[MarkerLoad | CoordinateLoad] = []
    for terms in kinematics.forces:
        loads += [*terms.marker_loads, *terms.coordinate_loads]
    inverse = [s - f for s, f in zip(slopes, virtual_power(kinematics, loads), strict=True)]
    rest = dict.fromkeys(kinematics.a, kinematics.graph.zero)
    return TreeEquations(
        method="gibbs_appell",
        mass_matrix=hessian(slopes, kinematics.a),
        bias=tuple(substitute(inverse, rest)),
        inverse_dynamics=tuple(inverse),
        kinetic_energy=_kinetic(kinematics),
        potential_energy=potential_energy(kinematics),
    )


def _velocities(kinematics: Kinematics) -> list[tuple[Vec3, Vec3]]:
    """Angular velocity of each link and velocity of its centre of mass, link axes."""
    links = zip(kinematics.links, kinematics.twists, strict=True)
    return [(angular, vec.add(linear, vec.cross(angular, link.com))) for link, (angular, linear) in links]


def energy_of_acceleration(kinematics: Kinematics) -> Expr:
    """S (W^2 kg), gravity taken as an acceleration of the ground; terms without accelerations left out."""
    velocities = _velocities(kinematics)
    rates = kinematics.total_derivative([x for pair in velocities for part in pair for x in part])
    total = kinematics.graph.zero
    falls: list[Vec3] = []  # gravity in link axes
    for k, (link, (omega, centre)) in enumerate(zip(kinematics.links, velocities, strict=True)):
        alpha, slide = ((rates[i], rates[i + 1], rates[i + 2]) for i in (6 * k, 6 * k + 3))
        falls.append(link.down(falls[link.parent] if link.parent != GROUND else kinematics.mechanism.gravity))
        push = vec.sub(vec.add(slide, vec.cross(omega, centre)), falls[k])
        momentum = vec.times(link.inertia, omega)
        spin = 0.5 * vec.dot(alpha, vec.times(link.inertia, alpha)) + vec.dot(alpha, vec.cross(omega, momentum))
        total = total + (0.5 * link.mass * vec.dot(push, push) + spin)
    return total


def _kinetic(kinematics: Kinematics) -> Expr:
    total = kinematics.graph.zero
    for link, (omega, centre) in zip(kinematics.links, _velocities(kinematics), strict=True):
        total = total + (link.mass * vec.dot(centre, centre) + vec.dot(omega, vec.times(link.inertia, omega)))
    return 0.5 * total
