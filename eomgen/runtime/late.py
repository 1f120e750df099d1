"""A core and a way to make more kernels -> one core, whose rarer kernels are made when first called.

Most runs need few of the kernels, and compiling those of the analyses as well would make every start slower.  An
exported package has them all from the beginning.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, partialmethod
from typing import TYPE_CHECKING, Any

from ..base.algebra import Array
from ..base.kernel_table import NAMED

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
        self.run = core.run  # here, because every run asks for it

    def having(self, name: str) -> Core:
        """The core with a rarer kernel, made now if there is none yet."""
        group = str(NAMED[name].late)
        if group not in self.further:
            self.further[group] = self.load(group)
        return self.further[group]

    def _make(self, kind: str, name: str, *options: Any) -> Any:
        if name in self.core.names:
            return getattr(self.core, kind)(name, *options)
        return LateKernel(self, kind, name, options)

    timed = partialmethod(_make, "timed")
    state = partialmethod(_make, "state")
    motion = partialmethod(_make, "motion")

    def __getattr__(self, name: str) -> Any:
        return getattr(self.core, name)


class LateKernel:
    """A kernel that is made when it is first called.

    Parameters
    ----------
    core : LateCore
    kind : {'timed', 'state', 'motion'}
        Of its arguments; see :class:`~.protocols.Core`.
    name : str
    options : tuple
        What the maker takes after the name: the context with parameters and inputs, then all else, the error last.
    """

    def __init__(self, core: LateCore, kind: str, name: str, options: tuple[Any, ...]) -> None:
        self.core, self.kind, self.name, self.options = core, kind, name, options

    @cached_property
    def kernel(self) -> Any:
        """The kernel itself."""
        core, (context, *rest) = self.core.having(self.name), self.options
        return getattr(core, self.kind)(self.name, core.context(context.p, context.u, rest[-1]), *rest)

    @property
    def failure(self) -> tuple[int, float, Array] | None:
        """The last failure, as other kernels have it; None before the first call."""
        return self.__dict__["kernel"].failure if "kernel" in self.__dict__ else None

    def __call__(self, *args: Any, **options: Any) -> Any:
        """Evaluate."""
        return self.kernel(*args, **options)


def eager(core: Any) -> Any:
    """The core that was there from the beginning, which has the right-hand side and the steppers."""
    return core.core if isinstance(core, LateCore) else core
