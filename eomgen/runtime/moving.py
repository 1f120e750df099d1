"""Stage runtime, motion of bodies: a trajectory and the module it came from -> poses, places of markers, animations."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.algebra import Array
from ..base.picture_data import read_picture
from ..base.texts import shown
from ..errors import ill_shaped, ill_typed, incomplete
from .near_names import unknown
from .refined import refined, states_at
from .room import read_number
from .show_parts import load_show

if TYPE_CHECKING:
    from .bound_model import BoundModel


def module_of(trajectory: Any, model: BoundModel | None, purpose: str) -> BoundModel:
    """The module of a run with its parameters bound.

    Raises
    ------
    UsageError
        The trajectory was read from a file or a pickle and no model is given, or one of other coordinates.
    """
    if model is not None:
        if not hasattr(model, "x_names"):
            raise ill_typed(f"model must be a module, as Model.compile() returns, not {shown(model)}")
        if tuple(trajectory.x_names) != model.x_names:
            raise ill_shaped(
                f"the trajectory of {trajectory.name!r} has states {', '.join(trajectory.x_names)}; module "
                f"{model.name!r} has {', '.join(model.x_names)}: give the module that it was made with"
            )
        return model.bind(p=trajectory.metadata.get("parameters"))
    found: BoundModel | None = getattr(trajectory.columns, "module", None)
    if found is None:
        raise incomplete(f"{purpose} needs the model, which a saved trajectory does not contain; give model=module")
    return found


def poses(trajectory: Any, model: BoundModel | None = None) -> Array:
    """See :meth:`.trajectory.Trajectory.poses`."""
    module = module_of(trajectory, model, "poses")
    names = module.u_names
    u = trajectory.to_numpy(*names) if names else None
    return module.poses(trajectory.q, t=trajectory.t, u=u)


def position(trajectory: Any, name: str, model: BoundModel | None = None) -> Array:
    """See :meth:`.trajectory.Trajectory.position`."""
    module = module_of(trajectory, model, "position")
    data = read_picture(module.metadata, module.p)
    every, name = poses(trajectory, module), module.layout.plain(name)
    if name in data.markers:
        frame = data.markers[name]
        if frame.body < 0:
            return np.repeat(frame.position[:, None], len(trajectory.t), axis=1)
        pose = every[frame.body]
        found: Array = np.einsum("ijk,j->ik", pose[:3, :3], frame.position) + pose[:3, 3]
        return found
    if name not in module.body_names:
        raise unknown("marker or body", name, (*data.markers, *module.body_names))
    return every[module.body_names.index(name), :3, 3]


def animate(trajectory: Any, file: Path | str | None, model: BoundModel | None, options: dict[str, Any]) -> Any:
    """See :meth:`.trajectory.Trajectory.animate`."""
    module = module_of(trajectory, model, "an animation")
    show = load_show("animate")
    numbers = {k: read_number(k, options[k]) for k in ("fps", "speed", "dpi") if isinstance(options.get(k), str)}
    return show.animate(
        trajectory,
        module,
        file,
        states=lambda t: states_at(trajectory, module, t),
        columns=lambda names: refined(trajectory, tuple(map(module.layout.plain, names))),
        **(options | numbers),
    )
