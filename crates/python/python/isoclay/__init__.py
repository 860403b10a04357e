"""Turns scans into elastic clay: point clouds, meshes and volumes become implicit B-spline solids.

>>> import isoclay
>>> field = isoclay.fit_volume(image)          # a nibabel image, or an array with its affine
>>> field.mesh().save("surface.ply")
>>> values = field(points)                     # positive inside the solid, (n, 3) -> (n,)

All coordinates are world coordinates, as the affine or the points give them. A field is positive inside of a cloud's or a
mesh's solid, and has the density of a volume; its surface lies at :attr:`Field.iso`.

Long work leaves the interpreter free, hears Ctrl-C, tells its progress, and gives the same bits on any number of threads.
"""

from . import errors
from ._document import Document, Edit
from ._field import REASONS, Field, difference, intersection, union
from ._fit import fit, fit_mesh, fit_points, fit_volume
from ._isoclay import CancelToken, __version__
from ._mesh import Mesh
from ._simulation import Region, Simulation

__all__ = [
    "REASONS",
    "CancelToken",
    "Document",
    "Edit",
    "Field",
    "Mesh",
    "Region",
    "Simulation",
    "__version__",
    "difference",
    "errors",
    "fit",
    "fit_mesh",
    "fit_points",
    "fit_volume",
    "intersection",
    "union",
]
