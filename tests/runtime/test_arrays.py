"""Files of arrays from anywhere: read within bounds, or refused by name."""

from __future__ import annotations

import io
import pickle
import zipfile
from collections.abc import Callable
from contextlib import suppress
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.runtime import arrays
from eomgen.runtime.arrays import BROKEN, read_arrays, sealed


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
HOSTILE = {
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
    "bomb": members([("a.npy", claim("(250000,)", b"\0" * 2_000_000))], zipfile.ZIP_DEFLATED),
    "half a head": members([("a.npy", claim("(1,", b"1" * 8))]),
    "head of another type": members([("a.npy", claim("(1,)", b"1" * 8).replace(b"'descr'", b"b'desc'"))]),
    "cut": npz(a=np.arange(100.0))[:500],
    "turned": npz(a=np.arange(100.0)).replace(np.array([50.0]).tobytes(), np.array([51.0]).tobytes()),
}


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize("what", HOSTILE)
def test_hostile_files_are_refused(what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(arrays, "SMALL", 10**6)
    file = tmp_path / "a.npz"
    file.write_bytes(HOSTILE[what])
    with pytest.raises(BROKEN):
        read_arrays(file)
    with pytest.raises(eg.UsageError, match="is not a trajectory saved by eomgen"):
        eg.load_trajectory(file)


def test_every_cut_of_a_trajectory_is_refused_or_whole(tmp_path: Path) -> None:
    module = eg.load(files("eomgen.examples") / "pendulum.yaml").compile(target="numpy")
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
    module = eg.load(files("eomgen.examples") / "pendulum.yaml").compile(target="numpy")
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
        with pytest.raises(eg.UsageError, match=r"run\.npz is not a trajectory saved by eomgen"):
            eg.load_trajectory(file)
    np.savez(file, **arrays)  # as another program would write the same arrays
    assert eg.load_trajectory(file).t_events[0].shape == arrays["t_events_0"].shape


def test_what_numpy_writes_is_read(tmp_path: Path) -> None:
    given: dict[str, Any] = {
        "a": np.arange(6.0).reshape(2, 3), "f": np.asfortranarray(np.arange(6.0).reshape(2, 3)), "e": np.empty((0, 3)),
        "s": np.array("text"), "i": np.array(3), "b": np.array([True]), "c": np.array([1j]),
    }  # fmt: skip
    save: Callable[..., None]
    for save in (np.savez, np.savez_compressed):
        save(tmp_path / "a.npz", **sealed(given))
        found = read_arrays(tmp_path / "a.npz")
        assert found.keys() == given.keys()
        for name, value in given.items():
            np.testing.assert_array_equal(found[name], value)
            assert found[name].flags.f_contiguous == value.flags.f_contiguous
            assert found[name].flags.writeable
    with pytest.raises(ValueError, match="is compressed"):
        read_arrays(tmp_path / "a.npz", compressed=False)
