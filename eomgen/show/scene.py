"""Data of a picture and poses over frames -> solids and lines, each fixed to a body or following it, in colours."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.picture_data import GROUND, JointData, PictureData, PlacedFrame
from .limits import NOTHING, SAME
from .solids import ROUND, Mesh, Triangles, mesh_of, rounded, solid, sphere, turned

# -- plates with holes -------------------------------------------------------------------------------------------------


CORNERS = 4  #: fewest of an outline that turns both ways


def hollow_lines(data: PictureData, body: int) -> list[Array]:
    """Closed lines (n, 3) in a plane of a body, in its axes, which are not those around their convex hull."""
    result = []
    for element in data.elements:
        stops = [stop for stop, _, _ in element.get("stops", ())]
        if element["kind"] != "lines" or len(stops) <= CORNERS or any(stop.body != body for stop in stops):
            continue
        points = np.array([stop.position for stop in stops])
        near = SAME * max(float(np.ptp(points, axis=0).max()), SAME)
        if np.abs(points[0] - points[-1]).max() > near:
            continue
        points = points[np.abs(points - np.roll(points, 1, axis=0)).max(axis=1) > near]
        flat = _in_plane(points) if len(points) >= CORNERS else None
        if flat is not None and (_turns(flat[0]) < -near * near).any():
            result.append(points)
    return result


def hollow_plate(points: Array, half: float) -> Mesh:
    """A plate within a closed line in a plane, of which ``half`` of the thickness lies on each side."""
    flat = _in_plane(points)
    assert flat is not None
    corners, axes, middle = flat
    n, cap = len(corners), _triangles(corners)
    ring = np.arange(n)
    after = np.roll(ring, -1)
    sides = np.vstack([np.column_stack([ring, after, ring + n]), np.column_stack([after, after + n, ring + n])])
    vertices = np.vstack([np.column_stack([corners, np.full(n, height)]) for height in (-half, half)])
    return vertices @ axes + middle, np.vstack([cap[:, ::-1], cap + n, sides])


def _in_plane(points: Array) -> tuple[Array, Array, Array] | None:
    """Counterclockwise corners (n, 2) in axes of the plane, the axes as rows and their origin; None out of a plane."""
    middle = points.mean(axis=0)
    _, sizes, axes = algebra.svd(points - middle)
    if sizes[2] > SAME * sizes[0]:
        return None
    axes[2] = np.cross(axes[0], axes[1])
    corners = (points - middle) @ axes[:2].T
    x, y = corners.T
    if float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) < 0.0:
        axes[1:] *= -1.0
        corners[:, 1] *= -1.0
    return corners, axes, middle


def _turns(corners: Array) -> Array:
    """Cross products of the edges before and after each corner."""
    before, after = corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners
    turns: Array = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return turns


def _triangles(corners: Array) -> np.ndarray:
    """Triangles (n - 2, 3) that fill a counterclockwise outline, cut off one by one (Meisters, 1975)."""
    left, result = list(range(len(corners))), list[tuple[int, int, int]]()
    k = tried = 0
    while len(left) > 3:
        a, b, c = (left[(k + step) % len(left)] for step in (-1, 0, 1))
        rest = corners[[i for i in left if i not in (a, b, c)]]
        turns = [_side(corners[p], corners[q], rest) for p, q in ((a, b), (b, c), (c, a))]
        empty = not np.all([turn >= 0.0 for turn in turns], axis=0).any()
        if tried > len(left) or (_side(corners[a], corners[b], corners[c : c + 1])[0] >= 0.0 and empty):
            result.append((a, b, c))
            left.pop(k % len(left))
            tried = 0
        else:
            tried += 1
            k += 1
        k %= len(left)
    return np.array([*result, tuple(left)])


def _side(p: Array, q: Array, points: Array) -> Array:
    """Positive where points lie to the left of the line from p to q."""
    side: Array = (q[0] - p[0]) * (points[:, 1] - p[1]) - (q[1] - p[1]) * (points[:, 0] - p[0])
    return side


# -- the scene ---------------------------------------------------------------------------------------------------------

# Nothing here knows how it is drawn: the backends ask every :class:`Item` where its points are at a frame.


SYMBOL = 0.02  #: of the extent of a mechanism: the size of a symbol
OF_LINK = 0.16  #: and of the middle link's length, at most
BAR = 0.55  #: radius of a bar in sizes of a symbol
OFF = 0.3  #: of a link's length: a centre of mass so far beside it belongs to its outline
NEAR = SAME  #: of the extent: points that are one

#: Order in which roles lie over each other.
ROLES = ("hatch", "rail", "wheel", "shape", "link", "force", "block", "pull", "com", "joint", "frame", "trace", "arrow")


class Item(NamedTuple):
    """A solid (with ``faces``) or a line of the picture.

    Attributes
    ----------
    role : str
        One of ROLES.
    name : str
        Of the body, joint or element.
    body : int
        Index of the body it is fixed to and whose colour it has; GROUND.
    points : (n, 3) array
        In body axes (m); where ``follow`` is given, in ground axes at the first frame.
    faces : (m, 3) array or None
        Triangles; None for a line through the points, broken at NaN.
    follow : callable or None
        Poses (n_bodies + 1, 4, 4) -> points (n, 3) in ground axes, of what is fixed to no body.
    path : (k, n, 3) array or None
        Or its points in ground axes at each frame.
    convex : bool
        Whether the outline of a solid is that of its vertices.
    color : str
        ``#rrggbb`` of its faces; else by its role and body.
    """

    role: str
    name: str
    body: int
    points: Array
    faces: Triangles | None = None
    follow: Callable[[Array], Array] | None = None
    path: Array | None = None
    convex: bool = True
    color: str = ""

    @property
    def layer(self) -> float:
        """Its place in the order in which items lie over each other: lines on wheels and discs lie on these."""
        return ROLES.index("shape") + 0.5 if self.role == "wheel" and self.faces is None else ROLES.index(self.role)

    def at(self, poses: Array, frame: int = 0) -> Array:
        """Points in ground axes (n, 3) at poses (n_bodies + 1, 4, 4) of a frame, the last of which is ground's."""
        if self.path is not None:
            there: Array = self.path[frame]
            return there
        if self.follow is not None:
            return self.follow(poses)
        return move(poses[self.body], self.points)


