"""Stage cli, consistent: model file and a rough state -> the state on the constraints that differs least from it."""

from __future__ import annotations

from typing import Any

import click

from ..base.texts import without_noise
from ..errors import at_odds, no_such
from .analysis import Prepared, analysis_options, time_option
from .screen import print_heading, print_json, print_table
from .sections import verb_command
from .shared_options import parse_settings


@verb_command()
@analysis_options
@time_option
@click.option(
    "--weight", multiple=True, metavar="NAME=W", help="Weight of a change of a coordinate or rate; default 1."
)
@click.option("--mass", is_flag=True, help="Weight changes by the mass matrix of the tree instead.")
@click.option("--hold", multiple=True, metavar="NAME", help="Coordinate or rate that keeps its value exactly.")
def consistent(
    work: Prepared, t: float, weight: tuple[str, ...], mass: bool, hold: tuple[str, ...], as_json: bool
) -> None:
    """Bring a rough state (--set, the rest as declared) onto the constraints with the least change."""
    if weight and mass:
        raise at_odds("give either --weight or --mass")
    module = work.module
    rough = module.x0(t=t)
    for name, value in work.initial.items():
        if name not in module.x_names:
            raise no_such(f"--set {name}: the names of a rough state are {', '.join(module.x_names)}")
        rough[module.x_names.index(name)] = value
    weights: Any = "mass" if mass else parse_settings(weight, "--weight", "theta=100") or None
    found = module.consistent(rough, t, weights=weights, hold=hold)
    change = found - rough
    if as_json:
        states = {"x": found, "rough": rough, "change": change}
        print_json(
            work.heading(t) | {key: dict(zip(module.x_names, row.tolist(), strict=True)) for key, row in states.items()}
        )
        return
    print_heading("the nearest state on the constraints")
    units = [module.layout.unit(name) for name in module.x_names]
    columns = rough.tolist(), found.tolist(), change.tolist()
    rows = [
        [name, f"{a:.6g}", f"{b:.6g}", f"{c:.3g}"]
        for name, a, b, c in zip(module.x_names, *(without_noise(x, units) for x in columns), strict=True)
    ]
    print_table(["", "given", "consistent", "change"], rows, right=range(1, 4))
