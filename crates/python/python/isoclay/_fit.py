"""Fits."""

from __future__ import annotations

import os
from typing import Any, Literal

from . import _inputs, _isoclay
from ._field import Field
from ._wishes import PathLike, Progress, Tolerance, choice, wishes


def fit_points(
    points: Any,
    normals: Any = None,
    *,
    unoriented: Literal["winding", "tagging"] | None = None,
    robust: bool = False,
    method: Literal["gradient", "offset-pairs"] = "gradient",
    tolerance: Tolerance | None = None,
    coefficients: int | None = None,
    max_depth: int | None = None,
    smoothing: float | None = None,
    precision: Literal["f32", "f64"] = "f32",
    unit: str | None = None,
    threads: int | None = None,
    memory: int | None = None,
    progress: Progress | None = None,
    cancel: _isoclay.CancelToken | None = None,
) -> Field:
    """Fits a signed distance, positive inside, to points on a surface.

    Args:
        points: An ``(n, 3)`` array, or a cloud of Open3D, pyvista or trimesh.
        normals: Outward normals, ``(n, 3)``, of any length; those of the cloud if it has some.
        unoriented: How to estimate normals where there are none, or those there are not to be trusted: by the winding number
            of the points, which takes noise and holes, or by flooding the space outside.
        robust: Take no notice of points that contradict the others: for clouds with outliers.
        method: What a normal asks for: a gradient, or two points beside the surface.
        tolerance: Root mean square of the distances in a leaf: a length, or ``"0.01%"`` of the diagonal, or ``"0.1mm"``.
            What the noise justifies if not given.
        coefficients: Most coefficients to spend.
        max_depth: Finest level, 6 to 16: 2 to that power cells along the box.
        smoothing: Weight of the bending energy; chosen from the data if not given.
        precision: Of the coefficients.
        unit: Of the coordinates: ``"mm"``, ``"cm"``, ``"m"`` or ``"um"``.
        threads: To work with; one a core if not given.
        memory: Most bytes that the fit may hold.
        progress: Called with a stage and the share done, on this thread.
        cancel: A token that stops the fit from another thread.

    Raises:
        isoclay.errors.NotEnoughSamples: Of fewer than 10 usable points.
        isoclay.errors.Degenerate: Of points that cannot bound a solid.
        isoclay.errors.BadOption: Of an option out of range.
        isoclay.errors.MemoryLimit: Of work beyond ``memory``.
        isoclay.errors.Cancelled: Of a token that was used.
    """
    array, own = _inputs.points(points)
    given = own if normals is None else _inputs.rows(normals, "normals")
    if method not in ("gradient", "offset-pairs"):
        raise ValueError(f"method is {method!r}; write 'gradient' or 'offset-pairs'")
    clouds = {"unoriented": unoriented, "robust": robust, "offset_pairs": method == "offset-pairs"}
    chosen = choice(tolerance, coefficients, max_depth, smoothing, precision, unit)
    hints = wishes(threads, memory, progress, cancel)
    return Field(_isoclay.fit_points(array, given, clouds, chosen, hints))


def fit_mesh(
    mesh: Any,
    *,
    band: float | None = None,
    tolerance: Tolerance | None = None,
    coefficients: int | None = None,
    max_depth: int | None = None,
    precision: Literal["f32", "f64"] = "f32",
    unit: str | None = None,
    threads: int | None = None,
    memory: int | None = None,
    progress: Progress | None = None,
    cancel: _isoclay.CancelToken | None = None,
) -> Field:
    """Fits a signed distance, positive inside, to the solid that triangles bound, closed or not.

    Args:
        mesh: ``(vertices, triangles)``, or a mesh of trimesh, pyvista or Open3D.
        band: Distance from the surface up to which the tolerance holds; the surface alone if not given.

    The other arguments, and what is raised, are those of :func:`fit_points`.
    """
    vertices, triangles = _inputs.mesh(mesh)
    chosen = choice(tolerance, coefficients, max_depth, None, precision, unit)
    hints = wishes(threads, memory, progress, cancel)
    return Field(_isoclay.fit_mesh(vertices, triangles, band, chosen, hints))


