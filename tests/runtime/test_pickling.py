"""Trajectories and modules go through pickle, as pools of processes send them."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import eomgen as eg
from eomgen.api.module import Module
from eomgen.errors import ToolchainError
from eomgen.runtime import pickling
from eomgen.runtime.late import eager

EXAMPLES = Path(__file__).parents[2] / "examples"
#: What another process does with a pickle: it prints a state's derivative, without SymPy or the model.
READER = """
import pickle, sys
from pathlib import Path
module = pickle.loads(Path(sys.argv[1]).read_bytes())
assert "sympy" not in sys.modules
assert "eomgen.describe" not in sys.modules
print([value.hex() for value in module.rhs(0.5, module.x0(theta=0.4)).tolist()])
"""


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_a_module_goes_to_another_process_with_its_values(tmp_path: Path, target: str) -> None:
    module = eg.load(EXAMPLES / "slider_crank.yaml").compile(target=target).bind({"r": 0.12}, {"tau": 0.5})
    file = tmp_path / "module.pickle"
    file.write_bytes(pickle.dumps(module))
    assert file.stat().st_size < 2000
    said = subprocess.run([sys.executable, "-c", READER, str(file)], check=True, capture_output=True, text=True).stdout
    expected = [value.hex() for value in module.rhs(0.5, module.x0(theta=0.4)).tolist()]
    assert said.strip() == str(expected)  # to the last bit
    other = module.bind({"r": 0.1})
    assert said.strip() != str([value.hex() for value in other.rhs(0.5, other.x0(theta=0.4)).tolist()])


def test_here_the_code_is_shared_and_the_values_are_not() -> None:
    module = eg.load(EXAMPLES / "slider_crank.yaml").compile(target="numpy").bind({"r": 0.12})
    for again in (pickle.loads(pickle.dumps(module)), copy.deepcopy(module)):
        assert eager(again.core) is eager(module.core)
        assert again is not module
        assert again.p.tolist() == module.p.tolist()


def test_rarer_kernels_go_along_once_they_are_made() -> None:
    module = eg.load(EXAMPLES / "slider_crank.yaml").compile(target="numpy")
    q = module.x0()[: module.n_q]
    with pytest.raises(eg.UsageError, match="pickled without centroidal.*before you pickle"):
        pickle.loads(pickle.dumps(module)).center_of_mass(q)
    expected = module.center_of_mass(q)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(module)).center_of_mass(q), expected)


def test_a_module_whose_code_has_gone_says_so(tmp_path: Path) -> None:
    with pytest.raises(ToolchainError, match=r"gone: .*_core\.py; compile the model again"):
        pickling.restore(Module, "eomgen._gone", str(tmp_path / "_core.py"), np.zeros(1), np.zeros(1))


@pytest.mark.needs("AVX2")
def test_code_that_this_processor_does_not_know_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    module = eg.load(EXAMPLES / "pendulum.yaml").compile()
    given = pickle.dumps(module)
    monkeypatch.delitem(sys.modules, eager(module.core).__name__)
    monkeypatch.setattr(pickling, "processor_features", frozenset)
    with pytest.raises(ToolchainError, match="needs a processor with AVX2, FMA3.*compile the model again here"):
        pickle.loads(given)


def test_a_module_made_by_hand_says_why_it_cannot(pendulum) -> None:
    with pytest.raises(TypeError, match="not in a file of its own"):
        pickle.dumps(pendulum)


def test_a_kernel_alone_is_refused() -> None:
    module = eg.load(EXAMPLES / "pendulum.yaml").compile()
    with pytest.raises(TypeError, match="cannot pickle"):
        pickle.dumps(module.rhs)


def test_a_trajectory_is_data(crank) -> None:
    traj = crank().simulate((0.0, 0.2), {"theta": 0.3}, dense_output=True, inputs={"tau": ([0.0, 1.0], [0.0, 1.0])})
    again = pickle.loads(pickle.dumps(traj))
    assert again.names == traj.names
    for name in ("t", *traj.names):
        np.testing.assert_array_equal(again[name], traj[name])
    np.testing.assert_array_equal(again.x, traj.x)
    np.testing.assert_array_equal(again.energies, traj.energies)
    assert again.metadata == traj.metadata
    assert again.residuals == traj.residuals
    assert again.energy_drift == traj.energy_drift
    assert repr(again) == repr(traj)
    with pytest.raises(eg.UsageError, match="no solution between its times"):
        again.at(0.1)


def test_a_trajectorys_events_are_kept(pendulum) -> None:
    traj = pendulum.simulate(2.0, {"theta": 1.0}, events=lambda t, x: x[0])
    again = pickle.loads(pickle.dumps(traj))
    assert len(again.t_events[0])
    np.testing.assert_array_equal(again.t_events[0], traj.t_events[0])
    np.testing.assert_array_equal(again.x_events[0], traj.x_events[0])
