"""Generated code against joints and Newton's and Euler's equations of every body."""

from __future__ import annotations

from copy import copy
from functools import partial

import numpy as np

from ..analysis.reactions import reactions
from ..base import algebra
from ..base.algebra import Array
from ..base.limits.numbers import EPS, TINY
from ..elements.forces.force import reaction_symbol
from ..elements.forces.friction import ReactionFriction
from ..elements.frames import GROUND, Marker
from ..elements.joints import Continuous, Prismatic, Revolute
from ..expr.core import Expr, substitute, symbols_of
from ..mechanics import Kinematics
from ..model.mechanism import JointSpec
from . import bodies
from .checked import CheckedModel
from .digits import FOLDED, UNIT, Number, Numbers, array, numbers
from .finding import Comparison, Finding, pairs, size_of
from .identities import jacobian_at
from .truth import Truth

# -- joints ------------------------------------------------------------------------------------------------------------


PARTS = ("x", "y", "z", *["rotation"] * 9)  #: of a relative pose


def check_joints(model: CheckedModel) -> list[Finding]:
    """Rotations, placements at the joints, relative velocities."""
    return [_rigid(model), _joints(model), _freedoms(model)]


def _rigid(model: CheckedModel) -> Finding:
    """R^T R = 1 and det R = 1 for every body."""
    check = "poses: rotation matrices are orthonormal"
    if not model.layout.n_bodies:
        return Finding.skipped(check, "there are no bodies")
    result = Comparison(check)
    bounds = model.bounds("poses", lambda: model.terms.poses)[1]
    for k, case in enumerate(model.states):
        poses = model.call("poses", case)
        error = 8.0 * bounds[:, k].reshape(-1, 4, 4)[:, :3, :3].max(axis=(1, 2)) + 8.0 * UNIT
        R = poses[:, :3, :3]
        gap = np.abs(np.einsum("bij,bik->bjk", R, R) - np.eye(3)).max(axis=(1, 2))
        gap = np.maximum(gap, np.abs(np.linalg.det(R) - 1.0))
        result.add(k, gap, error, 1.0, model.layout.bodies)
    return result.finding()


def placed(truth: Truth, marker: Marker, name: str) -> bodies.Pose:
    """A marker in ground axes, from the pose of its body."""
    frame = marker.frame
    flat = truth.system.evaluate(
        f"marker {name}", lambda: [*frame.position, *(x for row in frame.rotation for x in row)], truth.values
    )
    position, rotation = flat[:3], flat[3:].reshape(3, 3)
    if marker.body == GROUND:
        return bodies.Pose(rotation, position)
    body = truth.here[marker.body]
    return bodies.Pose(body.rotation @ rotation, body.position + body.rotation @ position)


def _joints(model: CheckedModel) -> Finding:
    """At every joint the successor stands, seen from the predecessor, where the joint's coordinates say.

    Joints of the tree and cut ones alike, which tells whether loops have all the equations they need; joints without
    coordinates by their own equations.
    """
    check = "joints: poses match their coordinates"
    if not model.mechanism.joints:
        return Finding.skipped(check, "there are no joints")
    result, graph = Comparison(check), model.kinematics.graph
    cut = model.kinematics.loop_coordinates
    limits = model.bounds("poses", lambda: model.terms.poses)[1]
    fixed = (
        model.bounds("constraints", lambda: model.terms.constraints)[1]
        if model.terms.constraints
        else np.zeros((0, len(model.states)))
    )
    for k, truth in enumerate(model.truths):
        measured = dict(zip(cut.names, truth.measured(truth.values), strict=True)) if cut.names else {}
        gaps, labels = [], []
        for spec in model.mechanism.joints:
            if not spec.joint.coordinates and spec.joint.role == "loop":
                continue
            outer = placed(truth, spec.predecessor, f"{spec.name} P")
            inner = placed(truth, spec.successor, f"{spec.name} S")
            symbols = [graph.symbol(name) for name in spec.coordinates]
            rotation, position = spec.joint.pose(graph, symbols)
            values = truth.values | {n: measured[n] for n in spec.coordinates if n in measured}
            parts = [*position, *(x for row in rotation for x in row)]
            flat = truth.system.evaluate(f"pose {spec.name}", partial(list, parts), values)
            back = outer.rotation.T
            relative = np.concatenate([back @ (inner.position - outer.position), (back @ inner.rotation).ravel()])
            for expected in (flat, _textbook(spec, truth)):
                if expected is not None:
                    gaps += [*numbers(relative - expected)]
                    labels += [f"{spec.name} {what}" for what in PARTS]
        C = model.module.kernels.constraint_jacobian(truth.case.q, **truth.case.timed)
        moved = float(np.abs(algebra.pinv(C)).sum(axis=1).max(initial=0.0)) if C.size else 0.0
        length = max(1.0, model.layout.length)
        rounding = float(fixed[:, k].max(initial=0.0)) + UNIT * float(np.abs(truth.case.q).max(initial=0.0)) * float(
            np.abs(C).max(initial=0.0)
        )
        limit = 8.0 * length * (float(limits[:, k].max(initial=0.0)) + UNIT + (1.0 + moved) * rounding)
        result.add(k, gaps, limit, 1.0, labels)
    return result.finding()


