"""Closed linkages of any length, described through the public interface."""

from __future__ import annotations

import eomgen as eg


def n_four_bar(n: int) -> eg.Model:
    """The N-four-bar mechanism, problem A02 of the IFToMM library of benchmarks: n parallelograms in a row.

    Uniform rods of 1 m and 1 kg: cranks 0 .. n stand 1 m apart on the ground, coupler k joins the tips of cranks k - 1
    and k.  They start upright, the tips at 1 m/s along x.  Wherever all rods lie flat the mechanism has n + 1 freedoms.
    """
    m = eg.Model(f"n_four_bar_{n}", gravity=(0, "-g", 0))
    m.parameter("g", 9.81, unit="m/s**2")
    m.parameter("l", 1.0, unit="m")
    m.parameter("m", 1.0, unit="kg")
    rod = {"mass": "m", "com": ("l/2", 0, 0), "inertia": {"zz": "m*l**2/12"}}
    cranks = [m.body(f"crank{k}", **rod) for k in range(n + 1)]
    couplers = [m.body(f"coupler{k}", **rod) for k in range(1, n + 1)]
    for k, crank in enumerate(cranks):
        m.revolute(f"A{k}", m.ground.at(f"{k}*l", 0, 0), crank, coordinate=f"theta{k}")
        m.initial(**{f"theta{k}": "pi/2"})
    for k, coupler in enumerate(couplers, 1):
        m.revolute(f"B{k}", cranks[k - 1].at("l", 0, 0), coupler, coordinate=f"bend{k}")
        m.revolute(f"C{k}", coupler.at("l", 0, 0), cranks[k].at("l", 0, 0))
        m.initial(**{f"bend{k}": "-pi/2"})
    m.initial(theta0_dot=-1.0)
    tip = cranks[0].marker("tip", at=("l", 0, 0))
    m.output("x", tip.position[0])
    m.output("y", tip.position[1])
    return m
