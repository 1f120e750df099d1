"""What one method of derivation has and others have not, as expressions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from ..base.texts import acceleration_name
from ..elements.frames import GROUND
from ..errors import ExpressionError, UnavailableError, UsageError, at_odds, ill_typed
from ..expr import vectors as vec
from ..expr.core import Expr, Graph, reachable, substitute, symbols_of
from ..expr.differentiate import jacobian
from ..expr.evaluate import evaluate
from ..expr.notation import Notation
from ..expr.spatial import Wrench
from ..expr.tensors import solve_symmetric
from ..expr.texts import quoted
from ..expr.vectors import Vec3
from ..mechanics import Kinematics
from ..mechanics.methods.free_bodies import FreeBodies
from ..mechanics.wrenches import JointWrenches
from ..model.expressions import parse
from ..model.sympy_face import free_names, is_sympy, lower_sympy, name_of, symbol
from ..model.values import MULTIPLIERS, numbered
from ..model.visit import rewritten
from ..runtime.argument_checks import unknown
from .quantities import Quantities, Row, Rows, require_bodies

# -- names of unknowns -------------------------------------------------------------------------------------------------

# A parameter ``p_theta`` is another thing than the momentum of theta, and ``lambda1`` is printed as ``lambda_1`` is.
# Where a name of the model is or is printed as the usual name, a longer word takes its place: ``momentum_theta``.


def model_notation(kinematics: Kinematics, more: Iterable[str] = ()) -> Notation:
    """How the names of a model are printed, and further names after them."""
    k, m = kinematics, kinematics.mechanism
    velocities = [*k.velocity_names, *k.state_names]
    rates = [*velocities, *map(acceleration_name, velocities)]
    outputs = [output.name for output in m.outputs]
    outputs += m.given.multipliers if m.given is not None else ()
    names = [*k.names, *k.loop_coordinates.names, *k.parameter_names, *k.input_names, *outputs, *rates, *more]
    return Notation(names, m.presentation.latex, m.presentation.instances)


def momentum_names(kinematics: Kinematics) -> tuple[str, ...]:
    """``p_theta``, ...: what momenta are called, one a velocity."""
    return _free(kinematics, ("p", "momentum"), lambda p: [f"{p}_{label}" for label in kinematics.velocity_labels])


def multiplier_names(kinematics: Kinematics, count: int) -> tuple[str, ...]:
    """``lambda_1``, ...: what multipliers of constraint equations are called, unless given equations name them."""
    equations = kinematics.mechanism.given
    if equations is not None and count == len(equations.multipliers):
        return equations.multipliers
    return _free(kinematics, MULTIPLIERS, lambda word: numbered(word, count))


def wrench_names(kinematics: Kinematics, joint: str) -> tuple[str, ...]:
    """``A_M_x``, ..., ``A_F_x``, ...: components of the moment and of the force of a joint."""
    moment = _free(kinematics, ("M", "moment"), lambda word: _axes(f"{joint}_{word}"))
    return (*moment, *_free(kinematics, ("F", "force"), lambda word: _axes(f"{joint}_{word}")))


def twist_rate_names(kinematics: Kinematics, body: str) -> tuple[str, ...]:
    """``rod_alpha_x``, ..., ``rod_a_x``, ...: components of the rate of a body's twist."""
    turning = _free(kinematics, ("alpha", "angular"), lambda word: _axes(f"{body}_{word}"))
    return (*turning, *_free(kinematics, ("a", "linear"), lambda word: _axes(f"{body}_{word}")))


def _axes(stem: str) -> list[str]:
    return [f"{stem}_{axis}" for axis in "xyz"]


def _free(kinematics: Kinematics, labels: Sequence[str], names: Callable[[str], list[str]]) -> tuple[str, ...]:
    """The names with the first word with which they are free."""
    notation = model_notation(kinematics)
    taken = {form for name in notation.names for form in (notation.latex(name), notation.text(name))}
    word, *others = labels
    while True:
        result = names(word)
        forms = {form for name in result for form in (notation.latex(name), notation.text(name))}
        if taken.isdisjoint(forms) and set(result).isdisjoint(notation.names):
            return tuple(result)
        word, others = (others[0], others[1:]) if others else (f"{word}_", [])


