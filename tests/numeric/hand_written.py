"""Two mechanisms written by hand in NumPy, as an emitted NumPy module would offer them.

Slider-crank in three coordinates: absolute angles theta of the crank and beta of the rod from +x, position s of the
slider on the line y = e + a sin(w t); the two loop rows close the rod's tip on the slider.  Uniform links.
Pendulum: one angle theta from the downward vertical, a point mass.
"""

import numpy as np

CRANK_PARAMETERS = {
    "l1": 0.153,
    "l2": 0.306,
    "m1": 0.038,
    "m2": 0.038,
    "m3": 0.076,
    "J1": 7.4e-05,
    "J2": 0.00059,
    "g": 9.81,
    "e": 0.0,
    "a": 0.0,
    "w": 0.0,
}
L = 0.3  # length scale


def crank_position(t, q, c, copies=1):
    """C (m, ...), C_q (m, 3, ...); the first row appears `copies` times."""
    l1, l2, e, a, w = c[0], c[1], c[8], c[9], c[10]
    theta, beta, s = q
    zero = np.zeros_like(theta)
    C = [l1 * np.cos(theta) + l2 * np.cos(beta) - s, l1 * np.sin(theta) + l2 * np.sin(beta) - e - a * np.sin(w * t)]
    C_q = [
        [-l1 * np.sin(theta), -l2 * np.sin(beta), zero - 1.0],
        [l1 * np.cos(theta), l2 * np.cos(beta), zero],
    ]
    return np.array(C + C[:1] * (copies - 1)), np.array(C_q + C_q[:1] * (copies - 1))


def crank_rate(t, q, c, copies=1):
    a, w = c[9], c[10]
    zero = np.zeros_like(q[0])
    C_t = [zero, zero - a * w * np.cos(w * t)]
    return np.array(C_t + C_t[:1] * (copies - 1))


def crank_gamma(t, q, v, c, copies=1):
    l1, l2, a, w = c[0], c[1], c[9], c[10]
    (theta, beta, _), (td, bd, _) = q, v
    gamma = [
        -l1 * np.cos(theta) * td**2 - l2 * np.cos(beta) * bd**2,
        -l1 * np.sin(theta) * td**2 - l2 * np.sin(beta) * bd**2 + a * w**2 * np.sin(w * t),
    ]
    return np.array(gamma + gamma[:1] * (copies - 1))


def crank_mass(q, c):
    l1, l2, m1, m2, m3, J1, J2 = c[:7]
    zero = np.zeros_like(q[0])
    k = m2 * l1 * l2 / 2 * np.cos(q[0] - q[1])
    return np.array(
        [
            [zero + J1 + m1 * l1**2 / 4 + m2 * l1**2, k, zero],
            [k, zero + J2 + m2 * l2**2 / 4, zero],
            [zero, zero, zero + m3],
        ]
    )


def crank_bias(q, v, u, c):
    l1, l2, m1, m2, g = c[0], c[1], c[2], c[3], c[7]
    k = m2 * l1 * l2 / 2 * np.sin(q[0] - q[1])
    return np.array(
        [
            k * v[1] ** 2 + (m1 / 2 + m2) * g * l1 * np.cos(q[0]) - u[0],
            -k * v[0] ** 2 + m2 * g * l2 / 2 * np.cos(q[1]),
            0.0 * v[2] - u[1],
        ]
    )


def crank_energy(q, v, c):
    l1, l2, m1, m2, g = c[0], c[1], c[2], c[3], c[7]
    T = 0.5 * np.einsum("i...,ij...,j...->...", v, crank_mass(q, c), v)
    return np.array([T, (m1 / 2 + m2) * g * l1 * np.sin(q[0]) + m2 * g * l2 / 2 * np.sin(q[1])])


