"""Tables against SciPy's interpolants, in NumPy and through the whole road."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, PchipInterpolator, RectBivariateSpline

import eomgen as eg
from eomgen.numeric.splines import curve_coefficients, slopes, surface_nodes
from eomgen.numeric.user_functions import Curve, Surface

REFERENCES = {
    "cubic": lambda x, y: CubicSpline(x, y),
    "natural": lambda x, y: CubicSpline(x, y, bc_type="natural"),
    "monotone": lambda x, y: PchipInterpolator(x, y),
    "periodic": lambda x, y: CubicSpline(x, y, bc_type="periodic"),
}


def points(n: int, kind: str, even: bool) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(n)
    x = np.linspace(-1.0, 2.0, n) if even else np.cumsum(rng.uniform(0.2, 1.0, n)) - 1.0
    y = rng.normal(size=n)
    if kind == "periodic":
        y[-1] = y[0]
    return x, y


def table(x: Any, y: Any, kind: str = "cubic", linear: bool = True) -> Curve:
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    period = x[-1] - x[0] if kind == "periodic" else None
    return Curve(x, curve_coefficients(x, y, slopes(x, y, kind), linear), period)


def near(found: Any, expected: Any, digits: float = 1e-13) -> None:
    assert np.max(np.abs(found - expected)) <= digits * max(1.0, np.max(np.abs(expected)))


@pytest.mark.parametrize("even", [True, False], ids=["even", "uneven"])
@pytest.mark.parametrize("n", [2, 3, 4, 5, 40])
@pytest.mark.parametrize("kind", REFERENCES)
def test_a_curve_is_scipys(kind: str, n: int, even: bool) -> None:
    x, y = points(max(n, 3) if kind == "periodic" else n, kind, even)
    curve, expected = table(x, y, kind), REFERENCES[kind](x, y)
    inside = np.unique([*x, *np.linspace(x[0], x[-1], 211)])
    inside = inside[:-1] if kind == "periodic" else inside  # at its end a periodic one begins
    smooth = {"monotone": 1, "periodic": 2}.get(kind, 3)  # orders that are compared at the points themselves
    for order in range(4):
        places = inside if order <= smooth else np.setdiff1d(inside, x)
        near(curve(places, order), expected(places, order), 1e-12 if kind == "periodic" else 1e-13)


def test_scalars_and_arrays_give_the_same() -> None:
    x, y = points(9, "cubic", even=False)
    curve = table(x, y)
    places = np.linspace(x[0] - 1, x[-1] + 1, 50)
    assert [float(curve(float(a), 1)) for a in places] == curve(places, 1).tolist()


@pytest.mark.parametrize("linear", [True, False])
def test_beyond_its_points_a_curve_goes_on_as_its_ends(linear: bool) -> None:
    x, y = points(7, "cubic", even=False)
    curve, inside = table(x, y, linear=linear), CubicSpline(x, y)
    for end, places in ((x[0], x[0] - np.array([1e-9, 0.5, 30.0])), (x[-1], x[-1] + np.array([1e-9, 0.5, 30.0]))):
        slope = float(inside(end, 1)) if linear else 0.0
        near(curve(places), float(inside(end)) + slope * (places - end))
        near(curve(places, 1), slope)
        assert not curve(places, 2).any()
        assert not curve(places, 3).any()


def test_a_periodic_curve_repeats_smoothly() -> None:
    x = np.linspace(0.0, 2 * np.pi, 25)
    y = np.sin(x) + 0.3 * np.cos(3 * x)
    y[-1] = y[0]
    curve = table(x, y, "periodic")
    places = np.linspace(0.01, 6.2, 90)
    for order in range(3):
        for turns in (-3, 1, 100):
            near(curve(places + turns * 2 * np.pi, order), curve(places, order), 1e-10)
        near(curve(np.array([2 * np.pi - 1e-9]), order), curve(np.array([1e-9]), order), 1e-6)


def test_a_monotone_table_never_overshoots() -> None:
    x, y = [0, 1, 2, 3, 4, 5], [0, 0, 0, 1, 1, 1]
    found = table(x, y, "monotone")(np.linspace(0, 5, 501))
    assert (np.diff(found) >= 0).all()
    assert found.min() == 0
    assert found.max() == 1
    assert table(x, y, "cubic")(np.linspace(0, 5, 501)).max() > 1.01  # so the test can fail


@pytest.mark.parametrize("shape", [(4, 4), (7, 9), (30, 5)])
def test_a_surface_is_scipys(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(5)
    x, y = (np.cumsum(rng.uniform(0.2, 1.0, n)) for n in shape)
    z = rng.normal(size=shape)
    surface, expected = Surface(x, y, surface_nodes(x, y, z, "cubic")), RectBivariateSpline(x, y, z, s=0)
    a = np.r_[rng.uniform(x[0], x[-1], 300), x[0], x[-1], x[1], x[0]]
    b = np.r_[rng.uniform(y[0], y[-1], 300), y[0], y[-1], y[2], y[-1]]
    for i in range(3):
        for j in range(3):
            near(surface(a, b, i, j), expected.ev(a, b, dx=i, dy=j), 1e-13 * 10 ** (i + j))


@pytest.mark.parametrize("slope", [1.0, 0.0])
def test_beyond_its_grid_a_surface_goes_on_as_its_edges(slope: float) -> None:
    rng = np.random.default_rng(6)
    x, y = np.arange(5.0), np.linspace(0, 2, 6)
    surface = Surface(x, y, surface_nodes(x, y, rng.normal(size=(5, 6)), "natural"), slope)
    near(surface(6.5, 0.7), surface(4.0, 0.7) + slope * 2.5 * surface(4.0, 0.7, 1, 0))
    near(surface(6.5, 0.7, 1, 1), slope * surface(4.0, 0.7, 1, 1))
    near(surface(2.2, -1.5, 1, 0), surface(2.2, 0.0, 1, 0) - slope * 1.5 * surface(2.2, 0.0, 1, 1))
    assert surface(6.5, 0.7, 2, 0) == 0.0
    corner = surface(4.0, 2.0) + slope * (surface(4.0, 2.0, 1, 0) + 0.5 * surface(4.0, 2.0, 0, 1))
    near(surface(5.0, 2.5), corner + slope * 0.5 * surface(4.0, 2.0, 1, 1))


def test_what_is_not_a_number_stays_that() -> None:
    x, y = points(9, "cubic", even=True)
    for order in range(4):
        assert np.isnan(table(x, y)(np.array([np.nan]), order)).all()
        assert np.isnan(table(x, y, "monotone")(float("nan"), order))
    surface = Surface(x, x, surface_nodes(x, x, np.outer(y, y), "cubic"))
    assert np.isnan(surface(np.nan, 0.0))
    assert np.isnan(surface(0.0, np.nan, 1, 0))


def reading(kind: str, even: bool) -> tuple[eg.Model, np.ndarray, np.ndarray]:
    """A model whose outputs are a table and its derivatives at the coordinate."""
    x, y = points(30, kind, even)
    m = eg.Model("reader")
    f = m.table("f", x, y, kind=kind)
    m.prismatic("s", m.ground, m.body("b", mass=1), axis="x")
    s = m.coordinate("s")
    for order in range(4):
        m.output(f"f{order}", f(s).diff(s, order) if order else f(s))
    return m, x, y


@pytest.mark.parametrize("even", [True, False], ids=["even", "uneven"])
@pytest.mark.parametrize("kind", REFERENCES)
def test_every_target_reads_the_same_table(kind: str, even: bool) -> None:
    model, x, y = reading(kind, even)
    curve = table(x, y, kind)
    places = np.sort(np.r_[x, x[0] - 1e-12, np.linspace(x[0] - 2, x[-1] + 2, 301)])
    states = np.array([places, np.zeros_like(places)])
    for target in ("cython", "numpy"):
        module = model.compile(target=target)
        found = module.outputs(0.0, states)
        for order in range(4):
            near(found[order], curve(places, order), 1e-14)
            single = [module.outputs(0.0, state)[order] for state in states.T[::17]]
            near(np.array(single), curve(places[::17], order), 1e-14)