def _textbook(spec: JointSpec, truth: Truth) -> Numbers | None:
    """Joints of one degree, written out once more: S turned by q about z, or shifted by q along z, in P."""
    if not isinstance(spec.joint, Revolute | Prismatic) or spec.coordinates[0] not in truth.values:
        return None
    q = truth.values[spec.coordinates[0]]
    if isinstance(spec.joint, Prismatic):
        return array([0, 0, q, 1, 0, 0, 0, 1, 0, 0, 0, 1])
    c, s = truth.mp.cos(q), truth.mp.sin(q)
    return array([0, 0, 0, c, -s, 0, s, c, 0, 0, 0, 1])


def _freedoms(model: CheckedModel) -> Finding:
    """In a unit of one velocity, and q' = N v, the successor moves by the joint's column of it, all else at rest.

    An angular velocity of a joint in Euler parameters is the relative one, in the successor's axes.
    """
    check = "joints: relative velocities"
    if not model.mechanism.joints or model.mechanism.bare:
        return Finding.skipped(check, "there are no joints")
    result, graph = Comparison(check), model.kinematics.graph
    limits = model.bounds("poses", lambda: model.terms.poses)[1]
    names = model.layout.v
    for k, truth in enumerate(model.truths):
        gaps, labels = [], []
        for spec in (model.mechanism.joints[b.joint] for b in model.kinematics.topology.branches):
            columns = spec.joint.subspace(graph, [graph.symbol(name) for name in spec.coordinates])
            inner = placed(truth, spec.successor, f"{spec.name} S")
            for name, (angular, linear) in zip(spec.velocities, columns, strict=True):
                flat = truth.system.evaluate(f"column {name}", lambda a=angular, l=linear: [*a, *l], truth.values)  # type: ignore[misc]
                motion = _relative(truth, spec, names.index(name), inner)
                gaps += [*numbers(motion - np.concatenate([inner.rotation @ flat[:3], inner.rotation @ flat[3:]]))]
                labels += [f"{name} {what}" for what in ("turning", "turning", "turning", "moving", "moving", "moving")]
        limit = 64.0 * (float(limits[:, k].max(initial=0.0)) + UNIT) * max(1.0, model.layout.length)
        result.add(k, gaps, limit, 1.0, labels)
    return result.finding()


def _relative(truth: Truth, spec: JointSpec, j: int, inner: bodies.Pose) -> Numbers:
    """Angular velocity and velocity of S relative to P at S (6,), ground axes, in a unit of velocity j."""
    total = array([truth.zero] * 6)
    for marker, sign in ((spec.successor, 1), (spec.predecessor, -1)):
        if marker.body != GROUND:
            w = truth.virtual[j][marker.body]
            arm = inner.position - truth.here[marker.body].position
            total = total + sign * np.concatenate([w.angular, w.at(arm)])
    return total


