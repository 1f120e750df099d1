"""Runs that start with shapes inside each other tell which and how deep."""

from __future__ import annotations

import warnings
from typing import Any

import contact_scenes as scenes
import numpy as np
import pytest
from contact_scenes import ELASTIC, LAW, PLANAR, on

from eomgen.simulation.meetings import PenetrationWarning


def pair(target: str) -> Any:
    """A box and two circles, all in one group, on a floor."""
    m, bodies = scenes.planar("deep", 3)
    shapes = [on(PLANAR[kind], body) for kind, body in zip(("box", "circle", "circle"), bodies, strict=True)]
    m.contacts("heap", shapes, law=ELASTIC)
    m.contacts("floor", shapes, {"shape": "half_plane", "on": m.ground.at(0, -1, 0)}, LAW)
    return m.compile(target=target)


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_the_deepest_pair_is_told(target: str) -> None:
    module = pair(target)
    apart = {"j1_x": 0.5, "j2_x": 1.0}
    for start, told in (
        ({"j1_x": 0.5, "j2_x": 0.65}, r"contacts 'heap': circle on b1 and circle on b2 are 0.05 m deep in each other"),
        ({"j1_x": 0.1, "j2_x": 1.0}, r"contacts 'heap': box on b0 and circle on b1 are 0.1 m deep in each other"),
        (
            {**apart, "j2_y": -0.93},
            r"contacts 'floor': half_plane on ground.* and circle on b2 are 0.03 m deep in each other",
        ),
    ):
        with pytest.warns(PenetrationWarning, match=told):
            module.simulate(1e-3, initial=start)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        module.simulate(1e-3, initial=apart)
        module.simulate(1e-3, initial={**apart, "j2_y": -0.9003})  # at rest on the floor


def test_numbers_of_the_deepest_pair_in_batches() -> None:
    mods = [pair(target) for target in ("numpy", "cython")]
    rng = np.random.default_rng(8)
    q, still = rng.uniform(-0.3, 0.3, (9, 40)), np.zeros((9, 40))
    found = [mod.kernels.motion("meeting_time")(q, still, still) for mod in mods]
    assert np.allclose(*found, rtol=1e-12)
    for k in range(40):
        alone = mods[0].kernels.motion("meeting_time")(q[:, k].copy(), still[:, k].copy(), still[:, k].copy())
        assert np.allclose(alone, found[0][:, k], rtol=1e-12)
        gaps = [0.2 - np.linalg.norm(q[3:5, k] - q[6:8, k])]
        gaps += [max(scenes.depths("box", "circle", q[:3, k], at)) for at in (q[3:6, k], q[6:9, k])]
        assert max(*gaps, 0.0) == pytest.approx(found[0][1, k], abs=1e-12)
