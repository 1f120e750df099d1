"""What a user holds: a mechanism under description, which can be checked, derived and compiled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Unpack

from ..base.results import picture_html, side_by_side
from ..errors import too_large
from ..model.model import Builder
from ..pipeline import derive
from ..runtime.runs.bound_run import waiting
from .equations import Equations

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..mechanics.report import MechanismReport
    from ..module import Module
    from ..toolchain.compiler import BuildOptions


SMALL = 30  #: bodies of a model that is drawn whenever a notebook shows it


class Model(Builder):
    """The description of a mechanism, to which bodies, joints and forces are added.

    Values are numbers, texts such as ``"m*r**2/12"`` or SymPy expressions; bodies, markers and joints are named by
    their handles or by text.  Names are looked up when the model is checked, so order does not matter.

    Parameters
    ----------
    name : str
        Identifier; the generated module bears it.
    gravity : sequence of three, optional
        Acceleration of gravity in ground axes (m/s^2).
    doc : str, optional
        One sentence about the model.
    check_inertia : {'error', 'note', 'off'} or bool, optional
        What happens to masses and inertias that no rigid body can have, and to motions without inertia: by default
        (``error``, True) they are refused; ``note`` takes them and says so in :attr:`notes`, ``off`` (False) is silent.

    Examples
    --------
    >>> import sympy
    >>> m = Model("pendulum", gravity=(0, -9.81, 0))
    >>> l = m.parameter("l", 0.5, unit="m")
    >>> bob = m.body("bob", mass=1, com=(0, -l, 0))
    >>> theta = m.revolute("hinge", m.ground, bob, coordinate="theta").coordinate
    >>> m.output("height", -l * sympy.cos(theta))
    >>> m.mechanism().joints[0].coordinates
    ('theta',)
    """

    @classmethod
    def from_sympy(cls, method: Any, name: str = "system", **options: Any) -> Model:
        """A model from equations that SymPy's mechanics formed; see :func:`eomgen.from_sympy`, with its arguments."""
        from ..importers.sympy_mechanics import describe_method

        with waiting(f"reading the equations of {type(method).__name__}"):
            return cls.from_description(describe_method(method, name, **options))

    def check(self) -> MechanismReport:
        """Check all that can be checked before a simulation, assembly included; see ``eomgen.api.check``."""
        from .check import check

        return check(self)

    def draw(
        self,
        x: Any = None,
        ax: Axes | None = None,
        *,
        t: float = 0.0,
        names: bool | None = None,
        axes: bool = False,
        **named: float | str,
    ) -> Axes:
        """Draw the mechanism at a configuration, without a compiler; arguments as for :meth:`~..module.Module.draw`.

        Examples
        --------
        >>> model = Model("pendulum", gravity=(0, -9.81, 0))
        >>> rod = model.body("rod", mass=1, com=(0, -0.5, 0))
        >>> hinge = model.revolute("hinge", model.ground, rod, coordinate="theta")
        >>> axes = model.draw({"theta": 0.3})  # doctest: +SKIP
        """
        return self.compile(target="numpy").draw(x, ax, t=t, names=names, axes=axes, **named)

    def _repr_html_(self) -> str:
        table = super()._repr_html_()
        if not self.description.sections["bodies"]:
            return table
        return side_by_side(picture_html(self._small_figure), table)

    def _small_figure(self) -> Any:
        count = len(self.description.sections["bodies"])
        if count > SMALL:
            raise too_large(f"{count} bodies take long to draw; draw() draws them")
        from ..show.draw import small_figure

        return small_figure(self.compile(target="numpy"))

    def derive(
        self,
        method: str = "auto",
        independent: Sequence[Any] | None = None,
        baumgarte: tuple[float, float] | None = None,
    ) -> Equations:
        """Derive the equations of motion.

        Parameters
        ----------
        method : str
            One of ``eomgen.mechanics.methods.METHODS``, or ``auto``: embedding or recursive, whichever has the
            right-hand side of fewer operations; lagrange of a bare Lagrangian.
        independent : names of coordinates or velocities, optional
            Independent ones of a mechanism with loops; the model's own by default.  The best conditioned others join
            them where they are fewer than the degrees of freedom.
        baumgarte : (alpha, beta), optional
            Of the augmented form (1/s): C'' + 2 alpha C' + beta^2 C = 0 holds instead of C'' = 0, and the right-hand
            side does not project its states.

        Raises
        ------
        ModelError
            Every fault of the description at once.
        AssemblyError
            The loops do not close at the declared initial values.
        UsageError
            No such method.
        """
        return derive(Equations, self, method, independent, baumgarte)

    def compile(
        self,
        method: str = "auto",
        target: str = "cython",
        independent: Sequence[Any] | None = None,
        baumgarte: tuple[float, float] | None = None,
        **options: Unpack[BuildOptions],
    ) -> Module:
        """Derive, generate and compile a module; see :meth:`~.equations.Equations.compile`."""
        return self.derive(method, independent, baumgarte).compile(target, **options)


def from_sympy(
    method: Any,
    name: str = "system",
    parameters: Mapping[Any, Any] | None = None,
    inputs: Mapping[Any, Any] | Sequence[Any] = (),
    outputs: Mapping[str, Any] | None = None,
    initial: Mapping[Any, Any] | None = None,
    specified: Mapping[Any, Any] | None = None,
    potential_energy: Any = None,
    guess: Mapping[Any, Any] | None = None,
) -> Model:
    """A model from equations of motion that SymPy's mechanics has formed.

    Coordinates, speeds, constants and inputs bear SymPy's names.  Configuration constraints and constraints of
    velocities are kept as constraints, so that the module projects states, assembles initial values and takes any
    independent coordinates; constraints of velocities that are derivatives of others are left out.  The multipliers of
    the constraints become outputs ``lam1``, ``lam2``, ... in the order of the model's constraints, which is SymPy's:
    M v' + C_q^T lam = f.  Noncontributing forces of auxiliary speeds are solved for wherever they act, and become
    outputs too.

    Parameters
    ----------
    method : KanesMethod, LagrangesMethod, System or JointsMethod
        Of ``sympy.physics.mechanics``, with its equations formed.
    name : str, optional
        Identifier; the generated module bears it.
    parameters : mapping, optional
        Values of constants, by symbol or name.  Every constant becomes a parameter, those left out without a value.
    inputs : mapping or sequence, optional
        Symbols that are given over time, with the value that holds while none is given.  Functions of time that are
        neither coordinates nor speeds are inputs anyway, their derivatives further ones (``f_dot`` of ``f``).
    outputs : mapping of str to sympy.Expr, optional
        Further named results, in anything the equations know and accelerations ``u'``.
    initial : mapping, optional
        Initial values of coordinates and speeds, by symbol or name.
    specified : mapping, optional
        Functions of time to replace by expressions in t: ``{f(t): a*sin(w*t)}``; derivatives follow.
    potential_energy : sympy.Expr, optional
        Potential energy (J), where SymPy's bodies do not have it.
    guess : mapping, optional
        Where assembly begins to look for coordinates that are not given, by symbol or name: it picks the branch.

    Returns
    -------
    Model

    Raises
    ------
    UsageError
        Another object, or its equations are not formed yet.
    ModelError
        Names that clash or are not those of anything in the equations.
    """
    return Model.from_sympy(
        method, name, parameters=parameters, inputs=inputs, outputs=outputs, initial=initial, specified=specified,
        potential_energy=potential_energy, guess=guess,
    )  # fmt: skip