# -- equations of bodies -----------------------------------------------------------------------------------------------

# What is expected comes from :mod:`.truth`, which shares no formula with the derivation but where the bodies are and
# what the force elements exert.


def check_bodies(model: CheckedModel) -> list[Finding]:
    """Equations of the tree, accelerations, energies, momenta and power."""
    result = [_tree(model, name) for name in ("mass_matrix", "bias", "inverse_dynamics")]
    result += [_accelerations(model), _energy(model), _momentum(model), _power(model)]
    return result


def source(model: CheckedModel) -> str:
    """What the equations are judged by."""
    if model.mechanism.lagrangian is not None:
        return "Lagrange's equations by differences of L"
    return "equations as they were given" if model.mechanism.given is not None else "free bodies"


def _inertia_sizes(truth: Truth) -> Array:
    """Sizes (n_v,) of the terms that the bias is a sum of, which may cancel: bodies' inertia forces, gravity, loads."""
    if truth.system.mechanism.bare:
        return np.zeros(truth.n)

    def norm(vector: Numbers) -> float:
        return float(truth.mp.sqrt(vector @ vector))

    rates, sizes = truth.body_rates(), np.abs(numbers(truth.applied()))
    for j in range(truth.n):
        for body, w, rate, twist in zip(truth.bodies, truth.virtual[j], rates, truth.twists, strict=True):
            turning, inertia = norm(twist.angular) ** 2, max(norm(row) for row in body.inertia)
            a = norm(rate.at(body.arm)) + turning * norm(body.arm) + norm(truth.gravity)
            moment = inertia * (norm(rate.angular) + turning)
            sizes[j] += float(body.mass) * a * norm(w.at(body.arm)) + moment * norm(w.angular)
    return sizes


def _tree(model: CheckedModel, name: str) -> Finding:
    result, layout = Comparison(f"{name}: {source(model)}"), model.layout
    labels = pairs(layout.v, layout.v) if name == "mass_matrix" else list(layout.v)
    for k, truth in enumerate(model.truths):
        actual = model.call(name, truth.case).ravel()
        if name == "mass_matrix":
            expected = numbers(truth.mass_matrix).ravel()
        elif name == "bias":
            expected = numbers(truth.bias)
        else:
            expected = numbers(truth.mass_matrix @ truth.system.exact(truth.case.a) + truth.bias)
        if name in model.graph_kernels:
            bound = model.bounds(name, model.graph_kernels[name])[1][:, k]
        else:
            bound = layout.n_v * model.bounds("inverse_dynamics", lambda: model.terms.inverse_dynamics)[1][:, k].max()
        size = size_of(expected)
        if name == "bias":
            size = max(size, size_of(_inertia_sizes(truth)))
        floor = np.full(len(expected), FOLDED * size)
        if name == "mass_matrix":
            d = np.sqrt(np.maximum(np.diag(expected.reshape(layout.n_v, layout.n_v)), 0.0))
            floor = FOLDED * np.outer(d, d).ravel() + 4.0 * EPS * size
        result.add(k, actual - expected, bound + UNIT * np.abs(expected) + floor, size, labels)
    return result.finding()


def true_accelerations(model: CheckedModel, k: int) -> tuple[Array, Array, float]:
    """v' at a state in many digits, of M a + h + C_q^T l = 0 and C_q a + gamma = 0; what rounding allows, and the size.

    Raises
    ------
    ZeroDivisionError
        The system is singular.
    """
    truth = model.truths[k]
    a, multipliers = (numbers(x) for x in truth.solve(list(model.layout.rows)))
    mass = np.diag(numbers(truth.mass_matrix))
    sizes = np.divide(_inertia_sizes(truth), mass, out=np.zeros_like(mass), where=mass > 0.0)
    limit = model.acceleration_limit(k, a, multipliers) + FOLDED * (size_of(a) + sizes)
    return a, limit, max(size_of(a), size_of(sizes))


