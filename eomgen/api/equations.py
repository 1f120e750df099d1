"""What a user holds: derived equations, to read, to count and to compile."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Unpack

from .. import pipeline
from ..module import Module
from ..reading.derivation import Derivation
from ..runtime.argument_checks import find_lacking

if TYPE_CHECKING:
    from ..explain import Explanation
    from ..runtime.device import Device, DeviceModule
    from ..toolchain.compiler import BuildOptions


class Equations(Derivation):
    """The derived equations of motion of a model: to read, to count and to compile.

    Attributes
    ----------
    method : str
        How they were derived, one of ``eomgen.mechanics.methods.METHODS``.
    choice : Choice or None
        What ``auto`` compared, of a tree.
    report : MechanismReport
        Bodies, joints, loops, rank, degrees of freedom, partition.
    q, v, parameters : tuple of sympy.Symbol
        Coordinates of the spanning tree, their velocities, and the parameters.
    mass_matrix, force : sympy.Matrix
        ``mass_matrix * v' = force``; for a mechanism with loops of the size of its degrees of freedom, v' then being
        the accelerations of ``independent``.  Large ones are written with ``intermediates``.
    notation : Notation
        How names are printed: LaTeX, text, HTML, labels of plots.
    T, V, generalized_forces, constraints, velocity_transformation, poses, ...
        Every quantity of the equations by name, as SymPy: the attributes of :class:`~eomgen.reading.Readable`.
    operations : dict of str to Operations
        Exact counts of mass matrix, bias, inverse dynamics and energies on the spanning tree, and of the entries of
        the linear system where the method solves one.
    system_size : tuple of int or None
        Unknowns and entries of that linear system.
    """

    if not TYPE_CHECKING:  # type checkers know all attributes

        def __getattr__(self, name: str) -> Any:
            return find_lacking(self, "Equations", name)

    def explain(self, level: str = "full") -> Explanation:
        """The worked solution: every step from the mechanism to the equations of motion, then the numbers of one state.

        Parameters
        ----------
        level : {'full', 'short'}
            ``short``: topology, coordinates, the equations of motion and counts.

        Returns
        -------
        Explanation
            ``.html``, ``.markdown``, ``.latex``, ``.save("solution.html")``, and ``.difference``, the largest one
            between the shown formulas and the compiled module.

        Raises
        ------
        UsageError
            An unknown level.

        Examples
        --------
        >>> import eomgen as eg
        >>> m = eg.Model("pendulum", gravity=(0, "-g", 0))
        >>> g, l = m.parameter("g", 9.81), m.parameter("l", 0.5)
        >>> hinge = m.revolute("hinge", m.ground, m.body("bob", mass=2, com=(0, -l, 0)), coordinate="theta")
        >>> solution = m.derive().explain()
        >>> solution.difference < 1e-10
        True
        """
        return self.explained(self, level)

    @staticmethod
    def explained(equations: Any, level: str) -> Explanation:
        """The worked solution of equations or of a view of them; see :meth:`explain`."""
        from ..explain import explain

        return explain(equations, level)

    def compile(
        self, target: str = "cython", kernels: Sequence[str] | None = None, **options: Unpack[BuildOptions]
    ) -> Module:
        """Generate code, compile it and load it.

        Parameters
        ----------
        target : {'cython', 'numpy'}
            ``numpy`` needs no compiler and is slower.
        kernels : names of kernels, optional
            Only these (see the README's table of calls); all by default, the rarer ones when they are first called.
        **options
            Fields of :class:`eomgen.toolchain.compiler.Options`, such as ``optimize`` or ``native``.

        Returns
        -------
        Module

        Raises
        ------
        ModelError
            A parameter has no value, or a coordinate has no inertia behind it.
        ToolchainError
            No compiler, or it failed.
        """
        module = Module(pipeline.compile_core(self, target, kernels, **options))
        module.equations = self
        return module

    def to_casadi(self) -> ModuleType:
        """The functions of the model in CasADi's SX, for Opti, IPOPT, acados and CasADi's integrators.

        Returns
        -------
        module
            ``rhs(t, x, u, p)`` and others; ``x_names`` and so on; see :func:`eomgen.codegen.targets.traced.functions`.

        Examples
        --------
        >>> import eomgen as eg
        >>> m = eg.Model("pendulum", gravity=(0, "-g", 0))
        >>> g, l = m.parameter("g", 9.81), m.parameter("l", 0.5)
        >>> hinge = m.revolute("hinge", m.ground, m.body("bob", mass=2, com=(0, -l, 0)), coordinate="theta")
        >>> model = m.derive().to_casadi()
        >>> model.rhs(0, [0.1, 0.0], model.u_values, model.p_values)
        DM([0, -1.95873])
        """
        functions: ModuleType = pipeline.make_functions(self, "casadi")
        return functions

    def to_cuda(self, device: Device | None = None) -> DeviceModule:
        """The functions of the model on a GPU of NVIDIA: batches of states, and ensembles of runs.

        Parameters
        ----------
        device : Device, optional
            ``eomgen.runtime.device.CudaDevice(1)`` for the second GPU; the first by default.

        Returns
        -------
        DeviceModule
            ``rhs(t, x, p=None, u=None)`` and others for states (n_x, k), ``simulate_many(span, x0)``; see
            :class:`~eomgen.runtime.device.DeviceModule`.

        Raises
        ------
        UsageError
            The model calls functions in C; there is no such GPU.
        MissingDependencyError
            cuda-core or NVRTC is not installed.
        """
        functions: DeviceModule = pipeline.make_functions(self, "cuda", device=device)
        return functions

    def to_jax(self) -> ModuleType:
        """Pure functions of the model in JAX, in 64 bits: for ``jit``, ``vmap`` and ``grad``.

        Importing them switches JAX to 64 bits in the whole process.

        Returns
        -------
        module
            ``rhs(t, x, u, p)`` and others; ``x_names`` and so on; see :func:`eomgen.codegen.targets.traced.functions`.
        """
        functions: ModuleType = pipeline.make_functions(self, "jax")
        return functions

    def write_fmu(self, path: str | Path | None = None, version: str = "2.0") -> Path:
        """Write a functional mock-up unit for other simulators, one file with its sources in C.

        It has model exchange and co-simulation.  Its variables are coordinates and velocities, their derivatives
        ``der(name)``, inputs, parameters (which can be set between steps), outputs and the values of events, with units
        and texts.  Start values are those of the model's initial state.  Coordinates that loops make dependent follow
        from the independent ones during initialization.

        Parameters
        ----------
        path : str or Path, optional
            Of the file, by default ``<name>.fmu`` here; a file of this name is replaced.
        version : {'2.0', '3.0'}, optional
            Of FMI.

        Returns
        -------
        Path

        Raises
        ------
        ModelError
            A parameter has no value, or the model has impacts: events with ``restitution``, or contacts with
            law ``rigid``.
        UsageError
            An unknown version, or a file name that does not end in ``.fmu``.
        ToolchainError
            No compiler, or it failed.

        Examples
        --------
        >>> import eomgen as eg
        >>> m = eg.Model("pendulum", gravity=(0, "-g", 0))
        >>> g, l = m.parameter("g", 9.81), m.parameter("l", 0.5)
        >>> hinge = m.revolute("hinge", m.ground, m.body("bob", mass=2, com=(0, -l, 0)), coordinate="theta")
        >>> m.derive().write_fmu("pendulum.fmu", version="3.0").name  # doctest: +SKIP
        'pendulum.fmu'
        """
        from ..codegen.targets.fmu import write_fmu
        from ..runtime.bound_model import BoundModel

        program = pipeline.build(self, "fmu")
        return write_fmu(program, BoundModel(pipeline.compile_core(self, "numpy")), path, version)
