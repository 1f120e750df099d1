"""What a user holds: a BoundModel with every run and analysis as a method; each loads when it is first called.

Type checkers and editors read ``module.pyi``, which ``tools/stubs.py`` writes from the tables here.

Analyses and runs call each other's functions: a subclass that overrides a method changes that call alone.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from importlib import import_module
from pathlib import Path
from types import MethodType
from typing import Any

from .errors import UnavailableError, ill_typed
from .runtime.argument_checks import both_names, find_lacking, plain_names
from .runtime.bound_model import BoundModel

#: Method -> the function, whose first argument is the model, or the file in which it is under the method's name.
CALLS: dict[str, str | Callable[..., Any]] = {
    "simulate": "runtime.runs.simulate",
    "simulate_many": "runtime.ensembles.ensemble",
    "integrator": "runtime.runs.integrator",
    "step": "runtime.runs.integrator",
    "verify": "verify.verify",
    "linearize": "analysis.linear",
    "modes": "analysis.modes",
    "equilibrium": "analysis.equilibrium",
    "sensitivities": "analysis.sensitivities",
    "fit": "analysis.fit",
    "standard_parameters": "analysis.regressor",
    "regressor": "analysis.regressor",
    "inertial_remainder": "analysis.regressor",
    "base_parameters": "analysis.base_parameters",
    "multipliers": "runtime.constrained",
    "reactions": "analysis.reactions",
    "undetermined_reactions": "analysis.reactions",
    "driving_forces": "analysis.reactions",
    "actuator_forces": "analysis.drive",
    "impact": "analysis.impact",
    "simulate_impacts": "analysis.impact",
    "consistent": "analysis.consistent",
    "kinematic_analysis": "analysis.kinematic",
    "motion_range": "analysis.kinematic",
    "report": "runtime.drawing",
    "draw": "runtime.drawing",
    "draw_branches": "runtime.drawing",
    "page": "codegen.targets.web",
}


#: Other form of the same equations -> the file of its class.
FORMS: dict[str, str] = {
    "minimal": "runtime.minimal",
    "canonical": "runtime.minimal",
    "dae": "runtime.runs.dae_solution",
}


SOLVERS = ("DOP853", "RK45", "RK23", "Radau", "Taylor")  #: for ``solve_ivp(method=...)``


def find_function(file: str, name: str) -> Any:
    """A function or class of another part of the package, which is loaded now.

    Raises
    ------
    UnavailableError
        A generated package was written without it.
    """
    try:
        return getattr(import_module(f".{file}", __package__), name)
    except ModuleNotFoundError as error:
        if error.name != f"{__package__}.{file.partition('.')[0]}":
            raise
        remedy = f"where eomgen is, Module.of({__package__}) has it"
        if file.startswith("analysis."):
            remedy = f"give --analyses to `eomgen generate`; {remedy}"
        elif file.startswith("codegen."):
            remedy = "it is made from the model, by `eomgen generate MODEL --target web`; traj.animate() shows runs"
        raise UnavailableError(f"{__package__} was generated without {name}: {remedy}") from None


class LazyMethod:
    """A function of another part of the package as a method, which is loaded when it is requested."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __get__(self, model: Any, kind: type[Any]) -> Any:
        if model is None:
            return self.function
        return MethodType(self.function if model.layout.instances else self.direct, model)

    @cached_property
    def function(self) -> Any:
        return plain_names(self.direct)

    @cached_property
    def direct(self) -> Any:
        """That of models without instances, whose names have no dots."""
        result = CALLS[self.name]
        return both_names(result if callable(result) else find_function(result, self.name))


