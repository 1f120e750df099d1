"""The table of what each call needs of a model, and the refusals that follow from it, each with what to do instead."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from ..errors import UnavailableError, UsageError, cannot, no_choice

if TYPE_CHECKING:
    from ..base.algebra import Array
    from .layout import Layout


class Kind(NamedTuple):
    """A kind of model that calls exclude."""

    about: str  #: what such a model has, for the table in the documentation
    names: Callable[[Layout], Sequence[str]]  #: what of a model makes it one; empty of any other
    message: str  #: with {call}, {model} and {names}


def _sampled(layout: Layout) -> list[str]:
    return [name for clock in layout.info.clocks for name in clock["states"]]


#: What calls with some kinds of models can be used instead.
OTHERS = "rhs, jacobian, simulate, simulate_many, equilibrium, linearize, modes, sensitivities, reactions"
KINDS = {
    "rates": Kind(
        "rates of coordinates given as functions of velocities",
        lambda layout: layout.q if getattr(layout, "general_rates", False) else (),
        "model {model!r} gives the rates of its coordinates as functions of its velocities; this analysis "
        "is not available for such models, only rhs, jacobian, simulate and linearize are",
    ),
    "states": Kind(
        "first-order states",
        lambda layout: layout.states,
        "{call} is not available for models with first-order states, and {model!r} has {names}; "
        f"available are {OTHERS}, impact, minimal and dae",
    ),
    "reaction_laws": Kind(
        "forces that depend on reactions of joints",
        lambda layout: layout.reaction_laws,
        "{call} is not available for models whose forces depend on reactions of joints, as those of {names} do: they "
        "are solved for in the motion under the model's own forces; "
        f"available are {OTHERS}, multipliers and driving_forces",
    ),
    "sampled": Kind(
        "sampled states",
        _sampled,
        "{call} is not available for models with sampled states, and {model!r} has {names}: between samples these do "
        "not change, so they have no equations in continuous time; declare the quantity as an input for the mechanism "
        "alone, or put the law itself in its place",
    ),
    "rigid": Kind(
        "rigid contacts, which exert impulses alone",
        lambda layout: [repr(name) for name in layout.info.rigid_only],
        "{call} is not available for models with rigid contacts, and contacts {names} of {model!r} have the law "
        "rigid, which exerts impulses, not forces: shapes would pass through each other; run by simulate with "
        "method='moreau' and step=, or choose another law",
    ),
    "baumgarte": Kind(
        "constraints stabilised by baumgarte=",
        lambda layout: () if layout.projects else layout.constraint_labels or ("",),
        "model {model!r} was derived with baumgarte=, so its right-hand side does not project; analyses of such models "
        "are not available; derive without baumgarte for analyses",
    ),
}
#: Call -> the kinds of models that it excludes, in the order in which they are looked for.
EXCLUDED: dict[str, tuple[str, ...]] = {
    "equilibrium": ("rates", "rigid", "sampled"),
    "linearize": ("rigid", "sampled"),
    "sensitivities": ("rates", "baumgarte", "rigid"),
    "kinematic_analysis": ("rates", "states"),
    "motion_range": ("rates", "states"),
    "actuator_forces": ("states", "reaction_laws"),
    "inverse_dynamics": ("reaction_laws",),
    "inverse_dynamics_derivatives": ("states", "reaction_laws"),
    "input_jacobian": ("rates", "baumgarte"),
    "parameter_jacobian": ("rates", "baumgarte"),
    "regressor": ("states",),
    "base_parameters": ("states",),
    "the canonical form": ("states",),
    "fit": ("rigid",),
    "simulate_many": ("rigid",),
    "simulate_impacts": ("rigid",),
    "integrator": ("rigid",),
    "step": ("rigid",),
    "dae.solve": ("rigid",),
    "methods of SciPy": ("rigid",),
}


def require_support(layout: Layout, call: str, name: str = "") -> None:
    """Refuse a model of a kind that the table excludes from a call, which may go by another name in the message."""
    for kind in EXCLUDED[call]:
        if names := KINDS[kind].names(layout):
            message = KINDS[kind].message.format(call=name or call, model=layout.name, names=", ".join(names))
            raise UnavailableError(message)


def require_switched(layout: Layout, states: Array) -> None:
    """Refuse first-order states (n_s,) that are neither 0 nor 1 where they say whether a constraint is closed."""
    raw = dict(zip(layout.states, states, strict=True))
    for name, state in layout.switches.items():
        if (value := raw[state]) not in (0.0, 1.0):
            raise no_choice(f"{state} is 1 while {name} is closed and 0 while it is open, not {value:g}")


def refuse_closed(layout: Layout, states: Array, what: str) -> None:
    """Refuse first-order states (n_s,) with which constraints that close and open are closed."""
    require_switched(layout, states)
    raw = dict(zip(layout.states, states, strict=True))
    names = [name for name, state in layout.switches.items() if raw[state] > 0.5]
    if names:
        first = layout.switches[names[0]]
        raise UnavailableError(
            f"{what} is not available while constraints that close and open are closed, and {', '.join(names)} of "
            f"{layout.name!r} {'are' if names[1:] else 'is'}: what holds for a time restricts no degree of freedom; "
            f"give {{{first!r}: 0}} to let it go, or a model where it holds always (without closes and opens)"
        )


def not_driven(layout: Layout) -> UsageError:
    """The refusal of method kinematic where drivers do not move all."""
    return cannot(f"method 'kinematic' is for mechanisms without degrees of freedom; {layout.name} has {layout.n_dof}")


def require_rigid_contacts(layout: Layout) -> None:
    """Refuse method moreau where no contacts can be rigid."""
    if not layout.info.rigid_contacts:
        raise cannot(
            f"method moreau is for rigid contact between groups of shapes, and {layout.name} has no contacts that can "
            "be rigid (soil yields): describe them by m.contacts(...) without soil, or choose another method"
        )


def refuse_moreau(method: object, what: str) -> None:
    """Refuse the method for rigid contact where only integrators run."""
    if isinstance(method, str) and method == "moreau":
        raise UnavailableError(
            f"{what} has no method moreau, which takes contacts as rigid: run by simulate with method='moreau' and "
            "step=, or give the name of an integrator as method="
        )