def fit_volume(
    volume: Any,
    affine: Any = None,
    *,
    order: Literal["xyz", "zyx"] = "xyz",
    method: Literal["adaptive", "interpolate"] = "adaptive",
    tolerance: Tolerance | None = None,
    coefficients: int | None = None,
    max_depth: int | None = None,
    smoothing: float | None = None,
    precision: Literal["f32", "f64"] = "f32",
    unit: str | None = None,
    threads: int | None = None,
    memory: int | None = None,
    progress: Progress | None = None,
    cancel: _isoclay.CancelToken | None = None,
) -> Field:
    """Fits a density to the voxels of a volume.

    Whole numbers of 16 bits and floats of 32 in either memory order are fitted where they lie, without a copy; do not change
    them meanwhile. Neither the memory order nor the type shows in the result, to the bit.

    Args:
        volume: An array, or an image of nibabel.
        affine: Map from voxel indices ``(i, j, k)`` to the world, 4 by 4, or one or three spacings. That of the image, or
            the identity, if not given.
        order: ``"xyz"`` for an array ``[i, j, k]``, as nibabel has it, ``"zyx"`` for ``[k, j, i]``, as many other readers
            have it. The affine is of ``(i, j, k)`` in both.
        method: Few coefficients where they suffice, or one a voxel, exact at each.
        tolerance: Root mean square of the residuals in a leaf: a density, or ``"0.5%"`` of the range between the 1st and the
            99th percentile. What the noise justifies if not given.
        max_depth: Finest level: 0 has a knot every four voxels, 2 one at each.
        smoothing: Weight of a ridge on fine functions.

    The other arguments, and what is raised, are those of :func:`fit_points`.
    """
    array, map_, own_unit = _inputs.volume(volume, affine, order)
    if method not in ("adaptive", "interpolate"):
        raise ValueError(f"method is {method!r}; write 'adaptive' or 'interpolate'")
    numbers, last_fastest = _inputs.numbers(array)
    if isinstance(tolerance, str) and tolerance.strip().endswith("mm"):
        raise ValueError(f"tolerance is {tolerance!r}, a length; that of a volume is a density, or a share such as '0.5%'")
    chosen = choice(tolerance, coefficients, max_depth, smoothing, precision, unit or own_unit)
    hints = wishes(threads, memory, progress, cancel)
    core = _isoclay.fit_volume(
        numbers, array.shape, last_fastest, map_[:3].tolist(), method == "interpolate", chosen, hints
    )
    return Field(core)


def fit(
    path: PathLike,
    *,
    unoriented: Literal["winding", "tagging"] | None = None,
    robust: bool = False,
    as_mesh: bool = False,
    tolerance: Tolerance | None = None,
    coefficients: int | None = None,
    max_depth: int | None = None,
    precision: Literal["f32", "f64"] = "f32",
    unit: str | None = None,
    threads: int | None = None,
    memory: int | None = None,
    progress: Progress | None = None,
    cancel: _isoclay.CancelToken | None = None,
) -> Field:
    """Fits a file of any kind that isoclay reads: a cloud, a mesh, a volume, or a directory of DICOM slices.

    The field is that of ``isoclay fit``, to the bit.

    Args:
        path: The file.
        as_mesh: Take the faces of a PLY or OBJ file for a solid, not its vertices for points.

    The other arguments are those of :func:`fit_points`; those for points alone are left aside for other files.

    Raises:
        isoclay.errors.BadFile: Of a file that cannot be used.
        isoclay.errors.FileFailed: Of a file that cannot be read.
    """
    clouds = {"unoriented": unoriented, "robust": robust, "offset_pairs": False}
    name = os.path.basename(os.fspath(path))
    chosen = choice(tolerance, coefficients, max_depth, None, precision, unit, name)
    hints = wishes(threads, memory, progress, cancel)
    return Field(_isoclay.fit_file(os.fspath(path), as_mesh, clouds, chosen, hints))
