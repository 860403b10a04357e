"""Fields."""

from __future__ import annotations

import base64
import html
import json
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from . import _inputs, _isoclay
from ._mesh import Mesh
from ._picture import drawn, png
from ._wishes import PathLike, Progress, Tolerance, tolerance as parsed, wishes

Array = npt.NDArray[np.float64]

REASONS = (
    "tolerance",
    "depth",
    "no data",
    "noise",
    "budget",
    "memory",
    "neighbours",
    "crease",
    "smoothing",
    "thin",
)
"""Why a leaf was not split, by the number that :attr:`Field.leaves` has for it."""


class Field:
    """A scalar density over space: the solid is where it is above :attr:`iso`.

    A field never changes; operations give new ones, which share all they can. It can be called, pickled, and combined:
    ``a | b``, ``a & b``, ``a - b``, ``~a`` are the union, intersection, difference and complement of the solids.
    """

    __slots__ = ("_core", "_recipe")

    def __init__(self, core: _isoclay.CoreField, recipe: tuple[Any, ...] = ()) -> None:
        """For isoclay itself; fields come from fits, files and other fields."""
        self._core = core
        # Of a formula of other fields: the function that made it, and what it was given.
        self._recipe = recipe

    # Files

    @staticmethod
    def load(path: PathLike) -> Field:
        """Reads a field file, ``.iclay``."""
        return Field(_isoclay.CoreField.load(path))

    def save(self, path: PathLike) -> None:
        """Writes a field file, ``.iclay``, all or nothing. The command line reads it too."""
        self._core.save(path)

    def __reduce__(self) -> tuple[Any, ...]:
        if self._recipe:
            name, *arguments = self._recipe
            return _remade, (name, arguments, self.iso, self.unit)
        return _unpickled, (self._core.to_bytes(),)

    # Asking

    def __call__(self, points: npt.ArrayLike, *, threads: int | None = None) -> Array:
        """Values at points: ``(..., 3)`` gives ``(...)``."""
        return self._asked(points, 0, threads)[0]

    def gradient(self, points: npt.ArrayLike, *, threads: int | None = None) -> Array:
        """Gradients at points: ``(..., 3)`` gives ``(..., 3)``. They point inwards."""
        return cast(Array, self._asked(points, 1, threads)[1])

    def hessian(self, points: npt.ArrayLike, *, threads: int | None = None) -> Array:
        """Second derivatives at points: ``(..., 3)`` gives ``(..., 3, 3)``."""
        return cast(Array, self._asked(points, 2, threads)[2])

    def value_gradient(self, points: npt.ArrayLike, *, threads: int | None = None) -> tuple[Array, Array]:
        """Values and gradients at once, for the price of the gradients."""
        values, gradients, _ = self._asked(points, 1, threads)
        return values, cast(Array, gradients)

    def _asked(
        self, points: npt.ArrayLike, order: int, threads: int | None
    ) -> tuple[Array, Array | None, Array | None]:
        array = np.asarray(points, dtype=np.float64)
        if array.ndim == 0 or array.shape[-1] != 3:
            raise ValueError(f"points have the shape {array.shape}; the last axis has to hold 3 coordinates")
        shape = array.shape[:-1]
        flat = np.ascontiguousarray(array.reshape(-1, 3))
        values, gradients, hessians = self._core.evaluate(flat, order, wishes(threads))
        return (
            values.reshape(shape)[()],
            None if gradients is None else gradients.reshape(*shape, 3),
            None if hessians is None else hessians.reshape(*shape, 3, 3),
        )

    def bounds(self, low: npt.ArrayLike, high: npt.ArrayLike) -> tuple[float, float]:
        """Two numbers that the field stays between everywhere in a box: never too close, possibly too far apart."""
        corners = [np.asarray(corner, dtype=np.float64) for corner in (low, high)]
        if any(corner.shape != (3,) for corner in corners):
            raise ValueError("the corners of a box are 3 coordinates each")
        return self._core.bounds(corners[0].tolist(), corners[1].tolist())

    def sample(
        self,
        like: Any = None,
        *,
        affine: Any = None,
        shape: tuple[int, int, int] | None = None,
        spacing: float | None = None,
        threads: int | None = None,
        progress: Progress | None = None,
        cancel: _isoclay.CancelToken | None = None,
    ) -> tuple[npt.NDArray[np.float32], Array]:
        """Values at the voxels of a grid, and the affine of the grid.

        The grid is that of ``like``, an image of nibabel; or ``shape`` voxels under ``affine``; or it fills the field's box
        with voxels of side ``spacing``, or 256 along its longest side. Returns an array ``[i, j, k]``.
        """
        if like is not None:
            affine, shape = like.affine, like.shape[:3]
        if shape is None:
            low, high = self.box
            size = float((high - low).max())
            step = spacing if spacing is not None else size / 255
            if not step > 0:
                raise ValueError(f"spacing is {step}; it has to be a positive length")
            counts = np.maximum(np.ceil((high - low) / step - 1e-9), 1).astype(int) + 1
            shape = (int(counts[0]), int(counts[1]), int(counts[2]))
            affine = np.diag([step, step, step, 1.0])
            affine[:3, 3] = low
        matrix = _inputs.matrix(affine)
        if min(shape) < 1 or len(shape) != 3:
            raise ValueError(f"the shape is {shape}; three numbers of voxels are needed, 1 or more each")
        asked = wishes(threads, None, progress, cancel)
        values = self._core.sample(matrix[:3].tolist(), (int(shape[0]), int(shape[1]), int(shape[2])), asked)
        return values, matrix

    def mesh(
        self,
        *,
        tolerance: Tolerance | None = None,
        triangles: int | None = None,
        resolution: int | None = None,
        iso: float | None = None,
        closed: bool = True,
        threads: int | None = None,
        progress: Progress | None = None,
        cancel: _isoclay.CancelToken | None = None,
    ) -> Mesh:
        """The surface as triangles, as large as its curvature and the error of the fit allow.

        Args:
            tolerance: Distance from the surface that 95 % of the triangles keep: a length, or ``"0.1%"`` of the diagonal.
            triangles: Most triangles, in place of a tolerance.
            resolution: Cells of one size, so many along the longest side of the box, in place of either.
            iso: Density of the surface, if not :attr:`iso`.
            closed: Close the surface where it meets the box.
        """
        if sum(wish is not None for wish in (tolerance, triangles, resolution)) > 1:
            raise ValueError("tolerance, triangles and resolution are three ways to say one thing; give one of them")
        if triangles is not None and triangles < 4:
            raise ValueError(f"triangles is {triangles}; a mesh has 4 or more")
        if resolution is not None and not 1 <= resolution <= 65535:
            raise ValueError(f"resolution is {resolution}; it has to be from 1 to 65535")
        number, unit = parsed(tolerance)
        if unit == "mm":
            number, unit = number and number / _mm(self.unit), ""
        fine = {"tolerance": number, "is_share": False, "triangles": triangles, "resolution": resolution}
        if unit == "%":
            fine.update(tolerance=cast(float, number) / 100, is_share=True)
        level = self._level(iso)
        vertices, corners, notes = _isoclay.mesh_of(
            self._core, level, not closed, fine, wishes(threads, None, progress, cancel)
        )
        if len(corners) == 0:
            low, high = self.bounds(*self.box)
            raise ValueError(
                f"the surface at {level} does not meet the box, in which the field stays between {low:g} and {high:g}; choose "
                "another iso"
            )
        return Mesh(vertices, corners, self.unit, notes)

    def _level(self, iso: float | None) -> float:
        if iso is None:
            iso = self.iso
        if iso is None:
            low, high = self.bounds(*self.box)
            raise ValueError(f"the field names no surface; choose iso= between {low:g} and {high:g}")
        return float(iso)

    def baked(
        self,
        tolerance: float | None = None,
        *,
        everywhere: bool = False,
        threads: int | None = None,
        progress: Progress | None = None,
        cancel: _isoclay.CancelToken | None = None,
    ) -> Field:
        """One spline in place of a formula, which can be saved and sculpted.

        Args:
            tolerance: How far it may be off: a length at the surface, elsewhere it has the right sign; or if ``everywhere`` a
                value at any place. A fiftieth of the finest knot interval if not given.
        """
        asked = wishes(threads, None, progress, cancel)
        return Field(self._core.baked(self._level(None), tolerance, everywhere, asked))

    # What it is

    @property
    def box(self) -> Array:
        """The two corners of the box that it describes, ``(2, 3)``."""
        return self._core.world_box

    @property
    def iso(self) -> float | None:
        """Density of the surface: 0 of clouds and meshes; of volumes where air and tissue part best."""
        return self._core.iso

    def with_iso(self, iso: float | None) -> Field:
        """The same with its surface elsewhere."""
        return Field(self._core.marked(iso, self.unit, self._core.provenance), self._recipe)

    @property
    def unit(self) -> str | None:
        """Of lengths, if known."""
        return self._core.unit

    @property
    def source(self) -> str:
        """What it was fitted to: ``cloud``, ``mesh``, ``volume``, or ``other`` for what was made of other fields."""
        return self._core.source

    @property
    def is_formula(self) -> bool:
        """Whether it is a formula of other fields, which :meth:`baked` makes one spline of."""
        return not self._core.is_stored

    @property
    def sha256(self) -> str:
        """Names it: equal for equal fields, to the bit; what the command line prints as ``field_sha256``."""
        return self._core.sha256

    @property
    def coefficient_count(self) -> int:
        """Coefficients that it is made of."""
        return self._core.coefficient_count

    @property
    def level_count(self) -> int:
        """Levels of refinement."""
        return self._core.level_count

    @property
    def precision(self) -> str:
        """Of the coefficients: ``f32`` or ``f64``."""
        return self._core.precision

    @property
    def report(self) -> dict[str, Any]:
        """What the fit said of its own error, in the tolerance's unit; empty for fields that were not fitted."""
        text = self._core.report
        return cast(dict[str, Any], json.loads(text)) if text else {}

    @property
    def notes(self) -> list[str]:
        """Repairs and doubts, each a sentence."""
        return self._core.notes

    @property
    def leaves(self) -> npt.NDArray[Any]:
        """The error of each leaf: a structured array of level, cell, samples, rms, max, reason (see :data:`REASONS`)."""
        level, cell, samples, rms, largest, reason = self._core.leaves()
        kind = [
            ("level", "u1"),
            ("cell", "u4", 3),
            ("samples", "u4"),
            ("rms", "f4"),
            ("max", "f4"),
            ("reason", "u1"),
        ]
        table = np.empty(len(level), dtype=kind)
        for name, column in zip(table.dtype.names or (), (level, cell, samples, rms, largest, reason), strict=True):
            table[name] = column
        return table

    # Solids made of solids

    def __or__(self, other: Field) -> Field:
        return union(self, other) if isinstance(other, Field) else NotImplemented

    def __and__(self, other: Field) -> Field:
        return intersection(self, other) if isinstance(other, Field) else NotImplemented

    def __sub__(self, other: Field) -> Field:
        return difference(self, other) if isinstance(other, Field) else NotImplemented

    def __invert__(self) -> Field:
        return _made("complement", self)

    def grown(self, by: float) -> Field:
        """Grown by a length, to first order; shrunk if it is negative."""
        return _made("grown", self, float(by))

    def moved(self, matrix: npt.ArrayLike) -> Field:
        """Carried by a 4 by 4 matrix: moved, turned, stretched, mirrored."""
        return _made("moved", self, _inputs.matrix(matrix)[:3].tolist())

    # Showing

    def __repr__(self) -> str:
        low, high = self.box
        unit = f" {self.unit}" if self.unit else ""
        size = " x ".join(f"{n:.4g}" for n in high - low)
        parts = [f"{size}{unit}", f"iso {self.iso:.6g}" if self.iso is not None else "no surface named"]
        if not self.is_formula:
            parts.append(f"{self.coefficient_count} coefficients")
        kind = "a formula" if self.is_formula else f"a {self.source}"
        return f"<isoclay.Field of {kind}: {', '.join(parts)}>"

    def picture(
        self, size: int = 320, *, toward: npt.ArrayLike | None = None, up: npt.ArrayLike | None = None
    ) -> npt.NDArray[np.uint8]:
        """The solid as seen from the direction ``toward``, with ``up`` upwards: ``(size, size, 3)`` colours.

        Volumes are seen from the front with z upwards, all else with y upwards.
        """
        of_volume = self.source == "volume"
        eye = toward if toward is not None else ((-0.5, 1.0, 0.35) if of_volume else (0.5, 0.35, 1.0))
        upwards = up if up is not None else ((0.0, 0.0, 1.0) if of_volume else (0.0, 1.0, 0.0))
        return drawn(self, self._level(None), size, np.asarray(eye, float), np.asarray(upwards, float))

    def _repr_png_(self) -> bytes | None:
        """A picture, for notebooks."""
        return None if self.iso is None else png(self.picture())

    def _repr_html_(self) -> str:
        """A table of figures with a picture, for notebooks."""
        report = self.report
        shown = [("box", " to ".join(str(np.round(corner, 4).tolist()) for corner in self.box))]
        shown += [("unit", self.unit or "unknown"), ("iso", "none" if self.iso is None else f"{self.iso:.6g}")]
        if not self.is_formula:
            shown.append(("coefficients", f"{self.coefficient_count:,}".replace(",", " ")))
        shown += [(name, f"{report[name]:.4g}") for name in ("rms", "p95", "max", "tolerance") if name in report]
        rows = "".join(f"<tr><th>{html.escape(k)}</th><td>{html.escape(v)}</td></tr>" for k, v in shown)
        picture = self._repr_png_()
        shown_picture = ""
        if picture is not None:
            data = base64.b64encode(picture).decode("ascii")
            shown_picture = f'<img alt="picture of the solid" src="data:image/png;base64,{data}">'
        return f"<div>{shown_picture}<table><caption>isoclay field of {html.escape(self.source)}</caption>{rows}</table></div>"


