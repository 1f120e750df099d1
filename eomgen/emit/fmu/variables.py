"""Variables of a unit: their names, references, units and start values, in the order of modelDescription.xml."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from ...program import Program
from ...runtime.allowed_parameters import bounds_of


class Variable(NamedTuple):
    """One variable.

    Attributes
    ----------
    name : str
        Unlike all others.
    reference : int
        Its value reference; the groups stand as in templates/fmu/fmu_model.h.j2.
    group : {'x', 'rate', 'u', 'p', 'y', 'time', 'event'}
    unit, doc : str
    start : float or None
    bounds : pair of float
        The least and the greatest value, infinite where there is none.
    exact : bool
        Of a state: whether its start value holds; others follow from these where loops are closed.
    state : int or None
        Of a rate: the reference of its state.
    """

    name: str
    reference: int
    group: str
    unit: str = ""
    doc: str = ""
    start: float | None = None
    bounds: tuple[float, float] = (-math.inf, math.inf)
    exact: bool = True
    state: int | None = None

    @property
    def unknown_at_start(self) -> bool:
        """Whether its initial value is calculated."""
        return self.group in ("y", "rate") or (self.group == "x" and not self.exact)


def list_variables(program: Program, start: Sequence[float]) -> list[Variable]:
    """All variables.

    Parameters
    ----------
    program : Program
    start : sequence of float
        x where the model starts.
    """
    metadata, units, docs = program.metadata, program.metadata["units"], program.metadata["docs"]
    x_names, taken = metadata["x_names"], set(metadata["x_names"])
    exact, bounds = find_exact(program), bounds_of(metadata)
    found: list[Variable] = []

    def add(name: str, group: str, unit: str, doc: str, **more: object) -> None:
        while name in taken and group != "x":
            name += "_out" if group == "y" else "_"
        taken.add(name)
        found.append(Variable(name, len(found), group, unit, doc, **more))  # type: ignore[arg-type]

    for k, name in enumerate(x_names):
        add(name, "x", units.get(name, ""), docs.get(name, ""), start=float(start[k]), exact=exact[k])
    for k, name in enumerate(x_names):
        add(f"der({name})", "rate", _rate_unit(units.get(name, "")), f"rate of {name}", state=k)
    for name, value in zip(metadata["u_names"], metadata["u_values"], strict=True):
        doc = docs.get(name, "")
        if name in metadata.get("signals", {}):
            doc = f"{doc}; its signal over time comes from outside".removeprefix("; ")
        add(name, "u", units.get(name, ""), doc, start=float(value or 0.0))
    for name, value in zip(metadata["p_names"], metadata["p_values"], strict=True):
        pair = bounds.get(name, (-math.inf, math.inf))
        add(name, "p", units.get(name, ""), docs.get(name, ""), start=float(value), bounds=pair)
    for name in metadata["y_names"]:
        add(name, "y", units.get(name, ""), docs.get(name, ""))
    add("time", "time", "s", "")
    for event in metadata.get("events", ()):
        add(f"event({event['name']})", "event", "", event["doc"])
    return found


def find_exact(program: Program) -> list[bool]:
    """Of each state, whether its start value holds: the others follow so that loops are closed."""
    sizes = program.sizes
    if not program.has_loops:
        return [True] * sizes.n_x
    independent = set(program.preferred)
    of_v = [k in independent for k in range(sizes.n_v)]
    of_q = [True] * sizes.n_q
    if sizes.n_h:
        of_q = [False] * sizes.n_q
        for k in independent:
            if (place := coordinate_of(program, k)) >= 0:  # no coordinate has the rate of a turning frame
                of_q[place] = True
    return [*of_q, *of_v]


def coordinate_of(program: Program, velocity: int) -> int:
    """The coordinate that a velocity is the rate of."""
    return program.coordinate_of[velocity] if program.coordinate_of else velocity


def _rate_unit(unit: str) -> str:
    """The unit of a rate."""
    if not unit:
        return ""
    if unit == "1":
        return "1/s"
    return f"{unit}^2" if unit.endswith("/s") else f"{unit}/s"
