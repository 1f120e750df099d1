"""Solids of uniform density: one short class a type, :data:`SOLIDS` the table of them; solids that meshes bound."""

from __future__ import annotations

import math
import os
from abc import abstractmethod
from collections.abc import Sequence
from functools import lru_cache
from stat import S_ISREG
from typing import ClassVar

import numpy as np

from ..base.files import as_name
from ..base.limits.numbers import MESH
from ..errors import UsageError, bad_data, bad_file, off_range, too_large
from ..expr import vectors as vec
from ..expr.core import Expr, Graph
from ..expr.records import Record
from ..expr.tensors import add_matrices, shift_tensor
from ..expr.vectors import Mat3, Vec3
from .dimensions import LENGTH
from .element_type import Element, key, keys_of
from .kinds import Fields, Scalar, Vector

# -- the class ---------------------------------------------------------------------------------------------------------

# Formulas after Bauchau, *Flexible Multibody Dynamics* (2011), app. A, and any table of mass moments of inertia; tests
# integrate the density over each solid instead.


class Solid(Element):
    """A solid of uniform density; its fields are its dimensions (m)."""

    dimensions: ClassVar[Fields]  #: its keys
    has_axis: ClassVar[bool] = False  #: whether z of its own axes can be laid along an ``axis``
    content_key: ClassVar[str] = "density"  #: the key that gives the mass through :meth:`content`

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        cls.dimensions = keys_of(cls)

    @abstractmethod
    def content(self) -> Expr:
        """What the density is multiplied with: the volume (m^3), of a rod its length (m)."""

    @abstractmethod
    def gyration(self) -> tuple[Expr | float, ...]:
        """Principal moments about the centre of mass in the solid's own axes, for each kg (m^2)."""

    def centre(self) -> Expr | float:
        """Centre of mass along z of its own axes, from the solid's reference point (m)."""
        return 0.0


# -- boxes, spheres, ellipsoids ----------------------------------------------------------------------------------------


class Box(Solid):
    """A rectangular block; edges along its axes."""

    size: Vec3 = key(Vector("edges along x, y, z (m)", required=True, dimension=LENGTH))

    def content(self) -> Expr:
        a, b, c = self.size
        return a * b * c

    def gyration(self) -> Vec3:
        a, b, c = (x * x / 12.0 for x in self.size)
        return (b + c, a + c, a + b)


class Ellipsoid(Solid):
    """An ellipsoid; half axes along its axes."""

    semi_axes: Vec3 = key(Vector("half axes along x, y, z (m)", required=True, dimension=LENGTH))

    def content(self) -> Expr:
        a, b, c = self.semi_axes
        return (4.0 / 3.0 * math.pi) * a * b * c

    def gyration(self) -> Vec3:
        a, b, c = (0.2 * x * x for x in self.semi_axes)
        return (b + c, a + c, a + b)


class Sphere(Solid):
    """A ball."""

    radius: Expr = key(Scalar("radius (m)", required=True, dimension=LENGTH))

    def content(self) -> Expr:
        return (4.0 / 3.0 * math.pi) * self.radius * self.radius * self.radius

    def gyration(self) -> Vec3:
        return (0.4 * self.radius * self.radius,) * 3


# -- solids of revolution ----------------------------------------------------------------------------------------------


_LENGTH = Scalar("length along the axis (m)", required=True, dimension=LENGTH)
_RADIUS = Scalar("radius (m)", required=True, dimension=LENGTH)


class Cylinder(Solid):
    """A full circular cylinder, placed by its centre; of length 0 a disc (which needs a mass)."""

    has_axis = True
    radius: Expr = key(_RADIUS)
    length: Expr = key(_LENGTH)

    def content(self) -> Expr:
        return math.pi * self.radius * self.radius * self.length

    def gyration(self) -> Vec3:
        r, l = self.radius, self.length
        lateral = r * r / 4.0 + l * l / 12.0
        return (lateral, lateral, 0.5 * r * r)


class Tube(Solid):
    """A hollow circular cylinder, placed by its centre."""

    has_axis = True
    outer_radius: Expr = key(_RADIUS.replace(doc="outer radius (m)"))
    inner_radius: Expr = key(_RADIUS.replace(doc="inner radius (m)"))
    length: Expr = key(_LENGTH)

    def content(self) -> Expr:
        a, b = self.outer_radius, self.inner_radius
        return math.pi * (a - b) * (a + b) * self.length

    def gyration(self) -> Vec3:
        a, b, l = self.outer_radius, self.inner_radius, self.length
        square = a * a + b * b
        lateral = square / 4.0 + l * l / 12.0
        return (lateral, lateral, 0.5 * square)


class Rod(Solid):
    """A thin straight rod, placed by its middle; ``line_density`` is its mass for each metre."""

    has_axis = True
    content_key = "line_density"
    length: Expr = key(_LENGTH)

    def content(self) -> Expr:
        return self.length

    def gyration(self) -> tuple[Expr | float, ...]:
        lateral = self.length * self.length / 12.0
        return (lateral, lateral, 0.0)


