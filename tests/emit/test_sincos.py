"""The sin and cos of generated code against 50-digit arithmetic (mpmath), and their bits in packs of any width."""

import ctypes
import subprocess
from math import ulp
from pathlib import Path

import numpy as np
import pytest
from mpmath import mp, mpf

TEMPLATES = Path(__file__).parents[2] / "templates" / "c"
NEAR = 1.0e6
SOURCE = """
#include "eomgen_sincos.h"
void evaluate(const double *angles, long n, double *sines, double *cosines)
{
    for (long i = 0; i < n; i += EOMGEN_WIDTH) {
        real a, s, c;
        memcpy(&a, angles + i, sizeof a);
        s = sine_of(a);
        c = cosine_of(a);
        memcpy(sines + i, &s, sizeof s);
        memcpy(cosines + i, &c, sizeof c);
    }
}
void together(const double *a, long n, double *sines, double *cosines)
{
    real s[7], c[7];
    for (long i = 0; i + 7 * EOMGEN_WIDTH <= n; i += 7 * EOMGEN_WIDTH) {
        real x[7];
        memcpy(x, a + i, sizeof x);
        bits far = sincos_four(x[0], x[1], x[2], x[3], s + 0, c + 0);
        far |= sincos_two(x[4], x[5], s + 4, c + 4);
        far |= sincos_one(x[6], s + 6, c + 6);
        if (any_far(far)) {
            for (int k = 0; k < 7; k++) { sincos_far(x[k], s + k, c + k); }
        }
        memcpy(sines + i, s, sizeof s);
        memcpy(cosines + i, c, sizeof c);
    }
}
"""
BUILDS = {
    "plain": [],
    "plain O0": ["-O0"],
    "two": ["-DEOMGEN_WIDTH=2"],
    "plain, packs of four": ["-mavx2", "-mfma"],
    "four": ["-mavx2", "-mfma", "-DEOMGEN_WIDTH=4"],
    "eight": ["-mavx512f", "-mavx512vl", "-mavx512dq", "-DEOMGEN_WIDTH=8"],
}
#: Operations contracted, as ensembles have them; the later flag wins.
CONTRACTED = {
    f"{build}, contracted": ["-DEOMGEN_CONTRACTED", "-ffp-contract=fast", *BUILDS[build]] for build in ("four", "eight")
}
CONTRACTED["eight, contracted"].append("-mfma")
FEATURES = {"plain, packs of four": "AVX2", **dict.fromkeys(("four", "four, contracted"), "AVX2")}
FEATURES |= dict.fromkeys(("eight", "eight, contracted"), "AVX-512")


def marked(builds):
    return [pytest.param(b, marks=pytest.mark.needs(FEATURES[b]) if b in FEATURES else ()) for b in builds]


class Evaluators(dict):
    """Build -> function(angles, name) -> (sines, cosines), compiled when asked for."""

    def __init__(self, folder):
        self.folder = folder
        (folder / "sincos.c").write_text(SOURCE)

    def __missing__(self, build):
        library = self.folder / f"sincos{len(self)}.so"
        command = ["gcc", "-O2", "-std=c99", "-Wall", "-Wextra", "-Werror", "-Wconversion", "-ffp-contract=off"]
        command += [*(BUILDS | CONTRACTED)[build], f"-I{TEMPLATES}", "-fPIC", "-shared"]
        subprocess.run([*command, str(self.folder / "sincos.c"), "-o", str(library), "-lm"], check=True)
        self[build] = maker(ctypes.CDLL(str(library)))
        return self[build]


@pytest.fixture(scope="module")
def evaluators(tmp_path_factory):
    return Evaluators(tmp_path_factory.mktemp("sincos"))


def maker(library):
    def call(angles, name="evaluate"):
        angles = np.ascontiguousarray(angles, dtype=float)
        assert angles.size % 8 == 0
        sines, cosines = np.full_like(angles, np.nan), np.full_like(angles, np.nan)
        pointers = [a.ctypes.data_as(ctypes.c_void_p) for a in (angles, sines, cosines)]
        getattr(library, name)(pointers[0], ctypes.c_long(angles.size), *pointers[1:])
        return sines, cosines

    return call


