"""Stage cli, impact: model file -> the state after an impact at the initial state, impulses, energy lost."""

from __future__ import annotations

import click

from ..base.texts import without_noise
from ..errors import at_odds, ill_typed, incomplete
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
@click.option(
    "--slip",
    multiple=True,
    metavar="NAME=MU:SPEED",
    help="Friction of a gap: its coefficient and the output that is the sliding velocity; in space MU:SPEED:SPEED.",
)
@click.option("--stop", multiple=True, metavar="NAME", help="Coordinate that is locked suddenly; repeat it for more.")
@click.option("--closed", is_flag=True, help="Treat the gaps as closed at any value.")
def impact(
    work: Prepared,
    t: float,
    gap: tuple[str, ...],
    slip: tuple[str, ...],
    stop: tuple[str, ...],
    closed: bool,
    as_json: bool,
) -> None:
    """Find the state after an impact at the initial state, without friction unless it is given."""
    from ..simulation.impact import check_friction, check_gaps

    if not gap and not stop:
        raise incomplete("give --gap NAME=RESTITUTION for what closes, or --stop NAME for a coordinate that is locked")
    module = work.module
    gaps, locked = check_gaps(module.layout, parse_settings(gap, "--gap", "s=0.5"), stop, ("--gap", "--stop"))
    rough = check_friction(module.layout, dict(map(_read_friction, slip)), gaps, "--slip")
    if rough and locked:
        raise at_odds("give --slip or --stop, not both")
    start = module.x0(work.initial or None, t=t)
    found = module.impact(t, start, gaps, lock=locked, closed=closed, friction=rough or None)
    after = dict(zip(module.x_names, found.x.tolist(), strict=True))
    if as_json:
        rubbed = {
            "friction": found.friction,
            "sliding_before": found.sliding_before,
            "sliding_after": found.sliding_after,
        }
        print_json(
            work.heading(t)
            | {"names": found.names, "impulses": found.impulses, "energy_lost": found.energy_lost, "x": after}
            | {"rates_before": found.rates_before, "rates_after": found.rates_after}
            | {"constraints": module.constraint_labels, "constraint_impulses": found.constraint_impulses}
            | (rubbed if rough else {})
        )
        return
    say(repr(found))
    print_heading("velocities after it")
    units = [module.layout.unit(name) for name in module.layout.v]
    before = found.before[module.n_q :].tolist()
    rates = without_noise([after[name] for name in module.layout.v], units, before)
    print_rows([(n, f"{x:.6g} {unit}") for n, x, unit in zip(module.layout.v, rates, units, strict=True)])


def _read_friction(text: str) -> tuple[str, tuple[str, tuple[str, ...]]]:
    """The gap, its coefficient and its sliding velocities, from NAME=MU:SPEED."""
    gap, equals, rest = text.partition("=")
    mu, *names = rest.split(":")
    if not equals or not names:
        raise ill_typed(f"--slip: {text!r} is not NAME=MU:SPEED, such as gap=0.3:vx_tip")
    return gap, (mu, tuple(names))
