"""Device code compiled for the host, number by number beside the module without a compiler (NumPy).

The text is the one that NVRTC gets; only the words that a GPU has and a host lacks are defined away.
"""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest
from sweeps import OF_ALL_KINDS, part_of

import eomgen as eg
from eomgen.cuda_functions import cuda_functions
from eomgen.device.arrays_on_device import DeviceArray
from eomgen.device.device_module import DeviceModule
from eomgen.errors import UsageError
from eomgen.targets import TIMED_ON_DEVICE

EXAMPLES = sorted(path.stem for path in models.EXAMPLES.glob("*.yaml"))
COLUMNS = 3
EARLY = 1e-4  #: a time (s) that driven mechanisms reach from their start


def states_of(module: Any, count: int = COLUMNS, seed: int = 3, t: float = 0.0) -> np.ndarray:
    """States near the start, a little off the constraints too."""
    random = np.random.default_rng(seed)
    x = module.x0()
    columns = [module.project(x + 0.01 * random.normal(size=x.size), t=t) for _ in range(count)]
    return np.array(columns).T + 1e-7 * random.normal(size=(x.size, count))


def arguments_of(model: DeviceModule, name: str, x: np.ndarray) -> list[np.ndarray]:
    q, v = x[: model.n_q], x[model.n_q :]
    every = {"x": x, "q": q, "v": v, "a": np.sin(3.0 * v)}
    return [every[port] for port, _ in model.facts["kernels"][name][0]]


def named(model: DeviceModule, name: str, given: list[np.ndarray]) -> dict[str, np.ndarray]:
    return dict(zip((port for port, _ in model.facts["kernels"][name][0]), given, strict=True))


def expected(module: Any, name: str, given: list[np.ndarray], t: float, k: int) -> np.ndarray:
    columns = [array[:, k] for array in given]
    if name == "resets":
        return np.array(module.kernels.timed(name)(t, np.concatenate(columns)))
    of_states = name in ("bias", "mass_matrix", "embedded_mass_matrix", "inverse_dynamics", "constraint_jacobian")
    call = getattr(module.kernels if of_states else module, name, None)  # velocities on the device are [v; s]
    call = module.kernels.timed("events", nan=True) if name == "events" else call
    call = call.every if name in ("constraints", "constraint_jacobian", "velocity_constraints") else call
    found = call(t, *columns) if name in TIMED_ON_DEVICE else call(*columns, t=t)
    return np.array(found)


def assert_near(found: np.ndarray, wanted: np.ndarray, name: str = "") -> None:
    finite = np.isfinite(wanted)
    assert (np.isfinite(found) == finite).all(), name
    size = max(1.0, np.abs(wanted[finite]).max(initial=0.0))
    np.testing.assert_allclose(found[finite], wanted[finite], rtol=0.0, atol=1e-12 * size, err_msg=name)


@pytest.mark.slow
@pytest.mark.parametrize("name", part_of(EXAMPLES, OF_ALL_KINDS.__contains__))
def test_every_function_of_every_example(name: str, device: Any) -> None:
    equations = eg.load(models.EXAMPLES / f"{name}.yaml").derive()
    model, module = cuda_functions(equations, device), equations.compile(target="numpy")
    x = states_of(module, t=EARLY)
    assert {"rhs", "jacobian", "mass_matrix", "inverse_dynamics", "energy", "poses"} <= set(model.facts["kernels"])
    for kernel, (_, shape) in model.facts["kernels"].items():
        given = arguments_of(model, kernel, x)
        found, status = getattr(model, kernel)(**named(model, kernel, given), t=EARLY, status=True)
        assert found.shape == (*shape, COLUMNS)
        for k in range(COLUMNS):
            assert_near(found[..., k], expected(module, kernel, given, EARLY, k), kernel)
        assert (status == 0).all() or kernel == "events", kernel


@pytest.mark.parametrize("kind", ["blade", "length"])
def test_rows_that_hold_no_position_and_given_rates(kind: str, device: Any) -> None:
    """A blade; two coordinates with one speed, and a length that it does not change."""
    if kind == "blade":
        model = eg.Model("sleigh")
        body = model.body("b", mass=2.0, com=(0.25, 0, 0), inertia={"zz": 0.3})
        model.planar("J", model.ground, body)
        model.knife_edge("k", body)
    else:
        model = eg.Model.from_equations(
            "turning",
            ["c", "s"],
            velocities=["w"],
            rates={"c": "-s*w", "s": "c*w"},
            mass_matrix=[["2 + c"]],
            forcing=["-s"],
            constraints=["c**2 + s**2 - 1"],
        )
        model.guess(c=1.0)
    equations = model.derive()
    device_model, module = cuda_functions(equations, device), equations.compile(target="numpy")
    x = states_of(module)
    for name in ("rhs", "jacobian"):
        found = getattr(device_model, name)(0.0, x)
        for k in range(COLUMNS):
            assert_near(found[..., k], getattr(module, name)(0.0, x[:, k]), name)


def test_parameters_inputs_and_times_of_each_state(device: Any) -> None:
    equations = eg.load(models.EXAMPLES / "slider_crank.yaml").derive()
    model, module = cuda_functions(equations, device), equations.compile(target="numpy")
    x = states_of(module)
    p = np.repeat(model.p[:, None], COLUMNS, axis=1) * np.array([1.0, 1.001, 0.999])
    u, t = np.array([[0.1, -2.0, 5.0]]), np.array([0.0, 0.5, 1.0])
    found = model.rhs(t, x, p, u)
    for k in range(COLUMNS):
        assert_near(found[:, k], module.rhs(t[k], x[:, k], p=p[:, k], u=u[:, k]))
    one = model.rhs(0.5, x[:, 1], p[:, 1], u[:, 1])
    assert one.shape == (6,)
    np.testing.assert_array_equal(one, found[:, 1])
    assert np.ptp(found[3]) > 1.0  # the inputs are felt