def crank_blocks(copies=1):
    """Blocks of the slider-crank; functions f(t, x, u, c) -> (n_out, ...)."""
    tail = np.shape

    def flat(a, x):
        return a.reshape(-1, *tail(x)[1:])

    def position(t, x, u, c):
        C, C_q = crank_position(t, x, c, copies)
        return np.concatenate([C, flat(C_q, x)])

    def terms(t, x, u, c):
        q, v = x[:3], x[3:]
        M = crank_mass(q, c)
        lower = M[np.tril_indices(3)]
        C_q = crank_position(t, q, c, copies)[1]
        return np.concatenate([lower, crank_bias(q, v, u, c), flat(C_q, x), crank_gamma(t, q, v, c, copies)])

    def residuals(t, x, u, c):
        q, v, a, lam = x[:3], x[3:6], x[6:9], x[9:]

        def r1(q, v):
            C_q = crank_position(t, q, c, copies)[1]
            return crank_mass(q, c) @ a + crank_bias(q, v, u, c) + C_q.T @ lam

        def r2(q, v):
            return crank_position(t, q, c, copies)[1] @ a + crank_gamma(t, q, v, c, copies)

        def r3(q):
            return crank_position(t, q, c, copies)[1] @ v + crank_rate(t, q, c, copies)

        parts = [
            complex_step(lambda z: r1(z, v), q),
            complex_step(lambda z: r1(q, z), v),
            complex_step(lambda z: r2(z, v), q),
            complex_step(lambda z: r2(q, z), v),
            complex_step(r3, q),
        ]
        return np.concatenate([p.ravel() for p in parts])

    blocks = {
        "position": position,
        "rate": lambda t, x, u, c: crank_rate(t, x, c, copies),
        "terms": terms,
        "residual_jacobian": residuals,
        "mass_matrix": lambda t, x, u, c: flat(crank_mass(x, c), x),
        "bias": lambda t, x, u, c: crank_bias(x[:3], x[3:], u, c),
        "inverse_dynamics": lambda t, x, u, c: (
            np.einsum("ij...,j...->i...", crank_mass(x[:3], c), x[6:]) + crank_bias(x[:3], x[3:6], u, c)
        ),
        "energy": lambda t, x, u, c: crank_energy(x[:3], x[3:], c),
        "poses": crank_poses,
        # the pin angle of the slider against the rod, the coordinate of the joint that was cut
        "loop_coordinates": lambda t, x, u, c: np.array([-x[1], -x[4], -x[7]]),
        "loop_coordinate_jacobian": lambda t, x, u, c: np.array([0 * x[1], 0 * x[1] - 1.0, 0 * x[1]]),
        "accelerated_outputs": lambda t, x, u, c: np.array([c[0] * np.cos(x[0]), x[8]]),
        "scales": lambda t, x, u, c: np.array([1.0, 1.0, L] + [L] * (1 + copies)),
    }
    return blocks


def crank_poses(t, x, u, c):
    theta, beta, s = x
    l1 = c[0]
    zero, one = np.zeros_like(theta), np.ones_like(theta)

    def pose(angle, px, py):
        co, si = np.cos(angle), np.sin(angle)
        return [co, -si, zero, px, si, co, zero, py, zero, zero, one, zero, zero, zero, zero, one]

    slide = c[8] + c[9] * np.sin(c[10] * t)
    return np.array(
        pose(theta, zero, zero) + pose(beta, l1 * np.cos(theta), l1 * np.sin(theta)) + pose(zero, s, zero + slide)
    )


def complex_step(f, x):
    """Derivative of f at x (n,), columns by direction."""
    h = 1e-30
    return np.stack([f(x + 1j * h * np.eye(len(x))[i]).imag / h for i in range(len(x))], axis=-1)


def crank_metadata(copies=1, **changes):
    """The dictionary of model.json for the slider-crank."""
    m = 1 + copies
    labels = ["C.x", "C.y", "C.x again"][:m]
    p = dict(CRANK_PARAMETERS)
    data = {
        "abi": 1,
        "name": "slider_crank",
        "doc": "A planar slider-crank.",
        "method": "embedding",
        "target": "numpy",
        "q_names": ["theta", "beta", "s"],
        "v_names": ["theta_dot", "beta_dot", "s_dot"],
        "x_names": ["theta", "beta", "s", "theta_dot", "beta_dot", "s_dot"],
        "u_names": ["tau", "push"],
        "p_names": list(p),
        "y_names": ["pin_x", "slider_acceleration"],
        "body_names": ["crank", "rod", "slider"],
        "loop_names": ["psi"],
        "joint_names": ["A", "B", "D"],
        "loop_joint_names": ["C"],
        "constraint_labels": labels,
        "constraint_kinds": ["length"] * m,
        "coordinate_kinds": ["angle", "angle", "length"],
        "loop_kinds": ["angle"],
        "p_values": list(p.values()),
        "u_values": [0.0, 0.0],
        "units": {"theta": "rad", "beta": "rad", "s": "m", "psi": "rad", "tau": "N*m", "push": "N", "pin_x": "m"},
        "docs": {"l1": "crank length"},
        "n_q": 3,
        "n_v": 3,
        "n_x": 6,
        "n_u": 2,
        "n_p": len(p),
        "n_y": 2,
        "n_c": m,
        "n_dof": 1,
        "n_bodies": 3,
        "n_loop_coordinates": 1,
        "independent": [0],
        "independent_rows": [0, 1],
        "redundant_rows": list(range(2, m)),
        "q_reference": [0.0, 0.0, p["l1"] + p["l2"]],
        "initial": {"theta": 0.0, "theta_dot": 10.0},
        "length_scale": L,
        "simulation": {"end": 1.0, "method": "DOP853", "rtol": 1e-8, "atol": 1e-10},
        "operations": {"rhs": {"multiplications": 60, "additions": 40, "divisions": 5}},
        "kernels": {},
    }
    return data | changes


