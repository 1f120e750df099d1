"""Stage cli, modes: model file -> natural frequencies, mode shapes and damping ratios about an equilibrium."""

from __future__ import annotations

from .analysis import Prepared, analysis_options, time_option
from .screen import print_json, say
from .sections import verb_command


@verb_command()
@analysis_options
@time_option
def modes(work: Prepared, t: float, as_json: bool) -> None:
    """Find natural frequencies and mode shapes about the equilibrium found from the initial position."""
    module = work.module
    guess = {name: value for name, value in work.initial.items() if not name.endswith("_dot")}
    rest = module.equilibrium(guess or None, t)
    found = module.modes(rest.x, t)
    if as_json:
        damped = [
            {
                "eigenvalue": [mode.eigenvalue.real, mode.eigenvalue.imag],
                "frequency": mode.frequency,
                "damped_frequency": mode.damped,
                "ratio": mode.ratio,
            }
            for mode in found.damped
        ]
        print_json(
            work.heading(t)
            | {"coordinates": rest.coordinates, "stability": rest.stability, "names": found.names}
            | {"squares": found.squares, "frequencies": found.frequencies, "hertz": found.hertz}
            | {"shapes": found.shapes, "rigid": found.rigid, "diverging": found.diverging, "damped": damped}
        )
        return
    say(repr(rest))
    say(repr(found))
