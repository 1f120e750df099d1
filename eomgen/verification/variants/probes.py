"""Stage verification, probes: outputs of the motion of every body, of energies and coordinates, for comparisons."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...describe.description import Description
from ...describe.rewritten_texts import is_zero
from ...describe.visit import bodies_of, copied
from .variant import kinds_of, velocities_of

#: Motion of a probe: outputs of the group, by suffix.
LINEAR = ("ax", "ay", "az")
ANGULAR = ("wx_dot", "wy_dot", "wz_dot")
SPEED, PLACE, SPIN = ("vx", "vy", "vz"), ("x", "y", "z"), ("wx", "wy", "wz")
MARK = "probe_of_body"


def with_probes(description: Description) -> tuple[Description, dict[str, str]]:
    """A description with a probe at every body's centre of mass (its origin where that is not given), and its outputs.

    Returns
    -------
    description
    kinds : dict
        Output -> what it is: the quantity of a probe, an energy, ``coordinate NAME``, ``velocity NAME``, or ``result``
        for the model's own.
    """
    made, kinds = copied(description), dict[str, str]()
    outputs = {entry.name for entry in made.sections["outputs"]} - {*kinds_of(made), *velocities_of(made)}
    if initial := made.values.get("initial"):  # of outputs: they belong to runs, and have other names here
        made.values["initial"] = {name: value for name, value in initial.items() if name not in outputs}
    for entry in made.sections["outputs"]:  # an output that bears a coordinate's name could be that coordinate only
        kinds[f"result_{entry.name}"] = "result"
        entry.name = f"result_{entry.name}"
    for number, entry in enumerate(bodies_of(made)):
        entry.values["markers"][MARK] = {"at": list(entry.values.get("com", (0, 0, 0))), "rpy": [0, 0, 0]}
        for quantity in (*LINEAR, *ANGULAR, *SPEED, *PLACE, *SPIN):
            name = f"probe_{number}_{quantity}"
            made.add("outputs", name, {"expression": f"{quantity}({entry.name}.{MARK})"})
            kinds[name] = quantity
    if bodies_of(made):
        for energy in ("kinetic_energy", "potential_energy"):
            made.add("outputs", f"probe_{energy}", {"expression": energy})
            kinds[f"probe_{energy}"] = energy
    if any(_has_mass(entry.values) for entry in bodies_of(made)):
        made.add("outputs", "probe_mass", {"expression": "total_mass"})
        kinds["probe_mass"] = "total_mass"
    for what, names in (("coordinate", kinds_of(made)), ("velocity", velocities_of(made))):
        for number, name in enumerate(names):
            made.add("outputs", f"probe_{what}_{number}", {"expression": name})
            kinds[f"probe_{what}_{number}"] = f"{what} {name}"
    for number, name in enumerate(given_coordinates(made)):
        for what, suffix in (("coordinate", ""), ("velocity", "_dot"), ("acceleration", "_ddot")):
            made.add("outputs", f"probe_given_{what}_{number}", {"expression": name + suffix})
            kinds[f"probe_given_{what}_{number}"] = f"{what} {name}{suffix}"
    return made, kinds


def given_coordinates(description: Description) -> list[str]:
    """Coordinates of a bare Lagrangian, and of given equations whose velocities are their rates."""
    values = description.values
    given = values.get("lagrangian") or values.get("equations") or {}
    if given.get("velocities") or given.get("rates"):
        return []
    return [str(name) for name in given.get("coordinates", ())]


def _has_mass(values: Mapping[str, Any]) -> bool:
    return "solids" in values or "points" in values or not is_zero(values.get("mass", 0.0))
