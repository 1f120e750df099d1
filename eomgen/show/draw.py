"""A module at a state -> a picture with matplotlib."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any

import numpy as np

from ..base.algebra import Array
from ..base.texts import quote
from ..errors import MissingDependencyError, at_odds, ill_shaped, ill_typed, no_number
from .axes import telling_values, telling_view
from .build_scene import build_scene
from .scene import Scene

# -- optional libraries ------------------------------------------------------------------------------------------------


def matplotlib(part: str, purpose: str) -> Any:
    """A module of matplotlib.

    Raises
    ------
    MissingDependencyError
    """
    try:
        return import_module(f"matplotlib.{part}")
    except ImportError as error:
        if error.name is not None and error.name.partition(".")[0] != "matplotlib":
            raise  # the library is there and something it needs is not
        raise MissingDependencyError(f'{purpose} needs matplotlib: pip install "matplotlib"') from error


# -- pictures ----------------------------------------------------------------------------------------------------------


SMALL = 4.6  #: longer edge of a picture in a notebook (inch)


def position(module: Any, x: Any, t: float) -> Array:
    """Coordinates (n_q,) of a state, a position or values by name; the declared initial ones without any."""
    if x is None or isinstance(x, Mapping):
        result: Array = module.x0(x, t=t)[: module.n_q]
        return result
    try:
        raw = np.asarray(x, dtype=float)
    except (TypeError, ValueError):
        raise ill_typed(f"x must be a state, a position or values by name, not {quote(x)}") from None
    if raw.shape == () and "x" in module.q_names:
        raise ill_shaped(f'x is a whole state here; give the coordinate called x in a mapping: draw({{"x": {raw:g}}})')
    if raw.shape not in ((module.n_x,), (module.n_q,)):
        raise ill_shaped(
            f"x has shape {raw.shape}; give a state ({module.n_x},), a position ({module.n_q},) or values by name"
        )
    if not np.isfinite(raw).all():
        raise no_number("x has values that are not finite")
    return raw[: module.n_q]


def draw(
    module: Any,
    x: Any = None,
    ax: Any = None,
    *,
    t: float = 0.0,
    names: bool | None = None,
    axes: bool = False,
    named: Mapping[str, float | str] | None = None,
) -> Any:
    """See :func:`eomgen.runtime.drawing.draw`."""
    if named:
        if x is not None and not isinstance(x, Mapping):
            raise at_odds(f"give either a state or values by name, not both: {', '.join(named)} and {quote(x)}")
        x = {**(x or {}), **named}
    scene = build_scene(module, position(module, x, t)[:, None], t, names=names, axes=axes)
    return draw_scene(scene, ax)


def draw_scene(scene: Scene, ax: Any = None, title: str | None = None, view: tuple[float, float] | None = None) -> Any:
    """Draw the first frame of a scene; returns the axes."""
    pyplot = matplotlib("pyplot", "draw") if ax is None else None
    artist = new_artist(scene, pyplot, ax, view)
    artist.show(0)
    if title is not None or not artist.ax.get_title():
        artist.ax.set_title(scene.name if title is None else title, fontsize=10, parse_math=False)
    return artist.ax


def figure_of(scene: Scene) -> Any:
    """A figure without a window, with empty axes for a scene."""
    figure = matplotlib("figure", "draw").Figure
    if scene.view is None:
        made = figure(figsize=(7.0, 6.4), layout="constrained")
        made.add_subplot(projection="3d")
        return made
    from .axes import figure_size

    made = figure(figsize=figure_size(scene), layout="constrained")
    made.add_subplot()
    return made


def figure_at(module: Any, quiet: bool = False) -> Any:
    """A figure without a window, of the declared initial position."""
    scene = build_scene(module, position(module, None, 0.0)[:, None], quiet=quiet)
    figure = figure_of(scene)
    draw_scene(scene, figure.axes[0])
    return figure


def small_figure(module: Any) -> Any:
    """The same in the size that suits a notebook."""
    figure = figure_at(module, quiet=True)
    figure.set_size_inches(SMALL * figure.get_size_inches() / figure.get_size_inches().max())
    return figure


def new_artist(scene: Scene, pyplot: Any, ax: Any = None, view: tuple[float, float] | None = None) -> Any:
    """Flat or Axes3DPicture, on the given axes or a new figure.

    Raises
    ------
    UsageError
        The axes are not of the kind that the mechanism needs.
    """
    flat = scene.view is not None
    if ax is not None and hasattr(ax, "get_zlim") == flat:
        needed = "plain axes" if flat else 'axes in space: plt.figure().add_subplot(projection="3d")'
        raise ill_typed(f"the mechanism is {'planar' if flat else 'spatial'}; ax must be {needed}")
    if flat:
        from .axes import Flat, figure_size

        if ax is None:
            ax = pyplot.figure(figsize=figure_size(scene), layout="constrained").add_subplot()
        return Flat(scene, ax)
    from .axes import Axes3DPicture

    if ax is None:
        ax = pyplot.figure(figsize=(7.0, 6.4), layout="constrained").add_subplot(projection="3d")
    return Axes3DPicture(scene, ax, view)


def draw_branches(
    module: Any, values: Mapping[str, float] | None, *, t: float, names: bool | None, named: Mapping[str, float | str]
) -> Any:
    """See :func:`eomgen.runtime.drawing.draw_branches`."""
    pyplot = matplotlib("pyplot", "draw_branches")
    result: Sequence[Array] = module.branches(values, t=t, **named)
    scenes = [build_scene(module, q[:, None], t, names=names) for q in result]
    columns = min(3, len(scenes))
    rows = -(-len(scenes) // columns)
    figure = pyplot.figure(figsize=(4.2 * columns, 4.0 * rows), layout="constrained")
    panels = []
    view = telling_view(scenes) if scenes[0].view is None else None
    value_labels = telling_values(module.q_names, result)
    low, high = np.min([s.low for s in scenes], axis=0), np.max([s.high for s in scenes], axis=0)
    for k, scene in enumerate(scenes):
        spatial = {} if scene.view is not None else {"projection": "3d"}
        ax = figure.add_subplot(rows, columns, k + 1, **spatial)
        title = f"branch {k + 1}" + (" (the declared one)" if k == 0 and not (values or named) else "")
        title += f"\n{value_labels[k]}" if value_labels[k] else ""
        panels.append(draw_scene(scene._replace(low=low, high=high), ax, title, view))
    return np.array(panels, dtype=object)