def angles():
    """Dense, near multiples of pi/2 and pi/4, tiny, large within the bound."""
    rng = np.random.default_rng(5)
    with mp.workdps(40):
        multiples = np.array([float(int(k) * mp.pi / 2) for k in rng.integers(1, 636_000, 700)])
        small = np.array([float(k * mp.pi / 4) for k in range(1, 100)])
    near = [np.nextafter(m, to) for m in (multiples, small) for to in (-np.inf, np.inf)]
    powers = 10.0 ** rng.uniform(-320.0, 6.0, 1000)
    edges = [0.0, 5e-324, 2.2e-308, 1e-8, np.pi / 4, np.pi, NEAR, np.nextafter(NEAR, 0.0)]
    ranges = [rng.uniform(-b, b, 1500) for b in (1.0, 8.0, 100.0, NEAR)]
    every = np.concatenate([*ranges, multiples, small, *near, powers, edges])
    return every[: every.size // 8 * 8]


def errors(values, angles, function):
    """Distances from the true values in units in the last place of these."""
    found = []
    with mp.workdps(50):
        for value, angle in zip(values.tolist(), angles.tolist(), strict=True):
            true = function(mpf(angle))
            found.append(float(abs(mpf(value) - true) / mpf(ulp(float(true)))))
    return np.array(found)


def test_within_two_units_in_the_last_place(evaluators):
    x = angles()
    sines, cosines = evaluators["plain"](x)
    for values, function in ((sines, mp.sin), (cosines, mp.cos)):
        found = errors(values, x, function)
        assert found.max() < 1.6, (found.max(), x[found.argmax()])
        assert found.mean() < 0.25
    assert np.abs(sines).max() <= 1.0
    assert np.abs(cosines).max() <= 1.0


@pytest.mark.parametrize("build", marked(CONTRACTED))
def test_contracted_within_two_units_in_the_last_place_and_the_same_everywhere(evaluators, build):
    x = angles()
    sines, cosines = evaluators[build](x)
    for values, function in ((sines, mp.sin), (cosines, mp.cos)):
        found = errors(values, x, function)
        assert found.max() < 1.8, (found.max(), x[found.argmax()])
        assert found.mean() < 0.3
    mirrored = evaluators[build](-x)
    np.testing.assert_array_equal(mirrored[0], -sines)
    np.testing.assert_array_equal(mirrored[1], cosines)
    order = np.random.default_rng(8).permutation(x.size)
    for name in ("evaluate", "together"):
        moved = evaluators[build](x[order], name)
        known = ~np.isnan(moved[0])
        assert known.sum() >= x.size - 56
        np.testing.assert_array_equal(moved[0][known], sines[order][known])
        np.testing.assert_array_equal(moved[1][known], cosines[order][known])
    far = np.array([NEAR * 1.01, -2e6, 1e22, -1.7e308, 2.0**53, 3e15, np.nan, np.inf])
    for values, function in zip(evaluators[build](far), (mp.sin, mp.cos), strict=True):
        assert errors(values[:6], far[:6], function).max() < 1.0
        assert np.isnan(values[6:]).all()


def test_a_coefficient_that_is_off_is_seen(tmp_path):
    text = (TEMPLATES / "eomgen_sincos.h").read_text()
    assert text.count("0.008333333333330925") == 2
    for name in ("eomgen_real.h", "eomgen_angles.h"):
        (tmp_path / name).write_text((TEMPLATES / name).read_text())
    (tmp_path / "eomgen_sincos.h").write_text(text.replace("0.008333333333330925", "0.00833333333333"))
    (tmp_path / "sincos.c").write_text(SOURCE)
    command = ["gcc", "-O2", "-std=c99", "-ffp-contract=off", f"-I{tmp_path}", "-fPIC", "-shared"]
    subprocess.run([*command, str(tmp_path / "sincos.c"), "-o", str(tmp_path / "s.so"), "-lm"], check=True)
    x = angles()
    sines, _ = maker(ctypes.CDLL(str(tmp_path / "s.so")))(x)
    assert errors(sines, x, mp.sin).max() > 2.0


def test_odd_and_even_to_the_last_bit(evaluators):
    x = np.concatenate([angles(), [0.0, 1e300, np.inf, 2e6, 5e-324, 1.5, 2.5, 3.5]])
    sines, cosines = evaluators["plain"](x)
    mirrored = evaluators["plain"](-x)
    known = ~np.isnan(sines)
    np.testing.assert_array_equal(mirrored[0].view(np.int64)[known], (-sines).view(np.int64)[known])
    np.testing.assert_array_equal(mirrored[1].view(np.int64)[known], cosines.view(np.int64)[known])


def test_far_angles_are_libms(evaluators):
    x = np.array([NEAR * 1.01, -2e6, 1e22, -1.7e308, 2.0**53, 3e15, 1e9, 4e6])
    sines, cosines = evaluators["plain"](x)
    assert errors(sines, x, mp.sin).max() < 1.0
    assert errors(cosines, x, mp.cos).max() < 1.0
    for values in evaluators["plain"]([np.inf, -np.inf, np.nan, 1.0, -np.nan, 2.0, 0.0, np.inf]):
        np.testing.assert_array_equal(np.isnan(values), [True, True, True, False, True, False, False, True])


@pytest.mark.parametrize("build", marked(BUILDS))
def test_the_same_bits_in_every_build_and_beside_any_neighbour(evaluators, build):
    rng = np.random.default_rng(6)
    x = np.concatenate([angles(), [np.inf, -np.inf, 1e300, 2e6, -2e6, 1e9, 0.0, -0.0]])
    x = rng.permutation(x)[: x.size // 56 * 56]
    expected = evaluators["plain"](x)
    for name in ("evaluate", "together"):
        for values, true in zip(evaluators[build](x, name), expected, strict=True):
            values[np.isnan(values)] = true[np.isnan(true)] = np.nan
            np.testing.assert_array_equal(values.view(np.int64), true.view(np.int64))
