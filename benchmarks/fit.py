"""Eight parameters of a two-link arm from a noisy run: exact derivatives of a fit beside differences of runs."""

from __future__ import annotations

from math import sin
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import eomgen as eg
from eomgen.analysis.fit import run_slopes

from .measure import interleaved, seconds_of
from .report import Limit, Report, Table

TITLE = "derivatives of a run by eight parameters"
VALUES = {"m2": 2.0, "m3": 1.2, "I2": 0.05, "I3": 0.03, "d1": 0.15, "d2": 0.08, "f1": 0.4, "f2": 0.2}
START, END, TIMES = {"a": 0.6, "b": -0.9}, 2.0, np.linspace(0.0, 2.0, 81)
RTOL, ATOL = 1e-8, 1e-10
DRIVE = "4*sin(5*t) + 3*sin(2.3*t)"
STEP = 1e-5  #: relative, of central differences
FASTER = 20.0


def arm() -> eg.Model:
    """Two links that swing with viscous and smoothed dry friction."""
    m = eg.Model("arm", gravity=(0, -9.81, 0))
    for name, value in VALUES.items():
        m.parameter(name, value)
    m.body("upper", mass="m2", com=(0.25, 0, 0), inertia={"zz": "I2"}, markers={"tip": (0.5, 0, 0)})
    m.body("lower", mass="m3", com=(0.2, 0, 0), inertia={"zz": "I3"})
    m.revolute("shoulder", m.ground, "upper", coordinate="a")
    m.revolute("elbow", "upper.tip", "lower", coordinate="b")
    m.friction("in_shoulder", "shoulder", coulomb="f1", viscous="d1", smoothing=0.05)
    m.friction("in_elbow", "elbow", coulomb="f2", viscous="d2", smoothing=0.05)
    m.torque("drive", "shoulder", m.input("tau"))
    return m


class Case:
    """The same derivatives by all ways; each is compared before it is timed."""

    def __init__(self) -> None:
        self.module = module = arm().compile()
        self.names, self.columns = tuple(VALUES), module.x_names
        self.start = module.x0(START)
        self.arguments: dict[str, Any] = {
            "span": (0.0, END), "initial": START, "inputs": {"tau": DRIVE}, "parameters": None, "t_eval": TIMES,
            "rtol": RTOL, "atol": ATOL, "method": "DOP853",
        }  # fmt: skip

    def along(self) -> Any:
        """Along the steps of the run, as ``fit`` takes them."""
        found = run_slopes(self.module, self.names, self.columns, self.arguments)
        assert found is not None
        return np.array([found[name] for name in self.columns])

    def beside(self) -> Any:
        """Integrated beside the motion."""
        found = self.module.sensitivities(self.names, **self.arguments)
        return np.moveaxis(found.dx, 1, 2)

    def _differences(self, run: Any) -> Any:
        columns = []
        for name, value in VALUES.items():
            high, low = (run({name: value * (1 + sign * STEP)}) for sign in (1, -1))
            columns.append((high - low) / (2 * STEP * value))
        return np.moveaxis(np.array(columns), 0, 2)

    def compiled(self) -> Any:
        """Central differences of compiled runs."""
        return self._differences(lambda p: self.module.simulate(**{**self.arguments, "parameters": p}).x)

    def scipy(self) -> Any:
        """Central differences of runs by SciPy, with the compiled right-hand side."""

        def run(values: dict[str, float]) -> Any:
            p = np.array([values.get(name, value) for name, value in zip(self.names, self.module.p, strict=True)])
            rhs = self.module.rhs
            return solve_ivp(
                lambda t, x: rhs(t, x, p=p, u=np.array([4 * sin(5 * t) + 3 * sin(2.3 * t)])),
                (0.0, END), self.start, method="DOP853", rtol=RTOL, atol=ATOL, t_eval=TIMES,
            ).y  # fmt: skip

        return self._differences(run)


def run(quick: bool) -> Report:
    """All ways in turns."""
    case = Case()
    ways = {
        "along the run": case.along,
        "beside the motion": case.beside,
        "differences of compiled runs": case.compiled,
        "differences of runs by solve_ivp": case.scipy,
    }
    truth = case.beside()
    size = np.abs(truth).max(axis=(0, 1))
    errors = {name: float((np.abs(way() - truth) / size).max()) for name, way in ways.items()}
    samples = interleaved(2 if quick else 7, **{name: lambda way=way: seconds_of(way) for name, way in ways.items()})
    first = samples["along the run"].median
    rows = [[name, s.median * 1e3, s.median / first, errors[name]] for name, s in samples.items()]
    ratio = samples["differences of runs by solve_ivp"].median / first
    promised = Limit("faster than differences of runs by solve_ivp", ratio, FASTER, "times", at_least=True)
    columns = ("way", "ms", "times the first", "differs from the second by")
    notes = (
        f"all derivatives of four states at {len(TIMES)} times, by eight parameters; medians, in turns",
        f"runs of DOP853, rtol {RTOL:g}; central differences of relative step {STEP:g}, two runs for each parameter",
    )
    return Report(
        (Table(TITLE, columns, rows),),
        () if quick else (promised,),
        notes,
        {name: s.as_dict() for name, s in samples.items()},
    )
