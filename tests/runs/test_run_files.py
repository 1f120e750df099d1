"""Runs in files: another run goes on from one; what is damaged or hostile is refused by name."""

import io
import json
import pickle
import zipfile
from contextlib import suppress
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from analysed import compiled
from refusals import refuses

import eomgen as eg


def halves(module: eg.Module, middle: float, end: float, folder: Path, **options: Any) -> tuple[Any, Any]:
    """A run, and its second half, which goes on from the first, read from its file."""
    whole = module.simulate(end, **options)
    first = eg.load_trajectory(module.simulate(middle, **options).save(folder / "first.npz"))
    return whole, module.simulate((first.t[-1], end), initial=first, **options)


@pytest.mark.parametrize(
    ("name", "middle", "end", "options"),
    [
        ("slider_crank", 0.4, 1.0, {"rtol": 1e-11, "atol": 1e-13}),
        ("double_pendulum", 0.4, 1.0, {"method": "BDF", "rtol": 1e-9, "atol": 1e-11}),
        ("hopper_with_apex", 0.7, 2.0, {"rtol": 1e-11, "atol": 1e-13, "max_step": 1e-2}),
        ("sampled_servo", 0.375, 1.0, {"rtol": 1e-11, "atol": 1e-13}),
    ],
)
def test_a_run_goes_on_from_another(name: str, middle: float, end: float, options: Any, tmp_path: Path) -> None:
    whole, second = halves(compiled(name, "numpy"), middle, end, tmp_path, **options)
    assert second.t[0] == middle
    np.testing.assert_allclose(second.x[:, -1], whole.x[:, -1], rtol=1e-6, atol=1e-6)
    for all_times, times in zip(whole.t_events, second.t_events, strict=True):
        np.testing.assert_allclose(times, all_times[all_times > middle], rtol=1e-7)


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
