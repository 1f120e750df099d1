"""The Cython layer on the pendulum: every way to give and take arrays gives the same numbers, mistakes are named."""

from __future__ import annotations

import json
from decimal import Decimal
from types import ModuleType
from typing import Any

import numpy as np
import pytest

M, L, G = 2.0, 0.5, 9.81


def fail(name: str, status: int, t: float, x: object) -> None:
    """What the runtime hands to the layer: raises."""
    raise ArithmeticError(name, status, t, x)


def rhs(x: Any, tau: Any = 0.0, m: float = M, l: float = L, g: float = G) -> Any:
    theta, omega = x
    return np.array([omega, (tau - m * g * l * np.sin(theta)) / (m * l**2)])


@pytest.fixture
def f(core: ModuleType) -> Any:
    return core.timed("rhs", core.context(), (2,), fail)


def test_module_describes_the_model(core: ModuleType) -> None:
    assert json.loads(core.metadata)["name"] == "pendulum"
    assert core.names[:3] == ("rhs", "rhs_long", "mass_matrix")
    assert core.sizes == {"n_p": 3, "n_u": 1, "n_const": 5, "n_work": 2000}
    assert "rhs of pendulum" in repr(core.timed("rhs", core.context(), (2,), fail))


def test_context_holds_declared_values_unless_given(core: ModuleType) -> None:
    c = core.context()
    np.testing.assert_array_equal(c.p, [M, L, G])
    np.testing.assert_array_equal(c.u, [0.0])
    np.testing.assert_allclose(c.c, [M, L, G, M * L**2, M * G * L])
    p = np.array([1.0, 2.0, 3.0])
    c = core.context(p, [4])
    p[:] = 0  # a copy was taken
    np.testing.assert_allclose(c.c, [1, 2, 3, 4, 6])
    with pytest.raises(ValueError, match="read-only"):
        c.p[0] = 1
    with pytest.raises(KeyError, match=r"p must have shape \(3,\), not \(2,\)"):
        core.context([1, 2], None, KeyError)
    with pytest.raises(ValueError, match=r"status 1.*nan"):
        core.context([1.0, np.nan, 1.0])


X = np.array([0.3, 1.5])
STRIDED = np.zeros((2, 3))
STRIDED[:, 1] = X
LOCKED = X.copy()
LOCKED.flags.writeable = False
UNALIGNED = np.frombuffer(b"\0" + X.tobytes(), dtype=np.uint8)[1:].view(float)


@pytest.mark.parametrize(
    "x",
    [X, LOCKED, STRIDED[:, 1], X[::-1].copy()[::-1], X.tolist(), tuple(X), X.astype(">f8"), UNALIGNED,
     X.astype(np.longdouble), X.astype(object), [Decimal("0.3"), 1.5]],
    ids=["plain", "read-only", "strided", "reversed", "list", "tuple", "swapped", "unaligned", "longdouble", "object",
         "decimal"],
)  # fmt: skip
def test_any_vector_of_real_numbers_is_taken(f: Any, x: Any) -> None:
    np.testing.assert_allclose(f(0.0, x), rhs(X), rtol=1e-14)


def test_narrow_types_are_widened(f: Any) -> None:
    np.testing.assert_allclose(f(0, X.astype(np.float32)), rhs(X.astype(np.float32).astype(float)), rtol=1e-14)
    np.testing.assert_allclose(f(0, np.array([1, 2])), rhs(np.array([1.0, 2.0])), rtol=1e-14)


@pytest.mark.parametrize("order", ["C", "F"])
def test_batches_are_columns(f: Any, order: Any) -> None:
    x = np.asarray(np.random.default_rng(1).normal(size=(2, 17)), order=order)
    result = f(0.0, x)
    np.testing.assert_allclose(result, rhs(x), rtol=1e-14)
    assert result.flags.c_contiguous
    np.testing.assert_allclose(f(0.0, x[:, ::3]), rhs(x[:, ::3]), rtol=1e-14)
    assert f(0.0, x[:, :0]).shape == (2, 0)
    assert f(0.0, x[:, :1]).shape == (2, 1)


