"""Stage runtime, pictures: calls of a module that draw -> :mod:`eomgen.show`, loaded when asked for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from .near_names import unknown
from .room import read_number, with_numbers
from .show_parts import load_show

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from ..show.explore import Explorer
    from .bound_model import BoundModel


def draw(
    model: BoundModel,
    /,
    x: Any = None,
    ax: Axes | None = None,
    *,
    t: float = 0.0,
    names: bool | None = None,
    axes: bool = False,
    **named: float | str,
) -> Axes:
    """Draw the mechanism at a configuration, true to scale.

    A mechanism that moves in a plane is drawn in this plane, a spatial one in space.  Bodies are the shapes that their
    ``display`` or ``solids`` give, else bars and plates between their joints and markers; joints, springs, dampers,
    cylinders, gears and cams have their symbols.

    Parameters
    ----------
    x : array (n_x,) or (n_q,), or mapping of str to float, optional
        A state, a position, or values of coordinates, which are assembled as by ``x0``; by default the declared initial
        position.  An array is drawn as given: loops that it leaves open are drawn open.
    ax : matplotlib Axes, optional
        Where to draw; a new figure by default.
    t : float
        Time (s); matters for driven constraints only.
    names : bool, optional
        Whether bodies and joints are named; by default where they are few.
    axes : bool
        Whether the axes of all bodies are drawn.
    **named : float or str
        Values of coordinates by name, as in a mapping x: ``draw(theta=0.3)``.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    MissingDependencyError
        matplotlib is not installed.
    UsageError
        The model has no bodies, or x does not fit.
    AssemblyError
        The loops do not close with these values.
    """
    x, t, layout = with_numbers("x", x), read_number("t", t), model.layout
    known = (*layout.q, *layout.loops, *layout.v, *layout.loop_rates, *layout.y)
    for name in named:
        if name not in (*known, *layout.p) and name.isidentifier():  # a place of a marker is none
            raise unknown("argument of draw or coordinate", name, ("ax", "t", "names", "axes", *known))
    drawn: Axes = load_show("draw").draw(model, x, ax, t=t, names=names, axes=axes, named=named)
    return drawn


def explore(model: BoundModel, /, x: Any = None) -> Explorer:
    """Show the mechanism in a notebook with sliders for its independent coordinates and its lengths.

    At each position the loops are closed near the previous one; a line of text says where that is not possible.

    Parameters
    ----------
    x : array (n_x,) or (n_q,), or mapping of str to float, optional
        Where to begin, as for :func:`draw`.

    Returns
    -------
    Explorer
        A notebook shows it; ``q`` is the position, ``module`` has the parameters of the sliders.

    Raises
    ------
    MissingDependencyError
        k3d or ipywidgets is not installed.
    UsageError
        The model has no bodies, or x does not fit.
    """
    start = load_show("draw").position(model, with_numbers("x", x), 0.0)
    shown: Explorer = load_show("explore").explore(model, start)
    return shown


def draw_branches(
    model: BoundModel,
    values: Mapping[str, float] | None = None,
    /,
    *,
    t: float = 0.0,
    names: bool | None = None,
    **named: float | str,
) -> NDArray[Any]:
    """Draw all positions in which the loops close with the given values, side by side at the same scale.

    Parameters
    ----------
    values, **named : float
        Coordinates that are held, as for :meth:`branches`; the declared initial ones by default.
    t, names
        As for :func:`draw`.

    Returns
    -------
    array of matplotlib Axes
        In the order of ``module.branches``.
    """
    panels: NDArray[Any] = load_show("draw").draw_branches(model, values, t=t, names=names, named=named)
    return panels