# -- values for names --------------------------------------------------------------------------------------------------


QUARTER = "quarter()"  #: symbol of a quarter of a turn while values are put in


def read_value(graph: Graph, name: str, value: Any) -> Expr:
    """The expression of a number, a text or a SymPy expression; functions of time stand for what they are called."""
    try:
        if isinstance(value, str):
            return parse(value, graph, graph.symbol)
        if is_sympy(value):
            return lower_sympy(graph, value, graph.symbol)
        return graph.constant(float(value))
    except ExpressionError as error:
        raise UsageError(f"{name}: {error}", code="EG-EXPRESSION") from None
    except (TypeError, ValueError, OverflowError):
        raise ill_typed(f"{name} must be a number, a text or a SymPy expression, not {quoted(value)}") from None


def read_values(by_name: Any, allowed: Sequence[str], what: str, plain: Callable[[str], str]) -> dict[str, Any]:
    """Values by name; refused are unknown names, those given twice, and values that are no expressions.

    ``what`` is what the names are, in messages; ``plain`` makes ``left_hinge`` of ``left.hinge`` in an instance of a
    component.
    """
    if not isinstance(by_name, Mapping):
        raise ill_typed(f"values are given by name, as a mapping does, not {quoted(by_name)}")
    values: dict[str, Any] = {}
    for key, value in by_name.items():
        name = name_of(key)
        name = plain(name) if isinstance(name, str) and name not in allowed else name
        if name not in allowed:
            raise unknown(what, name, allowed)
        if name in values:
            raise at_odds(f"{what} {name!r} is given twice; give it one value")
        values[name] = _without_dots(value, plain)
        read_value(Graph(), name, values[name])
    return values


def _without_dots(value: Any, plain: Callable[[str], str]) -> Any:
    """A value whose names of instances have no dots."""
    if isinstance(value, str):
        return rewritten(value, plain, str)
    if not is_sympy(value):
        return value
    return value.xreplace({symbol(name): symbol(plain(name)) for name in free_names([value]) if "." in name})


def put_in(expressions: Sequence[Expr], values: Mapping[str, Any]) -> list[Expr]:
    """The expressions with values put in for names, all at once; the graph simplifies what follows.

    Sines and cosines of quarter turns come out as 0, 1 and -1, which those of doubles would miss by rounding.
    """
    if not expressions or not values:
        return list(expressions)
    graph = expressions[0].graph
    quarter = graph.symbol(QUARTER)
    read = [read_value(graph, name, value) for name, value in values.items()]
    read = substitute(read, {x: k * quarter for x, k in _quarters(read)})
    result = substitute(expressions, dict(zip(map(graph.symbol, values), read, strict=True)))
    return substitute(_turned(result), {quarter: graph.constant(math.pi / 2)})


def _quarters(expressions: Sequence[Expr]) -> list[tuple[Expr, float]]:
    """Constants that are a few quarters of a turn, and how many."""
    graph = expressions[0].graph
    constants = [i for i in reachable(graph, (x.id for x in expressions)) if graph.nodes[i][0] == "const"]
    counts = [(i, round(graph.nodes[i][1] / (math.pi / 2))) for i in constants]
    return [(Expr(graph, i), float(k)) for i, k in counts if 0 < abs(k) <= 8 and graph.nodes[i][1] == k * math.pi / 2]