def _accelerations(model: CheckedModel) -> Finding:
    result, n_q = Comparison(f"accelerations: {source(model)}"), model.module.n_q
    for k, truth in enumerate(model.truths):
        try:
            a, limit, size = true_accelerations(model, k)
        except ZeroDivisionError:
            return Finding.skipped(result.check, "the system of accelerations and multipliers is singular")
        result.add(k, model.rhs(truth.case)[n_q:] - a, limit, size, [f"{n}'" for n in model.layout.v])
    return result.finding()


def kinetic(truth: Truth) -> Number:
    """T of the bodies and the rotors of drives."""
    total = sum((b.product(w, w) for b, w in zip(truth.bodies, truth.twists, strict=True)), truth.zero)
    for name, inertia in truth.drives:
        total += inertia * (truth.coordinate_slopes(name) @ truth.v) ** 2
    return total / 2


def potential(truth: Truth, poses: list[bodies.Pose], values: dict[str, Number]) -> Number:
    """V of gravity and of the force elements, with bodies at some poses."""
    total = truth.zero
    for body, pose, here in zip(truth.bodies, poses, truth.here, strict=True):
        centre = pose.position + pose.rotation @ (here.rotation.T @ body.arm)
        total -= body.mass * (truth.gravity @ centre)
    parts = [terms.potential for terms in truth.system.kinematics.forces if terms.potential is not None]
    return total + sum(truth.system.evaluate("potentials", lambda: parts, values), truth.zero)


def _energy(model: CheckedModel) -> Finding:
    check = "energy: of the bodies"
    if model.mechanism.bare or "energy" not in model.graph_kernels:
        return Finding.skipped(check, "there are no bodies; T and V are those of the given equations")
    result = Comparison(check)
    bounds = model.bounds("energy", model.graph_kernels["energy"])[1]
    for k, truth in enumerate(model.truths):
        expected = numbers([kinetic(truth), potential(truth, truth.here, truth.values)])
        actual = model.call("energy", truth.case)
        limit = bounds[:, k] + UNIT * np.abs(expected) + FOLDED * size_of(expected)
        result.add(k, actual - expected, limit, size_of(expected), model.labels("energy"))
    return result.finding()


def _momentum(model: CheckedModel) -> Finding:
    """Linear and angular momentum, and that external forces are what changes them."""
    check = "momentum: of the bodies"
    if "centroidal" not in model.graph_kernels:
        return Finding.skipped(check, "no body has a mass")
    result, n = Comparison(check), 3 + 3 * model.layout.n_v
    bounds = model.bounds("centroidal", model.graph_kernels["centroidal"])[1]
    for k, truth in enumerate(model.truths):
        expected = numbers(_momenta(truth))
        every = model.call("centroidal", truth.case)
        actual, limit = (np.concatenate([y[:3], y[n : n + 6]]) for y in (every, bounds[:, k]))
        labels = [f"{what} {axis}" for what in ("centre", "linear", "angular") for axis in "xyz"]
        size = size_of(expected)
        result.add(k, actual - expected, limit + UNIT * np.abs(expected) + FOLDED * size, size, labels)
    return result.finding()


def _momenta(truth: Truth) -> Numbers:
    """The centre of mass, linear and angular momentum (9,)."""
    mass, parts = sum((b.mass for b in truth.bodies), truth.zero), list(zip(truth.bodies, truth.here, strict=True))
    centre = sum((body.mass / mass * (pose.position + body.arm) for body, pose in parts), truth.zero)
    linear, angular = truth.zero, truth.zero
    for (body, pose), w in zip(parts, truth.twists, strict=True):
        momentum = body.mass * w.at(body.arm)
        linear = linear + momentum
        angular = angular + body.inertia @ w.angular + bodies.cross(pose.position + body.arm - centre, momentum)
    return np.concatenate([centre, linear, angular])


