"""Stage runtime: constraints with parameters given late -> whether as many rows are independent as were declared."""

from __future__ import annotations

from ..base.algebra import Array
from ..errors import UsageError
from ..numeric.ranks import rank
from .kernels import Kernels


def require_rank(kernels: Kernels, J: Array) -> None:
    """Refuse parameters with which more constraint rows are independent than with the declared ones.

    Parameters
    ----------
    kernels : Kernels
        With the parameters.
    J : (n_c, n_v) array
        Scaled constraint Jacobian at an assembled position.

    Raises
    ------
    UsageError
    """
    layout = kernels.layout
    pairs = list(zip(layout.p, kernels.context.p, layout.metadata["p_values"], strict=True))
    changed = [name for name, value, declared in pairs if value != declared]
    if not changed:
        return
    found = rank(J).rank
    if found > layout.rank:
        raise UsageError(
            f"with the given {', '.join(changed)}, {found} constraint rows are independent, but with the declared "
            f"values {layout.rank} are, and these determine the degrees of freedom; declare values like the given ones",
            code="EG-REDUNDANT",
        )
