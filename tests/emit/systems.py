"""Small systems written by hand on the graph, with everything the program stage takes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from eomgen.graph.core import Graph, cos, sin
from eomgen.graph.differentiate import gradient, jacobian, jvp
from eomgen.graph.evaluate import evaluate
from eomgen.program import Limits, SystemTerms, build_program


@dataclass
class System:
    """Terms, metadata and numbers of one system."""

    terms: SystemTerms
    metadata: dict
    p: np.ndarray
    u: np.ndarray
    q: np.ndarray  #: a configuration on the constraints, near enough
    limits: Limits = field(default_factory=Limits)

    @property
    def n(self):
        return self.terms.n_v

    def program(self, **options):
        return build_program(self.terms, self.metadata, limits=options.pop("limits", self.limits), **options)

    def values(self, q=(), v=(), a=(), t=0.0, multipliers=()):
        terms = self.terms
        pairs = [(terms.p, self.p), (terms.u, self.u), (terms.q, q), (terms.v, v), (terms.a, a)]
        pairs.append((terms.multipliers, multipliers))
        found = {terms.t: t}
        for names, numbers in pairs:
            found.update(zip(names, numbers, strict=False))
        return found

    def evaluate(self, field, **state):
        """A field of the terms as an array."""
        value = getattr(self.terms, field)
        shape = (len(value), len(value[0])) if value and isinstance(value[0], tuple) else (len(value),)
        flat = [y for row in value for y in row] if len(shape) == 2 else list(value)
        return np.array(evaluate(flat, self.values(**state)), dtype=float).reshape(shape)


def lagrangian_system(
    graph, name, q_names, parameters, inputs, energy, constraints=(), forces=None, outputs=None, **more
):
    """Terms from T(q, v), V(q) and constraint rows; symbols as the describe stage names them."""
    q = [graph.symbol(n) for n in q_names]
    v = [graph.symbol(n + "_dot") for n in q_names]
    a = [graph.symbol(n + "_ddot") for n in q_names]
    t = graph.symbol("t")
    T, V = energy(q, v)
    C = list(constraints(q, t)) if constraints else []
    n, m, zero = len(q), len(C), graph.zero
    Q = forces(q, v, t) if forces else [zero] * n
    momentum = gradient(T, v)
    motion = dict(zip([*q, *v], [*v, *a], strict=True))
    static = dict(zip([*q, *v], [*v, *[zero] * n], strict=True))
    inverse, bias = (
        [d - g + s - f for d, g, s, f in zip(jvp(momentum, w), gradient(T, q), gradient(V, q), Q, strict=True)]
        for w in (motion, static)
    )
    mass = jacobian(momentum, v)
    C_q = jacobian(C, q)
    C_t = jvp(C, {t: graph.one})
    velocity = jvp(C, {**dict(zip(q, v, strict=True)), t: graph.one})
    gamma = jvp(velocity, {**static, t: graph.one})
    y = outputs(q, v, a) if outputs else []
    loop = more.get("loop", lambda q: [])(q)
    rates = jvp(loop, dict(zip(q, v, strict=True)))
    L_q = jacobian(loop, q)
    n_dof = more.get("n_dof", n - m)
    terms = SystemTerms(
        graph=graph,
        t="t",
        q=tuple(q_names),
        v=tuple(n + "_dot" for n in q_names),
        a=tuple(n + "_ddot" for n in q_names),
        multipliers=tuple(f"lambda[{i}]" for i in range(m)),
        u=tuple(inputs),
        p=tuple(parameters),
        mass_matrix=tuple(tuple(mass.get((i, j), zero) for j in range(n)) for i in range(n)),
        bias=tuple(bias),
        inverse_dynamics=tuple(inverse),
        kinetic=T,
        potential=V,
        constraints=tuple(C),
        constraint_jacobian=tuple(tuple(C_q.get((i, j), zero) for j in range(n)) for i in range(m)),
        constraint_rate=tuple(C_t),
        velocity_constraints=tuple(velocity),
        gamma=tuple(gamma),
        poses=tuple(more.get("poses", lambda q: [])(q)),
        outputs=tuple(y),
        loop_coordinates=(*loop, *rates, *jvp(rates, motion)),
        loop_coordinate_jacobian=tuple(tuple(L_q.get((i, j), zero) for j in range(n)) for i in range(len(loop))),
        alignment=(),
        coordinate_scales=tuple(more.get("coordinate_scales", [graph.one] * n)),
        constraint_scales=tuple(more.get("constraint_scales", [graph.one] * m)),
        n_dof=n_dof,
        preferred=tuple(more.get("preferred", range(n_dof))),
        parent=tuple(more.get("parent", range(-1, n - 1))),
    )
    metadata = {
        "name": name,
        "doc": f"{name}, a test",
        "method": "lagrange",
        "q_names": list(terms.q),
        "v_names": list(terms.v),
        "x_names": [*terms.q, *terms.v],
        "u_names": list(inputs),
        "p_names": list(parameters),
        "y_names": [f"y{k}" for k in range(len(y))],
        "body_names": [f"body{k}" for k in range(len(terms.poses) // 16)],
        "constraint_labels": [f"row {k}" for k in range(m)],
        "constraint_kinds": ["length"] * m,
        "coordinate_kinds": list(more.get("kinds", ["angle"] * n)),
        "loop_names": [f"cut{k}" for k in range(len(loop))],
        "loop_kinds": ["angle"] * len(loop),
        "joint_names": [],
        "loop_joint_names": [],
        "independent_rows": list(range(n - n_dof)),
        "redundant_rows": list(range(n - n_dof, m)),
        "length_scale": float(more.get("length_scale", 1.0)),
        "q_reference": list(map(float, more.get("q_reference", [0.0] * n))),
        "initial": {},
        "guess": {},
        "simulation": {"end": 1.0, "method": "DOP853", "rtol": 1e-8, "atol": 1e-10},
        "p_values": list(parameters.values()),
        "u_values": list(inputs.values()),
        "units": {"l": "m"},
        "docs": {"l": 'a length, "quoted"??/ and */ awkward'},
        "independent": list(terms.preferred),
    }
    reference = np.array(more.get("q_reference", np.linspace(0.3, 0.9, n)), dtype=float)
    numbers = [np.array(list(d.values()), dtype=float) for d in (parameters, inputs)]
    return System(terms, metadata, *numbers, reference, more.get("limits", Limits()))


def pose(graph, angle, x, y):
    """Planar pose as 16 entries."""
    o, i, s, c = graph.zero, graph.one, sin(angle), cos(angle)
    return [c, -s, o, x, s, c, o, y, o, o, i, o, o, o, o, i]


def chain(links, parents=None, name="chain", **more):
    """A tree of planar pendula with relative angles, uniform links; link k hangs at the tip of parents[k]."""
    g = Graph()
    parents = list(range(-1, links - 1)) if parents is None else parents
    parameters = {"g": 9.81, "m": 0.7, "l": 0.4}
    gravity, mass, length = (g.symbol(s) for s in parameters)

    def bodies(q):
        angle, tip = [], []
        for k, parent in enumerate(parents):
            base = (g.zero, g.zero) if parent < 0 else tip[parent]
            angle.append(q[k] if parent < 0 else angle[parent] + q[k])
            tip.append((base[0] + length * sin(angle[k]), base[1] - length * cos(angle[k])))
        return angle, tip

    def energy(q, v):
        angle, tip = bodies(q)
        rates = dict(zip(q, v, strict=True))
        spin = jvp(angle, rates)
        T = V = g.zero
        for k in range(links):
            vx, vy = jvp(tip[k], rates)
            T = T + mass * (vx * vx + vy * vy) / 2 + mass * length * length / 12 * spin[k] * spin[k] / 2
            V = V + mass * gravity * tip[k][1]
        return T, V

    def outputs(q, v, a):
        tips = bodies(q)[1][-1]
        rates = jvp(tips, dict(zip(q, v, strict=True)))
        return [*tips, *jvp(rates, dict(zip([*q, *v], [*v, *a], strict=True)))]

    return lagrangian_system(
        g, name, [f"q{k}" for k in range(links)], parameters, {"tau": 0.3}, energy,
        forces=lambda q, v, t: [g.symbol("tau") * sin(t + 1.0)] + [-0.01 * w for w in v[1:]],
        outputs=outputs, parent=parents,
        poses=lambda q: [e for a, p in zip(*bodies(q), strict=True) for e in pose(g, a, *p)], **more,
    )  # fmt: skip


def slider_crank(copies=1, preferred=(0,), name="crank", driven=False, **more):
    """Slider-crank in absolute angles theta (crank), beta (rod) and the slider's position s; rows `copies` times."""
    g = Graph()
    parameters = {"g": 9.81, "l1": 0.1, "l2": 0.35, "m1": 1.0, "m2": 0.8, "m3": 0.5, "w": 1.0}
    gravity, l1, l2, m1, m2, m3, w = (g.symbol(s) for s in parameters)

    def energy(q, v):
        (th, be, _), (dth, dbe, ds) = q, v
        k = m2 * l1 * l2 / 2 * cos(th - be)
        T = (m1 * l1 * l1 / 3 + m2 * l1 * l1) * dth * dth / 2 + m2 * l2 * l2 / 3 * dbe * dbe / 2
        T = T + k * dth * dbe + m3 * ds * ds / 2
        return T, (m1 / 2 + m2) * gravity * l1 * sin(th) + m2 * gravity * l2 / 2 * sin(be)

    def constraints(q, t):
        th, be, s = q
        height = 0.02 * sin(w * t) if driven else g.zero
        rows = [l1 * cos(th) + l2 * cos(be) - s, l1 * sin(th) + l2 * sin(be) - height]
        return rows * copies + ([th - 2.0 * t] if more.get("spun") else [])

    L = g.constant(0.2)
    more = {"kinds": ["angle", "angle", "length"], "length_scale": 0.2, **more}
    theta = 0.3
    beta = -np.arcsin(0.1 * np.sin(theta) / 0.35)
    return lagrangian_system(
        g, name, ["theta", "beta", "s"], parameters, {"tau": 0.2}, energy, constraints,
        forces=lambda q, v, t: [g.symbol("tau") * cos(t), g.zero, -0.5 * v[2]],
        outputs=lambda q, v, a: [l1 * cos(q[0]), v[1] + a[2]] if more.get("accelerated", True) else [l1 * cos(q[0])],
        poses=lambda q: pose(g, q[0], l1, g.zero), loop=lambda q: [q[1] - q[0]],
        coordinate_scales=[g.one, g.one, L], constraint_scales=[L, L] * copies + [g.one] * ("spun" in more),
        preferred=preferred,
        q_reference=[theta, beta, 0.1 * np.cos(theta) + 0.35 * np.cos(beta)],
        **{"n_dof": 1, **more},
    )  # fmt: skip
