"""Stage verification, check joints: bodies stand and move as their joints say, in the tree and where loops are cut."""

from __future__ import annotations

from functools import partial

import numpy as np

from ..base import algebra
from ..describe.mechanism import JointSpec
from ..frames import GROUND, Marker
from ..joints import Prismatic, Revolute
from . import bodies
from .bench import Bench
from .comparison import Comparison
from .finding import Finding
from .rounding_sizes import UNIT
from .truth import Truth

PARTS = ("x", "y", "z", *["rotation"] * 9)  #: of a relative pose


def check(bench: Bench) -> list[Finding]:
    """Rotations, placements at the joints, relative velocities."""
    return [_rigid(bench), _joints(bench), _freedoms(bench)]


def _rigid(bench: Bench) -> Finding:
    """R^T R = 1 and det R = 1 for every body."""
    check = "poses: rotation matrices are orthonormal"
    if not bench.layout.n_bodies:
        return Finding.skipped(check, "there are no bodies")
    found = Comparison(check)
    bounds = bench.bounds("poses", lambda: bench.terms.poses)[1]
    for k, case in enumerate(bench.cases):
        poses = bench.call("poses", case)
        error = 8.0 * bounds[:, k].reshape(-1, 4, 4)[:, :3, :3].max(axis=(1, 2)) + 8.0 * UNIT
        R = poses[:, :3, :3]
        gap = np.abs(np.einsum("bij,bik->bjk", R, R) - np.eye(3)).max(axis=(1, 2))
        gap = np.maximum(gap, np.abs(np.linalg.det(R) - 1.0))
        found.add(k, gap, error, 1.0, bench.layout.bodies)
    return found.finding()


def placed(truth: Truth, marker: Marker, name: str) -> bodies.Pose:
    """A marker in ground axes, from the pose of its body."""
    frame = marker.frame
    flat = truth.system.evaluate(
        f"marker {name}", lambda: [*frame.position, *(x for row in frame.rotation for x in row)], truth.values
    )
    position, rotation = flat[:3], [flat[3:6], flat[6:9], flat[9:12]]
    if marker.body == GROUND:
        return bodies.Pose(rotation, position)
    body = truth.here[marker.body]
    return bodies.Pose(
        bodies.product(body.rotation, rotation), bodies.add(body.position, bodies.times(body.rotation, position))
    )


def _joints(bench: Bench) -> Finding:
    """At every joint the successor stands, seen from the predecessor, where the joint's coordinates say.

    Joints of the tree and cut ones alike, which tells whether loops have all the equations they need; joints without
    coordinates by their own equations.
    """
    check = "joints: poses match their coordinates"
    if not bench.mechanism.joints:
        return Finding.skipped(check, "there are no joints")
    found, graph = Comparison(check), bench.kinematics.graph
    cut = bench.kinematics.loop_coordinates
    limits = bench.bounds("poses", lambda: bench.terms.poses)[1]
    held = (
        bench.bounds("constraints", lambda: bench.terms.constraints)[1]
        if bench.terms.constraints
        else np.zeros((0, len(bench.cases)))
    )
    for k, truth in enumerate(bench.truths):
        measured = dict(zip(cut.names, truth.measured(truth.values), strict=True)) if cut.names else {}
        gaps, labels = [], []
        for spec in bench.mechanism.joints:
            if not spec.joint.coordinates and spec.joint.role == "loop":
                continue
            outer = placed(truth, spec.predecessor, f"{spec.name} P")
            inner = placed(truth, spec.successor, f"{spec.name} S")
            symbols = [graph.symbol(name) for name in spec.coordinates]
            rotation, position = spec.joint.pose(graph, symbols)
            values = truth.values | {n: measured[n] for n in spec.coordinates if n in measured}
            parts = [*position, *(x for row in rotation for x in row)]
            flat = truth.system.evaluate(f"pose {spec.name}", partial(list, parts), values)
            back = bodies.transpose(outer.rotation)
            turn = bodies.product(back, inner.rotation)
            place = bodies.times(back, bodies.sub(inner.position, outer.position))
            own = [*place, *(x for row in turn for x in row)]
            gaps += [float(x - y) for x, y in zip(own, flat, strict=True)]
            labels += [f"{spec.name} {what}" for what in PARTS]
            plain = _textbook(spec, truth)
            if plain is not None:
                flat = [*plain.position, *(x for row in plain.rotation for x in row)]
                gaps += [float(x - y) for x, y in zip(own, flat, strict=True)]
                labels += [f"{spec.name} {what}" for what in PARTS]
        C = bench.module.kernels.constraint_jacobian(
            truth.case.q, p=truth.case.p, u=truth.case.u, t=truth.case.t, rows="all"
        )
        moved = float(np.abs(algebra.pinv(C)).sum(axis=1).max(initial=0.0)) if C.size else 0.0
        length = max(1.0, bench.layout.length)
        rounding = float(held[:, k].max(initial=0.0)) + UNIT * float(np.abs(truth.case.q).max(initial=0.0)) * float(
            np.abs(C).max(initial=0.0)
        )
        limit = 8.0 * length * (float(limits[:, k].max(initial=0.0)) + UNIT + (1.0 + moved) * rounding)
        found.add(k, gaps, limit, 1.0, labels)
    return found.finding()