class Cone(Solid):
    """A full circular cone, placed by the centre of its base, its apex along the axis."""

    has_axis = True
    radius: Expr = key(_RADIUS.replace(doc="radius of the base (m)"))
    length: Expr = key(_LENGTH.replace(doc="height along the axis (m)"))

    def content(self) -> Expr:
        return (math.pi / 3.0) * self.radius * self.radius * self.length

    def gyration(self) -> Vec3:
        r, h = self.radius, self.length
        lateral = 0.15 * r * r + 0.0375 * h * h
        return (lateral, lateral, 0.3 * r * r)

    def centre(self) -> Expr:
        return 0.25 * self.length


SOLIDS = {solid.type_name: solid for solid in (Box, Cylinder, Tube, Sphere, Rod, Cone, Ellipsoid)}


# -- mass, centre of mass and inertia together -------------------------------------------------------------------------


class MassProperties(Record):
    """Mass (kg), centre of mass (m) and inertia about it (kg m^2), in body axes."""

    mass: Expr
    com: Vec3
    inertia: Mat3


def point(graph: Graph, mass: Expr, at: Vec3) -> MassProperties:
    """A point mass."""
    o = vec.zero(graph)
    return MassProperties(mass, at, (o, o, o))


def combine(graph: Graph, parts: Sequence[MassProperties]) -> MassProperties:
    """The sum of parts; a coordinate of the centre of mass that all share stays as it is written."""
    if len(parts) == 1:
        return parts[0]
    mass = graph.zero
    moment = vec.zero(graph)
    for part in parts:
        mass = mass + part.mass
        moment = vec.add(moment, vec.scale(part.mass, part.com))
    x, y, z = (
        parts[0].com[k] if all(part.com[k] == parts[0].com[k] for part in parts) else moment[k] / mass for k in range(3)
    )
    o = vec.zero(graph)
    inertia: Mat3 = (o, o, o)
    for part in parts:
        arm = vec.sub(part.com, (x, y, z))
        inertia = add_matrices(inertia, add_matrices(part.inertia, shift_tensor(part.mass, arm)))
    return MassProperties(mass, (x, y, z), inertia)


# -- meshes: an STL file and the solid that it bounds, by trimesh ------------------------------------------------------


class MeshProperties(Record):
    """Volume, centre and inertia about it at density 1, in the units and axes of the file."""

    volume: float
    centre: tuple[float, float, float]
    inertia: tuple[tuple[float, float, float], ...]


def measure_mesh(path: str) -> MeshProperties:
    """Mass properties of the solid that an STL file, text or binary, bounds.

    Raises UsageError where there is no such file, it is no STL file, trimesh is not installed, or its triangles do not
    bound a solid: the surface has holes, its triangles are wound inconsistently or inside out.
    """
    path = as_name("path", path)
    try:
        stat = os.stat(path)
    except OSError as error:
        raise bad_file(f"cannot read {path}: {error.strerror}") from None
    if not S_ISREG(stat.st_mode):
        raise bad_file(f"{path} is not a plain file")
    if not path.lower().endswith(".stl"):
        raise bad_file(f"{path}: only STL files (.stl) can be read")
    if stat.st_size > MESH:
        raise too_large(f"{path} has {stat.st_size:,} bytes, and {MESH:,} is the most; use a mesh with fewer triangles")
    return _measure(os.path.abspath(path), stat.st_mtime_ns, stat.st_size)


@lru_cache(maxsize=256)
@np.errstate(all="ignore")
def _measure(path: str, _changed: int, _size: int) -> MeshProperties:
    try:
        import trimesh
    except ImportError:
        raise UsageError(
            "meshes need trimesh: pip install 'eomgen[mesh]', or pip install trimesh", code="EG-PACKAGE-MISSING"
        ) from None
    log = trimesh.util.log
    was_disabled, log.disabled = log.disabled, True  # it logs the tracebacks of what it tries first
    try:
        mesh = trimesh.load(path, file_type="stl", force="mesh")
    except Exception as error:  # whatever a parser meets in a broken file
        raise bad_data(f"{path} is not an STL file that can be read ({error})") from None
    finally:
        log.disabled = was_disabled
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0 or not np.isfinite(mesh.vertices).all():
        raise bad_data(f"{path} has no triangles, or vertices that are not finite")
    if not mesh.is_watertight:
        raise bad_data(f"{path} does not bound a solid: its surface has holes (edges of one triangle only)")
    if not mesh.is_winding_consistent:
        raise bad_data(f"{path} does not bound a solid: neighbouring triangles are wound in opposite senses")
    measured = mesh.mass_properties
    volume = float(measured["volume"])
    if not np.isfinite(volume + np.sum(measured["inertia"]) + np.sum(measured["center_mass"])):
        raise off_range(f"{path} is so large or so small that its volume or its inertia is not finite")
    if not volume > 0.0:
        raise bad_data(f"{path} is inside out: its triangles face inwards, so the volume is {volume:.3g}")
    centre = np.asarray(measured["center_mass"], dtype=float)
    tensor = np.asarray(measured["inertia"], dtype=float)
    tensor = 0.5 * (tensor + tensor.T)
    x, y, z = centre.tolist()
    return MeshProperties(volume, (x, y, z), tuple(tuple(row) for row in tensor.tolist()))