def test_arrays_of_the_device_are_not_copied(device: Any) -> None:
    equations = eg.load(models.EXAMPLES / "double_pendulum.yaml").derive()
    model = cuda_functions(equations, device)
    x = np.random.default_rng(0).normal(size=(4, 100))
    wanted = model.rhs(0.0, x)
    before = device.copies
    found = model.rhs(0.0, device.foreign(x))
    assert device.copies == before  # t and u are there from the call before
    assert isinstance(found, DeviceArray)
    assert found.shape == (4, 100)
    np.testing.assert_array_equal(found.numpy(), wanted)
    told = found.__cuda_array_interface__
    assert (told["shape"], told["typestr"], told["version"]) == ((4, 100), "<f8", 3)
    model.rhs(0.5, device.foreign(x))
    assert device.copies == before + 1
    again = model.rhs(0.0, found)  # what comes out goes in
    np.testing.assert_array_equal(again.numpy(), model.rhs(0.0, wanted))


def test_times_and_inputs_of_the_last_call_are_not_those_of_the_next(device: Any) -> None:
    m = eg.Model("driven")
    m.prismatic("d", m.ground, m.body("mass", mass=1.0), axis="x", coordinate="x")
    m.input("F", 2.0)
    m.torque("push", "d", "F*(1 + t)")
    model, x = cuda_functions(m.derive(), device), np.zeros((2, 3))
    for t, u, force in ((0.0, None, 2.0), (1.0, None, 4.0), (0.0, [5.0], 5.0), (0.0, None, 2.0), (3.0, [1.0], 4.0)):
        np.testing.assert_array_equal(model.rhs(t, x, u=u)[1], force)
    with pytest.raises(ValueError, match="read-only"):
        model.u[0] = 3.0


def test_a_state_that_fails_leaves_the_others_alone(device: Any) -> None:
    equations = eg.load(models.EXAMPLES / "slider_crank.yaml").derive()
    model, module = cuda_functions(equations, device), equations.compile(target="numpy")
    x = states_of(module)
    good = model.rhs(0.0, x)
    x[2, 1] = 5.0  # cannot be closed
    x[0, 2] = np.nan
    found, status = model.rhs(0.0, x, status=True)
    np.testing.assert_array_equal(found[:, 0], good[:, 0])
    assert np.isnan(found[:, 1:]).any(axis=0).all()
    assert status[0] == 0
    assert (status[1:] > 0).all()
    with pytest.raises(eg.errors.EvaluationError):
        module.rhs(0.0, x[:, 1])


def test_no_states_give_no_results(device: Any) -> None:
    model = cuda_functions(eg.load(models.EXAMPLES / "double_pendulum.yaml").derive(), device)
    assert model.mass_matrix(np.empty((2, 0))).shape == (2, 2, 0)


def test_wrong_calls_are_refused_by_name(device: Any) -> None:
    model = cuda_functions(eg.load(models.EXAMPLES / "double_pendulum.yaml").derive(), device)
    x = np.zeros((4, 3))
    with pytest.raises(UsageError, match=r"x must have shape \(4,\) or \(4, k\), not \(3, 4\)"):
        model.rhs(0.0, x.T)
    with pytest.raises(UsageError, match=r"p must have shape \(5,\) or \(5, 3\), not \(5, 2\)"):
        model.rhs(0.0, x, np.ones((5, 2)))
    with pytest.raises(UsageError, match="t must be a number"):
        model.rhs([0.0, 1.0], x)
    with pytest.raises(UsageError, match="rhs needs x"):
        model.rhs(0.0)
    with pytest.raises(UsageError, match="mass_matrix takes q, p, u, t and status"):
        model.mass_matrix(x[:2], x=x)
    with pytest.raises(UsageError, match="same number of columns"):
        model.inverse_dynamics(x[:2, 0], x[:2], x[:2])
    with pytest.raises(UsageError, match=r"a must have shape \(2,\) or \(2, 3\), not \(2, 2\)"):
        model.inverse_dynamics(x[:2], x[:2], np.zeros((2, 2)))
    with pytest.raises(UsageError, match="x is one state"):
        model.rhs(0.0, x[:, 0], np.ones((5, 2)))
    with pytest.raises(UsageError, match="array of numbers"):
        model.rhs(0.0, "state")


def test_a_pendulum_of_any_length_falls_as_the_textbook_says(device: Any) -> None:
    m = eg.Model("swing", gravity=(0, "-g", 0))
    m.parameter("g", 9.81)
    m.parameter("l", 1.0)
    m.revolute("A", m.ground, m.body("bob", mass=1.0, com=(0, "-l", 0)), coordinate="theta")
    model = cuda_functions(m.derive(), device)
    lengths, angles = np.array([0.1, 0.5, 2.0]), np.array([0.1, -1.0, 3.0])
    given = {"g": np.full(3, 9.81), "l": lengths}
    found = model.rhs(0.0, [angles, np.zeros(3)], [given[name] for name in model.p_names])
    np.testing.assert_allclose(found, [np.zeros(3), -9.81 / lengths * np.sin(angles)], rtol=1e-14)
