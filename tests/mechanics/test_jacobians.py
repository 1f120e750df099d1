"""``jacobian`` is the derivative of the complete ``rhs``, its projection included, in every direction of x."""

from collections.abc import Callable
from itertools import product
from typing import Any

import judges
import models
import numpy as np
import pytest
from models import EXAMPLES
from sweeps import part_of

import eomgen as eg
from benchmarks.models.linkages import closed_chain, four_bars

# -- Models ------------------------------------------------------------------------------------------------------------
LOOPS = ["offset_slider_crank", "powered_slider_crank", "spatial_loop"]
#: By embedding and one by other methods, the rest by ``make thorough``.
ALWAYS = [
    *product(
        ("slider_crank", "rolling_disc", "spatial_loop", "powered_arm", "skewed_four_bar", "three_cranks", "car_axis"),
        ["embedding"],
    ),
    ("slider_crank", "lagrange"),
    ("spatial_loop", "recursive"),
    ("spherical_pendulum", "recursive"),
]
REDUNDANT = ["tilted_four_bar", "skewed_four_bar", "three_cranks"]


def compare(mod: Any, x: np.ndarray, t: float, h: float = 1e-5) -> None:
    n = mod.n_q
    kinds = mod.metadata["coordinate_kinds"]
    sizes = np.tile([mod.metadata["length_scale"] if kind == "length" else 1.0 for kind in kinds], 2)

    def rhs(columns: np.ndarray) -> np.ndarray:
        return mod.rhs(t, columns)

    expected = np.stack([judges.first(rhs, x, d * s, h=h) / s for d, s in zip(np.eye(2 * n), sizes, strict=True)], 1)
    found = mod.jacobian(t, x)
    assert found.shape == (2 * n, 2 * n)
    # each of the four blocks by its own largest entry, in units that do not favour metres or radians
    weigh = sizes[None, :] / sizes[:, None]
    for rows in (slice(0, n), slice(n, 2 * n)):
        for columns in (slice(0, n), slice(n, 2 * n)):
            ours, theirs = (part[rows, columns] * weigh[rows, columns] for part in (found, expected))
            floor = 1e-8 * np.abs(expected * weigh).max()  # a block that vanishes has the noise of the others
            assert np.abs(ours - theirs).max() <= max(1e-6 * np.abs(theirs).max(), floor)


NAMES = [*models.EXAMPLE_NAMES, *models.DRIVEN_NAMES, *LOOPS, "powered_arm", *REDUNDANT]


@pytest.mark.parametrize(
    ("name", "method"), part_of(product(NAMES, ["embedding", "lagrange", "recursive"]), ALWAYS.__contains__)
)
def test_jacobian_of_models(module: Callable[..., Any], name: str, method: str) -> None:
    mod = module(name, method)
    for x in judges.random_states(mod, 31, 3):
        # off the manifold the regularization of redundant rows follows the residual: a kink that is of second order
        compare(mod, x, 0.3, h=1e-6 if name == "bricard" else 1e-5)


def test_jacobian_of_a_tree_by_recursion() -> None:
    """Columns that turn themselves and Euler parameters, where recursion is shorter than what formulas give."""
    m = eg.Model("arm", gravity=(0.5, -9.81, 1.0))
    last: Any = m.ground
    kinds = ["revolute", "universal", "revolute", "spherical", "cylindrical", "revolute"]
    for k, kind in enumerate(kinds):
        inertia = {"xx": 0.3, "yy": 0.2 + 0.01 * k, "zz": 0.25, "xy": 0.02, "xz": -0.03, "yz": 0.01}
        body = m.body(f"b{k}", mass=1.0 + 0.3 * k, com=(0.3, -0.1 * k, 0.2), inertia=inertia)
        keys = {"rotation": "euler_parameters"} if kind == "spherical" else {}
        m.joint(kind, f"q{k}", last, body, **keys)
        last = body.at(0.2, 0.3, 0.1, rpy=(0.4, 0.3 * k, -0.2))
    m.damper("c", m.ground.at(1, 1, 0), last, damping=3)
    mod = m.compile("embedding", target="numpy", kernels=["rhs", "jacobian", "project"])
    random = np.random.default_rng(4)
    for _ in range(2):
        x = mod.project(random.uniform(-1, 1, mod.n_x))
        expected = np.stack([judges.first(lambda y: mod.rhs(0.2, y), x, d, h=1e-4) for d in np.eye(mod.n_x)], 1)
        assert np.abs(mod.jacobian(0.2, x) - expected).max() <= 1e-7 * np.abs(expected).max()