def _power(model: CheckedModel) -> Finding:
    """dE/dt along the motion, time and inputs held, against the power of forces without a potential and of drivers.

    E is the sum that the module reports, differentiated along x' = rhs in many digits.  The reactions of rows
    C' = C_q v + C_t do the power l . C_t.
    """
    check = "power: rate of energy, forces and drivers"
    if model.mechanism.bare or "energy" not in model.graph_kernels:
        return Finding.skipped(check, "there are no bodies, so it is not known which forces have a potential")
    result, layout = Comparison(check), model.layout
    for k, truth in enumerate(model.truths):
        a = model.rhs(truth.case)[model.module.n_q :]
        try:
            exact, multipliers = truth.solve(list(layout.rows))
        except ZeroDivisionError:
            return Finding.skipped(check, "the system of accelerations and multipliers is singular")
        rate = _energy_rate(model, truth, a)
        # C_q v = -C_t
        driven = -multipliers * (truth.constraint_jacobian[list(layout.rows)] @ truth.v)
        parts = np.concatenate([truth.applied(remainder=True) * truth.v, driven])
        power = sum(parts, truth.zero)
        momentum = np.abs(numbers(truth.mass_matrix @ truth.v))
        slack = model.acceleration_limit(k, numbers(exact), numbers(multipliers))
        gap = np.abs(numbers(truth.velocity_rows))[layout.rows] @ np.abs(numbers(multipliers))
        limit = float(momentum @ slack) + float(gap) + UNIT * float(np.abs(numbers(parts)).sum())
        size = max(float(np.abs(numbers(parts)).max(initial=0.0)), float(np.abs(a) @ momentum), TINY)
        result.add(k, [float(rate - power)], [limit], size)
    return result.finding()


def _energy_rate(model: CheckedModel, truth: Truth, a: Array) -> Number:
    """d(T + V)/dt along q' = N v, v' = a at a held time."""
    energies, exact = model.graph_kernels["energy"], truth.system.exact(a)
    return truth.slope(
        lambda values: sum(model.system.evaluate("kernel energy", energies, values), truth.zero),
        lambda s: truth.later(s, exact, frozen=True),
    )


# -- reactions ---------------------------------------------------------------------------------------------------------

# Reactions leave out what acts along a joint's coordinates (loads, inertias of drives); that is added here as the
# torque or force about or along the joint's axis, between the two bodies.


TURNING = (Revolute, Continuous)


def check_reactions(model: CheckedModel) -> list[Finding]:
    """One finding."""
    return [_reactions(model)]


def _inapplicable(model: CheckedModel) -> str:
    """Why the balance cannot be made up here, empty if it can."""
    table = model.layout.info.wrenches
    if table is None:
        return "there are no joints between bodies"
    if not model.layout.projects:
        return "derived with baumgarte="
    if model.mechanism.constraints:
        return "constraint elements act on bodies too, and reactions contain only the joints"
    plain = {s.coordinates[0] for s in model.mechanism.joints if isinstance(s.joint, (*TURNING, Prismatic))}
    loaded = {load.coordinate for terms in model.kinematics.forces for load in terms.coordinate_loads}
    loaded |= {s.coordinates[0] for s in model.mechanism.joints if s.armature is not None}
    if not loaded <= plain:
        return f"forces act along {', '.join(sorted(loaded - plain))}, not about or along one fixed axis"
    return ""


def _reactions(model: CheckedModel) -> Finding:
    """m a and the rate of angular momentum of each body against gravity, loads and what its joints exert on it."""
    check, module = "reactions: every body in balance", model.module
    why = _inapplicable(model)
    if why:
        return Finding.skipped(check, why)
    result = Comparison(check)
    labels = [f"{body} {part}" for body in model.layout.bodies for part in ("Fx", "Fy", "Fz", "Mx", "My", "Mz")]
    for k, truth in enumerate(model.truths):
        case = truth.case
        a = model.rhs(case)[module.n_q :]
        wrenches = reactions(module, case.t, case.x, **case.values)
        missing, size = _unbalanced(model, truth, a, wrenches)
        result.add(k, missing, _limit(model, k, truth, wrenches, size), size_of(size), labels)
    return result.finding()