PENDULUM_PARAMETERS = {"l": 1.0, "m": 2.0, "g": 9.81, "d": 0.0}


def pendulum_blocks():
    """Blocks of the pendulum, rhs and jacobian straight-line as for a small tree."""

    def rhs(t, x, u, c):
        length, m, g, d = c[:4]
        return np.array([x[1], (u[0] - d * x[1]) / (m * length * length) - g / length * np.sin(x[0])])

    def jacobian(t, x, u, c):
        length, m, g, d = c[:4]
        return np.array([0 * x[0], 0 * x[0] + 1.0, -g / length * np.cos(x[0]), 0 * x[0] - d / (m * length * length)])

    def bias(t, x, u, c):
        length, m, g, d = c[:4]
        return np.array([m * g * length * np.sin(x[0]) + d * x[1] - u[0]])

    def energy(t, x, u, c):
        length, m, g, _ = c[:4]
        return np.array([0.5 * m * length**2 * x[1] ** 2, -m * g * length * np.cos(x[0])])

    def poses(t, x, u, c):
        co, si = np.cos(x[0] - np.pi / 2), np.sin(x[0] - np.pi / 2)
        zero, one = 0 * co, 0 * co + 1.0
        return np.array([co, -si, zero, zero, si, co, zero, zero, zero, zero, one, zero, zero, zero, zero, one])

    return {
        "rhs": rhs,
        "jacobian": jacobian,
        "mass_matrix": lambda t, x, u, c: np.array([0 * x[0] + c[1] * c[0] ** 2]),
        "bias": bias,
        "inverse_dynamics": lambda t, x, u, c: c[1] * c[0] ** 2 * x[2:] + bias(t, x[:2], u, c),
        "energy": energy,
        "poses": poses,
        "accelerated_outputs": lambda t, x, u, c: np.array([c[0] * np.sin(x[0]), x[2]]),
    }


def pendulum_metadata(**changes):
    """The dictionary of model.json for the pendulum."""
    p = PENDULUM_PARAMETERS
    return {
        "abi": 1,
        "name": "pendulum",
        "doc": "",
        "method": "lagrange",
        "target": "numpy",
        "q_names": ["theta"],
        "v_names": ["theta_dot"],
        "x_names": ["theta", "theta_dot"],
        "u_names": ["tau"],
        "p_names": list(p),
        "y_names": ["bob_x", "alpha"],
        "body_names": ["bob"],
        "loop_names": [],
        "joint_names": ["A"],
        "loop_joint_names": [],
        "constraint_labels": [],
        "constraint_kinds": [],
        "coordinate_kinds": ["angle"],
        "p_values": list(p.values()),
        "u_values": [0.0],
        "units": {"theta": "rad", "l": "m"},
        "docs": {},
        "n_q": 1,
        "n_v": 1,
        "n_x": 2,
        "n_u": 1,
        "n_p": 4,
        "n_y": 2,
        "n_c": 0,
        "n_dof": 1,
        "n_bodies": 1,
        "n_loop_coordinates": 0,
        "independent": [0],
        "independent_rows": [],
        "redundant_rows": [],
        "q_reference": [0.5],
        "initial": {"theta": 0.5},
        "length_scale": 1.0,
        "simulation": {"end": 5.0, "method": "DOP853", "rtol": 1e-8, "atol": 1e-10},
        "operations": {},
        "kernels": {},
    } | changes