# -- Of loops by articulated bodies, in C beside the dense system of NumPy ---------------------------------------------
def tethered() -> eg.Model:
    """A body that falls freely but for a rod to ground."""
    m = eg.Model("tethered", gravity=(0.3, 0.0, -9.81))
    a = m.body("a", mass=1.2, com=(0.1, 0.2, -0.5), inertia=(0.2, 0.3, 0.15))
    m.free("F", m.ground, a, rotation="euler_parameters")
    m.distance("rod", m.ground.at(0.0, 0.0, 1.0), a.at(0.0, 0.3, 0.2), length=0.9)
    m.guess(F_x=0.2, F_y=0.1)
    return m


def driven() -> eg.Model:
    """A chain whose last joint is led over time."""
    m = closed_chain(6, False, False)
    m.driver("lead", "j5", "0.3*sin(2*t) + 0.1")
    return m


CASES: dict[str, Callable[[], eg.Model]] = {
    "closed chain": lambda: closed_chain(9, True, False),
    "spatial chain": lambda: closed_chain(9, True, True),
    "four-bars": lambda: four_bars(4),
    "rods": models.rods,
    "tethered": tethered,
    "rods held twice": lambda: models.rods(True),
    "driven chain": driven,
    "slider-crank": lambda: eg.load(EXAMPLES / "slider_crank.yaml"),
}
ALWAYS_IN_C = {"spatial chain"}


def on_constraints(module: Any, seed: int, t: float) -> np.ndarray:
    random = np.random.default_rng(seed)
    x = module.x0(t=t) if "driven" in module.name else module.x0()
    x = module.project(x + 0.02 * random.uniform(-1, 1, len(x)), t=t)
    x[module.n_q :] = random.uniform(-1, 1, module.n_v)
    return np.asarray(module.project(x, t=t))


@pytest.mark.parametrize("name", part_of(CASES, ALWAYS_IN_C.__contains__))
def test_jacobians_are_those_of_the_dense_system(name: str) -> None:
    equations = CASES[name]().derive("recursive")
    module = equations.compile(kernels=["rhs", "jacobian"], optimize=0)
    dense = equations.compile(target="numpy")
    for seed in range(3):
        x, t = on_constraints(dense, seed, 0.3), 0.3
        for found, expected in ((module.rhs(t, x), dense.rhs(t, x)), (module.jacobian(t, x), dense.jacobian(t, x))):
            assert np.abs(found - expected).max() <= 1e-10 * np.abs(expected).max()


def test_a_jacobian_does_not_need_the_preferred_coordinates_to_move() -> None:
    """At a dead centre the slider stands still: the columns are taken one by one."""
    equations = eg.load(EXAMPLES / "slider_crank.yaml").derive("recursive", independent=["s"])
    module = equations.compile(target="numpy")
    for angle in (1e-3, 3e-3, 0.02):
        x = module.x0(theta=angle, theta_dot=4.0)
        slopes = [judges.first(lambda y: module.rhs(0.0, y), x, e, h=1e-4) for e in np.eye(module.n_x)]
        found = module.jacobian(0.0, x)
        assert np.abs(found - np.array(slopes).T).max() <= 1e-6 * np.abs(found).max()