class Label(NamedTuple):
    """A name at a point of a body (body axes, m)."""

    text: str
    body: int
    point: Array
    role: str

    def at(self, poses: Array) -> Array:
        """The point (3,) in ground axes at poses (n_bodies + 1, 4, 4)."""
        return move(poses[self.body], self.point)


class Scene(NamedTuple):
    """All that is to be drawn.

    Attributes
    ----------
    items, labels : list
    view : (3, 3) array or None
        Rows right, up, towards the reader in ground axes, of a planar mechanism.
    up : (3,) array
        Upwards in ground axes.
    symbol : float
        Size of a symbol (m).
    frames : (k, n_bodies + 1, 4, 4) array
        Poses; the last body is ground.
    low, high : (3,) arrays
        Corners of the box that holds it all over the frames; of a planar one in axes of the page.
    note : str
        What is written beside the title.
    """

    name: str
    items: list[Item]
    labels: list[Label]
    view: Array | None
    up: Array
    symbol: float
    frames: Array
    low: Array
    high: Array
    note: str = ""


def passed(way: Array, frame: int, frames: int) -> Array:
    """The part of a trace's points (n, 3) up to a frame; all of it at the first one."""
    if frame == 0:
        return way
    done: Array = way[: frame * (len(way) - 1) // (frames - 1) + 1]
    return done


def move(pose: Array, points: Array) -> Array:
    """Points (n, 3) of a body in ground axes."""
    moved: Array = points @ pose[:3, :3].T + pose[:3, 3]
    return moved


def placed(poses: Array, frame: PlacedFrame) -> tuple[Array, Array]:
    """Rotation and position of a frame in ground axes."""
    pose = poses[frame.body]
    return pose[:3, :3] @ frame.rotation, pose[:3, :3] @ frame.position + pose[:3, 3]


def attachments(data: PictureData) -> list[Array]:
    """Points at which something is attached to each body, and its markers, body axes; the last list is ground's."""
    result: list[list[Array]] = [[] for _ in range(len(data.bodies) + 1)]
    for joint in data.joints:
        if joint.type == "free":
            continue
        for frame in (joint.P, joint.S):
            result[frame.body].append(frame.position)
    for element in data.elements:
        for stop, _, _ in element.get("stops", ()):
            result[stop.body].append(stop.position)
    for frame in data.markers.values():
        result[frame.body].append(frame.position)
    return [np.array(points).reshape(-1, 3) for points in result]


def distinct(points: Array, near: float) -> Array:
    """The points without those that repeat an earlier one."""
    kept: list[Array] = []
    for point in points:
        if all(np.abs(point - other).max() > near for other in kept):
            kept.append(point)
    return np.array(kept).reshape(-1, 3)


def symbol_size(data: PictureData, points: list[Array], poses: Array) -> tuple[float, float]:
    """Size of a symbol and extent of the mechanism (m) at a pose."""
    every = [move(poses[k], p) for k, p in enumerate(points[:-1])]
    every += [move(poses[k], data.com[k : k + 1]) for k in range(len(data.bodies)) if data.mass[k] > 0.0]
    every.append(points[-1])
    for shape in data.shapes:
        every.append(placed(poses, shape["frame"])[1][None])
    cloud = np.vstack(every)
    extent = float(np.ptp(cloud, axis=0).max(initial=0.0))
    for element in data.elements:
        if "radius" in element:
            extent = max(extent, 2.0 * abs(float(element["radius"])))
    for shape in data.shapes:
        if shape["kind"] != "mesh":
            extent = max(extent, float(np.abs(shape["sizes"]).max()))
    if extent == 0.0:
        extent = _inertia_size(data) or 1.0
    lengths = sorted(length for k, p in enumerate(points[:-1]) if (length := _length(data, k, p)) > NEAR * extent)
    middle = lengths[len(lengths) // 2] if lengths else extent
    return min(SYMBOL * extent, OF_LINK * middle), extent


def _length(data: PictureData, k: int, points: Array) -> float:
    every = np.vstack([points, data.com[k : k + 1]])
    return float(np.linalg.norm(np.ptp(every, axis=0)))


def _inertia_size(data: PictureData) -> float:
    """The largest edge of the boxes with the bodies' inertia (m)."""
    return max((float(equivalent_box(data, k).max()) for k in range(len(data.bodies))), default=0.0)


def inertia_items(data: PictureData, k: int, least: float) -> tuple[list[Item], float]:
    """The uniform disc or ellipsoid with the mass and moments of a body, and its size (m).

    Of two equal moments and a greater third, a disc or cylinder, no thinner than ``least``: I = m r^2 / 2 about its
    axis.  An ellipsoid is shown by its three principal sections, which hide nothing.
    """
    name, com = data.bodies[k], data.com[k]
    moments, edges = data.inertia[k], equivalent_box(data, k)
    order = np.argsort(moments)
    small, other, great = moments[order]
    if other - small < SAME * great < 0.5 * (great - other):
        radius = float(np.sqrt(2.0 * great / data.mass[k]))
        length = float(np.sqrt(max(12.0 * small / data.mass[k] - 3.0 * radius**2, 0.0)))
        frame = PlacedFrame(k, TO_AXIS["xyz"[order[2]]], com)
        mesh = attached(frame, disc(radius, max(length, least)))
        return [Item("shape", name, k, *mesh), *rim_mark(name, frame, radius, max(length, least))], 2.0 * radius
    turn, (a, b, c) = np.linspace(0.0, 2.0 * np.pi, ROUND + 1), np.sqrt(5.0 / 12.0) * edges
    x, y, zero, gap = np.cos(turn), np.sin(turn), np.zeros(ROUND + 1), np.full((1, 3), np.nan)
    rings = [np.column_stack(ring) for ring in ((a * x, b * y, zero), (zero, b * x, c * y), (a * x, zero, c * y))]
    return [Item("link", name, k, com + np.vstack([rings[0], gap, rings[1], gap, rings[2]]))], float(edges.max())


def rim_mark(name: str, frame: PlacedFrame, radius: float, length: float) -> list[Item]:
    """A line to the rim on both faces of a disc about z, so that its turning is seen; nothing on a long cylinder."""
    if length > radius:
        return []
    ends = [[s * radius, 0.0, 0.5 * z * length] for z in (1.0, -1.0) for s in (0.6, 1.0)]
    line = np.array([*ends[:2], [np.nan] * 3, *ends[2:]])
    return [Item("wheel", name, frame.body, line @ frame.rotation.T + frame.position)]


def equivalent_box(data: PictureData, k: int) -> Array:
    """Edges of the uniform box with the mass and moments of a body (m): a^2 = 6 (I_y + I_z - I_x) / m."""
    if not data.mass[k] > 0.0:
        return np.zeros(3)
    moments = data.inertia[k]
    squares = 6.0 * (moments.sum() - 2.0 * moments) / data.mass[k]
    edges: Array = np.sqrt(np.maximum(squares, 0.0))
    return edges


def attached(frame: PlacedFrame, mesh: Mesh) -> Mesh:
    """A mesh of a frame in axes of its body."""
    return mesh[0] @ frame.rotation.T + frame.position, mesh[1]


#: Rotations that bring z to an axis.
TO_AXIS = {
    "x": np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]),
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    "z": np.eye(3),
}


