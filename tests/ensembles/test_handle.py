"""How a worker gets a module: its file where that fits the processor, else a build of its own."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.compilation.options import WITH_AVX
from eomgen.compilation.processor import NEEDS, lane_width
from eomgen.ensembles import handle as handles


def swing(**options: Any) -> Any:
    m = eg.Model("swing_of_handles", gravity=(0, -9.81, 0))
    m.revolute("hinge", m.ground, m.body("bob", mass=1.0, com=(1, 0, 0), inertia={"zz": 0.1}), coordinate="a")
    return m.compile(**options)


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What is loaded from a file, in order."""
    files: list[str] = []
    restore = handles.restore

    def spy(kind: Any, name: str, file: str, *rest: Any) -> Any:
        files.append(file)
        return restore(kind, name, file, *rest)

    monkeypatch.setattr(handles, "restore", spy)
    handles._open.cache_clear()
    return files


def test_code_for_one_processor_is_not_run_by_another(opened: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    module = swing(native=True)
    handle = handles.describe(module)
    assert set(handle.needs) == handles.processor_features()
    assert handle.open().rhs(0.0, module.x0(a=0.3)).tolist() == module.rhs(0.0, module.x0(a=0.3)).tolist()
    assert opened == [handle.file]
    handles._open.cache_clear()
    fewer = handles.processor_features() - {handle.needs[0]}
    monkeypatch.setattr(handles, "processor_features", lambda: fewer)
    there = handle.open()  # built from the sources, for the processor that is there
    assert opened == [handle.file]
    np.testing.assert_allclose(there.rhs(0.0, module.x0(a=0.3)), module.rhs(0.0, module.x0(a=0.3)), rtol=1e-13)


def test_code_is_shared_by_processors_that_have_its_instructions(
    opened: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    handle = handles.describe(swing())
    assert handle.needs == (NEEDS[WITH_AVX] if lane_width() >= WITH_AVX else ())
    handle.open()
    assert opened == [handle.file]
    handles._open.cache_clear()
    monkeypatch.setattr(handles, "processor_features", frozenset)
    found = handle.open()
    assert len(opened) == (1 if handle.needs else 2)  # built from the sources
    np.testing.assert_array_equal(found.rhs(0.0, found.x0()), swing().rhs(0.0, found.x0()))


def test_what_a_processor_can_do_is_known() -> None:
    import platform

    features = handles.processor_features()
    assert platform.machine() in features
    assert len(features) > 3


def test_numbers_of_steps_have_64_bits_on_every_system() -> None:
    """C's long has 32 on some, so none crosses the boundary."""
    module = swing()
    ensemble = module.simulate_many(0.1, {"a": [0.1, 0.2]}, events={"low": "a"})
    for name in ("steps", "rejected", "evaluations", "event_counts"):
        assert getattr(ensemble, name).dtype == np.int64
    templates = Path(__file__).parents[2] / "templates"
    for part in ("cython/_ensembles.pxi", "c/ensembles/lane_runs.c", "c/ensembles/lane_steps.c"):
        assert not re.search(r"\blong\b", (templates / part).read_text()), part
