"""Volumes in blocks: how they are cut, what is seen of them before, and what a worker does with a block.

A fit of a block gives up what it knows of the halo and keeps the functions and leaves of its own block, its part; parts add up. So
what a worker holds is a block with its halo, and the functions of the blocks round it.
"""

from __future__ import annotations

import hashlib
import itertools
import os
import uuid
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from . import _isoclay
from ._field import Field
from ._fit import fit_volume

Doubles: TypeAlias = npt.NDArray[np.float64]
Ticket: TypeAlias = bytes | str
"""Bytes, or the file that has them."""
Voxel: TypeAlias = tuple[int, int, int]

LEAF = 4
"""Voxels along the cell that errors are told of."""
ALIGN = 32
"""Voxels along a brick of the coarsest level: blocks begin there."""
FORGOTTEN = 16
"""Voxels after which a prefilter has forgotten a voxel."""
BINS = 1 << 16
REACH = 2
"""Voxels round a leaf whose functions reach well into it."""


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


# What is seen of a volume before it is fitted


@dataclass(frozen=True)
class Look:
    """How often numbers occur in a block, by the first 16 bits of their floats, ordered, those that occur; how many are not
    finite; and a digest of the voxels."""

    bins: npt.NDArray[np.uint16]
    counts: npt.NDArray[np.int64]
    odd: int
    digest: bytes


def looked_at(plan: Plan, block: Block) -> Look:
    """A first look at a block."""
    array = np.ascontiguousarray(plan.read(block))
    digest = hashlib.sha256(array.data).digest()
    values = array.astype(np.float32, copy=False).reshape(-1)
    bits = values.view(np.uint32)
    ordered = np.where(bits >> 31 == 1, ~bits, bits | np.uint32(1 << 31))
    counts = np.bincount(ordered >> 16, minlength=BINS)
    bins = np.nonzero(counts)[0]
    return Look(bins.astype(np.uint16), counts[bins], int(np.count_nonzero(~np.isfinite(values))), digest)


def _middles(bins: npt.NDArray[np.intp]) -> Doubles:
    """The middles of the bins of a :class:`Look`."""
    ordered = (bins.astype(np.uint32) << 16) | np.uint32(1 << 15)
    bits = np.where(ordered >> 31 == 1, ordered & np.uint32(0x7FFFFFFF), ~ordered)
    return bits.astype(np.uint32).view(np.float32).astype(np.float64)


def overview(counts: npt.NDArray[np.int64]) -> tuple[float, float | None]:
    """The range between the 1st and the 99th percentile, and the density that parts two classes best [Otsu79]."""
    present = np.nonzero(counts)[0]
    values, weights = _middles(present), counts[present]
    rank = np.cumsum(weights)
    low, high = (values[np.searchsorted(rank, q * (rank[-1] - 1), side="right")] for q in (0.01, 0.99))
    if high <= low:
        return float(values[-1] - values[0]), None
    bins = np.clip((values - low) / (high - low) * 256, 0, 255).astype(int)
    heaps = np.bincount(bins, weights, minlength=256)
    below, moment = np.cumsum(heaps)[:-1], np.cumsum(heaps * np.arange(256))
    above = heaps.sum() - below
    with np.errstate(divide="ignore", invalid="ignore"):
        apart = moment[:-1] / below - (moment[-1] - moment[:-1]) / above
        between = np.where((below > 0) & (above > 0), below * above * apart**2, 0)
    best = np.nonzero(between == between.max())[0]
    return float(high - low), float(low + (high - low) / 256 * ((best[0] + best[-1]) / 2 + 1))


def noise(plan: Plan, block: Block) -> float:
    """Standard deviation of the noise of a block."""
    wide = plan.wide(block, plan.halo)
    field = fit_volume(plan.read(wide), plan.affine_at(wide.low), threads=plan.threads)
    return float(field.report["noise"] or 0.0)


# What is done with a block


@dataclass(frozen=True)
class Finished:
    """What is known of a block in the end."""

    part: Ticket
    """Its functions."""
    leaves: Ticket
    """The errors of its leaves."""
    counts: list[int]
    """Functions of each level."""
    digests: bytes
    """Of what stands in the places of its coarsest bricks."""
    slope: float
    """Of its fit."""


def fitted(job: Job, number: int, block: Block) -> Ticket:
    """What the fit of a block with its halo says of the block: its part."""
    kept = job.shelf.find(f"fit-{number}")
    if kept is not None:
        return kept
    wide = job.plan.wide(block, job.plan.halo)
    field = fit_volume(
        job.plan.read(wide), job.plan.affine_at(wide.low), tolerance=job.tolerance, threads=job.plan.threads
    )
    return job.shelf.put(f"fit-{number}", _part(job.plan, block, field, wide.low))


def interpolated(job: Job, number: int, block: Block) -> Finished:
    """All that is to be known of a block whose voxels are met."""
    names = f"fit-{number}", f"leaves-{number}"
    part, leaves = (job.shelf.find(name) for name in names)
    if part is None or leaves is None:
        plan = job.plan
        wide = plan.wide(block, plan.halo)
        field = fit_volume(plan.read(wide), plan.affine_at(wide.low), method="interpolate", threads=plan.threads)
        put_part = job.shelf.put(names[0], _part(plan, block, field, wide.low))
        own = _own_leaves(plan, block, wide)
        table = field.leaves
        cells = tuple(table["cell"].max(axis=0) + 1)
        errors = [table[error].reshape(cells[::-1]).transpose(2, 1, 0)[own] for error in ("rms", "max")]
        return finished(job, number, [put_part], (job.shelf.put(names[1], _leaves(*errors)), None))
    return finished(job, number, [part], (leaves, None))


