"""A core and a way to make more kernels -> one core, whose rarer kernels are made when first called.

Most runs need few of the kernels, and compiling those of the analyses as well would make every start slower.  An
exported package has them all from the beginning.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from ..base.algebra import Array
from ..base.kernel_table import NAMED
from .argument_names import both_names

if TYPE_CHECKING:
    from .protocols import Core


class LateCore:
    """A core that offers further kernels, compiled or loaded at the first call of any of them.

    Parameters
    ----------
    core : Core
    late : sequence of str
        Names of the further kernels.
    load : callable
        Makes a core of those that are late together: of :attr:`~..base.kernel_table.Kernel.late` of the table.

    Attributes
    ----------
    further : dict of str to Core
        Cores made so far, by what their kernels have in common.
    """

    def __init__(self, core: Core, late: Sequence[str], load: Callable[[str], Core]) -> None:
        self.core = core
        self.names = (*core.names, *(name for name in late if name not in core.names))
        self.load = load
        self.further: dict[str, Core] = {}
        self.journey = core.journey  # here, because every run asks for it

    def having(self, name: str) -> Core:
        """The core with a rarer kernel, made now if there is none yet."""
        group = str(NAMED[name].late)
        if group not in self.further:
            self.further[group] = self.load(group)
        return self.further[group]

    def timed(self, name: str, *options: Any) -> Any:
        """A kernel of time and state; see :class:`~.protocols.Core`."""
        return self._make("timed", name, options)

    def state(self, name: str, *options: Any) -> Any:
        """A kernel of the state alone."""
        return self._make("state", name, options)

    def motion(self, name: str, *options: Any) -> Any:
        """A kernel of coordinates, velocities and accelerations."""
        return self._make("motion", name, options)

    def _make(self, maker: str, name: str, options: tuple[Any, ...]) -> Any:
        if name in self.core.names:
            return getattr(self.core, maker)(name, *options)
        return LATE[maker](self, maker, name, options)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.core, name)


class LateKernel:
    """A kernel that is made when it is first called.

    Parameters
    ----------
    core : LateCore
    maker : {'timed', 'state', 'motion'}
    name : str
    options : tuple
        What the maker takes after the name: the context with parameters and inputs, then all else, the error last.
    """

    def __init__(self, core: LateCore, maker: str, name: str, options: tuple[Any, ...]) -> None:
        self.core, self.maker, self.name, self.options = core, maker, name, options

    @cached_property
    def kernel(self) -> Any:
        """The kernel itself."""
        core, (context, *rest) = self.core.having(self.name), self.options
        return getattr(core, self.maker)(self.name, core.context(context.p, context.u, rest[-1]), *rest)

    @property
    def failure(self) -> tuple[int, float, Array] | None:
        """The last failure, as other kernels have it; None before the first call."""
        return self.__dict__["kernel"].failure if "kernel" in self.__dict__ else None


class LateTimed(LateKernel):
    """A kernel of time and state."""

    @both_names
    def __call__(self, t: Any, x: Any, p: Any = None, u: Any = None, out: Any = None) -> Any:
        """Evaluate."""
        return self.kernel(t, x, p, u, out)


class LateState(LateKernel):
    """A kernel of the state alone."""

    @both_names
    def __call__(self, x: Any, p: Any = None, u: Any = None, out: Any = None, t: Any = 0.0) -> Any:
        """Evaluate."""
        return self.kernel(x, p, u, out, t)


class LateMotion(LateKernel):
    """A kernel of coordinates, velocities and accelerations."""

    @both_names
    def __call__(self, q: Any, v: Any, a: Any, p: Any = None, u: Any = None, out: Any = None, t: Any = 0.0) -> Any:
        """Evaluate."""
        return self.kernel(q, v, a, p, u, out, t)


LATE = {"timed": LateTimed, "state": LateState, "motion": LateMotion}


def eager(core: Any) -> Any:
    """The core that was there from the beginning, which has the right-hand side and the steppers."""
    return core.core if isinstance(core, LateCore) else core
