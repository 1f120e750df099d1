"""Ctrl-C and the progress line during a run in C."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(autouse=True)
def interrupts() -> Iterator[None]:
    """A process started in the background may ignore Ctrl-C."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def pressed(after: float) -> list[float]:
    """Ctrl-C in so many seconds; holds the time of it then."""
    when: list[float] = []

    def press() -> None:
        when.append(time.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    threading.Timer(after, press).start()
    return when


@pytest.mark.parametrize("name", ["double_pendulum", "andrews_squeezer"])
def test_an_interrupt_keeps_what_there_was(name: str) -> None:
    mod = eg.load(EXAMPLES / f"{name}.yaml").compile()
    mod.simulate((0, 1e-3))
    waits = []
    for _ in range(4):  # the machine may be busy: the least of several
        when = pressed(0.2)
        with pytest.raises(KeyboardInterrupt) as stopped:
            mod.simulate((0, 1e5), rtol=1e-12, atol=1e-12)
        waits.append(time.perf_counter() - when[0])
        if waits[-1] < 0.1:
            break
    assert min(waits) < 0.1
    assert isinstance(stopped.value, eg.SimulationInterrupted)
    part = stopped.value.trajectory
    assert 0.0 < part.t[-1] < 1e5
    assert len(part.t) > 50
    assert f"t = {part.t[-1]:.6g}" in str(stopped.value)
    few = part.t[:40]
    again = mod.simulate((0, few[-1]), rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(again.t[:39], few[:39])
    np.testing.assert_array_equal(again.x[:, :39], part.x[:, :39])


def test_progress_is_told_from_the_loop(capsys: pytest.CaptureFixture[str]) -> None:
    mod = eg.load(EXAMPLES / "double_pendulum.yaml").compile()
    told: list[float] = []

    class Watch:
        def look(self, t: float) -> None:
            told.append(t)

    from eomgen.runtime.signals import Forcing
    from eomgen.simulation.compiled import integrate_compiled

    options = {"rtol": 1e-11, "atol": 1e-12}
    begun = time.perf_counter()
    integrate_compiled(
        mod, Forcing(mod.layout, None), [0.0, 300.0], mod.x0(), "DOP853", None, False, options, Watch()
    )  # fmt: skip
    seconds = time.perf_counter() - begun
    assert told == sorted(told)
    assert told[-1] > 150.0
    assert len(told) < 30 + seconds / 1e-3  # now and then, not every step
    assert mod.simulate((0, 1), progress=True).status == 0
    capsys.readouterr()


def test_what_the_watch_or_a_handler_raises_comes_out() -> None:
    mod = eg.load(EXAMPLES / "double_pendulum.yaml").compile()

    def alarm(number: int, frame: Any) -> None:
        raise TimeoutError("too long")

    before = signal.signal(signal.SIGALRM, alarm)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.1)
        with pytest.raises(TimeoutError, match="too long"):
            mod.simulate((0, 1e5), rtol=1e-12, atol=1e-12, t_eval=[1e5])
    finally:
        signal.signal(signal.SIGALRM, before)