def _textbook(spec: JointSpec, truth: Truth) -> bodies.Pose | None:
    """Joints of one degree, written out once more: S turned by q about z, or shifted by q along z, in P."""
    if not isinstance(spec.joint, Revolute | Prismatic) or spec.coordinates[0] not in truth.values:
        return None
    mp, q, o = truth.mp, truth.values[spec.coordinates[0]], truth.zero
    one = mp.mpf(1)
    if isinstance(spec.joint, Prismatic):
        return bodies.Pose([[one, o, o], [o, one, o], [o, o, one]], [o, o, q])
    c, s = mp.cos(q), mp.sin(q)
    return bodies.Pose([[c, -s, o], [s, c, o], [o, o, one]], [o, o, o])


def _freedoms(bench: Bench) -> Finding:
    """In a unit of one velocity, and q' = N v, the successor moves by the joint's column of it, all else at rest.

    An angular velocity of a joint in Euler parameters is the relative one, in the successor's axes.
    """
    check = "joints: relative velocities"
    if not bench.mechanism.joints or bench.mechanism.bare:
        return Finding.skipped(check, "there are no joints")
    found, graph = Comparison(check), bench.kinematics.graph
    limits = bench.bounds("poses", lambda: bench.terms.poses)[1]
    names = bench.layout.v
    for k, truth in enumerate(bench.truths):
        gaps, labels = [], []
        for spec in (bench.mechanism.joints[b.joint] for b in bench.kinematics.topology.branches):
            columns = spec.joint.subspace(graph, [graph.symbol(name) for name in spec.coordinates])
            inner = placed(truth, spec.successor, f"{spec.name} S")
            for name, (angular, linear) in zip(spec.velocities, columns, strict=True):
                flat = truth.system.evaluate(f"column {name}", lambda a=angular, l=linear: [*a, *l], truth.values)  # type: ignore[misc]
                turn, shift = (bodies.times(inner.rotation, part) for part in (flat[:3], flat[3:]))
                own = _relative(truth, spec, names.index(name), inner)
                gaps += [float(x - y) for x, y in zip((*own.angular, *own.linear), (*turn, *shift), strict=True)]
                labels += [f"{name} {what}" for what in ("turning", "turning", "turning", "moving", "moving", "moving")]
        limit = 64.0 * (float(limits[:, k].max(initial=0.0)) + UNIT) * max(1.0, bench.layout.length)
        found.add(k, gaps, limit, 1.0, labels)
    return found.finding()


def _relative(truth: Truth, spec: JointSpec, j: int, inner: bodies.Pose) -> bodies.Twist:
    """Twist of S relative to P at S, ground axes, in a unit of velocity j."""
    ends = []
    for marker in (spec.successor, spec.predecessor):
        if marker.body == GROUND:
            ends.append(bodies.Twist([truth.zero] * 3, [truth.zero] * 3))
            continue
        w = truth.virtual[j][marker.body]
        ends.append(bodies.Twist(w.angular, w.at(bodies.sub(inner.position, truth.here[marker.body].position))))
    s, p = ends
    return bodies.Twist(bodies.sub(s.angular, p.angular), bodies.sub(s.linear, p.linear))