def measured(job: Job, number: int, turn: int, block: Block, parts: list[Ticket], mend: bool) -> tuple[Ticket, Ticket | None]:
    """The errors of the leaves of a block, of the sum of the parts near it; and where leaves exceed the tolerance, functions to
    add that take the residual away there."""
    names = f"leaves-{number}-{turn}", f"mend-{number}-{turn}"
    kept = job.shelf.find(names[0])
    if kept is not None:
        return kept, job.shelf.find(names[1])
    plan = job.plan
    # Leaves beside the block, to ask for the same at a border as the neighbour does.
    wide = plan.wide(block, LEAF)
    _, rms, largest = _residual(plan, block, wide, parts)
    own = _own_leaves(plan, block, wide)
    detail = None
    if mend and (rms > job.tolerance).any():
        wider = plan.wide(block, FORGOTTEN)
        residual, again, _ = _residual(plan, block, wider, parts)
        field = fit_volume(
            residual.astype(np.float32), plan.affine_at(wider.low), method="interpolate", threads=plan.threads
        )
        mask = _near(again > job.tolerance, _starts(plan, wider), residual.shape)
        detail = job.shelf.put(names[1], _part(plan, block, field, wider.low, mask.astype(np.uint8)))
    # Last, for who finds it takes the other to be there.
    return job.shelf.put(names[0], _leaves(rms[own], largest[own])), detail


def mending(found: tuple[Ticket, Ticket | None]) -> Ticket | None:
    """What a measurement asks to add."""
    return found[1]


def asks(found: tuple[Ticket, Ticket | None]) -> bool:
    """Whether a measurement asks to add something."""
    return found[1] is not None


def finished(job: Job, number: int, parts: list[Ticket], found: tuple[Ticket, Ticket | None]) -> Finished:
    """A block of which nothing is asked any more."""
    content, counts, digests, slope = _isoclay.finished_block(parts, job.plan.shape)
    part = parts[0] if content is None else job.shelf.put(f"sum-{number}", content)
    return Finished(part, found[0], counts, digests, slope)


def _part(
    plan: Plan, block: Block, field: Field, origin: Voxel, mask: npt.NDArray[np.uint8] | None = None
) -> bytes:
    return _isoclay.block_part(field._core, origin, block.low, block.high, plan.shape, mask)


def _leaves(rms: Doubles, largest: Doubles) -> bytes:
    """Tables ``[x, y, z]`` as they are kept: x fastest."""
    return b"".join(np.ascontiguousarray(table.transpose(2, 1, 0), dtype="<f4").tobytes() for table in (rms, largest))


def _cell_count(plan: Plan, axis: int) -> int:
    return max(-(-(plan.shape[axis] - 1) // LEAF), 1)


def _starts(plan: Plan, wide: Block) -> list[npt.NDArray[np.intp]]:
    """First voxels of the leaves in a part, which begins with one, on each axis. The very last voxel has no leaf of its own."""
    ends = [min((wide.high[a] - 1) // LEAF, _cell_count(plan, a) - 1) for a in range(3)]
    return [np.arange(wide.low[a] // LEAF, ends[a] + 1) * LEAF - wide.low[a] for a in range(3)]


def _own_leaves(plan: Plan, block: Block, wide: Block) -> tuple[slice, ...]:
    """Where the leaves of a block are among those of a part round it."""
    ends = (_cell_count(plan, a) if block.high[a] >= plan.shape[a] else block.high[a] // LEAF for a in range(3))
    return tuple(slice((block.low[a] - wide.low[a]) // LEAF, end - wide.low[a] // LEAF) for a, end in enumerate(ends))


def _residual(plan: Plan, block: Block, wide: Block, parts: list[Ticket]) -> tuple[Doubles, Doubles, Doubles]:
    """What the sum of parts leaves at the voxels of a block with a halo; root mean square and largest of each leaf."""
    box = plan.wide(block, ALIGN)
    core = _isoclay.near_field(parts, plan.shape, plan.rows, box.low, box.high, wide.low, wide.high)
    array = plan.read(wide)
    here = plan.affine_at(wide.low)
    residual = array.astype(np.float64)
    residual -= Field(core).sample(affine=here, shape=array.shape, threads=plan.threads)[0]
    squares, sizes, largest = residual**2, np.ones((1, 1, 1)), np.abs(residual)
    for axis, starts in enumerate(_starts(plan, wide)):
        squares = np.add.reduceat(squares, starts, axis)
        largest = np.maximum.reduceat(largest, starts, axis)
        counts = np.diff([*starts, residual.shape[axis]])
        sizes = sizes * counts.reshape([-1 if a == axis else 1 for a in range(3)])
    return residual, np.sqrt(squares / sizes), largest


def _near(
    bad: npt.NDArray[np.bool_], starts: list[npt.NDArray[np.intp]], shape: tuple[int, ...]
) -> npt.NDArray[np.bool_]:
    """The voxels of leaves, and those within reach of them."""
    for axis in range(3):
        bad = np.repeat(bad, np.diff([*starts[axis], shape[axis]]), axis)
    for axis in range(3):
        wide = bad.copy()
        for step in range(1, REACH + 1):
            ahead = [slice(None)] * 3
            back = [slice(None)] * 3
            ahead[axis], back[axis] = slice(step, None), slice(None, -step)
            wide[tuple(ahead)] |= bad[tuple(back)]
            wide[tuple(back)] |= bad[tuple(ahead)]
        bad = wide
    return bad
