"""A module -> a picture in a notebook with a slider for each coordinate and parameter."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.algebra import Array
from ..base.limits.pictures import HELD, SAME
from ..base.texts import html_text
from ..errors import EomgenError
from .browser import move_objects, scene_plot
from .build_scene import build_scene
from .draw import ipywidgets

COORDINATES = 12  #: sliders for coordinates, at most
PARAMETERS = 16
STEPS = 200  #: of a slider
LEAPS = 40  #: of a slider's range: positions at which loops are closed on the way
TRIED = 1.01  #: factor by which a parameter is changed to see whether it matters for the picture
HEIGHT = 420
ROOM = 0.2  #: of the picture's size, left free on each side


class Explorer:
    """A picture and its sliders; what a notebook shows of it is ``widget``.

    Attributes
    ----------
    module : Module
        With the parameters of the sliders bound.
    q : (n_q,) array
        The position shown; loops are closed.
    t : float
        The time (s), of mechanisms that drivers move.
    message : str
        Why the position is not the one asked for; empty where it is.
    sliders : dict of str to ipywidgets.FloatSlider
    widget : ipywidgets.VBox
    """

    def __init__(self, module: Any, start: Array) -> None:
        self._kit = ipywidgets("explore")
        self._first, self._start = module, np.array(start)
        self.module, self.q, self.t, self.message = module, np.array(start), 0.0, ""
        scene = build_scene(module, self.q[:, None])
        self._size = float((scene.high - scene.low).max())
        room = ROOM * (scene.high - scene.low)  # for what the sliders do
        self._plot = scene_plot(scene._replace(low=scene.low - room, high=scene.high + room), height=HEIGHT)
        self._plot.menu_visibility = False
        self._says, self._nudge = self._kit.HTML(), SAME
        places = {name: float(start[k]) for name, k in self._moved().items()}
        constants = {name: float(value) for name, value in zip(module.p_names, module.p, strict=True)}
        seen = [name for name in constants if self._matters(name, constants[name])][:PARAMETERS]
        self._coordinates = {name: self._slider(name, at, self._range(name, at)) for name, at in places.items()}
        self._parameters = {name: self._slider(name, constants[name], _around(constants[name])) for name in seen}
        self._clock = {"t": self._slider("t", 0.0, (0.0, self._end()))} if module.n_rows and self._is_driven() else {}
        self.sliders = self._clock | self._coordinates | self._parameters
        reset = self._kit.Button(description="start position")
        reset.on_click(lambda _: self.reset())
        groups = (self._clock | self._coordinates, self._parameters)
        columns = [self._kit.VBox(list(group.values())) for group in groups if group]
        self.widget = self._kit.VBox([self._plot, self._says, self._kit.HBox(columns), reset])

    def _end(self) -> float:
        """The end time that the model declares, else 1 s."""
        return float(self.module.info.simulation.get("end") or 1.0)

    def _is_driven(self) -> bool:
        """Whether time moves the constraints."""
        every = self.module.kernels.constraints
        return bool(np.abs(every(self.q, t=TRIED * self._end() / 3.0) - every(self.q, t=0.0)).max(initial=0.0) > SAME)

    def _moved(self) -> dict[str, int]:
        """Independent coordinates and their places in q."""
        layout = self.module.layout
        names = [layout.velocity_labels[i] for i in layout.independent]
        return {name: layout.q.index(name) for name in names[:COORDINATES] if name in layout.q}

    def _range(self, name: str, value: float) -> tuple[float, float]:
        """What a slider runs over: the limits of the joint, else a turn, or the size of the mechanism to both sides."""
        limits = self.module.limits.get(name, {})
        low, high = limits.get("lower"), limits.get("upper")
        reach = 0.5 * self._size if self.module.layout.unit(name) == "m" else np.pi
        return (value - reach if low is None else low), (value + reach if high is None else high)

    def _slider(self, name: str, value: float, ends: tuple[float, float]) -> Any:
        step = (ends[1] - ends[0]) / STEPS
        low, high = (value + step * np.fix((end - value) / step) for end in ends)  # the value is on a step
        unit = self.module.layout.unit(name)
        slider = self._kit.FloatSlider(
            value=value,
            min=low,
            max=high,
            step=step,
            description=f"{name} ({unit})" if unit else name,
            readout_format=".3g",
            style={"description_width": "9em"},
            layout={"width": "26em"},
        )
        slider.observe(lambda _: self.update(), names="value")
        return slider

    def _matters(self, name: str, value: float) -> bool:
        """Whether a parameter changes the picture or the position."""
        changed = self.module.bind(p={name: TRIED * value if value else TRIED - 1.0})
        q, first = self.q, self.module
        if np.abs(changed.poses(q) - first.poses(q)).max(initial=0.0) > SAME:
            return True
        if np.abs(changed.kernels.constraints(q) - first.kernels.constraints(q)).max(initial=0.0) > SAME * self._size:
            return True
        scenes = [build_scene(one, q[:, None], names=False).items for one in (changed, first)]
        pairs = zip(*scenes, strict=False)
        return any(
            a.role not in ("link", "shape", "com")
            and a.points.shape == b.points.shape
            and np.nanmax(np.abs(a.points - b.points), initial=0.0) > SAME * self._size
            for a, b in pairs
        )

    def reset(self) -> None:
        """Go back to where it began."""
        self.q = np.array(self._start)
        constants = dict(zip(self._first.p_names, self._first.p, strict=True))
        for name, slider in self.sliders.items():
            with slider.hold_trait_notifications():
                if name in self._clock:
                    slider.value = 0.0
                else:
                    slider.value = float(constants[name] if name in constants else self._start[self._moved()[name]])

    def update(self) -> None:
        """Close the loops at the sliders' values, near the position before, and show them."""
        values = {name: slider.value for name, slider in self._parameters.items()}
        wanted = {name: slider.value for name, slider in self._coordinates.items()}
        try:
            module = self._first.bind(p=values)
            t = self._clock["t"].value if self._clock else 0.0
            q = self._closed(module, wanted, t)
            self.message = self._missed(wanted, q)
            scene = build_scene(module, q[:, None], t)
        except EomgenError as error:
            self.message = str(error).partition("\n")[0]
        else:
            self.module, self.q, self.t = module, q, t
            move_objects(self._plot, scene)
            self._nudge = -self._nudge  # k3d shows names once the camera has moved
            self._plot.camera = [x * (1.0 + self._nudge) for x in self._plot.camera]
        self._says.value = f"<b style='color:#b22222'>{html_text(self.message)}</b>"

    def _closed(self, module: Any, wanted: dict[str, float], t: float) -> Array:
        """The position of these values, reached in small steps so that the way of closing the loops stays the same."""
        names = self.module.q_names
        start = {name: float(self.q[names.index(name)]) for name in wanted}
        parts = [abs(wanted[n] - start[n]) / (s.max - s.min) for n, s in self._coordinates.items() if s.max > s.min]
        parts += [abs(t - self.t) / slider.max for slider in self._clock.values()]
        count = max(1, int(np.ceil(LEAPS * max(parts, default=0.0)))) if module.n_rows else 1
        q = self.q
        for k in range(1, count + 1):
            now = {name: start[name] + (wanted[name] - start[name]) * k / count for name in wanted}
            guess = dict(zip(names, q.tolist(), strict=True)) | now
            if module.n_rows:
                found = module.assemble(guess, t=self.t + (t - self.t) * k / count)
            else:
                found = np.array(list(guess.values()))
            if self._missed(now, found):
                return np.asarray(found)
            q = found
        return np.asarray(q)

    def _missed(self, wanted: dict[str, float], q: Array) -> str:
        """What to say where the loops cannot be closed with what is wanted."""
        reached = {name: float(q[self.module.q_names.index(name)]) for name in wanted}
        off = [name for name, value in wanted.items() if abs(value - reached[name]) > HELD * max(1.0, abs(value))]
        if not off:
            return ""
        return ("the loops do not close there; the picture shows ") + ", ".join(
            f"{name} = {reached[name]:.4g}" for name in off
        )

    def __repr__(self) -> str:
        return f"<Explorer of {self.module.name}: {', '.join(self.sliders)}>"

    def _repr_mimebundle_(self, **options: Any) -> Any:
        return self.widget._repr_mimebundle_(**options)


def _around(value: float) -> tuple[float, float]:
    """Half to double a value, and both signs about 0."""
    if not value:
        return -1.0, 1.0
    low, high = sorted((0.5 * value, 2.0 * value))
    return low, high


def explore(module: Any, start: Array) -> Explorer:
    """See :func:`eomgen.runtime.drawing.explore`."""
    return Explorer(module, start)