def _turned(expressions: Sequence[Expr]) -> list[Expr]:
    """Sines and cosines of whole numbers of quarter turns, exactly."""
    graph = expressions[0].graph
    exact: dict[Expr, Expr] = {}
    for i in reachable(graph, (x.id for x in expressions)):
        operation, *operands = graph.nodes[i]
        if operation not in ("sin", "cos") or symbols_of([argument := Expr(graph, operands[0])]) != {QUARTER}:
            continue
        turns = float(evaluate([argument], {QUARTER: 1.0})[0])  # numbers beside it would not come out whole
        straight = float(evaluate([argument], {QUARTER: 0.0})[0])
        if straight == 0.0 and turns.is_integer():
            k = int(turns) % 4
            value = (0.0, 1.0, 0.0, -1.0)[k] if operation == "sin" else (1.0, 0.0, -1.0, 0.0)[k]
            exact[Expr(graph, i)] = graph.constant(value)
    return substitute(expressions, exact)


# -- quantities of methods ---------------------------------------------------------------------------------------------

# Gibbs-Appell: the function S.  Hamilton: H(q, p) and p'.  Methods with reactions or multipliers as unknowns: the block
# system that they solve.


BLOCKS = ("augmented", "newton_euler", "amalgamated")  #: methods that solve one system for more than accelerations


def require_method(quantities: Quantities, what: str, methods: tuple[str, ...]) -> None:
    """Refuse a quantity of other methods, which the message lists."""
    method = quantities.tree.method
    if method not in methods:
        have = " or ".join(repr(name) for name in methods)
        raise UnavailableError(f"method {method!r} has no {what}; derive the model with method={have}")


def gibbs_function(quantities: Quantities) -> Expr:
    """S (W^2 kg) = v' . M v' / 2 - Q_v . v' on the tree, the energy of acceleration less what has no accelerations."""
    require_method(quantities, "function of Gibbs and Appell", ("gibbs_appell",))
    a, mass = quantities.kinematics.a, quantities.equations.mass_matrix
    total = quantities.graph.zero
    for i, x in enumerate(a):
        row = 0.5 * mass[i][i] * x - quantities.tree_quadratic_velocity[i]
        for j in range(i):
            row = row + mass[i][j] * a[j]
        total = total + row * x
    return total


def hamiltonian(quantities: Quantities) -> Expr:
    """H(q, p, t) = (p - b) . M^-1 (p - b) / 2 - T_0 + V with T = v . M v / 2 + b . v + T_0 (Goldstein, sec. 8.1)."""
    require_method(quantities, "Hamiltonian", ("hamilton",))
    kinematics, tree, graph = quantities.kinematics, quantities.tree, quantities.graph
    p = [graph.symbol(name) for name in momentum_names(kinematics)]
    still = dict.fromkeys(kinematics.v, graph.zero)
    *linear, at_rest = substitute([*quantities.momenta, tree.kinetic_energy], still)
    moved = [x - b for x, b in zip(p, linear, strict=True)]
    total = graph.zero
    for x, rate in zip(moved, solve_symmetric(quantities.equations.mass_matrix, moved), strict=True):
        total = total + x * rate
    result = 0.5 * total - at_rest + tree.potential_energy
    places = enumerate(quantities.mobility.q_reference)  # somewhere else: coordinates may be singular at the reference
    numbers = quantities.numbers | dict(zip(kinematics.names, (x + 0.3 + 0.1 * k for k, x in places), strict=True))
    if not math.isfinite(float(evaluate([result], numbers | dict.fromkeys(momentum_names(kinematics), 1.0))[0])):
        raise UnavailableError(
            "the mass matrix of the spanning tree has no inverse, so that H is no function of the momenta; give every "
            "body a mass and an inertia"
        )
    return result


def momentum_rates(quantities: Quantities) -> Row:
    """p' = -dH/dq + Q (n_v,) in terms of q and v, without the forces of constraints."""
    require_method(quantities, "rates of momenta", ("hamilton",))
    return quantities.tree.canonical[len(quantities.kinematics.v) :]


