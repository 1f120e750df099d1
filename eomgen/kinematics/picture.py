"""Stage kinematics: MechanismReport -> the mechanism drawn as a graph, bodies in layers above the ground."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from ..base.files import as_path, save_figure
from ..errors import MissingDependencyError, bad_file

TREE, CUT, ELEMENT, BODY = "#1f4e79", "#c0392b", "#7d5ba6", "#eaf1f8"
WIDE, HIGH = 1.5, 1.35  #: inches for a body beside and above another
SMALLEST, LARGEST = 5.0, 10.0  #: font size
ARC = 0.9  #: twice the height of an arc between bodies of one layer, at most


class Places(NamedTuple):
    """Where bodies are drawn: name -> (column, layer); ground spans all columns in layer 0."""

    bodies: dict[str, tuple[float, float]]
    columns: int
    layers: int


class Counted(Protocol):
    """What a :class:`~.report.MechanismReport` is drawn from."""

    @property
    def name(self) -> str: ...
    @property
    def tree(self) -> list[dict[str, str]]: ...
    @property
    def joints(self) -> list[dict[str, Any]]: ...
    @property
    def elements(self) -> list[dict[str, Any]]: ...
    @property
    def loop_joints(self) -> list[str]: ...
    @property
    def degrees_of_freedom(self) -> int: ...
    @property
    def independent(self) -> list[str]: ...


def place(report: Counted) -> Places:
    """Bodies in the layer of their distance to ground in the tree, each above the middle of what it carries."""
    carried: dict[str, list[str]] = {"ground": []}
    for branch in report.tree:
        carried.setdefault(branch["parent"], []).append(branch["body"])
        carried.setdefault(branch["body"], [])
    found: dict[str, tuple[float, float]] = {}
    columns = layers = 0
    waiting = [(body, 1, False) for body in reversed(carried["ground"])]
    while waiting:
        body, layer, seen = waiting.pop()
        above = carried[body]
        if above and not seen:
            waiting += [(body, layer, True), *((child, layer + 1, False) for child in reversed(above))]
            continue
        if above:
            found[body] = ((found[above[0]][0] + found[above[-1]][0]) / 2, float(layer))
        else:
            found[body] = (float(columns), float(layer))
            columns += 1
        layers = max(layers, layer)
    return Places(found, max(columns, 1), layers)


def draw(report: Counted, file: str | Path | None = None, ax: Any = None) -> Any:
    """Draw it; see :meth:`.report.MechanismReport.draw`."""
    if ax is None and file is None:  # one that a notebook or a window shows
        ax = _part("pyplot").figure(figsize=_size(place(report)), layout="constrained").add_subplot()
    elif ax is None:
        ax = _part("figure").Figure(figsize=_size(place(report)), layout="constrained").add_subplot()
    if file is not None:
        known = ax.figure.canvas.get_supported_filetypes()
        if as_path("file", file).suffix[1:].lower() not in known:
            raise bad_file(f"{file}: the name of a picture must end in one of .{', .'.join(sorted(known))}")
    _fill(report, ax)
    if file is not None:
        save_figure(ax.figure, file)
    return ax


def new_figure(report: Counted) -> Any:
    """A figure of it without a window."""
    figure = _part("figure").Figure(figsize=_size(place(report)), layout="constrained")
    _fill(report, figure.add_subplot())
    return figure


def _part(name: str) -> Any:
    try:
        return import_module(f"matplotlib.{name}")
    except ImportError as error:
        raise MissingDependencyError("the picture needs matplotlib: pip install matplotlib") from error


def _size(places: Places) -> tuple[float, float]:
    return min(1.0 + WIDE * max(places.columns, 3), 40.0), min(1.3 + HIGH * (places.layers + 1), 40.0)


def _fill(report: Counted, ax: Any) -> None:
    places = place(report)
    font = max(SMALLEST, min(LARGEST, 10.0 * 40.0 / WIDE / max(places.columns, 27)))
    tree = {branch["joint"] for branch in report.tree}
    ends = [_Line(j["name"], j["type"], j["bodies"][0], j["bodies"][1], j["name"] in tree) for j in report.joints]
    lanes: dict[tuple[str, str], int] = {}
    for line in ends:
        pair = (min(line.start, line.end), max(line.start, line.end))
        _connect(ax, places, line, lanes.get(pair, 0), font)
        lanes[pair] = lanes.get(pair, 0) + 1
    for k, element in enumerate(report.elements):
        _element(ax, places, element, k, font)
    middle, half = (places.columns - 1) / 2, max((places.columns - 1) / 2 + 0.45, 0.9)
    ax.plot([middle - half, middle + half], [0, 0], color="#555555", linewidth=6, solid_capstyle="butt", zorder=3)
    ax.annotate("ground", (middle - half, 0), (0, -6), textcoords="offset points", va="top", fontsize=font)
    box = {"boxstyle": "round,pad=0.35", "facecolor": BODY, "edgecolor": TREE}
    for body, (x, y) in places.bodies.items():
        ax.annotate(body, (x, y), ha="center", va="center", fontsize=font, bbox=box, zorder=4)
    _finish(ax, report, middle, half, places.layers)


class _Line(NamedTuple):
    name: str
    kind: str
    start: str
    end: str
    in_tree: bool


def _at(places: Places, body: str, towards: str) -> tuple[float, float]:
    """Where a line to a body ends; on the ground below the other body."""
    if body in places.bodies:
        return places.bodies[body]
    return (places.bodies[towards][0] if towards in places.bodies else 0.0, 0.0)


def _connect(ax: Any, places: Places, line: _Line, lane: int, font: float) -> None:
    """A joint: solid in the tree, dashed and bent where it closes a loop."""
    start, end = _at(places, line.start, line.end), _at(places, line.end, line.start)
    bend = 0.0 if line.in_tree else 0.28 + 0.22 * lane
    if not line.in_tree and line.start not in places.bodies:  # from the ground, around the right of the body's column
        start, bend = (start[0] + 0.45, 0.0), min(0.35, ARC / max(end[1], 1.0))
    elif not line.in_tree and line.end not in places.bodies:
        end, bend = (end[0] + 0.45, 0.0), -min(0.35, ARC / max(start[1], 1.0))
    run, rise = end[0] - start[0], end[1] - start[1]
    if bend and rise == 0.0 and start[1]:  # over what stands between
        bend = -min(bend, ARC / abs(run)) if run > 0 else min(bend, ARC / max(abs(run), 0.1))
    colour = TREE if line.in_tree else CUT
    style = {"arrowstyle": "-", "connectionstyle": f"arc3,rad={bend}", "linewidth": 1.6, "color": colour,
             "linestyle": "-" if line.in_tree else (0, (4, 3)), "shrinkA": 0, "shrinkB": 0}  # fmt: skip
    ax.annotate("", end, start, arrowprops=style, zorder=1)
    middle = ((start[0] + end[0] + bend * rise) / 2, (start[1] + end[1] - bend * run) / 2)
    plain = {"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
    text = f"{line.name}\n{line.kind}"
    ax.annotate(text, middle, ha="center", va="center", fontsize=0.8 * font, color=colour, bbox=plain, zorder=2)


def _element(ax: Any, places: Places, element: dict[str, Any], index: int, font: float) -> None:
    """A constraint element: a diamond amid the bodies it holds, with dotted lines to them."""
    bodies = [body for body in element["bodies"] if body in places.bodies]
    points = [places.bodies[body] for body in bodies] or [(0.0, 0.0)]
    x = sum(p[0] for p in points) / len(points) + (0.3 if len(points) == 1 else 0.0)
    y = sum(p[1] for p in points) / len(points) + 0.45 + 0.15 * (index % 2)
    for point in points:
        ax.plot([x, point[0]], [y, point[1]], color=ELEMENT, linestyle=":", linewidth=1.3, zorder=1)
    ax.plot([x], [y], marker="D", color=ELEMENT, markersize=0.8 * font, zorder=3)
    text = f"{element['name']} ({element['type']})"
    ax.annotate(text, (x, y), (0, -0.8 * font), textcoords="offset points", ha="center", va="top", fontsize=0.8 * font,
                color=ELEMENT, zorder=5)  # fmt: skip


def _finish(ax: Any, report: Counted, middle: float, half: float, layers: int) -> None:
    """Title, legend and limits."""
    freedoms = report.degrees_of_freedom
    words = f"{freedoms} degree{'' if freedoms == 1 else 's'} of freedom"
    if report.independent and len(report.independent) <= 4:
        words += f" ({', '.join(report.independent)})"
    ax.set_title(f"{report.name}: {words}")
    lines = [("joint of the tree", TREE, "-")]
    if report.loop_joints:
        lines.append(("joint that closes a loop", CUT, "--"))
    if report.elements:
        lines.append(("constraint element", ELEMENT, ":"))
    for label, colour, style in lines:
        ax.plot([], [], color=colour, linestyle=style, label=label)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, 0.0), ncols=len(lines), frameon=False, fontsize="small")
    ax.set_xlim(middle - half - 0.35, middle + half + 0.35)
    ax.set_ylim(-0.35, layers + (0.8 if report.elements or report.loop_joints else 0.45))
    ax.set_axis_off()