class Module(BoundModel):
    """A model ready to be evaluated and simulated.

    ``x = [q; v; s]`` are the coordinates and velocities of the spanning tree and the first-order states of the model,
    if it has any, in SI units and radians, in the order of ``x_names``; q' = v but for Euler parameters.  Every state
    may be one (n,) or a batch (n, k) of k states as columns; results then carry the same last axis.  Every call takes
    ``p=None`` (n_p,) and ``u=None`` (n_u,), the values bound here by default, and ``out=None`` to write into; calls of
    positions alone take ``t=0.0`` too.  The callables below, multipliers and reactions also take arrays p (n_p, k) and
    u (n_u, k), a column for each state.  Values by name are the same for all states.  A call that fails raises
    an :class:`~.errors.EvaluationError` with the time and the state.

    Parameters
    ----------
    core : Core
    p, u : mapping of str to float, or arrays (n_p,), (n_u,), optional
        Parameters and inputs to bind; the declared values by default.

    Attributes
    ----------
    name, doc : str
    q_names, v_names, s_names, x_names, u_names, p_names, y_names, body_names : tuple of str
        What the entries of each vector are called.
    loop_names : tuple of str
        Coordinates of the joints that were cut; they can be given as initial values and read from results.
    n_q, n_v, n_s, n_x, n_u, n_p, n_y, n_c, n_dof, n_bodies : int
        Sizes; n_c counts the independent constraint rows, n_rows all of them.
    p, u : arrays
        The parameters and inputs bound.
    limits : dict
        Coordinate -> lower, upper, velocity and effort, those that the model gives; data only.
    rhs : callable
        ``rhs(t, x)`` -> x' (n_x,).  A pure function: x is projected onto the constraints first.
    jacobian : callable
        ``jacobian(t, x, wrt="x")`` -> (n_x, n_x), the derivative of the complete rhs by the state; by the inputs with
        ``wrt="u"``, (n_x, n_u), by the parameters with ``wrt="p"``, (n_x, n_p).  Exact, in all directions, at states on
        the constraints (of ``x0``, ``project`` or a trajectory); elsewhere it is the one at the projected state, off by
        the order of the distance, as derivatives by parameters and inputs are.
    input_jacobian, parameter_jacobian : callable
        The same as ``wrt="u"`` and ``wrt="p"``.  The projection is part of the rhs: where parameters move the
        constraints, the state is taken along to the nearest one on them.
    bias : callable
        ``bias(t, x)`` -> h (n_v,) in ``M v' + h`` = generalized forces that are not in the model.
    outputs : callable
        ``outputs(t, x)`` -> (n_y,).
    mass_matrix, embedded_mass_matrix : callable
        ``mass_matrix(q)`` -> (n_v, n_v) of the tree; (n_dof, n_dof) of the independent coordinates.
    inverse_dynamics : callable
        ``inverse_dynamics(q, v, a)`` -> (n_v,) generalized forces to add to those of the model.  Of a model with
        first-order states, v is [v; s], since forces depend on them.
    energy : callable
        ``energy(x)`` -> (T, V) in J.
    constraints, constraint_jacobian, velocity_constraints : callable
        ``constraints(q)`` -> C of the holonomic rows (m, rad), C_q (n_c, n_v), ``velocity_constraints(x)`` ->
        C_q v + C_t: independent rows, the holonomic ones first; ``rows="all"`` for redundant ones too.
    project : callable
        ``project(x, t=0.0)`` -> the nearest x on the constraints.
    poses : callable
        ``poses(q)`` -> (n_bodies, 4, 4), body frames to ground.
    center_of_mass, com_jacobian, momentum, centroidal_inertia : callable
        Sums over all bodies, in ground axes: ``center_of_mass(q)`` -> (3,) (m); ``com_jacobian(q)`` -> (3, n_v), which
        times v is its velocity; ``momentum(x)`` -> (6,), linear (kg m/s), then angular about the centre of mass
        (kg m^2/s); ``centroidal_inertia(q)`` -> (3, 3) about it (kg m^2).
    equations : Equations or None
        What the module was compiled from; None of a generated package.
    minimal : Minimal
        The strictly minimal form, ``x = [q_i; v_i]``, if the model has one.
    canonical : Canonical
        Hamilton's equations on [q; p], of a model derived by ``hamilton``.
    dae : Dae
        F(t, y, y') = 0 with multipliers, for differential-algebraic solvers.
    """

    @classmethod
    def of(cls, package: Any) -> Module:
        """The module of a generated package, or of one bound to other values, with every run and analysis of eomgen.

        Parameters
        ----------
        package : package
            As imported: ``Module.of(slider_crank).linearize()``; or its ``module``, or what its ``bind`` gives.

        Raises
        ------
        UsageError
            It is no generated package.
        """
        module = getattr(package, "module", package)
        if not hasattr(module, "x_names"):
            raise ill_typed(f"{package!r} is no package that eomgen generated")
        core, file = module.core, str(module.core.__file__)
        if file.endswith(".py"):  # what it raises would be errors of the package, which nothing here knows
            from .toolchain.trusted_files import load_source

            core = load_source(f"{__package__}._{module.name}", file, Path(file).read_bytes())
        return cls(core, module.p, module.constant_inputs)

    def __getattr__(self, name: str) -> Any:
        if name in SOLVERS:
            from .runtime.runs.integrator import find_solver

            return find_solver(self, name)
        if name in CALLS:  # an analysis of a user's own
            return LazyMethod(name).__get__(self, type(self))
        if name in FORMS:
            form = self.__dict__[name] = find_function(FORMS[name], name.capitalize())(self)
            return form
        return find_lacking(self, "a Module", name)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *CALLS, *FORMS})

    def __repr__(self) -> str:
        from .runtime.drawing import line

        return line(self)

    def _repr_html_(self) -> str:
        from .runtime.drawing import module_html

        return module_html(self)


for _name in CALLS:
    setattr(Module, _name, LazyMethod(_name))
