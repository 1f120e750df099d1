"""Ensembles kept in folders go on where they were, and run on workers of dask.distributed."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import distributed
import numpy as np
import pytest
from analysed import compiled
from refusals import refused, refuses

TIGHT = {"rtol": 1e-10, "atol": 1e-12}


@pytest.fixture
def pendulum() -> Any:
    return compiled("double_pendulum", "cython")


def angles(k: int, seed: int = 0) -> dict[str, Any]:
    draw = np.random.default_rng(seed)
    return {"theta1": draw.uniform(-1, 1, k), "bend": draw.uniform(-1, 1, k), "bend_dot": 0.1}


def test_only_what_is_missing_is_run_again(pendulum: Any, tmp_path: Path) -> None:
    whole = pendulum.simulate_many(1, angles(40))
    folder = tmp_path / "runs"
    pendulum.simulate_many(1, angles(40), store=folder, block=8)
    blocks = sorted(folder.glob("block_*.npz"))
    assert len(blocks) == 5
    for gone in (blocks[1], blocks[4]):  # as where a run was stopped
        gone.unlink()
    kept = {path: path.stat().st_mtime_ns for path in blocks if path.exists()}
    resumed = pendulum.simulate_many(1, angles(40), store=folder, block=8)
    np.testing.assert_array_equal(resumed.x, whole.x)
    np.testing.assert_array_equal(resumed.steps, whole.steps)
    assert sorted(folder.glob("block_*.npz")) == blocks
    assert all(path.stat().st_mtime_ns == written for path, written in kept.items())


def test_a_store_of_another_ensemble_is_refused(pendulum: Any, tmp_path: Path) -> None:
    pendulum.simulate_many(1, angles(4), store=tmp_path / "runs")
    for changed in (
        {"span": 2}, {"initial": angles(4, seed=1)}, {"parameters": {"g": 1.0}}, {"rtol": 1e-3},
    ):  # fmt: skip
        with refused("EG-FILE-DAMAGED ensemble"):
            pendulum.simulate_many(**{"span": 1, "initial": angles(4), **changed}, store=tmp_path / "runs")
    (tmp_path / "mine.txt").write_text("precious")
    refuses("EG-FILE ensemble", lambda: pendulum.simulate_many(1, angles(4), store=tmp_path))
    block = next((tmp_path / "runs").glob("block_*"))
    block.write_bytes(block.read_bytes()[:700])
    refuses("EG-FILE-DAMAGED remove", lambda: pendulum.simulate_many(1, angles(4), store=tmp_path / "runs"))


def test_what_a_killed_call_left_is_no_hindrance(pendulum: Any, tmp_path: Path) -> None:
    folder = tmp_path / "runs"
    folder.mkdir()
    part = folder / ".manifest.json.0a1b2c3d"
    part.write_bytes(b"torn")
    whole = pendulum.simulate_many(1, angles(40), store=folder)
    assert not part.exists()
    names = sorted(path.name for path in folder.iterdir())
    assert len(names) > 2, "a kill would lose all of it"
    (folder / f".{names[0]}.0a1b2c3d").write_bytes(b"torn")
    (folder / names[0]).unlink()
    again = pendulum.simulate_many(1, angles(40), store=folder)
    assert sorted(path.name for path in folder.iterdir()) == names
    np.testing.assert_array_equal(again.x, whole.x)


def test_hostile_stores_are_refused(pendulum: Any, tmp_path: Path) -> None:
    folder = tmp_path / "runs"
    pendulum.simulate_many(1, angles(20), store=folder, block=10)
    block, manifest = folder / "block_000000.npz", folder / "manifest.json"
    good, text = block.read_bytes(), manifest.read_text()
    with np.load(block) as data:
        arrays = {name: data[name] for name in data.files}
    changes: tuple[dict[str, Any], ...] = (
        {"runs_t": arrays["runs_t"][:3]}, {"x": arrays["x"][:1]}, {"x": arrays["x"] + 1.0}, {"more": np.zeros(3)},
        {"words": np.array("[1, 2]")}, {"words": np.array("[" * 99999)},
    )  # fmt: skip
    files = [{("old" if name == one else name): x for name, x in arrays.items()} for one in arrays]
    for damaged in (*files, *(arrays | change for change in changes)):
        np.savez(block, **damaged)
        with refused("EG-FILE-DAMAGED block_000000.npz"):
            pendulum.simulate_many(1, angles(20), store=folder)
    block.write_bytes(good)
    for other in (
        "{}",
        "[" * 99999,
        text.replace('"block": 10', '"block": -1'),
    ):
        manifest.write_text(other)
        with refused("EG-FILE-DAMAGED ensemble"):
            pendulum.simulate_many(1, angles(20), store=folder)


WARNINGS = pytest.mark.filterwarnings("default")  #: of distributed itself


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


@WARNINGS
@pytest.mark.slow
def test_workers_give_the_same_bits(pendulum: Any, client: Any) -> None:
    here = pendulum.simulate_many(2, angles(50), **TIGHT)
    there = pendulum.simulate_many(2, angles(50), cluster=client, block=9, **TIGHT)
    np.testing.assert_array_equal(there.x, here.x)
    np.testing.assert_array_equal(there.evaluations, here.evaluations)


@WARNINGS
@pytest.mark.slow
def test_a_block_whose_task_fails_is_marked_and_the_others_are_kept(pendulum: Any, client: Any, tmp_path: Path) -> None:
    def refuse(block: Any) -> dict[str, Any]:
        if block.x[0].max() > 0.9 and np.isfinite(block.x).all():
            raise ArithmeticError("too high")
        return {"top": block.x[0].max()}

    starts = {"theta1": np.array([0.1, 0.2, 2.0, 0.3]), "theta1_dot": 0.0}
    ensemble = pendulum.simulate_many(1e-3, starts, reduce=refuse, cluster=client, block=1, store=tmp_path / "runs")
    (failure,) = ensemble.failures()
    assert failure.run == 2
    assert "ArithmeticError: too high" in failure.message
    assert len(list((tmp_path / "runs").glob("block_*.npz"))) == 3  # what failed is run again next time
