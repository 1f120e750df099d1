"""Runs in files: killed ones go on to the last bit; what is of another run, damaged or hostile is refused by name."""

from __future__ import annotations

import hashlib
import io
import json
import os
import pickle
import signal
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from analysed import compiled
from children import HANGS
from models import IN_C
from refusals import refused, refuses

import eomgen as eg


class Killed(BaseException):
    """In place of a kill, while a checkpoint is written."""


@pytest.fixture(scope="module")
def pendulum() -> Any:
    return compiled("double_pendulum", "cython")


@pytest.fixture(scope="module")
def crank() -> Any:
    return compiled("slider_crank", "cython")


@pytest.fixture(scope="module")
def plain() -> Any:
    return models.build("double_pendulum").compile(target="numpy")


@pytest.fixture(scope="module")
def ball() -> Any:
    return compiled("hopper_with_apex", "cython").bind({"e": 0.98})


@pytest.fixture
def killed(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Let the process end in the writing after so many; 0: never."""
    save = np.savez

    def kill_after(count: int) -> None:
        left = [count or 10**9]

        def saving(*given: Any, **arrays: Any) -> None:
            if left[0] == 0:
                raise Killed
            left[0] -= 1
            save(*given, **arrays)

        monkeypatch.setattr(np, "savez", saving)

    return kill_after


def require_same(a: Any, b: Any) -> None:
    """Every bit of two trajectories."""
    assert a.t.tobytes() == b.t.tobytes()
    assert a.x.tobytes() == b.x.tobytes()
    assert [t.tobytes() for t in a.t_events] == [t.tobytes() for t in b.t_events]
    assert [x.tobytes() for x in a.x_events] == [x.tobytes() for x in b.x_events]
    assert a.metadata == b.metadata
    if a.has_dense_output:
        times = np.linspace(a.t[0], a.t[-1], 301)
        assert a.at(times).x.tobytes() == b.at(times).x.tobytes()


def go_through(module: Any, file: Path, killed: Callable[[int], None], kills: int, **run: Any) -> None:
    """Kill a run several times, and compare what comes of it in the end, and of its finished file."""
    whole = module.simulate(**run)
    for k in range(kills):
        killed(k + 1)
        with pytest.raises(Killed):
            module.simulate(checkpoint=file, checkpoint_every=0.0, **run)
    killed(0)
    require_same(whole, module.simulate(checkpoint=file, resume=True, **run))
    require_same(whole, module.simulate(checkpoint=file, **run))


COMPILED = [
    {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14},
    {"method": "RK45", "rtol": 1e-9, "t_eval": np.linspace(0, 60, 501)},
    {"method": "Radau", "rtol": 1e-7, "dense_output": True, "t_eval": np.linspace(0, 60, 77)},
    {"method": "Taylor", "rtol": 1e-13, "events": {"low": "theta1", "fast": "bend_dot - 1"}},
    {"method": "RK4", "step": 5e-3},
]


@pytest.mark.parametrize("options", COMPILED, ids=lambda options: options["method"])
def test_every_compiled_method_goes_on(pendulum: Any, options: Any, tmp_path: Path, killed: Any) -> None:
    go_through(pendulum, tmp_path / "run.ckpt", killed, 3, span=60, **options)


def test_resets_and_terminal_events_go_on(ball: Any, tmp_path: Path, killed: Any) -> None:
    half = {"half": {"expression": "h - 0.5", "terminal": 60}}
    go_through(ball, tmp_path / "a", killed, 3, span=40, max_step=1e-3)
    go_through(ball, tmp_path / "b", killed, 3, span=40, max_step=1e-3, t_eval=np.linspace(0, 40, 300), events=half)


SCIPY = [
    {"method": "RK23", "rtol": 1e-4, "t_eval": np.linspace(0, 2, 41)},
    {"method": "Radau", "rtol": 1e-4, "events": {"low": "theta1"}},
    {"method": "BDF", "rtol": 1e-4, "t_eval": np.linspace(0, 2, 41), "events": {"low": "theta1"}},
]


@pytest.mark.parametrize("options", SCIPY, ids=lambda options: options["method"])
def test_methods_of_scipy_go_on(plain: Any, options: Any, tmp_path: Path, killed: Any) -> None:
    go_through(plain, tmp_path / "run.ckpt", killed, 4, span=2, **options)


def test_functions_as_inputs_go_on_and_others_are_refused(crank: Any, tmp_path: Path, killed: Any) -> None:
    def drive(size: float) -> Callable[[float, Any], float]:
        return lambda t, x: size * np.sin(t) * x[1]

    go_through(crank, tmp_path / "run.ckpt", killed, 2, span=1, rtol=1e-6, inputs={"tau": drive(0.1)})
    with refused("EG-FILE-DAMAGED inputs.tau"):
        crank.simulate(1, rtol=1e-6, inputs={"tau": drive(0.2)}, checkpoint=tmp_path / "run.ckpt")


def written(file: Path) -> int:
    return file.stat().st_mtime_ns if file.exists() else 0


def test_kill_9(pendulum: Any, tmp_path: Path) -> None:
    """At any time: the file is whole, nothing is left beside it, and the run goes on."""
    run = {"span": 2000.0, "rtol": 1e-12, "atol": 1e-14, "max_step": 0.002, "t_eval": np.linspace(0, 2000, 1001)}
    code = (
        "import sys, numpy as np, eomgen as eg\n"
        f"module = eg.load_example('double_pendulum').compile(**{IN_C})\n"
        "module.simulate(2000.0, rtol=1e-12, atol=1e-14, max_step=0.002, t_eval=np.linspace(0, 2000, 1001),"
        "checkpoint=sys.argv[1], checkpoint_every=0.05)\n"
    )
    file, ended = tmp_path / "run.ckpt", 0
    for pause in (0.0, 0.09):
        seen = written(file)
        child = subprocess.Popen([sys.executable, "-c", code, str(file)])
        start = time.monotonic()
        while written(file) == seen and child.poll() is None and time.monotonic() - start < HANGS:
            time.sleep(0.01)
        time.sleep(pause)
        child.send_signal(signal.SIGKILL)
        ended += child.wait() == 0
        assert written(file) != seen or ended
    assert ended < 2
    found = pendulum.simulate(checkpoint=file, resume=True, **run)
    assert [path.name for path in tmp_path.iterdir()] == ["run.ckpt"]
    require_same(pendulum.simulate(**run), found)


CHANGES: list[tuple[dict[str, Any], str]] = [
    ({"span": 2}, "span, corners"),
    ({"method": "RK45"}, "method"),
    ({"rtol": 1e-5}, "options.rtol"),
    ({"max_step": 0.1}, "options.max_step"),
    ({"parameters": {"m2": 1.5}}, "parameters.m2"),
    ({"initial": {"theta1": 0.1}}, "initial"),
    ({"events": ["theta1"]}, "events"),
    ({"t_eval": [0.5]}, "t_eval"),
    ({"dense_output": True}, "dense_output"),
]


def test_another_run_is_refused_by_name(pendulum: Any, plain: Any, crank: Any, tmp_path: Path) -> None:
    file = tmp_path / "run.ckpt"
    run = {"span": 1, "rtol": 1e-6}
    pendulum.simulate(checkpoint=file, **run)
    for change, names in CHANGES:
        refuses(f"EG-FILE-DAMAGED {names}", pendulum.simulate, checkpoint=file, **(run | change))
    refuses("EG-FILE-DAMAGED code", plain.simulate, checkpoint=file, **run)
    refuses("EG-FILE-DAMAGED model_digest", crank.simulate, checkpoint=file, **run)
    again = pendulum.simulate(checkpoint=file, resume=False, **(run | {"rtol": 1e-5}))
    require_same(pendulum.simulate(checkpoint=file, **(run | {"rtol": 1e-5})), again)


def test_what_no_checkpoint_can_be_kept_of_is_refused(pendulum: Any, plain: Any, tmp_path: Path) -> None:
    file = tmp_path / "run.ckpt"
    for options, words in (
        ({"method": "LSODA"}, "EG-UNSUPPORTED LSODA"),
        ({"method": "BDF", "dense_output": True}, "EG-UNSUPPORTED continuous"),
        ({"checkpoint_every": -1}, "EG-RANGE checkpoint_every"),
        ({"checkpoint_every": float("nan")}, "EG-NUMBER checkpoint_every"),
        ({"resume": "yes"}, "EG-CHOICE resume"),
        ({"resume": True}, "EG-FILE checkpoint"),
        ({"checkpoint": 3}, "EG-TYPE file"),
        ({"checkpoint": "a\0b"}, "EG-TYPE file"),
    ):
        refuses(words, plain.simulate, 1, **{"checkpoint": file, **options})
    refuses("EG-MISSING resume checkpoint=", pendulum.simulate, 1, resume=True)
    assert not file.exists()


def test_a_full_disk_does_not_end_the_run(pendulum: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "run.ckpt"
    whole = pendulum.simulate(1, checkpoint=file, rtol=1e-6)
    kept = file.read_bytes()

    def full(*args: Any, **options: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez", full)
    with pytest.warns(UserWarning, match="checkpoint"):
        again = pendulum.simulate(1, checkpoint=file, rtol=1e-6, resume=False)
    require_same(whole, again)
    assert file.read_bytes() == kept
    assert os.listdir(tmp_path) == ["run.ckpt"]


def sealed(arrays: dict[str, Any]) -> dict[str, Any]:
    """With the seal of saved files: SHA-256 of all names, types, shapes and bytes."""
    found = hashlib.sha256()
    for name in sorted(arrays):
        array = np.asarray(arrays[name])
        found.update(f"\n{name} {array.dtype.str} {array.shape}\n".encode())
        found.update(array.tobytes())
    return {**arrays, "seal": np.array(found.hexdigest())}


def rewritten(file: Path, **changes: Any) -> bytes:
    """A checkpoint with some arrays replaced, or left out where they are None, under a seal of its own."""
    with np.load(file) as data:
        arrays = {name: data[name] for name in data.files if name != "seal"} | changes
    arrays = {name: value for name, value in arrays.items() if value is not None}
    out = io.BytesIO()
    np.savez(out, **sealed(arrays))
    return out.getvalue()


def test_hostile_numbers_are_refused(pendulum: Any, tmp_path: Path, killed: Any) -> None:
    """Whatever C would take as an index is compared with what there is; the other numbers are no more than numbers."""
    file, run = tmp_path / "run.ckpt", {"span": 150.0, "method": "Radau", "rtol": 1e-7, "events": ["theta1"]}
    killed(1)
    with pytest.raises(Killed):
        pendulum.simulate(checkpoint=file, checkpoint_every=0.0, **run)
    killed(0)
    good, (counts, block, notes) = file.read_bytes(), (np.load(file)[name] for name in ("counts", "block", "notes"))
    bad: list[dict[str, Any]] = [{"counts": np.where(np.arange(17) == i, 10**6, counts)} for i in (7, 8, 9, 10, 11, 16)]
    bad += [{"counts": np.where(np.arange(17) == i, -5, counts)} for i in (7, 8, 9, 10, 11, 16)]
    bad += [{"counts": counts[:-1]}, {"counts": counts.astype("U20")}, {"block": block[:-1]}, {"rows": None}]
    stored = np.load(file)["states"]
    bad += [{"event_counts": np.array([[1, 7, 0]])}, {"events": np.zeros((6, 2))}]
    bad += [{"states": np.zeros((len(stored) + more, 4))} for more in (-1, 1)]
    bad += [{"times": np.zeros((2, 2))}, {"notes": np.full((1, notes.shape[1]), 9.0)}, {"header": np.zeros(3)}]
    for change in bad:
        file.write_bytes(rewritten(file, **change))
        with refused("EG-FILE-DAMAGED damaged"):
            pendulum.simulate(checkpoint=file, **run)
            pytest.fail(f"taken: {change}")
        file.write_bytes(good)
    file.write_bytes(rewritten(file, block=np.full_like(block, np.nan)))
    with refused("EG-FILE-DAMAGED damaged"):  # NaN is no row
        pendulum.simulate(checkpoint=file, **run)


def npz(**arrays: Any) -> bytes:
    out = io.BytesIO()
    np.savez(out, **arrays)
    return out.getvalue()


def members(pairs: list[tuple[str, bytes]], kind: int = zipfile.ZIP_STORED) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", kind) as archive:
        for name, data in pairs:
            archive.writestr(name, data)
    return out.getvalue()


def claim(shape: str, data: bytes = b"", kind: str = "<f8") -> bytes:
    """An .npy text that says it has a shape."""
    head = f"{{'descr': {kind!r}, 'fortran_order': False, 'shape': {shape}, }}".encode()
    return b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head + data


OBJECTS = io.BytesIO()


np.save(OBJECTS, np.array([print], dtype=object), allow_pickle=True)


HOSTILE: dict[str, Any] = {
    "empty": b"",
    "text": b"no archive",
    "pickle": pickle.dumps([1]),
    "objects": members([("a.npy", OBJECTS.getvalue())]),
    "object claimed": members([("a.npy", claim("(1,)", b"12345678", "|O"))]),
    "huge shape": members([("a.npy", claim("(10**12,)"))]),
    "huge number": members([("a.npy", claim("(1000000000000,)"))]),
    "overflowing shape": members([("a.npy", claim("(4294967296, 4294967296, 2)"))]),
    "negative shape": members([("a.npy", claim("(-1,)"))]),
    "too much data": members([("a.npy", claim("(1,)", b"1" * 16))]),
    "code in head": members([("a.npy", claim("__import__('os')"))]),
    "no array": members([("a.npy", b"x" * 40)]),
    "twice": members([("a.npy", claim("(0,)")), ("a", claim("(0,)"))]),
    "bomb": lambda: members([("a.npy", claim("(37500000,)", b"\0" * 300_000_000))], zipfile.ZIP_DEFLATED),
    "half a head": members([("a.npy", claim("(1,", b"1" * 8))]),
    "head of another type": members([("a.npy", claim("(1,)", b"1" * 8).replace(b"'descr'", b"b'desc'"))]),
    "cut": npz(a=np.arange(100.0))[:500],
    "turned": npz(a=np.arange(100.0)).replace(np.array([50.0]).tobytes(), np.array([51.0]).tobytes()),
}


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize("what", HOSTILE)
def test_hostile_files_are_refused(what: str, tmp_path: Path) -> None:
    file = tmp_path / "a.npz"
    data = HOSTILE[what]
    file.write_bytes(data() if callable(data) else data)
    refuses("EG-FILE-DAMAGED trajectory", eg.load_trajectory, file)


def test_every_cut_of_a_trajectory_is_refused_or_whole(tmp_path: Path) -> None:
    module = models.build("pendulum").compile(target="numpy")
    file = module.simulate(0.1, rtol=1e-3).save(tmp_path / "run.npz")
    whole = file.read_bytes()
    for length in range(0, len(whole), 61):
        file.write_bytes(whole[:length])
        with pytest.raises(eg.UsageError):
            eg.load_trajectory(file)
    random = np.random.default_rng(0)
    for _ in range(60):
        data = bytearray(whole)
        data[random.integers(len(data))] ^= 1 << random.integers(8)
        file.write_bytes(data)
        with suppress(eg.UsageError):
            assert len(eg.load_trajectory(file)) > 1  # what was turned is not read


def test_a_trajectory_with_other_arrays_is_refused_by_name(tmp_path: Path) -> None:
    module = models.build("pendulum").compile(target="numpy")
    file = module.simulate(0.1, events=[lambda t, x: x[0] - 0.3]).save(tmp_path / "run.npz")
    with np.load(file) as data:
        arrays = {name: data[name] for name in data.files}
    header = str(arrays["header"])
    damaged = [{("old" if name == one else name): x for name, x in arrays.items()} for one in arrays]
    damaged += [{**arrays, name: x} for one in "tx" for name, x in ((one, arrays[one][..., :-1]), (one, np.array("1")))]
    damaged += [{**arrays, "x": arrays["x"].astype(complex)}, {**arrays, "t_events_1": arrays["t"]}]
    for text in (header[:-9], "3", "[]", "null", header.replace("x_names", "names"), header.replace("0.1", "0.2")):
        damaged.append({**arrays, "header": np.array(text)})
    for changed in damaged:
        np.savez(file, **changed)
        refuses("EG-FILE-DAMAGED run.npz", eg.load_trajectory, file)
    np.savez(file, **arrays)  # as another program would write the same arrays
    assert eg.load_trajectory(file).t_events[0].shape == arrays["t_events_0"].shape


def test_files_that_are_no_runs(tmp_path: Path) -> None:
    np.savez(tmp_path / "y.npz", header=np.array(json.dumps({"format": "other"})))
    refuses("EG-FILE-DAMAGED format", eg.load_trajectory, tmp_path / "y.npz")
    with pytest.raises(FileNotFoundError):
        eg.load_trajectory(tmp_path / "none.npz")
    run = models.build("pendulum").compile(target="numpy").simulate(0.1)
    for name in ("run.xls", "run.xlsx.gz"):
        refuses("EG-FILE .npz .csv", run.save, tmp_path / name)