def _limit(model: CheckedModel, k: int, truth: Truth, wrenches: np.ndarray, size: np.ndarray) -> np.ndarray:
    """What rounding allows the balances of the bodies at state k to be off by, of terms of such sizes."""
    module = model.module
    loads = np.array([[np.abs(wrenches[:, :3]).max(initial=0.0)] * 3 + [np.abs(wrenches).max(initial=0.0)] * 3])
    C = jacobian_at(module, truth.case)
    exact, multipliers = (numbers(x) for x in truth.solve(list(model.layout.rows)))
    slack = model.acceleration_limit(k, exact, multipliers) if module.layout.n_v else np.zeros(0)
    grown = (1.0 + model.dependence(C)) * UNIT * 6 * len(model.layout.bodies)
    limit = _inertia(truth) @ slack + grown * (size + np.repeat(loads, len(model.layout.bodies), axis=0).ravel())
    return np.asarray(limit)


def force_limit(model: CheckedModel, k: int, truth: Truth, wrenches: np.ndarray) -> float:
    """What rounding allows the force in a joint at state k to be off by: it carries all bodies beyond it."""
    a = model.rhs(truth.case)[model.module.n_q :]
    _, size = _unbalanced(model, truth, a, wrenches)
    return float(_limit(model, k, truth, wrenches, size).reshape(-1, 2, 3)[:, 0].sum())


def _inertia(truth: Truth) -> np.ndarray:
    """|wrench| (6 n_bodies, n_v) that a unit of each acceleration takes, about the bodies' origins."""
    columns = []
    for row in truth.virtual:
        for body, w in zip(truth.bodies, row, strict=True):
            force = body.mass * w.at(body.arm)
            columns += [force, body.inertia @ w.angular + bodies.cross(body.arm, force)]
    return np.abs(numbers(columns)).reshape(len(truth.virtual), 6 * len(truth.bodies)).T