class BlockSystem(NamedTuple):
    """A linear system of a method: ``matrix * unknowns = right``; of equations SymPy matrices.

    Attributes
    ----------
    matrix : sympy.Matrix
        (n, n)
    unknowns : sympy.Matrix
        (n, 1), accelerations, reactions and multipliers.
    right : sympy.Matrix
        (n, 1)
    """

    matrix: Any
    unknowns: Any
    right: Any


def block_system(quantities: Quantities) -> BlockSystem:
    """The system that the method solves for accelerations and reactions.

    ``augmented``: [M C_q^T; C_q 0] [v'; lambda] = [Q + Q_v; -gamma], redundant constraints left out.
    """
    require_method(quantities, "block system", BLOCKS)
    kinematics, tree, zero = quantities.kinematics, quantities.tree, quantities.graph.zero
    if tree.method == "augmented" or tree.system is None:
        jacobian = quantities.constraint_jacobian
        upper = [(*row, *(line[i] for line in jacobian)) for i, row in enumerate(quantities.equations.mass_matrix)]
        lower = [(*line, *(zero for _ in jacobian)) for line in jacobian]
        unknowns = (*(str(a.node[1]) for a in kinematics.a), *multiplier_names(kinematics, len(quantities.rows)))
        right = (*(-h for h in quantities.equations.bias), *(-g for g in quantities.gamma))
        return BlockSystem((*upper, *lower), unknowns, right)
    system = tree.system
    n = len(system.unknowns)
    rows = [[zero] * n for _ in system.right]
    for (i, j), entry in zip(system.places, system.entries, strict=True):
        rows[i][j] = entry
    return BlockSystem(tuple(map(tuple, rows)), unknown_names(quantities), system.right)


def unknown_names(quantities: Quantities) -> tuple[str, ...]:
    """Names of the unknowns of newton_euler and amalgamated, in the order of the system.

    Of each body ``rod_alpha_x`` .. and ``rod_a_x`` .., the rates of its twist in the axes of its joint, gravity
    subtracted; of amalgamated also the accelerations of the joint; of its joint ``A_M_x`` .. and ``A_F_x`` .., the
    wrench on the body at the joint; then the multipliers.
    """
    kinematics, tree = quantities.kinematics, quantities.tree
    assert tree.system is not None
    names: list[str] = []
    for link, branch in zip(kinematics.links, kinematics.topology.branches, strict=True):
        joint = kinematics.mechanism.joints[branch.joint].name
        rates = [str(kinematics.a[link.first + c].node[1]) for c in range(len(link.columns))]
        names += twist_rate_names(kinematics, link.name)
        names += rates if tree.method == "amalgamated" else []
        names += wrench_names(kinematics, joint)
    left = len(tree.system.unknowns) - len(names)
    return (*names, *multiplier_names(kinematics, left))


def body_velocities(quantities: Quantities) -> Rows:
    """B_b (6 n_b, n_dof) of M = B_b^T M_b B_b (Shabana, sec. 5.7).

    The six velocities of a body are that of its centre of mass in ground axes, then its angular velocity in body axes.
    """
    require_bodies(quantities.kinematics)
    motion, v = quantities.kinematics.motion, list(quantities.kinematics.v)
    velocities: list[Expr] = []
    for body in quantities.kinematics.mechanism.bodies:
        velocities += quantities.velocity(body.name).center_of_mass
        velocities += motion.turning_of(quantities.markers[body.name], own_axes=True, rate=False)
    entries = jacobian(velocities, v)
    zero = quantities.graph.zero
    rows = [[entries.get((i, j), zero) for j in range(len(v))] for i in range(len(velocities))]
    return tuple(quantities.along_independent(row) for row in rows)


def body_mass_matrix(quantities: Quantities) -> Rows:
    """M_b (6 n_b, 6 n_b), mass and inertia body by body."""
    require_bodies(quantities.kinematics)
    bodies = quantities.kinematics.mechanism.bodies
    mass = [[quantities.graph.zero] * (6 * len(bodies)) for _ in range(6 * len(bodies))]
    for k, body in enumerate(bodies):
        for i in range(3):
            mass[6 * k + i][6 * k + i] = body.mass
            mass[6 * k + 3 + i][6 * k + 3 : 6 * k + 6] = body.inertia[i]
    return tuple(map(tuple, mass))