def symbol_mesh(shape: str, sizes: list[float], axis: str, symbol: float) -> Mesh:
    """A piece of a joint's symbol, in axes of its marker."""
    scaled = [symbol * x for x in sizes]
    mesh = solid(shape, scaled, BAR * symbol)
    assert mesh is not None
    return mesh[0] @ TO_AXIS[axis].T, mesh[1]


def link_items(
    data: PictureData,
    points: list[Array],
    symbol: float,
    extent: float,
    model_file: str | None = None,
    quiet: bool = False,
) -> list[Item]:
    """Bodies: the shapes that they were given, else bars and plates between what is attached to them.

    ``model_file``: beside which files of meshes lie; ``quiet``: without warnings about them.
    """
    items: list[Item] = []
    shaped = set()
    for shape in data.shapes:
        body = shape["body"]
        name = "ground" if body == GROUND else data.bodies[body]
        if shape["kind"] == "mesh":
            mesh = mesh_of(shape, name, model_file, quiet)
        else:
            mesh = solid(shape["kind"], shape["sizes"], BAR * symbol, ROUND)
        if mesh is not None:
            shaped.add(body)
            here = attached(shape["frame"], mesh)
            items.append(Item("shape", name, body, *here, convex=shape["kind"] != "mesh", color=shape.get("color", "")))
            if shape["kind"] == "cylinder":
                items += rim_mark(name, shape["frame"], *shape["sizes"])
    hidden = data.hidden
    blocks = {joint.S.body for joint in data.joints if joint.pieces and joint.slides and _is_block(data, joint, symbol)}
    wheels = {element["marker"].body for element in data.elements if element["kind"] in ("wheel", "contour")}
    for element in data.elements:  # those that its circles, its rack or its law of lift show
        ends = {"circles": ("a", "b", "beside"), "rack": ("a",), "lift": ("a",)}.get(element["kind"], ())
        wheels |= {data.joints[element[end]].S.body for end in ends if element[end] is not None}
    rods = {frame.body for joint in data.joints if joint.slides and joint.pieces for frame in (joint.P, joint.S)}
    for k, name in enumerate(data.bodies):
        if k in shaped or k in hidden:
            continue
        hollows = hollow_lines(data, k)
        places = distinct(points[k], NEAR * extent)
        if hollows:  # the hull of all points would hide them
            items += [Item("shape", name, k, *hollow_plate(line, BAR * symbol), convex=False) for line in hollows]
            on_lines = np.abs(places[:, None] - np.vstack(hollows)).max(axis=2).min(axis=1) <= NEAR * extent
            places = places[~on_lines]
            if len(places) < 2:
                continue
        com = data.com[k]
        if k in rods - blocks and len(places) == 1 and _telescopes(data, k, symbol):
            continue  # a barrel or a rod, which its joint draws
        if data.mass[k] > 0.0 and len(places) == 1 and np.linalg.norm(com - places[0]) > 0.5 * symbol:
            places = np.vstack([places, com])
            items.append(Item("link", name, k, *_moved(sphere(1.6 * symbol), com)))  # the mass at the end of a rod
        if len(places) >= 2 and data.mass[k] > 0.0 and _off(com, places) > OFF * np.linalg.norm(np.ptp(places, axis=0)):
            places = np.vstack([places, com])  # most of the body is there
        if len(places) >= 2:
            bar = rounded(places, BAR * symbol)
            if bar is not None:
                items.append(Item("link", name, k, *bar))
        elif k not in blocks and k not in wheels and data.mass[k] > 0.0:
            uniform, size = inertia_items(data, k, symbol)
            if 4.0 * symbol < size <= 2.0 * extent:
                items += uniform
            else:
                items.append(Item("link", name, k, *_moved(sphere(1.6 * symbol), com)))
        if data.mass[k] > 0.0 and len(points[k]) >= 2 and len(places) >= 2:
            items.append(Item("com", name, k, *_moved(sphere(0.3 * symbol), com)))
    return items


