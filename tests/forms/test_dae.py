"""The differential-algebraic form: consistent values, exact Jacobian, and IDA's solution against our trajectories."""

from __future__ import annotations

import sys
from typing import Any

import judges
import models
import numpy as np
import pytest

from eomgen.errors import MissingDependencyError, SimulationError, UsageError


@pytest.mark.parametrize("name", ["double_pendulum", "slider_crank", "skewed_four_bar", "rolling_disc"])
def test_consistent_values_leave_no_residual_and_the_jacobian_is_exact(name: str) -> None:
    mod = models.build(name).compile(target="numpy")
    form = mod.dae
    x = judges.random_states(mod, 3, 1)[0]
    y, yp = form.initial(x)
    assert len(form.y_names) == form.n_y == mod.n_x + mod.n_c + len(mod.constraints(x[: mod.n_q]))
    assert np.abs(form.residual(0.0, y, yp)).max() <= 1e-11 * np.abs(yp).max()
    q, v, a = x[: mod.n_q], x[mod.n_q :], yp[mod.n_q : mod.n_x]
    l = y[mod.n_x : mod.n_x + mod.n_c]
    C_q = mod.constraint_jacobian(q)
    assert np.abs(mod.mass_matrix(q) @ a + mod.bias(0.0, x) + C_q.T @ l).max() <= 1e-10 * max(
        1.0, np.abs(l).max(initial=0)
    )
    random = np.random.default_rng(1)
    y, yp, cj = y + 0.02 * random.normal(size=form.n_y), random.normal(size=form.n_y), 3.7
    J = form.jacobian(0.2, y, yp, cj)

    def moved(columns: np.ndarray) -> np.ndarray:
        return np.stack([form.residual(0.2, c[: form.n_y], c[form.n_y :]) for c in columns.T], axis=1)

    both = np.concatenate([y, yp])
    numeric = np.stack(
        [judges.first(moved, both, np.concatenate([e, cj * e]), h=1e-3, size=1.0) for e in np.eye(form.n_y)], axis=1
    )
    assert np.abs(J - numeric).max() <= 1e-8 * np.abs(J).max()
    assert v.shape == a.shape


def test_compiled_residual_and_jacobian_equal_those_in_numpy() -> None:
    mod, twin = (models.build("slider_crank").compile(target=target) for target in ("cython", "numpy"))
    random = np.random.default_rng(2)
    y, yp = random.normal(size=(2, mod.dae.n_y))
    out, res = np.empty((mod.dae.n_y, mod.dae.n_y)), np.empty(mod.dae.n_y)
    mod.dae.residual(0.1, y, yp, res)
    np.testing.assert_allclose(res, twin.dae.residual(0.1, y, yp), rtol=1e-12, atol=1e-12)
    mod.dae.jacobian(0.1, y, yp, 2.5, out)
    np.testing.assert_allclose(out, twin.dae.jacobian(0.1, y, yp, 2.5), rtol=1e-12, atol=1e-11)
    with pytest.raises(UsageError, match=r"y must have shape \(10,\)"):
        mod.dae.residual(0.0, y[:3], yp)


@pytest.mark.parametrize(
    ("name", "end", "first", "last"),
    [("slider_crank", 0.5, 1e-5, 1e-7), ("four_bar", 1.0, 1e-4, 1e-6), ("andrews_squeezer", 0.03, 1e-4, 1e-6)],
)
def test_ida_finds_the_trajectories_of_embedding(name: str, end: float, first: float, last: float) -> None:
    """A real solver of differential-algebraic equations on F alone: the difference falls with its tolerance."""
    pytest.importorskip("sksundae")
    mod = models.build(name).compile(target="cython" if name == "andrews_squeezer" else "numpy")
    times = np.linspace(0.0, end, 13)
    ours = mod.simulate((0.0, end), t_eval=times, rtol=1e-10, atol=1e-12)
    assert np.ptp(ours.x, axis=1).max() > 1.0
    errors = []
    for rtol in (1e-7, 1e-9):
        theirs = mod.dae.solve((0.0, end), t_eval=times, rtol=rtol, atol=1e-2 * rtol)
        assert theirs.metadata["method"] == "IDA"
        np.testing.assert_array_equal(theirs.t, times)
        errors.append(np.abs(theirs.x - ours.x).max() / np.abs(ours.x).max())
    assert errors[0] <= first
    assert errors[1] <= min(last, 0.3 * errors[0])


def test_ida_with_inputs_events_of_time_and_nonholonomic_rows() -> None:
    pytest.importorskip("sksundae")
    mod = models.build("rolling_disc").compile(target="numpy")
    ours = mod.simulate((0.0, 0.3), rtol=1e-10, atol=1e-12)
    theirs = mod.dae.solve((0.0, 0.3), rtol=1e-8, atol=1e-10)
    assert theirs.t[-1] == 0.3
    assert len(theirs.t) > 5
    assert np.abs(theirs.x[:, -1] - ours.x[:, -1]).max() <= 1e-5 * np.abs(ours.x).max()
    powered = models.build("two_link_manipulator").compile(target="numpy")
    name = powered.u_names[0]
    push = {name: lambda t, x: 0.5 * np.sin(3 * t)}
    ours, theirs = powered.simulate((0.0, 0.5), inputs=push, rtol=1e-10), powered.dae.solve((0.0, 0.5), inputs=push)
    assert np.abs(theirs.x[:, -1] - ours.x[:, -1]).max() <= 1e-5 * np.abs(ours.x).max()
    with pytest.raises(SimulationError, match="IDA stopped"):
        powered.dae.solve((0.0, 0.5), t_eval=[0.25, 0.5], max_num_steps=2)


def test_without_the_binding_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sksundae", None)
    monkeypatch.setitem(sys.modules, "sksundae.ida", None)
    mod: Any = models.build("pendulum").compile(target="numpy")
    with pytest.raises(MissingDependencyError, match="dae.solve needs sksundae: pip install scikit-sundae"):
        mod.dae.solve((0.0, 0.1))