def test_batches_may_have_times_and_inputs_of_their_own(core: ModuleType) -> None:
    x = np.random.default_rng(2).normal(size=(2, 5))
    f = core.timed("rhs", core.context(), (2,), fail)
    tau = np.linspace(0, 1, 5)
    np.testing.assert_allclose(f(0.0, x, u=tau[None, :]), rhs(x, tau), rtol=1e-14)
    np.testing.assert_allclose(f(0.0, x, u=[3.0]), rhs(x, 3.0), rtol=1e-14)
    layout = core.timed("layout", core.context(), (3, 2), fail)
    np.testing.assert_allclose(layout(tau, x)[2, 1], 21 + 100 * tau + 1000 * x[0], rtol=1e-14)


def test_results_have_the_given_shape(core: ModuleType) -> None:
    f = core.timed("layout", core.context(), (3, 2), fail)
    expected = np.array([[0, 1], [10, 11], [20, 21]])
    np.testing.assert_array_equal(f(2.0, [1, 0]), expected + 1200)
    batch = f(0.0, np.array([[1.0, 2.0, 3.0], [0, 0, 0]]))
    assert batch.shape == (3, 2, 3)
    np.testing.assert_array_equal(batch[:, :, 1], expected + 2000)
    assert core.state("mass_matrix", core.context(), (1, 1), fail)([0.0]) == [[M * L**2]]
    assert core.state("empty", core.context(), (0,), fail)(np.empty(0)).shape == (0,)


def test_states_and_motions(core: ModuleType) -> None:
    energy = core.state("energy", core.context(), (2,), fail)
    np.testing.assert_allclose(energy(X), [0.5 * M * L**2 * X[1] ** 2, -M * G * L * np.cos(X[0])], rtol=1e-14)
    inverse = core.motion("inverse_dynamics", core.context(), (1,), fail)
    a = rhs(X, 0.7)[1]
    np.testing.assert_allclose(inverse(X[:1], X[1:], [a]), [0.7], rtol=1e-13)
    np.testing.assert_allclose(inverse([0.3], [1.5], [a], u=[0.7]), [0], atol=1e-13)
    x = np.random.default_rng(3).normal(size=(2, 4))
    np.testing.assert_allclose(inverse(x[:1], x[1:], rhs(x)[1:], t=1.0), np.zeros((1, 4)), atol=1e-13)
    with pytest.raises(ValueError, match=r"v of inverse_dynamics must have shape \(1,\) or \(1, 4\), not \(1, 3\)"):
        inverse(x[:1], x[1:, :3], x[:1])


def test_parameters_and_inputs_of_one_call(f: Any) -> None:
    np.testing.assert_allclose(f(0.0, X, p=[1, 2, 3]), rhs(X, 0, 1, 2, 3), rtol=1e-14)
    np.testing.assert_allclose(f(0.0, X, p=np.array([1, 9, 2, 9, 3, 9.0])[::2]), rhs(X, 0, 1, 2, 3), rtol=1e-14)
    np.testing.assert_allclose(f(0.0, X, [1, 2, 3], [4]), rhs(X, 4, 1, 2, 3), rtol=1e-14)
    np.testing.assert_allclose(f(0.0, X), rhs(X), rtol=1e-14)  # nothing was kept
    with pytest.raises(ValueError, match=r"p must have shape \(3,\), not \(1,\)"):
        f(0.0, X, p=[1])
    with pytest.raises(ValueError, match=r"u of rhs must have shape \(1,\) or \(1, k\), not \(2,\)"):
        f(0.0, X, u=[1, 2])
    with pytest.raises(ValueError, match="cannot be computed"):
        f(0.0, X, p=[1, np.inf, 1])


def test_results_go_into_out(f: Any) -> None:
    out = np.empty(2)
    assert f(0.0, X, out=out) is out
    np.testing.assert_allclose(out, rhs(X), rtol=1e-14)
    strided = np.zeros((2, 2))
    view = strided[:, 1]
    assert f(0.0, X, out=view) is view
    np.testing.assert_allclose(strided, np.column_stack([np.zeros(2), rhs(X)]), rtol=1e-14)
    x = np.random.default_rng(4).normal(size=(2, 6))
    for target in (np.empty((2, 6)), np.empty((2, 6), order="F")):
        assert f(0.0, x, out=target) is target
        np.testing.assert_allclose(target, rhs(x), rtol=1e-14)