def _off(point: Array, others: Array) -> float:
    """Distance of a point from the line through the first and the last of others, or from their middle."""
    along = others[-1] - others[0]
    length = float(np.linalg.norm(along))
    reach = point - others[0]
    if length == 0.0:
        return float(np.linalg.norm(reach))
    part = float(np.clip(reach @ along / length**2, 0.0, 1.0))
    return float(np.linalg.norm(reach - part * along))


def _moved(mesh: Mesh, by: Array) -> Mesh:
    return mesh[0] + by, mesh[1]


def _is_block(data: PictureData, joint: JointData, symbol: float) -> bool:
    """Whether what slides is a block on a rail; else it is a rod in a cylinder, which reaches along the axis."""
    if joint.P.body == GROUND or joint.S.body == GROUND:
        return True
    k, axis = joint.S.body, joint.S.rotation[:, 2]
    places = [data.com[k]] if data.mass[k] > 0.0 else []
    for other in data.joints:
        places += [f.position for f in (other.P, other.S) if f.body == k]
    return all(abs(float(axis @ (place - joint.S.position))) < 2.0 * symbol for place in places)


def _telescopes(data: PictureData, k: int, symbol: float) -> bool:
    """Whether a body is a barrel or a rod."""
    return any(
        joint.slides and k in (joint.P.body, joint.S.body) and not _is_block(data, joint, symbol)
        for joint in data.joints
    )


