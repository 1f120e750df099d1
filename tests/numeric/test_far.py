"""Bodies held together far from the origin, where rounding is larger than 1e-10; loops closed from far away."""

import numpy as np
import pytest

import eomgen as eg
from eomgen.errors import AssemblyError

EPS = np.finfo(float).eps


def tether(R, length, rotation="euler_angles", at=0.0, target="numpy"):
    """Two bodies on an orbit of radius R, a rod between them, held at `at` from their origins."""
    m = eg.Model("tether", gravity=(0, 0, 0))
    a, b = m.body("a", mass=100.0, inertia=(1, 1, 1)), m.body("b", mass=50.0, inertia=(1, 1, 1))
    m.free("fa", m.ground, a, rotation=rotation)
    m.free("fb", m.ground, b, rotation=rotation)
    m.distance("rod", a.at(at, 0, 0) if at else a, b.at(-at, 0, 0) if at else b, length=length)
    m.point_gravity("ga", m.ground, "a", mu=3.986e14)
    m.point_gravity("gb", m.ground, "b", mu=3.986e14)
    m.initial = {"fa_x": R, "fb_x": R + length + 2 * at}
    return m.compile(target=target)


def places(mod, R, length, count):
    """States closed to rounding, in all directions from the centre and from each other."""
    random = np.random.default_rng(1)
    i, j = mod.x_names.index("fa_x"), mod.x_names.index("fb_x")
    for _ in range(count):
        x = np.array(mod.x0())
        out, along = (u / np.linalg.norm(u) for u in random.normal(size=(2, 3)))
        x[i : i + 3], x[j : j + 3] = R * out, R * out + length * along
        yield x


@pytest.mark.parametrize("target", ["numpy", "cython"])
@pytest.mark.parametrize("rotation", ["euler_angles", "euler_parameters"])
@pytest.mark.parametrize("R", [7e6, 4e8, 1.5e11])
def test_states_closed_to_rounding_are_accepted(R, rotation, target):
    """mu / R^2 towards the centre for both, the rod being short; its length kept to rounding."""
    length = 10.0
    mod = tether(R, length, rotation, target=target)
    i, j = mod.x_names.index("fa_x"), mod.x_names.index("fb_x")
    for x in places(mod, R, length, 25):
        z = mod.project(x)
        assert np.linalg.norm(z[j : j + 3] - z[i : i + 3]) == pytest.approx(length, abs=16 * EPS * R)
        a = mod.rhs(0.0, x)[mod.n_q :]
        k = mod.v_names.index("fa_x_dot")
        pull = -3.986e14 * x[i : i + 3] / R**3
        np.testing.assert_allclose(a[k : k + 3], pull, rtol=0, atol=10 * length / R * 3.986e14 / R**2)
        assert np.isfinite(mod.outputs(0.0, x)).all() if mod.y_names else True


def test_rods_held_away_from_origins_too():
    """The length scale is that of the rod and its ends, 0.6 m; what is closed to rounding is 1e4 times 1e-10."""
    mod = tether(4e9, 1.0, at=0.1)
    i, j = mod.x_names.index("fa_x"), mod.x_names.index("fb_x")
    for x in places(mod, 4e9, 1.2, 10):
        z = mod.project(x)  # turned to where the rod fits
        assert np.abs(mod.constraints(z[: mod.n_q])).max() < 16 * EPS * 4e9
        assert np.linalg.norm(z[j : j + 3] - z[i : i + 3]) < 1.3


def test_the_length_of_rods_counts_in_the_size_of_a_mechanism():
    assert tether(0.0, 30.0).metadata["length_scale"] == pytest.approx(30.0)


def test_a_run_on_an_orbit_takes_no_more_steps_than_its_motion_needs():
    mod = tether(7e6, 10.0, target="cython")
    v = (3.986e14 / 7e6) ** 0.5
    x0 = mod.x0(fa_y_dot=v, fb_y_dot=v * (7e6 + 10.0) / 7e6)
    run = mod.simulate((0, 600), x0, rtol=1e-6, atol=1e-3)
    assert len(run.t) < 60
    gap = np.array([run["fb_x"] - run["fa_x"], run["fb_y"] - run["fa_y"]])
    np.testing.assert_allclose(np.hypot(*gap), 10.0, atol=1e-7)
    speed = v / 7e6  # turns with the orbit, in line with the centre
    angle = np.unwrap(np.arctan2(gap[1], gap[0]))
    np.testing.assert_allclose(angle, speed * run.t, atol=1e-4)


@pytest.mark.parametrize("distance", [10.0, 1e3, 1e6])
@pytest.mark.parametrize("at", [0.0, 0.1])
def test_loops_close_from_far_away(distance, at):
    """One body given far from the other: that one comes to it."""
    m = eg.Model("far", gravity=(0, 0, 0))
    a, b = m.body("a", mass=1.0, inertia=(1, 1, 1)), m.body("b", mass=1.0, inertia=(1, 1, 1))
    m.free("fa", m.ground, a)
    m.free("fb", m.ground, b)
    m.distance("rod", a.at(at, 0, 0) if at else a, b.at(0, at, 0) if at else b, length=0.2)
    m.initial = {"fa_x": distance}
    mod = m.compile(target="numpy")
    x = mod.x0()
    assert x[0] == distance
    assert np.linalg.norm(x[6:9] - x[:3]) < 0.2 + 2 * at + 1e-6
    assert np.abs(mod.constraints(x[: mod.n_q])).max() < 1e-10 + 100 * EPS * distance


def test_what_does_not_close_from_far_away_says_so():
    """A slide whose rod of 0.1 m must reach a point 5 m beside its way, sought from 100 km away."""
    m = eg.Model("reach", gravity=(0, 0, 0))
    slide = m.body("slide", mass=1.0)
    m.prismatic("S", m.ground, slide, axis="x")
    m.distance("rod", m.ground.at(0, 5, 0), slide, length=0.1)
    m.guess(S=1e5)
    with pytest.raises(AssemblyError, match="the guess is far away"):
        m.compile(target="numpy")
