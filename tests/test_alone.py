"""Work without the collector, in threads: each may end before or after the others, and what was comes back."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest

from eomgen.alone import LINEAR_ALGEBRA, alone


def threads_of_linear_algebra() -> set[int]:
    return {library["num_threads"] for library in LINEAR_ALGEBRA.info() if library["user_api"] == "blas"}


@pytest.fixture
def hasty() -> Iterator[None]:
    """Threads that take turns far more often than usual, and two threads of linear algebra."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    with LINEAR_ALGEBRA.limit(limits=2, user_api="blas"):
        yield
    sys.setswitchinterval(before)


def test_alone_inside_and_as_before_outside(hasty: None) -> None:
    before = threads_of_linear_algebra()
    with alone():
        assert not gc.isenabled()
        assert threads_of_linear_algebra() == {1}
        with alone():
            pass
        assert not gc.isenabled()
        assert threads_of_linear_algebra() == {1}
    assert gc.isenabled()
    assert threads_of_linear_algebra() == before


def test_a_collector_that_was_off_stays_off() -> None:
    gc.disable()
    try:
        with alone():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()


def test_an_error_gives_back_what_was(hasty: None) -> None:
    before = threads_of_linear_algebra()
    with pytest.raises(KeyError), alone():
        raise KeyError
    assert gc.isenabled()
    assert threads_of_linear_algebra() == before


def test_threads_leave_what_they_found(hasty: None) -> None:
    before = threads_of_linear_algebra()

    def work(_: int) -> bool:
        with alone():
            return gc.isenabled()

    with ThreadPoolExecutor(4) as pool:
        assert not any(pool.map(work, range(2000)))
    assert gc.isenabled()
    assert threads_of_linear_algebra() == before
