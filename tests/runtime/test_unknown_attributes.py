"""An attribute that is not there is an AttributeError that names the nearest; probes of other tools stay quick."""

from __future__ import annotations

import copy
import pickle
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def held() -> dict[str, Any]:
    equations = eg.load(EXAMPLES / "pendulum.yaml").derive()
    module = equations.compile(target="numpy")
    return {"a Module": module, "a Trajectory": module.simulate(0.1), "Equations": equations}


WRONG = {
    "a Module": {"simualte": "simulate", "simulat_many": "simulate_many", "mass_matrx": "mass_matrix"},
    "a Trajectory": {"t_evnts": "t_events", "to_panda": "to_pandas"},
    "Equations": {"compil": "compile", "mass_matrx": "mass_matrix"},
}


@pytest.mark.parametrize("kind", WRONG)
def test_a_wrong_name_is_told_with_the_nearest(held: dict[str, Any], kind: str) -> None:
    for name, near in WRONG[kind].items():
        with pytest.raises(AttributeError, match=rf"^{kind} has no attribute '{name}'; did you mean .*\b{near}\b.*\?$"):
            getattr(held[kind], name)
        assert not hasattr(held[kind], name)
        assert getattr(held[kind], name, 3) == 3
    with pytest.raises(AttributeError, match=f"^{kind} has no attribute 'zzz'; there are .*, "):
        _ = held[kind].zzz


@pytest.mark.parametrize("kind", WRONG)
def test_copies_and_probes_work_as_before(held: dict[str, Any], kind: str) -> None:
    one = held[kind]
    again = copy.copy(one)
    assert type(again) is type(one)
    if kind == "a Trajectory":
        np.testing.assert_array_equal(pickle.loads(pickle.dumps(one)).x, one.x)
        np.testing.assert_array_equal(copy.deepcopy(one).x, one.x)
    probes = ("_ipython_display_", "_ipython_canary_method_should_not_exist_", "_repr_mimebundle_", "__array__", "_x")
    begun = time.perf_counter()
    for _ in range(1000):
        assert not any(hasattr(one, probe) for probe in probes)
    assert time.perf_counter() - begun < 0.5  # 0.01 s; a search for near names would take 2 s
    with pytest.raises(AttributeError, match="has no attribute '__array__'$"):
        _ = one.__array__


def test_an_empty_object_before_it_is_filled_recurses_nowhere(held: dict[str, Any]) -> None:
    for one in held.values():
        bare = object.__new__(type(one))
        with pytest.raises(AttributeError, match="has no attribute 'zzz'"):
            _ = bare.zzz
