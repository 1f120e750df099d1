"""Stage cli, impact: model file -> the state after an impact at the initial state, impulses, energy lost."""

from __future__ import annotations

import click

from ..analysis.tables import without_noise
from ..errors import UsageError
from .analysis import Prepared, analysis_options, time_option
from .screen import print_heading, print_json, print_rows, say
from .sections import verb_command
from .shared_options import parse_settings


@verb_command()
@analysis_options
@time_option
@click.option(
    "--gap", multiple=True, metavar="NAME=E", help="Gap (coordinate or output) that closes, with its restitution."
)
@click.option("--stop", multiple=True, metavar="NAME", help="Coordinate that is locked suddenly; repeat it for more.")
@click.option("--closed", is_flag=True, help="Treat the gaps as closed at any value.")
def impact(work: Prepared, t: float, gap: tuple[str, ...], stop: tuple[str, ...], closed: bool, as_json: bool) -> None:
    """Find the state after an impact at the initial state: without friction, by Newton's law of restitution."""
    from ..analysis.impact_gaps import check_gaps

    if not gap and not stop:
        raise UsageError("give --gap NAME=RESTITUTION for what closes, or --stop NAME for a coordinate that is locked")
    module = work.module
    gaps, locked = check_gaps(module.layout, parse_settings(gap, "--gap", "s=0.5"), stop, ("--gap", "--stop"))
    found = module.impact(t, module.x0(work.initial or None, t=t), gaps, lock=locked, closed=closed)
    after = dict(zip(module.x_names, found.x.tolist(), strict=True))
    if as_json:
        print_json(
            work.heading(t)
            | {"names": found.names, "impulses": found.impulses, "energy_lost": found.energy_lost, "x": after}
            | {"rates_before": found.rates_before, "rates_after": found.rates_after}
            | {"constraints": module.constraint_labels, "constraint_impulses": found.constraint_impulses}
        )
        return
    say(repr(found))
    print_heading("velocities after it")
    units = [module.layout.unit(name) for name in module.layout.v]
    before = found.before[module.n_q :].tolist()
    rates = without_noise([after[name] for name in module.layout.v], units, before)
    print_rows([(n, f"{x:.6g} {unit}") for n, x, unit in zip(module.layout.v, rates, units, strict=True)])