def _unbalanced(
    model: CheckedModel, truth: Truth, a: np.ndarray, wrenches: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Force and moment about its origin that each body lacks (6 n_bodies,), and the size of the terms."""
    exact = truth.system.exact
    rates = truth.body_rates(exact(a))
    total, size = np.zeros((len(truth.bodies), 6)), np.zeros((len(truth.bodies), 6))

    def take(body: int, force: Numbers, moment: Numbers, arm: Numbers) -> None:
        whole = numbers(np.concatenate([force, moment + bodies.cross(arm, force)]))
        total[body] += whole
        parts = np.abs(whole).reshape(2, 3)
        size[body] += np.repeat(parts.max(axis=1), 3)  # a vector turned from other axes is rounded as a whole

    for k, (body, rate, w) in enumerate(zip(truth.bodies, rates, truth.twists, strict=True)):
        take(k, *body.needed(rate, w.angular), body.arm)
        take(k, -body.mass * truth.gravity, 0 * body.arm, body.arm)
    for body_index, arm, force, torque in truth.marker_loads():
        take(body_index, -force, -torque, arm)
    along = _along(truth, a)
    for spec, wrench in zip(model.mechanism.joints, wrenches, strict=True):
        point = placed(truth, spec.successor, f"{spec.name} S").position
        force, moment = exact(wrench).reshape(2, 3)
        if spec.coordinates and spec.coordinates[0] in along:
            pull = along[spec.coordinates[0]] * placed(truth, spec.predecessor, f"{spec.name} P").rotation[:, 2]
            force, moment = (force, moment + pull) if isinstance(spec.joint, TURNING) else (force + pull, moment)
        for end, sign in ((spec.successor, -1), (spec.predecessor, 1)):
            if end.body != GROUND:
                take(end.body, sign * force, sign * moment, point - truth.here[end.body].position)
    return total.ravel(), _wrench_sum(truth, size).ravel()


def _wrench_sum(truth: Truth, size: np.ndarray) -> np.ndarray:
    """Sizes (n_bodies, 6) of the terms of all bodies about each origin: a joint carries what is beyond it."""
    origins = np.array([numbers(pose.position) for pose in truth.here])
    apart = np.linalg.norm(origins[:, None] - origins[None], axis=2)
    forces, moments = size[:, :3].max(axis=1), size[:, 3:].max(axis=1)
    whole = np.stack([np.full(len(size), forces.sum()), moments.sum() + apart @ forces], axis=1)
    return np.repeat(whole, 3, axis=1)


def _along(truth: Truth, a: Array) -> dict[str, Number]:
    """Forces along joint coordinates, inertias of drives among them."""
    total: dict[str, Number] = {}
    for name, value in truth.coordinate_loads():
        total[name] = total.get(name, truth.zero) + value
    exact = truth.system.exact(a)
    for name, inertia in truth.drives:
        if name in truth.system.kinematics.velocity_labels:
            bend = exact[truth.system.kinematics.velocity_labels.index(name)]
        else:
            k = truth.system.kinematics.loop_coordinates.names.index(name)
            bend = truth.bend(truth.measured, lambda s: truth.later(s, exact))[k]
        total[name] = total.get(name, truth.zero) - inertia * bend
    return total


# -- laws of reactions -------------------------------------------------------------------------------------------------

# The forces are those that the equations of motion contain, in many digits.  They are held against their laws at the
# reactions of :func:`~eomgen.analysis.reactions.reactions`, which are found from numbers, joint by joint.


def check_reaction_laws(model: CheckedModel) -> list[Finding]:
    """One finding, of models with such friction."""
    laws = [terms for terms in model.kinematics.forces if isinstance(terms.force, ReactionFriction)]
    if not laws or model.layout.info.wrenches is None or not model.layout.projects:
        return []
    result = Comparison("friction: laws at the joints' reactions")
    specs = {spec.name: spec for spec in model.mechanism.joints}
    forces = [terms.force for terms in laws if isinstance(terms.force, ReactionFriction)]
    loads = [load.value for terms in laws for load in terms.coordinate_loads]
    for k, truth in enumerate(model.truths):
        case = truth.case
        wrenches = reactions(model.module, case.t, case.x, **case.values)
        by_joint = dict(zip(model.layout.info.joint_names, wrenches, strict=True))
        loose = force_limit(model, k, truth, wrenches)
        acting = numbers(truth.system.evaluate("friction by reactions", lambda: loads, truth.values))
        expected, slopes = np.transpose([_law(truth, f, specs[f.joint], by_joint[f.joint]) for f in forces])
        limit = slopes * loose + (1.0 + np.abs(slopes)) * UNIT * np.abs(expected) * len(model.layout.bodies)
        result.add(k, acting - expected, limit, float(np.abs(expected).max()), [f.name for f in forces])
    return [result.finding()]


def _law(truth: Truth, force: ReactionFriction, spec: JointSpec, wrench: np.ndarray) -> tuple[float, float]:
    """The force of a law at a reaction (ground axes), and how much it grows with that."""
    axis = numbers(placed(truth, spec.successor, f"{spec.name} S").rotation[:, 2])
    along = float(wrench[:3] @ axis)
    radial = float(np.linalg.norm(wrench[:3] - along * axis))
    values = [_value(truth, force, *pair) for pair in ((radial, along), (radial + 1.0, along), (radial, along + 1.0))]
    grown = abs(values[1] - values[0]) + abs(values[2] - values[0])
    return float(values[0]), float(grown)


def _value(truth: Truth, force: ReactionFriction, radial: float, along: float) -> Number:
    kinematics, number = truth.system.kinematics, truth.mp.mpf
    names = [reaction_symbol(kinematics.graph, force.joint, k).node[1] for k in range(3)]
    by_joint = dict(zip(names, (number(radial), truth.zero, number(along)), strict=True))
    outputs = truth.system.evaluate(f"law of {force.name}", lambda: [_open(kinematics, force)], truth.values | by_joint)
    return outputs[0]


def _open(kinematics: Kinematics, force: ReactionFriction) -> Expr:
    """The force of an element in terms of the state and of the joint's reaction."""
    motion = copy(kinematics.motion)
    motion.known_reactions = {}
    law = force.along(*force.path.measure(motion))
    mapping = motion.derived_symbols(kinematics.mechanism, symbols_of([law]))
    return substitute([law], mapping)[0] if mapping else law