def _mm(unit: str | None) -> float:
    lengths = {"um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1000.0}
    if unit not in lengths:
        raise ValueError("a tolerance in mm needs the unit of the field, which is not known; give a length in its own unit")
    return lengths[unit]


def union(*fields: Field, smooth: float = 0.0) -> Field:
    """What is inside of any. With ``smooth``, creases are rounded over that range, in the unit of the fields' values."""
    return _made("union", list(fields), float(smooth))


def intersection(*fields: Field, smooth: float = 0.0) -> Field:
    """What is inside of all; ``smooth`` as in :func:`union`."""
    return _made("intersection", list(fields), float(smooth))


def difference(solid: Field, *taken: Field, smooth: float = 0.0) -> Field:
    """What is inside of ``solid`` and of none of ``taken``; ``smooth`` as in :func:`union`."""
    return _made("difference", [solid, *taken], float(smooth))


def _made(name: str, *arguments: Any) -> Field:
    def core(argument: Any) -> Any:
        if isinstance(argument, Field):
            return argument._core
        if isinstance(argument, list):
            return [core(one) for one in argument]
        return argument

    made = getattr(_isoclay, name)(*map(core, arguments))
    return Field(made, (name, *arguments))


def _remade(name: str, arguments: list[Any], iso: float | None, unit: str | None) -> Field:
    made = _made(name, *arguments)
    return Field(made._core.marked(iso, unit, ""), made._recipe)


def _unpickled(data: bytes) -> Field:
    return Field(_isoclay.CoreField.from_bytes(data))
