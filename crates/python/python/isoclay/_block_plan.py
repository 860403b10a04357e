"""How a volume is cut into blocks, and where what is found out about them is kept."""

from __future__ import annotations

import itertools
import os
import uuid
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Doubles: TypeAlias = npt.NDArray[np.float64]
Ticket: TypeAlias = bytes | str
"""Bytes, or the file that has them."""
Voxel: TypeAlias = tuple[int, int, int]

ALIGN = 32
"""Voxels along a brick of the coarsest level: blocks begin there."""
FORGOTTEN = 16
"""Voxels after which a prefilter has forgotten a voxel."""


@dataclass(frozen=True)
class Plan:
    """A volume and how it is cut."""

    volume: Any
    affine: Doubles
    order: str
    method: str
    block: int
    halo: int
    unit: str | None
    threads: int

    def __post_init__(self) -> None:
        if len(self.volume.shape) != 3:
            raise ValueError(f"a volume has three axes, this has the shape {tuple(self.volume.shape)}")
        if self.order not in ("xyz", "zyx"):
            raise ValueError(f"order is {self.order!r}; write 'xyz' for [i, j, k], or 'zyx' for [k, j, i]")
        if self.method not in ("adaptive", "interpolate"):
            raise ValueError(f"method is {self.method!r}; write 'adaptive' or 'interpolate'")
        if self.block < ALIGN or self.block % ALIGN:
            raise ValueError(f"block is {self.block}; it has to be a multiple of 32, 32 or more")
        step = FORGOTTEN if self.method == "interpolate" else ALIGN
        if self.halo < step or self.halo % step:
            raise ValueError(f"halo is {self.halo}; to fit by {self.method!r} it has to be a multiple of {step}")

    @property
    def shape(self) -> Voxel:
        """Voxels along x, y, z."""
        shape = tuple(int(n) for n in self.volume.shape)
        return shape[::-1] if self.order == "zyx" else shape  # type: ignore[return-value]

    @property
    def rows(self) -> list[list[float]]:
        """The affine as the Rust side takes it."""
        rows: list[list[float]] = self.affine[:3].tolist()
        return rows

    def cuts(self) -> list[list[tuple[int, int]]]:
        """First voxel of the blocks, and that behind their last, on each axis."""
        cuts = []
        for n in self.shape:
            starts = list(range(0, n, self.block))
            # A remainder that a halo would swallow goes with the block before.
            if len(starts) > 1 and n - starts[-1] < ALIGN:
                starts.pop()
            cuts.append([*zip(starts, [*starts[1:], n], strict=True)])
        return cuts

    def blocks(self) -> list[Block]:
        """All blocks, in a fixed order: z fastest."""
        products = itertools.product(*self.cuts())
        return [Block(*zip(*spans, strict=True)) for spans in products]

    def wide(self, block: Block, halo: int) -> Block:
        """A block with a halo, as far as there are voxels."""
        low = tuple(max(0, v - halo) for v in block.low)
        high = tuple(min(n, v + halo) for v, n in zip(block.high, self.shape, strict=True))
        return Block(low, high)  # type: ignore[arg-type]

    def read(self, block: Block) -> npt.NDArray[Any]:
        """Voxels ``[i, j, k]`` of a block."""
        places = tuple(slice(a, b) for a, b in zip(block.low, block.high, strict=True))
        if self.order == "zyx":
            places = places[::-1]
        part = self.volume[places]
        if hasattr(part, "compute"):
            part = part.compute(scheduler="synchronous")
        array = np.asarray(part)
        return array.transpose(2, 1, 0) if self.order == "zyx" else array

    def affine_at(self, origin: Voxel) -> Doubles:
        """The affine of a part that begins at a voxel."""
        moved = self.affine.copy()
        moved[:3, 3] = self.affine[:3, :3] @ origin + self.affine[:3, 3]
        return moved


@dataclass(frozen=True)
class Block:
    """Voxels from ``low`` to before ``high``."""

    low: Voxel
    high: Voxel


@dataclass(frozen=True)
class Shelf:
    """Where parts are kept: in the memory of the workers, or in files of a directory that all of them see."""

    directory: str | None
    name: str
    """What the files' names begin with; it tells fits apart that share a directory."""

    def find(self, part: str) -> str | None:
        """The file of a part that is there already, as after a fit that was cut off."""
        path = self._path(part)
        return path if path is not None and os.path.exists(path) else None

    def put(self, part: str, content: bytes) -> Ticket:
        """Keeps a part. A file is whole or not there; two workers that write one write the same."""
        path = self._path(part)
        if path is None:
            return content
        passing = f"{path}.{uuid.uuid4().hex}.tmp"
        try:
            with open(passing, "wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            os.replace(passing, path)
        except OSError:
            Path(passing).unlink(missing_ok=True)
            raise
        return path

    def _path(self, part: str) -> str | None:
        return None if self.directory is None else os.path.join(self.directory, f"{self.name}-{part}")


@dataclass(frozen=True)
class Job:
    """What all tasks of a fit share."""

    plan: Plan
    tolerance: float
    shelf: Shelf
