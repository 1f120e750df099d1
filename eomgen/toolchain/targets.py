"""Targets: what code is generated for, one row each; `eomgen generate --target` and ``compile(target=)`` read it.

Kept light: the command line lists the targets before it loads anything that generates.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from importlib import import_module
from typing import Any, NamedTuple

from ..errors import no_such

Files = dict[str, str]


#: What ``eomgen derive --format`` writes equations in; all but the first two are languages of other programs.
FORMATS = ("latex", "text", "sympy", "matlab", "octave", "julia", "mathematica", "c")

#: Types of the numbers of a C library.
PRECISIONS = ("double", "float")

#: Versions of FMI, the standard of functional mock-up units.
FMI_VERSIONS = ("2.0", "3.0")


#: Kernels of targets whose library differentiates by itself.
TRACED_KERNELS = (
    "rhs", "mass_matrix", "bias", "inverse_dynamics", "energy", "constraints", "constraint_jacobian",
    "velocity_constraints", "project", "poses", "outputs", "events", "kinematics", "dae_residual",
)  # fmt: skip

#: Kernels of a device: what is called for many states at once, and what runs need.
DEVICE_KERNELS = (
    "rhs", "jacobian", "mass_matrix", "embedded_mass_matrix", "bias", "inverse_dynamics", "energy", "constraints",
    "constraint_jacobian", "velocity_constraints", "project", "poses", "outputs", "events", "resets",
)  # fmt: skip

#: Kernels that a functional mock-up unit calls; it has those of them that the model has.
FMU_KERNELS = (
    *("rhs", "jacobian", "input_jacobian", "parameter_jacobian", "project", "kinematics"),
    *("outputs", "output_derivatives", "events", "resets"),
)


class Target(NamedTuple):
    """One target; functions of eomgen as "file.function"."""

    about: str  #: what comes of it, for help
    #: of (program, context): makes the files of a package that stands alone, by name; the context is what templates are
    #: rendered with: name, doc, metadata, layouts, calls
    package: str = ""
    load: str = ""  #: of (program, options, seconds, functions): makes a core in this process
    functions: str = ""  #: of (program, options): makes functions of another library, or of a device, in this process
    arrays: bool = False  #: whether loops over arrays do better than straight-line code
    precisions: bool = False  #: whether its numbers may be of single precision
    kernels: tuple[str, ...] = ()  #: the functions it has, of :data:`~eomgen.base.kernel_table.KERNELS`; all if empty
    whole: str = ""  #: of (program, module, directory, version): writes one file instead of a package

    @property
    def module(self) -> bool:
        """Whether a module can be compiled and loaded in this process."""
        return bool(self.load)

    def files(self, program: Any, context: dict[str, Any]) -> Files:
        """The package of a program."""
        result: Files = find_function(self.package)(program, context)
        return result


def find_function(name: str) -> Callable[..., Any]:
    """The function "file.function" within eomgen."""
    home, function = name.rsplit(".", 1)
    result: Callable[..., Any] = getattr(import_module(f"..{home}", __package__), function)
    return result


TRACED = Target(
    "", "codegen.targets.traced.package", functions="codegen.targets.traced.functions", arrays=True,
    kernels=TRACED_KERNELS,
)  # fmt: skip

TARGETS: dict[str, Target] = {
    "cython": Target("extension module", "codegen.package.cython_package", load="codegen.targets.cython.load"),
    "numpy": Target(
        "functions of NumPy arrays for a session, no compiler", load="codegen.targets.numpy.load", arrays=True
    ),
    "c": Target("C library", "codegen.targets.c.c_library", precisions=True),
    "casadi": TRACED._replace(about="set of functions of CasADi's SX"),
    "jax": TRACED._replace(about="set of pure functions of JAX"),
    "cuda": Target(
        "set of functions of many states on NVIDIA GPUs",
        "codegen.targets.cuda.cuda_package",
        functions="codegen.targets.cuda.functions",
        kernels=DEVICE_KERNELS,
    ),
    "fmu": Target(
        "functional mock-up unit for other simulators, one file",
        whole="codegen.targets.fmu.generate_fmu",
        kernels=FMU_KERNELS,
    ),
    "web": Target("page in which the mechanism runs, one file", whole="codegen.targets.web.generate_web"),
}


def find_target(name: str, allowed: Iterable[str] | None = None) -> Target:
    """The row of a name. Raises UsageError (there is none, or none among those allowed)."""
    names = list(TARGETS if allowed is None else allowed)
    if not isinstance(name, str) or name not in names:
        raise no_such(f"no target {name!r}; there are {', '.join(names)}")
    return TARGETS[name]
