"""Derivatives by inputs and parameters in C against central differences of ``rhs`` in C, and against NumPy."""

import numpy as np
import pytest

from eomgen.emit import emit_numpy

CASES = {
    "crank": lambda s: s.slider_crank(name="crank_p"),
    "driven": lambda s: s.slider_crank(driven=True, name="crank_pt"),
    "redundant": lambda s: s.slider_crank(copies=2, name="crank_p2"),
    "by direction": lambda s: s.slider_crank(name="crank_pd", driven=True, limits=s.Limits(jacobian_nodes=0)),
    "small tree": lambda s: s.chain(3, name="chain_p"),
    "large tree": lambda s: s.chain(3, name="chain_pl", limits=s.Limits(unrolled=2)),
}
KERNELS = ["rhs", "project", "parameter_jacobian", "input_jacobian", "assembly_jacobian"]
KERNELS += ["constraints", "velocity_constraints", "loop_coordinates"]


def differences(library, system, x, t, what):
    """d rhs by parameters or inputs, fourth order."""
    values = np.array(system.p if what == "parameter" else system.u)

    def rhs(changed):
        if what == "parameter":
            library.set_parameters(changed)
        else:
            library.u[: len(changed)] = changed
        return library.fine("rhs", x, t)

    columns = []
    for k, value in enumerate(values):
        h = 1e-3 * abs(value)
        step = h * np.eye(len(values))[k]
        near, far = (rhs(values + j * step) - rhs(values - j * step) for j in (1, 2))
        columns.append((8 * near - far) / (12 * h))
    rhs(values)
    return np.array(columns).T


@pytest.mark.parametrize("case", CASES)
def test_derivatives_of_the_right_hand_side(case, systems, compiled):
    from eomgen.api.module import Module
    from eomgen.compilation.numpy_module import load_numpy

    system = CASES[case](systems)
    library = compiled(system, kernels=KERNELS)
    twin = Module(load_numpy(emit_numpy(system.program(kernels=KERNELS)), f"twin_{system.metadata['name']}"))
    n = system.n
    for t, speed in ((0.0, 0.0), (0.4, 6.0)):
        x = np.concatenate([system.q, speed * np.array([1.0, -0.4, 0.1])])
        x = library.fine("project", x, t) if "project" in library.entries else x
        for what in ("parameter", "input"):
            found = library.fine(f"{what}_jacobian", x, t).reshape(2 * n, -1)
            expected = differences(library, system, x, t, what)
            assert np.abs(expected).max() > 0.1
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 * np.abs(expected).max())
            other = getattr(twin, f"{what}_jacobian")(t, x)
            np.testing.assert_allclose(found, other, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("case", ["crank", "driven", "redundant"])
def test_the_derivatives_of_what_assembly_holds(case, systems, compiled):
    """Straight-line, by central differences of the kernels it is the derivative of."""
    system = CASES[case](systems)
    library, n, t = compiled(system, kernels=KERNELS), system.n, 0.3
    x = np.random.default_rng(2).uniform(-1.0, 1.0, 2 * n)
    state = np.concatenate([x, system.u, system.p])

    def held(z):
        library.u[: len(system.u)] = z[2 * n : 2 * n + len(system.u)]
        library.set_parameters(z[2 * n + len(system.u) :])
        rows = [library.fine("constraints", z[:n], t), library.fine("velocity_constraints", z[: 2 * n], t)]
        loops = library.fine("loop_coordinates", [*z[: 2 * n], *np.zeros(n)], t)
        return np.concatenate([*rows, loops[: 2 * system.terms.n_loop_coordinates]])

    h = 1e-4
    expected = np.array([(held(state + h * e) - held(state - h * e)) / (2 * h) for e in np.eye(len(state))]).T
    held(state)
    found = library.fine("assembly_jacobian", x, t).reshape(expected.shape)
    assert np.abs(expected).max() > 0.1
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8)
