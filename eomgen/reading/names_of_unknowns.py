"""Stage reading, names: Kinematics -> names of momenta, multipliers and reactions that no name of the model has.

A parameter ``p_theta`` is another thing than the momentum of theta, and ``lambda1`` is printed as ``lambda_1`` is.
Where a name of the model is or is printed as the usual name, a longer word takes its place: ``momentum_theta``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from ..base.notation import Notation
from ..describe.printed_names import MULTIPLIERS, numbered
from ..kinematics import Kinematics
from ..kinematics.state import acceleration_name


def model_notation(kinematics: Kinematics, more: Iterable[str] = ()) -> Notation:
    """How the names of a model are printed, and further names after them."""
    k, m = kinematics, kinematics.mechanism
    velocities = [*k.velocity_names, *k.state_names]
    rates = [*velocities, *map(acceleration_name, velocities)]
    outputs = [output.name for output in m.outputs]
    outputs += m.given.multipliers if m.given is not None else ()
    names = [*k.names, *k.loop_coordinates.names, *k.parameter_names, *k.input_names, *outputs, *rates, *more]
    return Notation(names, m.latex, m.instances)


def momentum_names(kinematics: Kinematics) -> tuple[str, ...]:
    """``p_theta``, ...: what momenta are called, one a velocity."""
    return _free(kinematics, ("p", "momentum"), lambda p: [f"{p}_{label}" for label in kinematics.velocity_labels])


def multiplier_names(kinematics: Kinematics, count: int) -> tuple[str, ...]:
    """``lambda_1``, ...: what multipliers of constraint equations are called, unless given equations name them."""
    given = kinematics.mechanism.given
    if given is not None and count == len(given.multipliers):
        return given.multipliers
    return _free(kinematics, MULTIPLIERS, lambda word: numbered(word, count))


def wrench_names(kinematics: Kinematics, joint: str) -> tuple[str, ...]:
    """``A_M_x``, ..., ``A_F_x``, ...: components of the moment and of the force of a joint."""
    moment = _free(kinematics, ("M", "moment"), lambda word: _axes(f"{joint}_{word}"))
    return (*moment, *_free(kinematics, ("F", "force"), lambda word: _axes(f"{joint}_{word}")))


def twist_rate_names(kinematics: Kinematics, body: str) -> tuple[str, ...]:
    """``rod_alpha_x``, ..., ``rod_a_x``, ...: components of the rate of a body's twist."""
    turning = _free(kinematics, ("alpha", "angular"), lambda word: _axes(f"{body}_{word}"))
    return (*turning, *_free(kinematics, ("a", "linear"), lambda word: _axes(f"{body}_{word}")))


def _axes(stem: str) -> list[str]:
    return [f"{stem}_{axis}" for axis in "xyz"]


def _free(kinematics: Kinematics, words: Sequence[str], names: Callable[[str], list[str]]) -> tuple[str, ...]:
    """The names with the first word with which they are free."""
    notation = model_notation(kinematics)
    taken = {form for name in notation.names for form in (notation.latex(name), notation.text(name))}
    word, *others = words
    while True:
        found = names(word)
        forms = {form for name in found for form in (notation.latex(name), notation.text(name))}
        if taken.isdisjoint(forms) and set(found).isdisjoint(notation.names):
            return tuple(found)
        word, others = (others[0], others[1:]) if others else (f"{word}_", [])
