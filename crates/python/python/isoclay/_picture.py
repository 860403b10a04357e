"""Small pictures of solids for notebooks: rays through a grid that looks along the line of sight."""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from ._field import Field

_CLAY = np.array([0.80, 0.56, 0.42])
_PAPER = np.array([0.93, 0.94, 0.95])
_SUN = np.array([-0.45, 0.65, 0.62])
_DEPTH = 96
"""Samples along a ray. Thin parts may be missed; ``isoclay picture`` misses none."""


def drawn(
    field: Field, iso: float, size: int, toward: npt.NDArray[np.float64], up: npt.NDArray[np.float64]
) -> npt.NDArray[np.uint8]:
    """A shaded view of a solid, ``(size, size, 3)``."""
    back = toward / np.linalg.norm(toward)
    right = np.cross(up, back)
    if not 8 <= size <= 4096:
        raise ValueError(f"size is {size}; it has to be from 8 to 4096 pixels")
    if not np.linalg.norm(right) > 1e-9:
        raise ValueError("toward and up are parallel; give two directions")
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(back, right), back])
    low, high = field.box
    middle, reach = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    # From the upper left corner on the far side: rows go down, rays come towards the eye.
    across, along = 2 * reach / (size - 1), 2 * reach / (_DEPTH - 1)
    affine = np.eye(4)
    affine[:3, :3] = np.stack([-axes[1] * across, axes[0] * across, axes[2] * along], axis=1)
    affine[:3, 3] = middle + reach * (axes[1] - axes[0] - axes[2])
    values, _ = field.sample(affine=affine, shape=(size, size, _DEPTH))
    _outside(values, affine, low, high, iso)
    inside = values > iso
    image = np.broadcast_to(_PAPER, (size, size, 3)).copy()
    rows, columns = np.nonzero(inside.any(axis=2))
    nearest = _DEPTH - 1 - np.argmax(inside[rows, columns, ::-1], axis=1)
    behind = np.minimum(nearest + 1, _DEPTH - 1)
    a, b = values[rows, columns, nearest] - iso, values[rows, columns, behind] - iso
    depth = nearest + np.where(b < a, a / np.maximum(a - b, 1e-30), 0).clip(0, 1)
    places = np.stack([rows, columns, depth], axis=1) @ affine[:3, :3].T + affine[:3, 3]
    gradients = field.gradient(places)
    normals = -gradients / np.maximum(np.linalg.norm(gradients, axis=1, keepdims=True), 1e-30)
    # Where the solid was cut at its box, the field's normal is not that of the cut.
    faces = np.concatenate([places - low, high - places], axis=1)
    cut = faces.min(axis=1) < along
    normals[cut] = np.concatenate([-np.eye(3), np.eye(3)])[faces[cut].argmin(axis=1)]
    normals = normals @ axes.T
    sun = np.clip(normals @ (_SUN / np.linalg.norm(_SUN)), 0, 1)
    light = 0.25 + 0.2 * (normals[:, 1] + 1) + 0.65 * sun
    image[rows, columns] = np.clip(_CLAY**2.2 * light[:, None], 0, 1) ** (1 / 2.2)
    return (image * 255 + 0.5).astype(np.uint8)


def _outside(
    values: npt.NDArray[np.float32],
    affine: npt.NDArray[np.float64],
    low: npt.NDArray[np.float64],
    high: npt.NDArray[np.float64],
    iso: float,
) -> None:
    """Takes out what lies beyond the box, where a field only goes on somehow."""
    grids = np.meshgrid(*[np.arange(n, dtype=np.float32) for n in values.shape], indexing="ij", sparse=True)
    beyond = np.zeros(values.shape, dtype=bool)
    for axis in range(3):
        place = sum((grids[k] * np.float32(affine[axis, k]) for k in range(3)), np.float32(affine[axis, 3]))
        beyond |= (place < low[axis]) | (place > high[axis])
    values[beyond] = min(float(values.min()), iso) - 1


def png(image: npt.NDArray[np.uint8]) -> bytes:
    """The bytes of a PNG file of ``(height, width, 3)`` colours."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    height, width, _ = image.shape
    rows = np.hstack([np.zeros((height, 1), np.uint8), image.reshape(height, -1)])
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(rows.tobytes(), 6))
        + chunk(b"IEND", b"")
    )
