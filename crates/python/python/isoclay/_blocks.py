"""What a worker does with a block of a volume.

A fit of a block gives up what it knows of the halo and keeps the functions and leaves of its own block, its part; parts add up. So
what a worker holds is a block with its halo, and the functions of the blocks round it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from . import _isoclay
from ._block_plan import ALIGN, FORGOTTEN, Block, Doubles, Job, Plan, Ticket, Voxel
from ._field import Field
from ._fit import fit_volume

LEAF = 4
"""Voxels along the cell that errors are told of."""
REACH = 2
"""Voxels round a leaf whose functions reach well into it."""


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
