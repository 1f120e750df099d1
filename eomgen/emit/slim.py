"""Stage emit: generated files of a package -> what of eomgen calls and runs need; the rest refuses by name."""

from __future__ import annotations

from collections.abc import Mapping

from .abridged import abridge
from .carried import carry, describe_folder
from .selection import Selection
from .uses import SourceText

#: Files that a slim package has not -> what asks for them.
LEFT_OUT = {
    "analysis/impact": "events with impacts",
    "numeric/assembly_failure": "the reason why loops do not close",
    "numeric/leaps": "motions through change points",
    "numeric/nearest_branch": "positions near a guess",
    "numeric/splines": "cubic tables",
    "runtime/culprit": "the cause of a failure",
    "runtime/late_rules": "rules of several parameters",
    "runtime/origin": "the origin of a result",
    "runtime/rate_checks": "inputs whose rates are in the equations",
    "runtime/start_branch": "starts at change points",
    "runtime/signal_rates": "rates of inputs",
    "simulation/moreau": "rigid contact",
    "simulation/led_state": "inputs that move constraints and depend on the state",
    "simulation/progress": "progress=",
    "simulation/stalling": "the detection of runs without progress",
    "runtime/change_points": "change_points",
    "runtime/tree_motion": "kinematics",
    "runtime/wanted_outputs": "outputs and places of markers as initial values",
    "runtime/pickling": "pickling",
    "runtime/moving": "animate",
    "runtime/plotting": "plot",
    "runtime/storage": "save, to_xarray and pickles",
    "simulation/checkpoint": "checkpoint=",
    "simulation/driven": "mechanisms that drivers move entirely",
    "simulation/solver_state": "checkpoint=",
    "simulation/steppers": "step and classes of solvers",
}
#: Types of the options that these take, which their signatures unpack.
OPTIONS = ("SolverOptions",)
OF_CLOCKS = ("simulation/clocks", "simulation/controllers")
#: Classes whose methods users call.
PUBLIC = (
    ("api/module", "Module"),
    ("runtime/bound_model", "BoundModel"),
    ("runtime/assembled", "Assembled"),
    ("runtime/momenta", "Momenta"),
    ("runtime/trajectory", "Trajectory"),
)
#: Calls of a Module that a slim package has; the others are refused.
CALLS = ("simulate",)


def carry_slim(
    package: Mapping[str, str], signals: bool, start_terms: bool, states: bool, clocks: bool, contact_shapes: bool
) -> dict[str, str]:
    """Files of eomgen for a slim package, by name: what is reached of each, and refusals in place of others.

    Parameters
    ----------
    package : mapping of str to str
        Generated files, from which all begins.
    signals : bool
        Whether the model declares inputs over time, whose expressions runs in Python have to play.
    start_terms : bool
        Whether its initial values follow from parameters.
    states : bool
        Whether the model has first-order states.
    clocks : bool
        Whether some of these are sampled.
    contact_shapes : bool
        Whether groups of shapes are in contact.
    """
    left_out = LEFT_OUT if signals or start_terms else LEFT_OUT | {"runtime/tapes": "inputs that a model declares"}
    left_out = left_out if start_terms else left_out | {"runtime/late_start": "initial values that follow from others"}
    left_out = left_out if states else left_out | {"runtime/mechanical": "first-order states"}
    left_out = left_out if contact_shapes else left_out | {"simulation/meetings": "contacts between groups of shapes"}
    left_out = left_out if clocks else left_out | dict.fromkeys(OF_CLOCKS, "sampled states")
    own = {name: text for name, text in package.items() if name.endswith(".py")}
    typed = [SourceText("", text) for name, text in package.items() if name.endswith(".pyi")]
    selection = Selection(carry(package) | own, left_out)
    for name in own:
        selection.begin(name.removesuffix(".py"))
    for one in (one for source in typed for one in source.imports.values()):
        selection.reach(one.home or "", one.name)
    for name in CALLS:
        selection.reach(f"simulation/{name}", name)
    for name in OPTIONS:
        selection.reach("runtime/option_types", name)
    selection.follow(PUBLIC)
    called = {file for file, _ in PUBLIC}
    kept = [file for file in sorted(selection.files) if f"{file}.py" not in own]
    texts = {f"{file}.py": abridge(selection, file, file in called) for file in kept}
    texts |= {f"{file}.py": _REFUSAL.format(left_out[file]) for file in sorted(selection.refused)}
    folders = sorted({name.partition("/")[0] for name in texts if "/" in name})
    return texts | {f"{name}/__init__.py": describe_folder(name) for name in folders}


_REFUSAL = """from ..errors import left_out
raise left_out("{}")
"""
