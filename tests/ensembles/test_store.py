"""Runs that are stopped go on where they were."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.ensembles import run_blocks

from .test_simulate_many import angles


def test_only_what_is_missing_is_run_again(pendulum: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = pendulum.simulate_many(1, angles(40))
    folder = tmp_path / "runs"
    begun: list[int] = []
    run_block = run_blocks.run_block

    def stopping(module: Any, cases: Any, *rest: Any) -> Any:
        if len(begun) == 3:
            raise KeyboardInterrupt
        begun.append(cases.count)
        return run_block(module, cases, *rest)

    monkeypatch.setattr(run_blocks, "run_block", stopping)
    with pytest.raises(KeyboardInterrupt):
        pendulum.simulate_many(1, angles(40), store=folder, block=8)
    assert len(list(folder.glob("block_*.npz"))) == 3
    begun.clear()
    begun.append(0)  # room for two more
    resumed = pendulum.simulate_many(1, angles(40), store=folder, block=8)
    assert begun == [0, 8, 8]
    np.testing.assert_array_equal(resumed.x, whole.x)
    np.testing.assert_array_equal(resumed.steps, whole.steps)
    monkeypatch.setattr(run_blocks, "run_block", None)  # nothing is left to do
    np.testing.assert_array_equal(pendulum.simulate_many(1, angles(40), store=folder, block=8).x, whole.x)


def test_a_store_of_another_ensemble_is_refused(pendulum: Any, tmp_path: Path) -> None:
    pendulum.simulate_many(1, angles(4), store=tmp_path / "runs")
    for changed in (
        {"span": 2}, {"initial": angles(4, seed=1)}, {"parameters": {"g": 1.0}}, {"rtol": 1e-3}, {"keep_events": 3},
    ):  # fmt: skip
        with pytest.raises(eg.UsageError, match="belongs to another ensemble: .* differ"):
            pendulum.simulate_many(**{"span": 1, "initial": angles(4), **changed}, store=tmp_path / "runs")
    (tmp_path / "mine.txt").write_text("precious")
    with pytest.raises(eg.UsageError, match="not empty and does not contain an ensemble"):
        pendulum.simulate_many(1, angles(4), store=tmp_path)
    block = next((tmp_path / "runs").glob("block_*"))
    block.write_bytes(block.read_bytes()[:700])
    with pytest.raises(eg.UsageError, match="cannot be read.*remove it to run its block again"):
        pendulum.simulate_many(1, angles(4), store=tmp_path / "runs")
    block.write_bytes(b"torn")
    with pytest.raises(eg.UsageError, match="cannot be read.*remove it to run its block again"):
        pendulum.simulate_many(1, angles(4), store=tmp_path / "runs")


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
        with pytest.raises(eg.UsageError, match=r"block_000000\.npz cannot be read: it(s arrays are| has) no"):
            pendulum.simulate_many(1, angles(20), store=folder)
    block.write_bytes((folder / "block_000001.npz").read_bytes())  # that of other runs
    with pytest.raises(eg.UsageError, match=r"block_000000\.npz cannot be read"):
        pendulum.simulate_many(1, angles(20), store=folder)
    block.write_bytes(good)
    for other in (
        "[1]",
        "{}",
        "[" * 99999,
        text.replace('"block": 10', '"block": -1'),
        text.replace(": 10", ": 1e999"),
    ):
        manifest.write_text(other)
        with pytest.raises(eg.UsageError, match="belongs to another ensemble"):
            pendulum.simulate_many(1, angles(20), store=folder)
