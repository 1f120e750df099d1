"""Mechanism -> Kinematics, Mobility, TreeEquations: together a Derivation, the equations to read and to count.

:class:`~..api.equations.Equations` compiles them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar, cast

import numpy as np

from ..base.texts import fold, quote
from ..errors import AssemblyError, cannot, ill_typed, off_range
from ..expr.core import Expr, copied
from ..expr.records import Record
from ..expr.schedule import Operations, count
from ..expr.without_gc import timed, without_gc
from ..mechanics import Kinematics, analyse
from ..mechanics.methods import GIVEN, METHODS, TreeEquations, direct_equations
from ..mechanics.mobility import Mobility, find_mobility
from ..model.sympy_face import names_of
from ..model.visit import Undotted
from ..runtime.argument_checks import unknown
from . import Displayed

if TYPE_CHECKING:
    from ..codegen.choice import Choice
    from ..mechanics.report import MechanismReport
    from ..model.mechanism import Mechanism

OF_LAGRANGIANS = ("lagrange", "hamilton", "augmented")  #: methods that take a bare Lagrangian


class Derivation(Record, Displayed):
    """What a derivation gives; :class:`~..api.equations.Equations` says what its attributes are."""

    kinematics: Kinematics = field(repr=False)
    mobility: Mobility = field(repr=False)
    tree: TreeEquations = field(repr=False)
    seconds: dict[str, float] = field(default_factory=dict, repr=False)
    choice: Choice | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        vars(self)["_derived"] = copied((self.kinematics, self.mobility, self.tree))

    def fresh(self) -> tuple[Kinematics, Mobility, TreeEquations]:
        """A copy of what was derived, in a graph of its own, as it was before anyone read or compiled anything.

        Whatever is made of expressions adds nodes to their graph, whose numbers decide on the order of sums, factors
        and statements.  What is built from such a copy depends on the model alone.
        """
        return copied(cast("tuple[Kinematics, Mobility, TreeEquations]", vars(self)["_derived"]))

    @property
    def method(self) -> str:
        """Name of the method of derivation."""
        return self.tree.method

    @cached_property
    def report(self) -> MechanismReport:
        """Bodies, joints, loops, rank, degrees of freedom, partition."""
        from ..mechanics.report import report

        return report(self.kinematics, self.mobility)

    @cached_property
    def operations(self) -> dict[str, Operations]:
        """Operations of each part, counted on the graph; work that depends on parameters only is included."""
        tree, c = self.tree, self.kinematics.constraints
        parts: dict[str, Sequence[Expr]] = {"bias": tree.bias}
        if tree.accelerations is None:
            lower = [x for i, row in enumerate(tree.mass_matrix) for x in row[: i + 1]]
            parts = {"mass_matrix": lower, "bias": tree.bias, "mass_matrix and bias": [*lower, *tree.bias]}
        else:
            parts["accelerations"] = tree.accelerations
        parts |= {
            "inverse_dynamics": tree.inverse_dynamics,
            "energy": [tree.kinetic_energy, tree.potential_energy],
        }
        if tree.system is not None:
            parts["linear system"] = [*tree.system.entries, *tree.system.right]
        if c.labels:
            rows = [x for row in c.jacobian for x in row]
            parts["constraints"] = [*c.values, *rows, *c.gamma]
        return {name: count(list(part)) for name, part in parts.items()}

    @property
    def system_size(self) -> tuple[int, int] | None:
        """Unknowns and nonzero entries of the linear system, of a method with unknown reactions; else None."""
        system = self.tree.system
        return None if system is None else (len(system.unknowns), len(system.places))

    # -- display
    __repr__ = Displayed.__repr__

    @cached_property
    def _text(self) -> str:
        from .writers import equations_text

        lines = [equations_text(self), ""]
        counts = (f"{name} {operations.total}" for name, operations in self.operations.items())
        lines += fold(", ".join(counts), 80, "operations: ", "  ")
        if self.system_size is not None:
            unknowns, entries = self.system_size
            lines.append(f"  linear system of {unknowns} unknowns, {entries} nonzero entries")
        if self.choice is not None:
            lines += fold(str(self.choice), 80, "", "  ")
        return "\n".join(lines)


Derived = TypeVar("Derived", bound=Derivation)


@np.errstate(all="ignore")  # results are looked at, and what is not finite is refused by name
def derive_mechanism(
    kind: type[Derived],
    mechanism: Mechanism,
    method: str,
    independent: Sequence[str] | None = None,
    baumgarte: tuple[float, float] | None = None,
    described: float = 0.0,
) -> Derived:
    """The equations of motion of what a model says; ``described`` is the time (s) that reading it took."""
    from ..codegen.choice import choose

    seconds = {"describe": described}
    chosen = choose_method(mechanism, method)
    with without_gc(), timed(seconds, "kinematics"):
        plain = Undotted(mechanism.presentation.instances).coordinate  # leg.hip of an instance is leg_hip
        wanted = tuple(map(plain, names_of("independent", independent, "a coordinate")))
        kinematics = analyse(mechanism, wanted)
        mobility = _mobility(kinematics, wanted)
    if baumgarte is not None:
        kinematics = _stabilised(kinematics, chosen, baumgarte)
    with without_gc(), timed(seconds, "equations"):
        if mechanism.reaction_quantities or mechanism.switched or any(force.by_reaction for force in mechanism.forces):
            from ..codegen.reactions import with_reactions

            kinematics = with_reactions(kinematics, mobility)
        choice: Choice | None = None
        if chosen == GIVEN:
            tree = direct_equations(kinematics)
        elif chosen != "auto":
            tree = METHODS[chosen](kinematics)
        else:
            tree, choice = choose(kinematics, mobility)
    with without_gc():
        return kind(kinematics, mobility, tree, seconds, choice)


def choose_method(mechanism: Mechanism, method: str) -> str:
    """Resolve ``auto`` for a bare Lagrangian; refuse a method that is not there or does not fit."""
    if not isinstance(method, str):
        raise ill_typed(f"method must be the name of a method, not {quote(method)}")
    if mechanism.written is not None:
        if method not in ("auto", GIVEN):
            raise cannot(f"method {method!r} needs bodies; for given equations there are: auto, {GIVEN}")
        return GIVEN
    if method == "auto" and mechanism.bare:
        return "lagrange"
    if method not in ("auto", *METHODS):
        raise unknown("method", method, ("auto", *METHODS))
    if mechanism.bare and method not in OF_LAGRANGIANS:
        raise cannot(
            f"method {method!r} needs bodies; for a bare Lagrangian there are: auto, {', '.join(OF_LAGRANGIANS)}"
        )
    return method


def _stabilised(kinematics: Kinematics, method: str, baumgarte: Sequence[float]) -> Kinematics:
    """Kinematics with Baumgarte's terms, of the method that takes them."""
    from ..mechanics.methods.augmented import stabilise

    if method != "augmented":
        raise cannot(f"baumgarte works with method 'augmented' only, not {method!r}; other methods project states")
    try:
        alpha, beta = (float(x) for x in baumgarte)
    except (TypeError, ValueError):
        raise ill_typed(f"baumgarte must be two numbers (alpha, beta) in 1/s, not {baumgarte!r}") from None
    if not (0.0 <= alpha < float("inf") and 0.0 <= beta < float("inf")):
        raise off_range(f"baumgarte must be two finite numbers that are not negative, not {baumgarte!r}")
    if not kinematics.constraints.labels:
        raise cannot("baumgarte stabilises constraints, and this model has no constraints; leave it out")
    return stabilise(kinematics, alpha, beta)


def _mobility(kinematics: Kinematics, independent: Sequence[str]) -> Mobility:
    """The mobility; a loop that does not close is reported at its joint's place, or that of initial."""
    try:
        return find_mobility(kinematics, independent)
    except AssemblyError as error:
        mechanism = kinematics.mechanism
        names = [row.partition(".")[0] for row in error.rows]
        places = [f"joints.{j.name}" for j in mechanism.joints if j.name in names]
        places += [f"constraints.{c.name}" for c in mechanism.constraints if c.name in names]
        place = min(places, key=lambda place: names.index(place.partition(".")[2]), default=None)
        if str(error).startswith("the given values"):  # more than there are degrees of freedom
            place = "initial"
        if place is None:
            raise
        raise AssemblyError(str(mechanism.problem(place, str(error))), error.rows, error.code) from None
