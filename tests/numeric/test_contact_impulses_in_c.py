"""Impulses of rigid contacts in compiled code: the laws themselves judge them, and the same iterations in NumPy."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest

from eomgen.compilation.compiler import find_compiler
from eomgen.compilation.cython_layer import HEADERS
from eomgen.compilation.options import stepper_flags
from eomgen.layer import read_header, read_layer
from eomgen.numeric.contact_impulses import solve_contacts
from eomgen.numeric.contact_problem import ContactProblem
from eomgen.runtime.late import eager

FILES = ("eomgen_contacts.c", "eomgen_wide_contacts.c")


@pytest.fixture(scope="module")
def in_c() -> Any:
    return eager(models.build("pendulum").compile().core).solve_contacts


def problem(rng: np.random.Generator, m: int, d: int, freedoms: int) -> ContactProblem:
    """Contacts of as many directions; those beyond the freedoms are redundant."""
    J = rng.normal(size=(m * d, freedoms))
    heavy = np.exp(rng.uniform(-2.0, 2.0, freedoms))
    v = rng.normal(size=freedoms)
    return ContactProblem(
        J @ (J / heavy).T, (J @ v).reshape(m, d), rng.uniform(0.0, 0.8, m) * (rng.uniform(size=m) > 0.2)
    )


def faults(problem: ContactProblem, P: np.ndarray) -> float:
    """How far Signorini's and Coulomb's laws are missed, as velocities, written without projections."""
    y = (problem.W @ P.ravel()).reshape(P.shape) + problem.c
    found = 0.0
    for i in range(problem.m):
        push, away = P[i, 0], y[i, 0]
        found = max(found, -away, -push * problem.normal[i], min(abs(push) * problem.normal[i], abs(away)))
        pull, slip = np.linalg.norm(P[i, 1:]), np.linalg.norm(y[i, 1:])
        reach = problem.mu[i] * push
        found = max(found, (pull - reach) * problem.across[i])
        if slip > 1e-2:  # slides: full friction, opposite to the slip, whose direction is known well
            found = max(found, np.abs(P[i, 1:] + reach * y[i, 1:] / slip).max() * problem.across[i])
    return float(found)


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize(("m", "freedoms"), [(1, 3), (3, 9), (6, 8), (12, 40), (20, 24)])
def test_both_find_the_same(in_c: Any, d: int, m: int, freedoms: int) -> None:
    rng = np.random.default_rng(100 * m + d)
    for _ in range(6):
        given = problem(rng, m, d, freedoms)
        start = np.abs(rng.normal(size=(m, d))) * (rng.uniform() > 0.5)
        tolerance = 1e-11 * float(np.abs(given.c).max())
        P, count, residual = in_c(given.W, given.c, given.mu, start, tolerance, 600)
        same = solve_contacts(given, start, tolerance, 600)
        assert residual == pytest.approx(given.size(given.misses(P)[0]), abs=1e-13)
        assert residual <= tolerance
        assert faults(given, P) < 1e-7
        assert count == same.iterations
        np.testing.assert_allclose((given.W @ P.ravel()), given.W @ same.impulses.ravel(), atol=1e-9)
        if m * d <= freedoms:
            np.testing.assert_allclose(P, same.impulses, atol=1e-10 * max(1.0, float(np.abs(P).max())))


def test_nothing_in_place_and_shapes_that_do_not_fit(in_c: Any) -> None:
    given = problem(np.random.default_rng(1), 4, 2, 10)
    start, W = np.zeros((4, 2)), given.W.copy()
    in_c(given.W, given.c, given.mu, start, 1e-9, 10)
    assert not start.any()
    np.testing.assert_array_equal(given.W, W)
    for bad in (
        (given.W[:3, :3], given.c, given.mu, start),
        (given.W, given.c, given.mu[:2], start),
        (given.W, given.c, given.mu, start[:2]),
        (np.zeros((20, 20)), np.zeros((4, 5)), given.mu, np.zeros((4, 5))),
    ):
        with pytest.raises(ValueError, match="do not belong together"):
            in_c(*bad, 1e-9, 10)


def test_numbers_that_are_not_finite_are_told_by_the_residual(in_c: Any) -> None:
    given = problem(np.random.default_rng(2), 10, 2, 30)
    given.c[3, 0] = np.nan
    _, count, residual = in_c(given.W, given.c, given.mu, np.zeros((10, 2)), 1e-9, 50)
    assert not residual <= 1e-9
    assert count <= 50


def test_bits_do_not_depend_on_the_width(tmp_path: Path) -> None:
    """The text for processors with AVX2 finds the same impulses as that for any."""
    texts = {**read_layer(), **{name: read_header(name) for name in HEADERS}}
    for name in ("eomgen_contacts.h", "eomgen_contact_steps.h", *FILES, *HEADERS):
        (tmp_path / name).write_text(texts[name], encoding="utf-8")
    flags = [flag for flag in stepper_flags(find_compiler()) if flag != "-fvisibility=hidden"]
    library = tmp_path / "contacts.so"
    subprocess.run(
        [*find_compiler().command, *flags, "-shared", *FILES, "-lm", "-o", str(library)], cwd=tmp_path, check=True
    )
    loaded = ctypes.CDLL(str(library))
    if not loaded.eomgen_contacts_wide():
        return  # a processor without, or a compiler that makes one text
    rng = np.random.default_rng(8)
    for m, d in ((3, 1), (9, 2), (14, 2), (10, 3)):
        given = problem(rng, m, d, 15)
        found = []
        for width in ("plain", "wide"):
            n = m * d
            P, work, numbers = np.zeros((m, d)), np.empty(n * (n + 8) + 3 * m), np.empty(n + m, np.intc)
            count, residual = ctypes.c_int(), ctypes.c_double()
            getattr(loaded, f"eomgen_{width}_solve_contacts")(
                m, d, *map(address, (given.W, given.c, given.mu, P)), ctypes.c_double(1e-10), 50,
                address(work), address(numbers), ctypes.byref(count), ctypes.byref(residual),
            )  # fmt: skip
            found.append((P, count.value, residual.value))
        np.testing.assert_array_equal(found[0][0], found[1][0])
        assert found[0][0].any()
        assert found[0][1:] == found[1][1:]


def address(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def test_one_contact_in_the_plane_is_solved_whatever_its_compliance(in_c: Any) -> None:
    """Compliances of condition 1e4 and more: impulses of one direction nearly stand for those of the other."""
    rng = np.random.default_rng(0)
    for _ in range(1500):
        A = rng.normal(size=(2, 2)) * 10.0 ** rng.uniform(-1.5, 0.5, size=(1, 2))
        given = ContactProblem(A.T @ A + 1e-12 * np.eye(2), rng.normal(size=(1, 2)), rng.uniform(0.0, 2.0, 1))
        found = solve_contacts(given, np.zeros((1, 2)), 1e-10, 50)
        P, count, residual = in_c(given.W, given.c, given.mu, np.zeros((1, 2)), 1e-10, 50)
        assert max(found.residual, residual) <= 1e-10
        assert faults(given, P) < 1e-7
        assert count == found.iterations
