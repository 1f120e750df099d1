"""A few faults of every kind; ``python -m hostile.faults`` tries all of them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hostile.fault_work import Work
from hostile.faults import FAULTS
from sweeps import part_of

NAMES = [name for name in FAULTS if name != "damaged Cython layer"]


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Work:
    return Work(tmp_path_factory.mktemp("faults"), Path(os.environ["EOMGEN_CACHE_DIR"]))  # that of all tests


@pytest.mark.slow
@pytest.mark.parametrize("name", part_of(NAMES, NAMES[::2].__contains__))
def test_every_fault_is_survived(work: Work, name: str) -> None:
    results = list(FAULTS[name](work, True))
    assert results
    assert [result for result in results if not result.survived] == []
