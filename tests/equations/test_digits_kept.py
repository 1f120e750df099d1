"""Masses and lengths that are far apart: what is left of the accelerations, beside 60 digits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.api.equations import derive
from eomgen.program.collect import collect_terms
from eomgen.verification.digits import Digits, context, solve

PENDULUMS = 4
STATE = np.array([0.3, -0.1, 0.7, 0.3, 1.0, 0.3, -0.4, -1.1])


def chain(masses: Sequence[float], lengths: Sequence[float]) -> eg.Model:
    """Rods one below the other."""
    m = eg.Model("chain", gravity=(0, -9.81, 0))
    above: Any = m.ground
    for k, (mass, length) in enumerate(zip(masses, lengths, strict=True), start=1):
        m.parameter(f"m{k}", mass)
        m.parameter(f"l{k}", length)
        rod = m.body(f"b{k}", mass=f"m{k}", com=(f"l{k}/2", 0, 0), inertia={"zz": f"m{k}*l{k}**2/12"})
        m.revolute(f"q{k}", above, rod)
        above = rod.at(f"l{k}", 0, 0)
    return m


def exact(model: eg.Model, x: np.ndarray) -> list[Any]:
    """Accelerations of a tree with 60 digits."""
    equations = derive(model, "lagrange")
    terms = collect_terms(equations.kinematics, equations.mobility, equations.tree)
    mp, n = context(), terms.n_v
    values = {name: mp.mpf(float(v)) for name, v in zip((*terms.q, *terms.v), x, strict=True)}
    values |= {p.name: mp.mpf(float(p.value or 0.0)) for p in model.mechanism().parameters} | {terms.t: mp.mpf(0)}
    flat = Digits(mp, [*(e for row in terms.mass_matrix for e in row), *terms.bias])(values)
    return [z[0] for z in solve([flat[i * n : i * n + n] for i in range(n)], [[-h] for h in flat[n * n :]])]


def error(model: eg.Model, method: str, x: np.ndarray) -> float:
    """The largest error of an acceleration, relative to the largest one."""
    truth = exact(model, x)
    found = model.compile(method=method, target="numpy").rhs(0.0, x)[len(truth) :]
    return float(max(abs(a - float(b)) for a, b in zip(truth, found, strict=True)) / max(map(abs, truth)))


@pytest.mark.parametrize("method", ["newton_euler", "amalgamated"])
@pytest.mark.parametrize("ratio", [1e6, 1e12])
def test_free_bodies_keep_all_digits_under_a_heavy_tip(method: str, ratio: float) -> None:
    model = chain([1, 1, 1, ratio], [1] * PENDULUMS)
    if ratio > 1e9:  # the embedded mass matrix is lost in rounding
        with pytest.raises(eg.ModelError, match="no inertia behind it"):
            model.check()
        return
    assert error(model, method, STATE) < 1e-13


@pytest.mark.parametrize(("ratio", "limit"), [(1.0, 1e-13), (1e3, 1e-10), (1e6, 1e-6)])
@pytest.mark.parametrize("method", ["embedding", "lagrange", "recursive", "gibbs_appell", "hamilton"])
def test_others_lose_no_more_than_the_ratio_of_masses(method: str, ratio: float, limit: float) -> None:
    """Hamilton's lost the square of it: 5.5e-4 at 1e6, and 3e8 at 1e12 without a word."""
    assert error(chain([1, 1, 1, ratio], [1] * PENDULUMS), method, STATE) < limit


@pytest.mark.parametrize("ratio", [1e3, 1e8, 1e16])
def test_a_ratio_that_costs_nothing_gets_no_word(ratio: float) -> None:
    """A heavy or light end of two rods, and a heavy body in every second place."""
    for model in (chain([1, ratio], [1, 1]), chain([ratio, 1], [1, 1]), chain([1, ratio, 1, ratio], [1] * 4)):
        assert not [note for note in model.check().notes if "digits" in note]
    assert error(chain([1, ratio], [1, 1]), "embedding", np.array([0.3, 0.7, 1.0, -2.0])) < 1e-14


@pytest.mark.parametrize(("ratio", "kept"), [(1e4, 7), (1e6, 3)])
def test_check_says_what_is_lost(ratio: float, kept: int) -> None:
    """A first rod that is so short leaves that many digits."""
    model, x = chain([1, 1], [1 / ratio, 1]), np.array([0.3, 0.7, 1.0, -2.0])
    notes = [note for note in model.check().notes if "digits" in note]
    assert len(notes) == 1
    assert f"rounding leaves about {kept} of 16 digits of the accelerations" in notes[0]
    assert "newton_euler and amalgamated keep all digits" in notes[0]
    lost = error(model, "embedding", x)
    assert 10.0 ** -(kept + 3) < lost < 10.0 ** (1 - kept)
    assert error(model, "newton_euler", x) < 1e-14
