"""What can be fitted, in the forms that other libraries hold it: found out by the attributes they have."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Doubles: TypeAlias = npt.NDArray[np.float64]

_UNITS = {"micron": "um", "mm": "mm", "meter": "m"}


def points(source: Any) -> tuple[Doubles, Doubles | None]:
    """Points and normals of an array or of an object with ``points`` or ``vertices`` (Open3D, pyvista, trimesh)."""
    normals = None
    for name in ("points", "vertices"):
        found = getattr(source, name, None)
        if found is not None and not callable(found):
            normals = _normals(source)
            source = found
            break
    array = rows(source, "points")
    if normals is not None and len(normals) != len(array):
        normals = None
    return array, normals


def _normals(source: Any) -> Doubles | None:
    for name in ("normals", "vertex_normals"):
        found = getattr(source, name, None)
        if found is not None and not callable(found) and len(found) > 0:
            return rows(found, name)
    data = getattr(source, "point_data", None)
    if data is not None and "Normals" in data:
        return rows(data["Normals"], "Normals")
    return None


def mesh(source: Any) -> tuple[Doubles, npt.NDArray[np.uint32]]:
    """Vertices and triangles of a trimesh, pyvista or Open3D mesh, or of a pair of arrays."""
    if isinstance(source, tuple | list) and len(source) == 2:
        return rows(source[0], "vertices"), triangles(source[1])
    if hasattr(source, "triangulate") and hasattr(source, "points"):
        # A pyvista mesh has one flat list: how many corners, the corners, and so on.
        flat = np.asarray(source.triangulate().faces)
        return rows(source.points, "points"), triangles(flat.reshape(-1, 4)[:, 1:])
    vertices = getattr(source, "vertices", None)
    faces = getattr(source, "faces", None)
    if faces is None:
        faces = getattr(source, "triangles", None)
    if vertices is None or faces is None:
        raise TypeError(
            f"{type(source).__name__} is no mesh; give (vertices, triangles), or an object that has vertices and faces, as "
            "those of trimesh, pyvista and Open3D have"
        )
    return rows(vertices, "vertices"), triangles(faces)


def rows(source: Any, name: str) -> Doubles:
    """An (n, 3) array of doubles."""
    array = np.ascontiguousarray(source, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"{name} has the shape {array.shape}; (n, 3) is needed")
    return array


def triangles(source: Any) -> npt.NDArray[np.uint32]:
    """An (n, 3) array of indices."""
    array = np.asarray(source)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"triangles have the shape {array.shape}; (n, 3) is needed")
    if array.dtype.kind not in "iu":
        raise TypeError(f"triangles are {array.dtype}; whole numbers are needed")
    if array.size and (array.min() < 0 or array.max() > np.iinfo(np.uint32).max):
        raise ValueError("a triangle has a corner below 0 or beyond 32 bits")
    return np.ascontiguousarray(array, dtype=np.uint32)


def volume(source: Any, affine: Any, order: str) -> tuple[npt.NDArray[Any], Doubles, str | None]:
    """Voxels ``[i, j, k]``, their affine, and the unit of an image or an array."""
    unit = None
    if hasattr(source, "dataobj"):
        if order != "xyz":
            raise ValueError(f"order={order!r} is for arrays; an image is [i, j, k] by itself, leave it out")
        if affine is None:
            affine = source.affine
        unit = _unit(source)
        source = np.asanyarray(source.dataobj)
        while source.ndim > 3 and source.shape[-1] == 1:
            source = source[..., 0]
    array = np.asanyarray(source)
    if array.ndim != 3:
        raise ValueError(
            f"a volume has three axes, this has the shape {array.shape}; of a series choose one, as image.slicer[..., 0]"
        )
    if order == "zyx":
        array = array.transpose(2, 1, 0)
    elif order != "xyz":
        raise ValueError(f"order is {order!r}; write 'xyz' for [i, j, k], as nibabel has it, or 'zyx' for [k, j, i]")
    return array, matrix(affine), unit


def _unit(image: Any) -> str | None:
    ask = getattr(getattr(image, "header", None), "get_xyzt_units", None)
    return _UNITS.get(ask()[0]) if ask is not None else None


def matrix(affine: Any) -> Doubles:
    """A 4 by 4 matrix from a matrix, from one or three spacings, or the identity."""
    if affine is None:
        return np.eye(4)
    array = np.asarray(affine, dtype=np.float64)
    if array.shape in ((), (3,)):
        return np.diag([*np.broadcast_to(array, 3), 1.0])
    if array.shape != (4, 4) or not np.array_equal(array[3], [0, 0, 0, 1]):
        raise ValueError(f"the affine is {array.tolist()}; a matrix of 4 by 4 with the last row 0 0 0 1 is needed, or a spacing")
    return array


def numbers(array: npt.NDArray[Any]) -> tuple[npt.NDArray[Any], bool]:
    """The voxels in a row as they lie in memory, and whether the last axis is fastest; int16 and float32 without a copy."""
    if array.dtype.kind == "c" or array.dtype.kind not in "biuf":
        raise TypeError(f"voxels are {array.dtype}; whole or real numbers are needed")
    fits_int16 = array.dtype.kind == "b" or (array.dtype.kind in "iu" and np.can_cast(array.dtype, np.int16))
    wanted = np.dtype(np.int16 if fits_int16 else np.float32)
    if array.dtype != wanted:
        array = array.astype(wanted, order="K")
    flags = array.flags
    if not flags.aligned or not (flags.c_contiguous or flags.f_contiguous):
        array = np.array(array, order="F")
    last_fastest = not array.flags.f_contiguous
    return array.reshape(-1, order="C" if last_fastest else "F"), last_fastest