def frame_items(data: PictureData, symbol: float) -> list[Item]:
    """Axes of all bodies and of ground; names end in the axis."""
    items = []
    for k in range(-1, len(data.bodies)):
        for axis in range(3):
            tip = np.zeros((2, 3))
            tip[1, axis] = 4.0 * symbol
            items.append(Item("frame", "xyz"[axis], k, tip))
    return items


def disc(radius: float, thick: float) -> Mesh:
    """A wheel about z."""
    return turned((radius, radius), (-thick / 2, thick / 2), 48)


# -- colours -----------------------------------------------------------------------------------------------------------


#: Okabe and Ito's colours, which colour-blind readers tell apart, without yellow; then darker ones.
BODIES = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#7A5195", "#2F4B7C", "#A05195", "#665191")
DARK = "#333333"


class Style(NamedTuple):
    """How a role is drawn; None: in the colour of the body."""

    color: str | None
    face: str | None = None
    edge: str | None = None
    width: float = 1.2
    alpha: float = 1.0


STYLES = {
    "hatch": Style("#777777", "#BBBBBB", "#777777", 1.1),
    "rail": Style("#888888", "#CCCCCC", "#888888", 1.2),
    "shape": Style(None, None, None, 0.8, 0.75),
    "link": Style(None, None, None, 0.8, 0.85),
    "wheel": Style(DARK, None, DARK, 1.2, 0.45),
    "force": Style("#B22222", "#B22222", "#B22222", 1.3),
    "pull": Style("#B22222", width=1.3),
    "com": Style(DARK, DARK, DARK, 0.5),
    "block": Style(None, None, DARK, 1.0),
    "joint": Style(DARK, "white", DARK, 1.3),
    "frame": Style(None, width=1.2),
    "trace": Style("#999999", width=1.2),
    "arrow": Style("#7B1FA2", width=1.8),
}
AXES = {"x": "#D62728", "y": "#2CA02C", "z": "#1F77B4"}


