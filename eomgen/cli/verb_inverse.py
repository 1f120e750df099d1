"""Stage cli, inverse: model file -> the forces of chosen drives that make a motion."""

from __future__ import annotations

from collections.abc import Sequence

import click

from ..base.texts import without_noise
from .analysis import Prepared, analysis_options, time_option
from .screen import print_heading, print_json, print_rows
from .sections import verb_command
from .shared_options import parse_settings


@verb_command()
@analysis_options
@time_option
@click.option("--actuated", multiple=True, metavar="NAME", help="Driven coordinate or input; repeat it for more.")
@click.option(
    "--accelerate", multiple=True, metavar="NAME=VALUE", help="Acceleration of an independent coordinate, 0 by default."
)
def inverse(work: Prepared, t: float, actuated: tuple[str, ...], accelerate: tuple[str, ...], as_json: bool) -> None:
    """Find the forces of drives for given accelerations at the initial state; loops stay closed."""
    module = work.module
    x = module.x0(work.initial or None, t=t)
    found = module.actuator_forces(t, x, parse_settings(accelerate), actuated=actuated or None)
    if as_json:
        print_json(
            work.heading(t)
            | {"forces": found.as_dict(), "accelerations": dict(zip(module.layout.a, found.a, strict=True))}
            | {"constraints": module.constraint_labels, "multipliers": found.multipliers}
            | {"joints": module.joint_names, "reactions": found.reactions}
        )
        return
    print_heading(f"forces of the drives at t = {t:g} s")
    forces = found.as_dict()
    _print_values(list(forces), list(forces.values()), [_unit(module, name) for name in forces])
    print_heading("accelerations")
    _print_values(module.layout.a, found.a.tolist(), [module.layout.unit(name) for name in module.layout.a])


def _print_values(names: Sequence[str], values: Sequence[float], units: Sequence[str]) -> None:
    settled = zip(names, without_noise(values, units), units, strict=True)
    print_rows([(name, f"{value:.6g} {unit}") for name, value, unit in settled])


def _unit(module: object, name: str) -> str:
    """Unit of the force along a coordinate, or of an input."""
    layout = module.layout  # type: ignore[attr-defined]
    if name in layout.u:
        return str(layout.unit(name))
    return {"m": "N", "rad": "N m"}.get(layout.unit(name), "")