# -- free bodies -------------------------------------------------------------------------------------------------------

# Every joint is cut, and what it does is drawn as a force and a moment (Shabana, Computational Dynamics, sec. 3.3): of
# joints of the spanning tree as unknown components, of joints that close loops by the multipliers of their equations.
# All vectors are in ground axes, moments about the centre of mass.


METHODS_OF_BODIES = ("newton_euler", "amalgamated")


class BodyBalance(NamedTuple):
    """One body: rates of its momenta, and what acts on it, each (3,).

    ``inertia_force`` m a_c = ``force``; ``inertia_moment`` J alpha + omega x J omega = ``moment``.
    """

    inertia_force: Vec3
    force: Vec3
    inertia_moment: Vec3
    moment: Vec3


class BodiesApart:
    """The equations of all bodies set free.

    ``A_F_x`` .. and ``A_M_x`` .. are what joint A of the spanning tree does to the body that it carries (the other one
    gets the opposite), at the joint; ``lambda_1`` .. are the multipliers of the constraint equations.
    """

    def __init__(self, quantities: Quantities) -> None:
        require_method(quantities, "equations of free bodies", METHODS_OF_BODIES)
        self.quantities = quantities
        self.kinematics, self.graph = quantities.kinematics, quantities.graph
        self.links = {link.body: k for k, link in enumerate(self.kinematics.links)}
        self.joints = [self.kinematics.mechanism.joints[b.joint].name for b in self.kinematics.topology.branches]

    def _unknown(self, joint: str) -> tuple[Vec3, Vec3]:
        """Force and moment of a joint."""
        m_x, m_y, m_z, f_x, f_y, f_z = map(self.graph.symbol, wrench_names(self.kinematics, joint))
        return (f_x, f_y, f_z), (m_x, m_y, m_z)

    def _centre(self, body: int) -> Vec3:
        pose = self.kinematics.poses.link(self.links[body])
        return vec.add(pose.position, vec.times(pose.rotation, self.kinematics.links[self.links[body]].com))

    def balance(self, name: str) -> BodyBalance:
        """The equations of a body."""
        body = next(k for k, b in enumerate(self.kinematics.mechanism.bodies) if b.name == name)
        force, moment = self._weight_and_elements(body)
        for wrench in (*self._from_joints(body), *self._from_cut_joints(body)):
            moment, force = vec.add(moment, wrench[0]), vec.add(force, wrench[1])
        rate, turning = self._inertia(name, body)
        return BodyBalance(rate, force, turning, moment)

    def _inertia(self, name: str, body: int) -> tuple[Vec3, Vec3]:
        """m a_c, and J alpha + omega x J omega."""
        link = self.kinematics.links[self.links[body]]
        motion, marker = self.kinematics.motion, self.quantities.markers[name]
        spec = self.kinematics.mechanism.bodies[body]
        omega, alpha = (motion.turning_of(marker, own_axes=True, rate=rate) for rate in (False, True))
        spin = vec.cross(omega, vec.times(spec.inertia, omega))
        turn = vec.times(motion.rotation(marker), vec.add(vec.times(spec.inertia, alpha), spin))
        return vec.scale(link.mass, self.quantities.acceleration(name).center_of_mass), turn

    def _about_centre(self, body: int, point: Vec3, force: Vec3, moment: Vec3) -> Wrench:
        arm = vec.sub(point, self._centre(body))
        return vec.add(moment, vec.cross(arm, force)), force

    def _weight_and_elements(self, body: int) -> tuple[Vec3, Vec3]:
        """Weight and the loads of force elements at markers: force, moment about the centre of mass."""
        kinematics = self.kinematics
        force = vec.scale(kinematics.links[self.links[body]].mass, kinematics.mechanism.gravity)
        moment = vec.zero(self.graph)
        for load in (load for terms in kinematics.forces for load in terms.marker_loads):
            if load.marker.body == body:
                point = kinematics.motion.position(load.marker)
                turned, push = self._about_centre(body, point, load.force, load.torque)
                moment, force = vec.add(moment, turned), vec.add(force, push)
        return force, moment

    def _from_joints(self, body: int) -> list[Wrench]:
        """What the joints of the tree do to a body."""
        result: list[Wrench] = []
        for k, (link, joint) in enumerate(zip(self.kinematics.links, self.joints, strict=True)):
            parent = self.kinematics.links[link.parent].body if link.parent != GROUND else GROUND
            if body not in (link.body, parent):
                continue
            point = self.kinematics.poses.link(k).position
            force, moment = self._unknown(joint)
            if body == parent:
                force, moment = vec.neg(force), vec.neg(moment)
            result.append(self._about_centre(body, point, force, moment))
        return result

    def _multipliers(self) -> dict[str, Expr]:
        """The multiplier of each constraint equation that counts, by its label."""
        labels = self.kinematics.constraints.labels
        names = multiplier_names(self.kinematics, len(self.quantities.rows))
        return {labels[i]: self.graph.symbol(n) for i, n in zip(self.quantities.rows, names, strict=True)}

    def _from_cut_joints(self, body: int) -> list[Wrench]:
        """What the joints that close loops do to a body: -lambda dC, and the loads along their coordinates."""
        multipliers, joints = self._multipliers(), JointWrenches(self.kinematics)
        loads: dict[str, Expr] = {}
        for name, value in joints.loads_on_cut():
            loads[name] = loads.get(name, self.graph.zero) + value
        result: list[Wrench] = []
        for cut in joints.cut:
            ends = (cut.spec.predecessor.body, cut.spec.successor.body)
            if body not in ends:
                continue
            point = self.kinematics.poses.marker(cut.spec.successor).position
            weighted = [(-multipliers[label], six) for label, six in cut.rows if label in multipliers]
            weighted += [(loads[name], six) for name, six in cut.coordinates if name in loads]
            for factor, six in weighted:
                factor = factor if body == ends[1] else -factor
                force, moment = vec.scale(factor, (six[0], six[1], six[2])), vec.scale(factor, (six[3], six[4], six[5]))
                result.append(self._about_centre(body, point, force, moment))
        return result

    def along_joint(self, name: str) -> list[tuple[Expr, Expr]]:
        """Along each free direction of a joint of the tree: its component of the reaction, and what drives it.

        Force elements along the coordinate and constraint elements, by their multipliers, drive it; the inertia of a
        drive (armature) takes its part of that.
        """
        k = self.joints.index(name)
        link, bodies = self.kinematics.links[k], FreeBodies(self.kinematics)
        rotation = self.kinematics.poses.link(k).rotation
        force, moment = self._unknown(name)
        pulls = self._pulls()
        armature = self.kinematics.mechanism.joints[self.kinematics.topology.branches[k].joint].armature
        result = []
        for c, (angular, linear) in enumerate(link.columns):
            turn, push = vec.times(rotation, angular), vec.times(rotation, linear)
            j = link.first + c
            drive = bodies.forces[j] - pulls[j]
            if armature is not None:
                drive = drive - armature * self.kinematics.a[j]
            result.append((vec.dot(turn, moment) + vec.dot(push, force), drive))
        return result

    def _pulls(self) -> Row:
        """C_q^T lambda of the constraint elements."""
        constraints, multipliers = self.kinematics.constraints, self._multipliers()
        total = [self.graph.zero] * len(self.kinematics.v)
        for label, row in zip(constraints.labels, constraints.jacobian, strict=True):
            if label in self.kinematics.coupled and label in multipliers:
                total = [x + multipliers[label] * entry for x, entry in zip(total, row, strict=True)]
        return tuple(total)
