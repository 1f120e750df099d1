"""Stage verification, check reactions: Newton's and Euler's equations of each body alone, with what its joints exert.

Reactions leave out what acts along a joint's coordinates (loads, inertias of drives); that is added here as the torque
or force about or along the joint's axis, between the two bodies.
"""

from __future__ import annotations

import numpy as np

from ..analysis.reactions import reactions
from ..base.algebra import Array
from ..frames import GROUND
from ..joints import Continuous, Prismatic, Revolute
from . import bodies
from .bench import Bench, numbers
from .check_joints import placed
from .comparison import Comparison, size_of
from .digits import Number
from .finding import Finding
from .rounding_sizes import UNIT
from .truth import Truth

TURNING = (Revolute, Continuous)


def check(bench: Bench) -> list[Finding]:
    """One finding."""
    return [_reactions(bench)]


def _inapplicable(bench: Bench) -> str:
    """Why the balance cannot be made up here, empty if it can."""
    table = bench.layout.metadata.get("wrenches")
    if table is None:
        return "there are no joints between bodies"
    if not bench.layout.projects:
        return "derived with baumgarte="
    if bench.mechanism.constraints:
        return "constraint elements act on bodies too, and reactions contain only the joints"
    plain = {s.coordinates[0] for s in bench.mechanism.joints if isinstance(s.joint, (*TURNING, Prismatic))}
    loaded = {load.coordinate for terms in bench.kinematics.forces for load in terms.coordinate_loads}
    loaded |= {s.coordinates[0] for s in bench.mechanism.joints if s.armature is not None}
    if not loaded <= plain:
        return f"forces act along {', '.join(sorted(loaded - plain))}, not about or along one fixed axis"
    return ""


def _reactions(bench: Bench) -> Finding:
    """m a and the rate of angular momentum of each body against gravity, loads and what its joints exert on it."""
    check, module = "reactions: every body in balance", bench.module
    why = _inapplicable(bench)
    if why:
        return Finding.skipped(check, why)
    found = Comparison(check)
    labels = [f"{body} {part}" for body in bench.layout.bodies for part in ("Fx", "Fy", "Fz", "Mx", "My", "Mz")]
    for k, truth in enumerate(bench.truths):
        case = truth.case
        a = bench.rhs(case)[module.n_q :]
        wrenches = reactions(module, case.t, case.x, p=case.p, u=case.u)
        missing, size = _unbalanced(bench, truth, a, wrenches)
        found.add(k, missing, _limit(bench, k, truth, wrenches, size), size_of(size), labels)
    return found.finding()


def _limit(bench: Bench, k: int, truth: Truth, wrenches: np.ndarray, size: np.ndarray) -> np.ndarray:
    """What rounding allows the balances of the bodies at state k to be off by, of terms of such sizes."""
    case, module = truth.case, bench.module
    loads = np.array([[np.abs(wrenches[:, :3]).max(initial=0.0)] * 3 + [np.abs(wrenches).max(initial=0.0)] * 3])
    C = module.kernels.constraint_jacobian(case.q, p=case.p, u=case.u, t=case.t)
    exact, multipliers = (numbers(x) for x in truth.solve(list(bench.layout.rows)))
    slack = bench.acceleration_limit(k, exact, multipliers) if module.layout.n_v else np.zeros(0)
    grown = (1.0 + bench.dependence(C)) * UNIT * 6 * len(bench.layout.bodies)
    limit = _inertia(truth) @ slack + grown * (size + np.repeat(loads, len(bench.layout.bodies), axis=0).ravel())
    return np.asarray(limit)


def force_limit(bench: Bench, k: int, truth: Truth, wrenches: np.ndarray) -> float:
    """What rounding allows the force in a joint at state k to be off by: it carries all bodies beyond it."""
    a = bench.rhs(truth.case)[bench.module.n_q :]
    _, size = _unbalanced(bench, truth, a, wrenches)
    return float(_limit(bench, k, truth, wrenches, size).reshape(-1, 2, 3)[:, 0].sum())


def _inertia(truth: Truth) -> np.ndarray:
    """|wrench| (6 n_bodies, n_v) that a unit of each acceleration takes, about the bodies' origins."""
    columns = []
    for row in truth.virtual:
        flat: list[float] = []
        for body, w in zip(truth.bodies, row, strict=True):
            force = bodies.scale(body.mass, w.at(body.arm))
            moment = bodies.add(bodies.times(body.inertia, w.angular), bodies.cross(body.arm, force))
            flat += [abs(float(x)) for x in (*force, *moment)]
        columns.append(flat)
    return np.array(columns).T.reshape(6 * len(truth.bodies), len(truth.virtual))


def _unbalanced(bench: Bench, truth: Truth, a: np.ndarray, wrenches: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Force and moment about its origin that each body lacks (6 n_bodies,), and the size of the terms."""
    rates = truth.body_rates([truth.mp.mpf(float(x)) for x in a])
    total, size = np.zeros((len(truth.bodies), 6)), np.zeros((len(truth.bodies), 6))

    def take(body: int, force: list[Number], moment: list[Number], arm: list[Number]) -> None:
        whole = numbers([*force, *bodies.add(moment, bodies.cross(arm, force))])
        total[body] += whole
        parts = np.abs(whole).reshape(2, 3)
        size[body] += np.repeat(parts.max(axis=1), 3)  # a vector turned from other axes is rounded as a whole

    for k, (body, rate, w) in enumerate(zip(truth.bodies, rates, truth.twists, strict=True)):
        acceleration = bodies.add(rate.at(body.arm), bodies.cross(w.angular, bodies.cross(w.angular, body.arm)))
        spin = bodies.times(body.inertia, w.angular)
        moment = bodies.add(bodies.times(body.inertia, rate.angular), bodies.cross(w.angular, spin))
        take(k, bodies.scale(body.mass, acceleration), moment, body.arm)
        take(k, bodies.scale(-body.mass, truth.gravity), [truth.zero] * 3, body.arm)
    for body_index, arm, force, torque in truth.marker_loads():
        take(body_index, bodies.scale(-1, force), bodies.scale(-1, torque), arm)
    along = _along(truth, a)
    for spec, wrench in zip(bench.mechanism.joints, wrenches, strict=True):
        point = placed(truth, spec.successor, f"{spec.name} S").position
        many = [truth.mp.mpf(float(x)) for x in wrench]
        if spec.coordinates and spec.coordinates[0] in along:
            axis = [row[2] for row in placed(truth, spec.predecessor, f"{spec.name} P").rotation]
            own = bodies.scale(along[spec.coordinates[0]], axis)
            many = bodies.add(
                many, [*[truth.zero] * 3, *own] if isinstance(spec.joint, TURNING) else [*own, *[truth.zero] * 3]
            )
        for end, sign in ((spec.successor, -1), (spec.predecessor, 1)):
            if end.body != GROUND:
                arm = bodies.sub(point, truth.here[end.body].position)
                take(end.body, bodies.scale(sign, many[:3]), bodies.scale(sign, many[3:]), arm)
    return total.ravel(), _carried(truth, size).ravel()


def _carried(truth: Truth, size: np.ndarray) -> np.ndarray:
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
    many = [truth.mp.mpf(float(x)) for x in a]
    for name, inertia in truth.drives:
        if name in truth.system.kinematics.velocity_labels:
            bend = many[truth.system.kinematics.velocity_labels.index(name)]
        else:
            k = truth.system.kinematics.loop_coordinates.names.index(name)
            bend = truth.bend(truth.measured, lambda s: truth.later(s, many))[k]
        total[name] = total.get(name, truth.zero) - inertia * bend
    return total
