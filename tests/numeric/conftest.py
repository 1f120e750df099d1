"""The hand-written slider-crank as plain functions of numeric/."""

import importlib.util
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from eomgen.numeric import Scales, unpack_terms
from eomgen.numeric.embedded import DynamicsSlopes

HERE = Path(__file__).parent


def load_hand_written():
    name = "eomgen_test_hand_written"
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, HERE / "hand_written.py")
        sys.modules[name] = module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    return sys.modules[name]


@pytest.fixture(scope="session")
def models():
    return load_hand_written()


@pytest.fixture
def crank(models):
    """``crank(t=0, copies=1, u=(0, 0), **parameters)``: functions of q and v at that time."""

    def make(t=0.0, copies=1, u=(0.0, 0.0), length=models.L, **parameters):
        p = models.CRANK_PARAMETERS | parameters
        c, u = np.array(list(p.values())), np.array(u)
        blocks = models.crank_blocks(copies)
        m = 1 + copies

        def terms(q, v):
            return unpack_terms(blocks["terms"](t, np.concatenate([q, v]), u, c), 3, m)

        def residuals(q, v, a, multipliers):
            x = np.concatenate([q, v, a, multipliers])
            flat = blocks["residual_jacobian"](t, x, u, c)
            parts = np.split(flat, np.cumsum([9, 9, 3 * m, 3 * m]))
            return DynamicsSlopes(*(part.reshape(-1, 3) for part in parts))

        return SimpleNamespace(
            p=SimpleNamespace(**p),
            c=c,
            scales=Scales(np.array([1.0, 1.0, length]), np.full(m, length)),
            position=lambda q: models.crank_position(t, q, c, copies),
            rate=lambda q: models.crank_rate(t, q, c, copies),
            gamma=lambda q, v: models.crank_gamma(t, q, v, c, copies),
            terms=terms,
            residuals=residuals,
            closed=lambda theta: np.array(
                [
                    theta,
                    (beta := np.arcsin((p["e"] + p["a"] * np.sin(p["w"] * t) - p["l1"] * np.sin(theta)) / p["l2"])),
                    p["l1"] * np.cos(theta) + p["l2"] * np.cos(beta),
                ]
            ),
        )

    return make
