"""At rest beside a change point: where rounding does not tell a position from it, an error and no accelerations."""

from __future__ import annotations

from functools import cache
from typing import Any

import pytest

import eomgen as eg
from eomgen.limits.crossings import UNTOLD

LENGTHS = (0.2, 0.5)  #: crank and coupler (m)


@cache
def parallelograms(scales: tuple[float, ...], method: str, target: str, turned: bool = False) -> Any:
    """Parallelograms beside each other; turned: from the other crank on, so that another joint is cut."""
    m = eg.Model("parallelograms", gravity=(0, -9.81, 0))
    for k, scale in enumerate(scales):
        crank, coupler = (scale * length for length in LENGTHS)
        a, b, c = (
            m.body(f"{name}{k}", mass=1, com=(0.5 * length, 0, 0), inertia={"zz": 0.01 * scale**2})
            for name, length in (("a", crank), ("b", coupler), ("c", crank))
        )
        ends = [m.ground, m.ground.at(coupler, 0, 0)]
        if turned:
            m.revolute(f"r{k}", ends[1], c)
            m.revolute(f"s{k}", b.at(coupler, 0, 0), c.at(crank, 0, 0))
            m.revolute(f"q{k}", a.at(crank, 0, 0), b)
            m.revolute(f"p{k}", ends[0], a)
        else:
            m.revolute(f"p{k}", ends[0], a)
            m.revolute(f"q{k}", a.at(crank, 0, 0), b)
            m.revolute(f"r{k}", ends[1], c)
            m.revolute(f"s{k}", b.at(coupler, 0, 0), c.at(crank, 0, 0))
    return m.compile(method=method, target=target)


def at(k: int, angle: float, share: float = 1.0) -> dict[str, float]:
    """Angles of the cranks of parallelogram k, the second a share of the first, closed to first order."""
    other = share * angle
    closing = LENGTHS[0] / LENGTHS[1] * (other - angle) - angle
    return {f"p{k}": angle, f"q{k}": closing, f"r{k}": other}


@pytest.mark.parametrize("share", [1.0, 0.9, 0.5, 0.0])
@pytest.mark.parametrize("angle", [1e-8, 3e-9, 1e-10, 0.0])
@pytest.mark.parametrize("scales", [(1.0, 0.01), (1.0, 1.0), (1000.0, 1.0)])
@pytest.mark.parametrize("target", ["numpy", "cython"])
@pytest.mark.parametrize("method", ["embedding", "augmented"])
def test_it_is_refused(method: str, target: str, scales: tuple[float, ...], angle: float, share: float) -> None:
    mod = parallelograms(scales, method, target)
    x = mod.x0(at(0, 0.5) | at(1, angle, share))
    with pytest.raises((eg.PartitionError, eg.UnsolvedError)):
        mod.rhs(0.0, x)
    with pytest.raises((eg.PartitionError, eg.UnsolvedError)):
        mod.jacobian(0.0, x)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_beyond_it_is_right_to_what_closures_tell(target: str, turned: bool, scale: float) -> None:
    """Both cranks of a parallelogram turn alike: 1e-16 / s^2 of their acceleration, whatever joint is cut."""
    mod = parallelograms((scale,), "embedding", target, turned)
    names = list(mod.q_names)
    expected = 9.81 * (2 * 0.1 + 0.2) / (2 * (0.01 + 0.1**2) + 0.2**2) / scale  # two cranks and the coupler of 1 kg
    for angle in (100 * UNTOLD, 1e-4, 1e-3):
        given = {name: value for name, value in at(0, angle).items() if name in names}
        x = mod.x0(given | ({"s0": angle} if "s0" in names else {}))
        found = mod.rhs(0.0, x)[mod.n_q :]
        crank = found[names.index("p0" if "p0" in names else "r0")]
        assert abs(crank) == pytest.approx(expected, rel=10 * 1e-16 / (0.1 * angle) ** 2 + angle**2)
