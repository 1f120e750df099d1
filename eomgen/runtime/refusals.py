"""What a model cannot be asked, and why."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..errors import UnavailableError, no_choice

if TYPE_CHECKING:
    from ..base.algebra import Array
    from .layout import Layout


def require_velocities(layout: Layout) -> None:
    """Refuse a model whose q' is given as functions of other velocities.

    Raises
    ------
    UnavailableError
    """
    if getattr(layout, "given_rates", False):
        raise UnavailableError(
            f"model {layout.name!r} gives the rates of its coordinates as functions of its velocities; this analysis "
            "is not available for such models, only rhs, jacobian, simulate and linearize are"
        )


def refuse_states(layout: Layout, what: str) -> None:
    """Refuse a model with first-order states where their values are not asked for.

    Raises
    ------
    UnavailableError
    """
    if layout.states:
        raise UnavailableError(
            f"{what} is not available for models with first-order states, and {layout.name!r} has "
            f"{', '.join(layout.states)}; available are rhs, jacobian, simulate, simulate_many, equilibrium, "
            "linearize, modes, sensitivities, reactions, impact, minimal and dae"
        )


def refuse_reaction_laws(layout: Layout, what: str) -> None:
    """Refuse a model whose forces depend on reactions, where other forces than its own act or the motion is given.

    Raises
    ------
    UnavailableError
    """
    if layout.reaction_laws:
        raise UnavailableError(
            f"{what} is not available for models whose forces depend on reactions of joints, as those of "
            f"{', '.join(layout.reaction_laws)} do: they are solved for in the motion under the model's own forces; "
            "available are rhs, jacobian, simulate, simulate_many, equilibrium, linearize, modes, sensitivities, "
            "reactions, multipliers and driving_forces"
        )


def refuse_sampled(layout: Layout, what: str) -> None:
    """Refuse a model with sampled states where motions in continuous time are asked for.

    Raises
    ------
    UnavailableError
    """
    clocks = layout.metadata.get("clocks", [])
    if clocks:
        names = ", ".join(name for clock in clocks for name in clock["states"])
        raise UnavailableError(
            f"{what} is not available for models with sampled states, and {layout.name!r} has {names}: between "
            "samples these do not change, so they have no equations in continuous time; declare the quantity as an "
            "input for the mechanism alone, or put the law itself in its place"
        )


def require_switched(layout: Layout, states: Array) -> None:
    """Refuse first-order states (n_s,) that are neither 0 nor 1 where they say whether a constraint is closed.

    Raises
    ------
    UsageError
    """
    given = dict(zip(layout.states, states, strict=True))
    for name in layout.metadata.get("switched", ()):
        if (value := given[f"{name}_closed"]) not in (0.0, 1.0):
            raise no_choice(f"{name}_closed is 1 while {name} is closed and 0 while it is open, not {value:g}")


def refuse_closed(layout: Layout, states: Array, what: str) -> None:
    """Refuse first-order states (n_s,) with which constraints that close and open are closed.

    Raises
    ------
    UnavailableError
    UsageError
        Such a state is neither 0 nor 1.
    """
    require_switched(layout, states)
    given = dict(zip(layout.states, states, strict=True))
    names = [name for name in layout.metadata.get("switched", ()) if given[f"{name}_closed"] > 0.5]
    if names:
        first = f"{names[0]}_closed"
        raise UnavailableError(
            f"{what} is not available while constraints that close and open are closed, and {', '.join(names)} of "
            f"{layout.name!r} {'are' if names[1:] else 'is'}: what holds for a time restricts no degree of freedom; "
            f"give {{{first!r}: 0}} to let it go, or a model where it holds always (without closes and opens)"
        )


def refuse_rigid(layout: Layout, what: str) -> None:
    """Refuse a model with contacts that exert impulses alone, which its equations in continuous time do not have.

    Raises
    ------
    UnavailableError
    """
    names = layout.metadata.get("rigid_only")
    if names:
        raise UnavailableError(
            f"{what} is not available for models with rigid contacts, and contacts {', '.join(map(repr, names))} of "
            f"{layout.name!r} have normal_law: rigid, which exerts impulses, not forces: shapes would pass through "
            "each other; run by simulate with method='moreau' and step=, or choose another normal_law"
        )


def refuse_moreau(method: object, what: str) -> None:
    """Refuse the method for rigid contact where only integrators run.

    Raises
    ------
    UnavailableError
    """
    if isinstance(method, str) and method == "moreau":
        raise UnavailableError(
            f"{what} has no method moreau, which takes contacts as rigid: run by simulate with method='moreau' and "
            "step=, or give the name of an integrator as method="
        )


def require_projection(layout: Layout) -> None:
    """Refuse a model whose right-hand side holds constraints by Baumgarte's stabilisation.

    Raises
    ------
    UnavailableError
    """
    if not layout.projects:
        raise UnavailableError(
            f"model {layout.name!r} was derived with baumgarte=, so its right-hand side does not project; analyses "
            "of such models are not available; derive without baumgarte for analyses"
        )
