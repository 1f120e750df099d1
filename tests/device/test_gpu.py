"""What only a GPU can show: arrays of other libraries that lie on it, and a package that finds it by itself."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest

import eomgen as eg
from eomgen.errors import UsageError
from eomgen.generation import generate

pytestmark = pytest.mark.needs("a GPU")
STATES = np.random.default_rng(0).normal(size=(4, 100))
CHILD = """
import sys
sys.path.insert(0, {folder!r})
import double_pendulum as model
import numpy as np
assert not [name for name in sys.modules if name.partition(".")[0] in ("sympy", "scipy", "eomgen")]
loaded = model.load()
x = np.load({states!r})
runs = loaded.simulate_many((0.0, 0.1), x)
assert (runs.status == 0).all()
np.save({states!r}, loaded.rhs(0.0, x))
"""


@pytest.fixture(scope="module")
def on_gpu() -> Any:
    return eg.load(models.EXAMPLES / "double_pendulum.yaml").derive().to_cuda()


@pytest.fixture(scope="module")
def wanted() -> np.ndarray:
    module = eg.load(models.EXAMPLES / "double_pendulum.yaml").derive().compile(target="numpy")
    return np.array([module.rhs(0.0, x) for x in STATES.T]).T


def assert_close(found: Any, wanted: np.ndarray) -> None:
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-12 * np.abs(wanted).max())


@pytest.mark.needs("CuPy")
def test_arrays_of_cupy(on_gpu: Any, wanted: np.ndarray) -> None:
    import cupy

    x = cupy.asarray(STATES)
    found = on_gpu.rhs(0.0, x)
    taken = cupy.asarray(found)
    assert taken.data.ptr == found.pointer
    assert_close(taken.get(), wanted)
    for bad, words in ((cupy.asarray(STATES.T.copy()).T, "in C order"), (x.astype("f4"), "must hold float64")):
        with pytest.raises(UsageError, match=words):
            on_gpu.rhs(0.0, bad)


@pytest.mark.needs("CuPy")
def test_what_another_stream_has_under_way_is_waited_for(on_gpu: Any, wanted: np.ndarray) -> None:
    import cupy

    for _ in range(20):
        with cupy.cuda.Stream(non_blocking=True):
            busy = cupy.zeros((3000, 3000))
            for _ in range(5):
                busy = busy @ busy
            x = cupy.asarray(STATES) + busy[0, 0]
            found = on_gpu.rhs(0.0, x)
        assert_close(found.numpy(), wanted)


@pytest.mark.needs("PyTorch")
def test_tensors_of_pytorch(on_gpu: Any, wanted: np.ndarray) -> None:
    import torch

    x = torch.as_tensor(STATES, device="cuda")
    found = on_gpu.rhs(0.0, x)
    taken = torch.as_tensor(found, device="cuda")
    assert taken.data_ptr() == found.pointer
    assert_close(taken.cpu().numpy(), wanted)
    assert_close(on_gpu.rhs(0.0, torch.as_tensor(STATES)), wanted)  # of the host: copied


def test_arrays_of_jax(on_gpu: Any, wanted: np.ndarray) -> None:
    jax = pytest.importorskip("jax")
    if jax.default_backend() != "gpu":
        pytest.skip("this JAX is for processors")
    with jax.enable_x64(True):
        x = jax.numpy.array(STATES)
        assert_close(on_gpu.rhs(0.0, x).numpy(), wanted)


@pytest.mark.needs("Numba")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of Numba's own
def test_arrays_of_numba(on_gpu: Any, wanted: np.ndarray) -> None:
    from numba import cuda

    found = on_gpu.rhs(0.0, cuda.to_device(STATES))
    assert_close(cuda.as_cuda_array(found).copy_to_host(), wanted)


def test_many_states_are_as_each_alone(on_gpu: Any) -> None:
    """Threads, blocks and the columns that the last block lacks."""
    x = np.random.default_rng(1).normal(size=(4, 70_001))
    found = on_gpu.rhs(0.0, x)
    for k in (0, 31, 32, 127, 128, 65_535, 65_536, 70_000):
        np.testing.assert_array_equal(found[:, k], on_gpu.rhs(0.0, x[:, k]))


def test_memory_is_given_back(on_gpu: Any) -> None:
    """More than the GPU has, one after the other."""
    x = np.random.default_rng(1).normal(size=(4, 4_000_000))
    on_gpu.rhs(0.0, x)
    most = 1.2 * memory_of_gpu()
    for _ in range(int(most / x.nbytes / 2)):  # states, and as much for results
        on_gpu.rhs(0.0, x)


def memory_of_gpu() -> float:
    """Bytes."""
    command = ["nvidia-smi", "--query-gpu=memory.total", "--format=csv,noheader,nounits"]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return float(told.splitlines()[0]) * 1e6


def test_a_package_finds_the_gpu(tmp_path: Path, wanted: np.ndarray) -> None:
    folder = generate(eg.load(models.EXAMPLES / "double_pendulum.yaml"), tmp_path, target="cuda").parent
    states = tmp_path / "states.npy"
    np.save(states, STATES)
    script = CHILD.format(folder=str(folder), states=str(states))
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert_close(np.load(states), wanted)
