"""The NumPy target against the C target and the evaluator, one state and batches."""

import types

import numpy as np
import pytest

from eomgen.emit import emit_numpy


def load(system, **options):
    """The emitted module, its relative imports resolved within eomgen."""
    text = emit_numpy(system.program(**options))["_core.py"]
    module = types.ModuleType("eomgen._emitted")
    module.__package__ = "eomgen"
    exec(compile(text, "_core.py", "exec"), module.__dict__)  # noqa: S102
    return module


def cases(systems):
    return [
        systems.chain(3),
        systems.chain(5, [-1, 0, 0, 2, 2], limits=systems.Limits(unrolled=0, statements=30, jacobian_nodes=0)),
        systems.slider_crank(driven=True, name="crank_t", limits=systems.Limits(statements=25)),
        systems.slider_crank(copies=2, name="crank_2"),
    ]


@pytest.mark.parametrize("k", range(4))
def test_every_kernel_equals_the_c_target(systems, compiled, k):
    system = cases(systems)[k]
    library, core = compiled(system), load(system).core
    assert core.names == tuple(core.layout.metadata["kernels"])
    context = core.context(system.p, system.u)
    rng = np.random.default_rng(2)
    x = np.concatenate([system.q, rng.uniform(-1.0, 1.0, system.n)])
    batch = x[:, None] + 0.01 * rng.standard_normal((2 * system.n, 3))
    inputs = {"rhs": batch, "jacobian": library_batch(library, "project", batch)}
    for name, entry in library.entries.items():
        states = inputs.get(name, batch)
        if name == "kinematics":
            i = list(system.terms.preferred)
            states = np.vstack([states[i], states[[system.n + j for j in i]], states[i], states[: system.n]])
        elif entry.n_in != 2 * system.n:
            states = np.vstack([states] * (1 + entry.n_in // len(states)))[: entry.n_in]
        call = core.timed(name, context, (entry.n_out,), failing)
        expected = library_batch(library, name, states)
        scale = max(1.0, np.abs(expected).max(initial=0.0))
        if entry.n_in and entry.n_out:
            np.testing.assert_allclose(call(0.3, states), expected, rtol=1e-10, atol=1e-11 * scale, err_msg=name)
        one = call(0.3, states[:, 0])
        np.testing.assert_allclose(one, expected[:, 0], rtol=1e-10, atol=1e-11 * scale, err_msg=name)


def failing(name, status, t, x):
    raise AssertionError(f"{name} failed with status {status} at {t}, {x}")


def library_batch(library, name, states):
    return np.array([library.fine(name, column, 0.3) for column in states.T]).T


def test_straight_line_blocks_equal_the_evaluator_in_the_last_place(systems):
    system = systems.chain(4, [-1, 0, 0, 2])
    module = load(system)
    c = module.precompute(system.p)
    rng = np.random.default_rng(4)
    x = rng.uniform(-2.0, 2.0, (12, 5))
    state = {"q": x[:4], "v": x[4:8], "a": x[8:]}
    values = system.values(t=0.2, **state)
    from eomgen.graph.evaluate import evaluate

    for block, field, n in (("bias", "bias", 8), ("inverse_dynamics", "inverse_dynamics", 12), ("poses", "poses", 4)):
        expected = np.array([np.broadcast_to(y, 5) for y in evaluate(getattr(system.terms, field), values)])
        out = module.BLOCKS[block](0.2, x[:n], system.u, c)
        np.testing.assert_allclose(out, expected, rtol=4e-15, atol=4e-15 * np.abs(expected).max())


def test_a_singular_mass_matrix_shows_as_nan_in_its_column_only(systems):
    system = systems.chain(2)
    module = load(system)
    c = module.precompute([9.81, 0.0, 0.4])
    with np.errstate(all="ignore"):
        assert np.isnan(module.BLOCKS["rhs"](0.0, np.zeros(4), system.u, c)).all()
    heavy = module.precompute(system.p)
    assert np.isfinite(module.BLOCKS["rhs"](0.0, np.zeros((4, 2)), system.u, heavy)).all()


def test_time_zero_divides_as_in_c(systems):
    """1/t at t = 0 is an infinity, not a Python exception."""
    g = systems.Graph()
    system = systems.lagrangian_system(
        g, "clock", ["x"], {}, {}, lambda q, v: (v[0] * v[0] / 2, g.zero), outputs=lambda q, v, a: [1.0 / g.symbol("t")]
    )
    with np.errstate(all="ignore"):
        assert np.isinf(load(system).BLOCKS["outputs"](0.0, np.zeros(2), system.u, np.empty(0))).all()