def style_of(role: str) -> Style:
    """How a role is drawn."""
    return STYLES[role]


def color_of(item: Item | Label) -> str:
    """The colour of lines and, where the role has none of its own, of faces."""
    if isinstance(item, Item) and item.color:
        return item.color
    if item.role == "frame":
        return AXES[item.name] if isinstance(item, Item) else DARK
    color = STYLES[item.role].color if isinstance(item, Item) else None
    if color is not None and not (item.role == "wheel" and isinstance(item, Item) and item.faces is not None):
        return color
    return BODIES[item.body % len(BODIES)] if item.body != GROUND else "#888888"


# -- the plane of a mechanism ------------------------------------------------------------------------------------------


TRIALS = 6  #: positions that are looked at
ROUNDING = SAME  #: relative size of what is rounding and not motion


def find_view(poses: Callable[[Array], Array], q: Array, quaternions: list[int], gravity: Array) -> Array | None:
    """Axes of a page (3, 3), rows right, up and towards the reader in ground axes; None of a spatial mechanism.

    Positions of the tree are drawn at random, loops open: every motion that the joints have shows.

    Parameters
    ----------
    poses : callable
        q (n_q, k) -> (n_bodies, 4, 4, k).
    q : (n_q,) array
    quaternions : list of int
        First of each four Euler parameters.
    gravity : (3,) array
    """
    random = np.random.default_rng(0)
    trial = q[:, None] + random.uniform(-1.0, 1.0, (len(q), TRIALS))
    for i in quaternions:
        trial[i : i + 4] /= np.linalg.norm(trial[i : i + 4], axis=0)
    first = poses(q[:, None])[..., 0]
    moved = poses(trial)
    if not np.isfinite(moved).all():
        return None
    displacement = moved[:, :3, 3] - first[:, :3, 3, None]
    turns = np.einsum("bijk,blj->bilk", moved[:, :3, :3], first[:, :3, :3])  # relative rotation
    size = max(float(np.abs(displacement).max(initial=0.0)), NOTHING)
    # the normal n has n . travel = 0 and R n = n
    rows = [(displacement / size).transpose(0, 2, 1).reshape(-1, 3)]
    rows.append((turns.transpose(0, 3, 1, 2) - np.eye(3)).reshape(-1, 3))
    stacked = np.vstack(rows)
    candidates = [np.eye(3)[k] for k in (2, 1, 0)]
    strength = float(np.linalg.norm(gravity))
    if strength:  # a page on which things fall is better than one on which they do not
        candidates.sort(key=lambda n: abs(float(n @ gravity)) > ROUNDING * strength)
    axes = algebra.svd(stacked, full_matrices=True)[2]
    candidates.append(axes[2])
    for n in candidates:
        if float(np.abs(stacked @ n).max(initial=0.0)) <= 1e3 * ROUNDING:
            return _page(n, gravity)
    return None


def _page(normal: Array, gravity: Array) -> Array:
    """Right, up and towards the reader, for a normal in ground axes."""
    up = None
    strength = float(np.linalg.norm(gravity))
    along_axis = strength > 0.0 and float(np.abs(gravity).max()) > (1.0 - ROUNDING) * strength
    if along_axis and abs(float(normal @ gravity)) < ROUNDING * strength:
        up = -gravity / strength
    if up is None:
        k = int(np.argmax(np.abs(normal)))
        up = np.eye(3)[1 if k == 2 else 2]
        up = up - (up @ normal) * normal
        up /= np.linalg.norm(up)
    right = np.cross(up, normal)
    if right[int(np.argmax(np.abs(right)))] < 0.0:
        right = -right
    return np.array([right, up, np.cross(right, up)])


def page_axes(up: Array) -> tuple[int, int]:
    """Of a picture in space: the axis that is nearest to the vertical, and the one that runs to the right."""
    vertical = int(np.argmax(np.abs(up)))
    return vertical, 1 if vertical == 0 else 0
