"""An STL file -> volume, centre of mass and inertia of the solid it bounds, by trimesh."""

from __future__ import annotations

import os
from functools import lru_cache
from stat import S_ISREG

import numpy as np

from ...base.files import as_name
from ...base.limits.numbers import MESH
from ...base.records import dataclass
from ...errors import UsageError, bad_data, bad_file, off_range, too_large


@dataclass(frozen=True)
class MeshProperties:
    """Volume, centre and inertia about it at density 1, in the units and axes of the file."""

    volume: float
    centre: tuple[float, float, float]
    inertia: tuple[tuple[float, float, float], ...]


def measure_mesh(path: str) -> MeshProperties:
    """Mass properties of the solid that a mesh bounds.

    Parameters
    ----------
    path : str
        An STL file, text or binary.

    Returns
    -------
    MeshProperties

    Raises
    ------
    UsageError
        There is no such file, it is no STL file, or its triangles do not bound a solid: the surface has holes, its
        triangles are wound inconsistently or inside out.  Also when trimesh is not installed.
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
    told, log.disabled = log.disabled, True  # it logs the tracebacks of what it tries first
    try:
        mesh = trimesh.load(path, file_type="stl", force="mesh")
    except Exception as error:  # whatever a parser meets in a broken file
        raise bad_data(f"{path} is not an STL file that can be read ({error})") from None
    finally:
        log.disabled = told
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
