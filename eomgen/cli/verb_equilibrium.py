"""Stage cli, equilibrium: model file -> a position where all forces balance, with parameters solved for."""

from __future__ import annotations

import click

from .analysis import Prepared, analysis_options, pairs, time_option
from .screen import print_json, say
from .sections import verb_command
from .shared_options import parse_settings


@verb_command()
@analysis_options
@time_option
@click.option("--hold", multiple=True, metavar="NAME[=VALUE]", help="Coordinate that is held; repeat it for more.")
@click.option("--unknown", multiple=True, metavar="NAME", help="Parameter or input to solve for; repeat it for more.")
def equilibrium(work: Prepared, t: float, hold: tuple[str, ...], unknown: tuple[str, ...], as_json: bool) -> None:
    """Find a static equilibrium from the initial position; --set NAME=VALUE of a coordinate changes the guess."""
    module = work.module
    guess = {name: value for name, value in work.initial.items() if not name.endswith("_dot")}
    held: dict[str, float | None] = dict.fromkeys(word for word in hold if "=" not in word)
    held |= parse_settings(tuple(word for word in hold if "=" in word), "--hold", "theta=0.3")
    found = module.equilibrium(guess or None, t, hold=held, unknowns=unknown)
    if as_json:
        print_json(
            work.heading(t)
            | {"coordinates": found.coordinates, "unknowns": found.unknowns, "supports": found.supports}
            | {"forces": found.forces, "steps": found.steps}
            | {"eigenvalues": pairs(found.eigenvalues), "stability": found.stability}
        )
        return
    say(repr(found))