def test_out_may_be_the_state_itself(f: Any) -> None:
    x = X.copy()
    np.testing.assert_allclose(f(0.0, x, out=x), rhs(X), rtol=1e-14)
    line = np.array([9.0, *X])
    f(0.0, line[1:], out=line[:2])
    np.testing.assert_allclose(line[:2], rhs(X), rtol=1e-14)
    batch = np.random.default_rng(5).normal(size=(2, 6))
    expected = rhs(batch)
    f(0.0, batch, out=batch)
    np.testing.assert_allclose(batch, expected, rtol=1e-14)


@pytest.mark.parametrize(
    ("out", "words"),
    [(np.empty(3), r"shape \(2,\), not float64 array of shape \(3,\)"), (np.empty(2, np.float32), "not float32 array"),
     (np.empty((2, 1)), r"of shape \(2, 1\)"), ([0.0, 0.0], "not list"), (LOCKED, "read-only")],
)  # fmt: skip
def test_out_that_does_not_fit_is_refused(f: Any, out: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        f(0.0, X.copy(), out=out)


@pytest.mark.parametrize(
    ("x", "words"),
    [
        ([1.0], r"x of rhs must have shape \(2,\) or \(2, k\), not \(1,\)"),
        (np.zeros((3, 2)), r"not \(3, 2\)"),
        (1.0, r"not \(\)"),
        (np.zeros((2, 1, 1)), r"not \(2, 1, 1\)"),
        ([1j, 0], r"real numbers, \(2,\) or \(2, k\), not \[1j, 0\]"),
        (["a", "b"], r"real numbers, \(2,\) or \(2, k\), not \['a'"),
        (np.zeros((2, 3)), r"t of rhs must be a number or have shape \(k,\), not \(2,\)"),
    ],
)
def test_states_that_do_not_fit_are_refused(core: ModuleType, x: Any, words: str) -> None:
    f = core.timed("rhs", core.context(), (2,), fail, error=LookupError)
    with pytest.raises(LookupError, match=words):
        f([0.0, 1.0] if "t of" in words else 0.0, x)


def test_factories_refuse_what_does_not_fit(core: ModuleType) -> None:
    with pytest.raises(ValueError, match="has no kernel 'lhs'; it has rhs, rhs_long"):
        core.timed("lhs", core.context(), (2,), fail)
    with pytest.raises(ValueError, match=r"shape \(3,\) does not hold the 2 numbers"):
        core.timed("rhs", core.context(), (3,), fail)


def test_failures_are_handed_on(core: ModuleType) -> None:
    f = core.timed("failing", core.context(), (2,), fail)
    np.testing.assert_array_equal(f(0.0, [1.0, 5.0]), [1, 5])
    for x in (np.array([2.0, 5.0]), [2.0, 5.0]):
        with pytest.raises(ArithmeticError) as raised:
            f(0.5, x)
        name, status, t, state = raised.value.args
        assert (name, status, t) == ("failing", 2, 0.5)
        np.testing.assert_array_equal(state, [2, 5])
    with pytest.raises(ArithmeticError) as raised:  # the first column that fails
        f([0.0, 1.0, 2.0], [[1.0, 3.0, 4.0], [5.0, 6.0, 7.0]])
    assert raised.value.args[1:3] == (2, 1.0)
    with pytest.raises(RuntimeError, match="status 2"):
        core.timed("failing", core.context(), (2,), lambda *args: None)(0.0, [2.0, 5.0])


def test_recoverable_failures_become_nan_where_wanted(core: ModuleType) -> None:
    f = core.timed("failing", core.context(), (2,), fail, nan=True)
    assert f.nan
    assert f.failure is None
    x, out = np.array([2.0, 5.0]), np.zeros(2)
    assert np.isnan(f(0.5, x, out=out)).all()
    x[:] = 0
    status, t, state = f.failure
    assert (status, t) == (2, 0.5)
    np.testing.assert_array_equal(state, [2, 5])
    f.failure = None
    batch = f(0.0, np.array([[0.5, 3.0, 0.25], [5.0, 6.0, 7.0]]))
    np.testing.assert_array_equal(batch, [[0.5, np.nan, 0.25], [5, np.nan, 7]])
    np.testing.assert_array_equal(f.failure[2], [3, 6])
    for fatal in ([200.0, 0.0], [[2.0, 200.0], [0.0, 0.0]]):
        with pytest.raises(ArithmeticError) as raised:
            f(0.0, np.array(fatal))
        assert raised.value.args[1] == -1
