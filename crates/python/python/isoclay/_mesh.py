"""Triangle meshes."""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _isoclay
from ._wishes import PathLike


@dataclass(frozen=True)
class Mesh:
    """Triangles in world coordinates, counter-clockwise seen from outside."""

    vertices: npt.NDArray[np.float64]
    """``(n, 3)``"""
    triangles: npt.NDArray[np.uint32]
    """``(m, 3)`` rows of ``vertices``."""
    unit: str | None = None
    """Of the vertices."""
    notes: list[str] = field(default_factory=list)
    """What is to be told of it."""

    @property
    def faces(self) -> npt.NDArray[np.uint32]:
        """The triangles, by the name that trimesh has for them."""
        return self.triangles

    @property
    def volume(self) -> float:
        """Volume that a closed mesh encloses."""
        a, b, c = (self.vertices[self.triangles[:, k]] for k in range(3))
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)

    @property
    def is_closed(self) -> bool:
        """Whether every edge has a triangle on either side, turned the same way round."""
        edges = self.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
        code = edges[:, 0] * len(self.vertices) + edges[:, 1]
        back = edges[:, 1] * len(self.vertices) + edges[:, 0]
        return len(code) > 0 and len(np.unique(code)) == len(code) and bool(np.array_equal(np.sort(code), np.sort(back)))

    def save(self, path: PathLike) -> list[str]:
        """Writes .ply, .stl, .obj, .glb, .gltf, .3mf or .wrl, all or nothing. Returns what is to be told of the file."""
        return _isoclay.write_mesh(path, self.vertices, self.triangles, self.unit)

    def to_trimesh(self) -> Any:
        """A ``trimesh.Trimesh`` of the same vertices; needs trimesh."""
        return import_module("trimesh").Trimesh(self.vertices, self.triangles, process=False)

    def to_pyvista(self) -> Any:
        """A ``pyvista.PolyData`` of the same vertices; needs pyvista."""
        return import_module("pyvista").PolyData.from_regular_faces(self.vertices, self.triangles)
