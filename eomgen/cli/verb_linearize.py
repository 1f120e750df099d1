"""Stage cli, linearize: model file -> A, B, C, D about a state, eigenvalues."""

from __future__ import annotations

import click

from ..base.texts import without_noise
from .analysis import Prepared, analysis_options, pairs, time_option
from .screen import print_heading, print_json, print_table, say
from .sections import verb_command


@verb_command()
@analysis_options
@time_option
@click.option(
    "--equilibrium", "at_rest", is_flag=True, help="Linearize about the equilibrium found from the initial position."
)
@click.option("--full", is_flag=True, help="Use all of x as states, not only the independent ones.")
def linearize(work: Prepared, t: float, at_rest: bool, full: bool, as_json: bool) -> None:
    """Linearize a model about its initial state, or about an equilibrium.

    States are independent displacements and velocities along the constraints, so that these add no eigenvalues.
    """
    module = work.module
    if at_rest:
        guess = {name: value for name, value in work.initial.items() if not name.endswith("_dot")}
        x = module.equilibrium(guess or None, t).x
    else:
        x = module.x0(work.initial or None, t=t)
    found = module.linearize(x, t, form="full" if full else "minimal")
    if as_json:
        matrices = {key: getattr(found, key) for key in ("A", "B", "C", "D", "mass", "damping", "stiffness", "drift")}
        print_json(
            work.heading(t)
            | {"x": dict(zip(module.x_names, found.x.tolist(), strict=True))}
            | {"states": found.states, "inputs": found.inputs, "outputs": found.outputs, **matrices}
            | {"velocities": found.velocity_names, "positions": found.position_names}
            | {"equilibrium": found.is_equilibrium, "steady": found.is_steady}
            | {"eigenvalues": pairs(found.eigenvalues), "stability": found.stability}
        )
        return
    say(repr(found))
    for label, matrix, columns, rows in (
        ("A", found.A, found.states, found.states),
        ("B", found.B, found.inputs, found.states),
        ("C", found.C, found.states, found.outputs),
        ("D", found.D, found.inputs, found.outputs),
    ):
        if matrix.size:
            print_heading(label)
            entries = iter(without_noise(matrix.ravel().tolist()))
            lines = [[name, *(f"{next(entries):.6g}" for _ in columns)] for name in rows]
            print_table(["", *columns], lines, right=range(1, len(columns) + 1))
