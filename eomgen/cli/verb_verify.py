"""Stage cli, verify: model file -> the table of everything its module was compared with, and an exit code."""

from __future__ import annotations

import sys

import click

from .analysis import Prepared, analysis_options
from .failures import BREACH
from .number_option import NumberRange
from .screen import print_json, say, stage
from .sections import verb_command


@verb_command()
@analysis_options
@click.option("--states", type=click.IntRange(min=1), default=6, show_default=True, help="Number of random states.")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the random states.")
@click.option(
    "--seconds",
    type=NumberRange(min=0.0),
    default=12.0,
    show_default=True,
    help="Time limit for all checks in s; variants get what is left.",
)
def verify(work: Prepared, states: int, seed: int, seconds: float, as_json: bool) -> None:
    """Check a compiled model against independent computations; exit with 5 if a limit is broken."""
    with stage("verify"):
        found = work.module.verify(states=states, seed=seed, seconds=seconds)
    if as_json:
        heading = {"name": work.equations.name, "method": work.equations.method}
        print_json(heading | found.as_dict() | {"seconds": round(found.seconds, 3)})
    else:
        say(str(found))
    sys.exit(0 if found.ok else BREACH)
