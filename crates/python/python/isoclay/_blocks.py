"""Fits of volumes block by block.

A fit of a block gives up what it knows of the halo and keeps the functions and leaves of its own block; such fields add up. So
what a worker holds is a block with its halo, and the functions of the blocks round it.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from . import _isoclay
from ._field import Field
from ._fit import fit_volume
from ._wishes import tolerance as parsed

Doubles: TypeAlias = npt.NDArray[np.float64]

LEAF = 4
"""Voxels along the cell that errors are told of."""
BINS = 1 << 16
NOISE_BLOCKS = 8
"""Blocks that are asked for the noise."""
ROUNDS = 3
"""Rounds of repair at most: the first mends what two blocks chose differently, the next what that left."""
REACH = 2
"""Voxels round a leaf whose functions reach well into it."""


class Runner(Protocol):
    """Where work is done."""

    def submit(self, work: Callable[..., Any], *arguments: Any) -> Any:
        """Begins a piece of work. What it gives may be an argument of others, in lists too."""

    def gather(self, handles: list[Any]) -> list[Any]:
        """What pieces of work gave, in their order."""


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
        if self.block < 32 or self.block % 32:
            raise ValueError(f"block is {self.block}; it has to be a multiple of 32, 32 or more")
        step = 16 if self.method == "interpolate" else 32
        if self.halo < step or self.halo % step:
            raise ValueError(f"halo is {self.halo}; to fit by {self.method!r} it has to be a multiple of {step}")

    @property
    def shape(self) -> tuple[int, int, int]:
        """Voxels along x, y, z."""
        shape = tuple(int(n) for n in self.volume.shape)
        return shape[::-1] if self.order == "zyx" else shape  # type: ignore[return-value]

    def blocks(self, halo: int) -> list[Block]:
        """All blocks, in a fixed order."""
        cuts = []
        for n in self.shape:
            starts = list(range(0, n, self.block))
            # A remainder that a halo would swallow goes with the block before.
            if len(starts) > 1 and n - starts[-1] < 32:
                starts.pop()
            cuts.append([*zip(starts, [*starts[1:], n], strict=True)])
        made = []
        for (x0, x1), (y0, y1), (z0, z1) in itertools.product(*cuts):
            low, high = (x0, y0, z0), (x1, y1, z1)
            origin = tuple(max(0, v - halo) for v in low)
            end = tuple(min(n, v + halo) for v, n in zip(high, self.shape, strict=True))
            made.append(Block(low, high, origin, end))  # type: ignore[arg-type]
        return made

    def read(self, block: Block) -> npt.NDArray[Any]:
        """Voxels ``[i, j, k]`` of a block with its halo."""
        places = tuple(slice(a, b) for a, b in zip(block.origin, block.end, strict=True))
        if self.order == "zyx":
            places = places[::-1]
        part = self.volume[places]
        if hasattr(part, "compute"):
            part = part.compute(scheduler="synchronous")
        array = np.asarray(part)
        return array.transpose(2, 1, 0) if self.order == "zyx" else array

    def affine_at(self, origin: tuple[int, int, int]) -> Doubles:
        """The affine of a part that begins at a voxel."""
        moved = self.affine.copy()
        moved[:3, 3] = self.affine[:3, :3] @ origin + self.affine[:3, 3]
        return moved


@dataclass(frozen=True)
class Block:
    """A block of voxels, from ``low`` to before ``high``, and what is read for it, from ``origin`` to before ``end``."""

    low: tuple[int, int, int]
    high: tuple[int, int, int]
    origin: tuple[int, int, int]
    end: tuple[int, int, int]

    def is_near(self, other: Block, reach: int) -> bool:
        """Whether another block begins within a reach of what is read for this one."""
        spans = zip(self.origin, self.end, other.low, other.high, strict=True)
        return all(low < end + reach and high > origin - reach for origin, end, low, high in spans)


def own_part(
    plan: Plan, block: Block, field: Field, tolerance: float, mask: npt.NDArray[np.uint8] | None = None
) -> Field:
    """Of a fit of a block with its halo the functions and leaves of the block, in the grids of the whole volume."""
    part = {"field": field._core, "origin": block.origin, "low": block.low, "high": block.high, "mask": mask}
    return _joined(plan, None, [part], tolerance, None)


def added(plan: Plan, base: Field | None, fields: list[Field], tolerance: float, iso: float | None) -> Field:
    """The sum of fields in the grids of the whole volume; leaves are those of the base, if there is one."""
    whole = {"origin": (0, 0, 0), "low": (0, 0, 0), "high": plan.shape, "mask": None}
    return _joined(plan, base, [{"field": field._core, **whole} for field in fields], tolerance, iso)


def _joined(
    plan: Plan, base: Field | None, parts: list[dict[str, Any]], tolerance: float, iso: float | None
) -> Field:
    story = {
        "program": f"isoclay {_isoclay.__version__} (Python)",
        "input_kind": "volume",
        "arguments": {"block": plan.block, "halo": plan.halo, "method": plan.method, "tolerance": tolerance},
    }
    core, rows = None if base is None else base._core, plan.affine[:3].tolist()
    return Field(_isoclay.join_blocks(core, parts, plan.shape, rows, tolerance, iso, plan.unit, json.dumps(story)))


def histogram(plan: Plan, block: Block) -> tuple[npt.NDArray[np.int64], int]:
    """How often each number occurs, by the first 16 bits of its float, ordered; and how many are not finite."""
    values = np.ascontiguousarray(plan.read(block), dtype=np.float32).reshape(-1)
    bits = values.view(np.uint32)
    ordered = np.where(bits >> 31 == 1, ~bits, bits | np.uint32(1 << 31))
    return np.bincount(ordered >> 16, minlength=BINS), int(np.count_nonzero(~np.isfinite(values)))


def _middles(bins: npt.NDArray[np.intp]) -> Doubles:
    """The middles of bins of :func:`histogram`."""
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
    field = fit_volume(plan.read(block), plan.affine_at(block.origin), threads=plan.threads)
    return float(field.report["noise"] or 0.0)


def block_fitted(plan: Plan, block: Block, tolerance: float) -> Field:
    """What the fit of a block with its halo says of the block."""
    options: dict[str, Any] = {"method": "interpolate"} if plan.method == "interpolate" else {"tolerance": tolerance}
    field = fit_volume(plan.read(block), plan.affine_at(block.origin), threads=plan.threads, **options)
    return own_part(plan, block, field, tolerance)


def block_measured(
    plan: Plan, block: Block, fields: list[Field], tolerance: float, mend: bool
) -> tuple[Doubles, Doubles, Field | None]:
    """Root mean square and largest residual of each leaf of a block, of the sum of the fields near it; and where leaves exceed
    the tolerance, functions to add that take the residual away there."""
    field = added(plan, None, fields, tolerance, None)
    array = plan.read(block)
    affine = plan.affine_at(block.origin)
    residual = array.astype(np.float64) - field.sample(affine=affine, shape=array.shape, threads=plan.threads)[0]
    cells = tuple(max(-(-(n - 1) // LEAF), 1) for n in plan.shape)
    starts = []
    for axis in range(3):
        first, last = block.origin[axis] // LEAF, min((block.end[axis] - 1) // LEAF, cells[axis] - 1)
        starts.append(np.arange(first, last + 1) * LEAF - block.origin[axis])
    squares, sizes, largest = residual**2, np.ones_like(residual), np.abs(residual)
    for axis in range(3):
        squares = np.add.reduceat(squares, starts[axis], axis)
        sizes = np.add.reduceat(sizes, starts[axis], axis)
        largest = np.maximum.reduceat(largest, starts[axis], axis)
    rms = np.sqrt(squares / sizes)
    own = tuple(
        slice((block.low[a] - block.origin[a]) // LEAF, _own_end(block, a, plan.shape[a], len(starts[a])))
        for a in range(3)
    )
    if not mend or not (rms > tolerance).any():
        return rms[own], largest[own], None
    bad = rms > tolerance
    for axis in range(3):
        lengths = np.diff([*starts[axis], residual.shape[axis]])
        bad = np.repeat(bad, lengths, axis)
    mask = bad.copy()
    for axis in range(3):
        wide = mask.copy()
        for step in range(1, REACH + 1):
            ahead = [slice(None)] * 3
            back = [slice(None)] * 3
            ahead[axis], back[axis] = slice(step, None), slice(None, -step)
            wide[tuple(ahead)] |= mask[tuple(back)]
            wide[tuple(back)] |= mask[tuple(ahead)]
        mask = wide
    detail = fit_volume(residual.astype(np.float32), affine, method="interpolate", threads=plan.threads)
    return rms[own], largest[own], own_part(plan, block, detail, tolerance, mask.astype(np.uint8))


def detail_of(measured: tuple[Doubles, Doubles, Field | None]) -> Field | None:
    """What a measurement asks to add."""
    return measured[2]


def errors_of(measured: tuple[Doubles, Doubles, Field | None]) -> tuple[Doubles, Doubles, bool]:
    """What a measurement found, and whether it asks to add something."""
    return measured[0], measured[1], measured[2] is not None


def _own_end(block: Block, axis: int, whole: int, count: int) -> int:
    return count if block.high[axis] >= whole else (block.high[axis] - block.origin[axis]) // LEAF


def blocks_fitted(
    plan: Plan, tolerance: float | str | None, runner: Runner, progress: Callable[[str, float], object]
) -> Field:
    """The field of the whole volume."""
    progress("looking at the volume", 0.0)
    counts, odd = np.zeros(BINS, np.int64), 0
    for part, bad in runner.gather([runner.submit(histogram, plan, block) for block in plan.blocks(0)]):
        counts += part
        odd += bad
    if odd:
        raise ValueError(f"{odd} voxels are not finite; replace them, for example by the value of air, before fitting")
    span, iso = overview(counts)
    blocks = plan.blocks(plan.halo)
    wanted = _tolerance(plan, tolerance, span, blocks, runner, progress)
    progress("fitting blocks", 0.1)
    fits = [runner.submit(block_fitted, plan, block, wanted) for block in blocks]
    notes = [f"put together from {len(blocks)} blocks of {plan.block} voxels with a halo of {plan.halo}"]
    if plan.method == "interpolate":
        field = added(plan, None, runner.gather(fits), wanted, iso)
        progress("done", 1.0)
        return _told(field, field.leaves["rms"], field.leaves["max"], notes)
    measured_blocks = plan.blocks(32)
    near = [[n for n, other in enumerate(blocks) if block.is_near(other, LEAF)] for block in measured_blocks]
    pieces: list[list[Any]] = [[fit] for fit in fits]
    details: list[Any] = []
    for turn in range(ROUNDS + 1):
        measured = [
            runner.submit(block_measured, plan, block, [piece for n in near[b] for piece in pieces[n]], wanted, turn < ROUNDS)
            for b, block in enumerate(measured_blocks)
        ]
        found = runner.gather([runner.submit(errors_of, one) for one in measured])
        progress("mending", 0.6 + 0.1 * turn)
        if not any(asks for *_, asks in found):
            break
        more = [runner.submit(detail_of, one) if asks else None for one, (*_, asks) in zip(measured, found, strict=True)]
        for piece, detail in zip(pieces, more, strict=True):
            if detail is not None:
                piece.append(detail)
                details.append(detail)
    progress("joining", 0.95)
    field = added(plan, None, runner.gather(fits), wanted, iso)
    if details:
        field = added(plan, field, runner.gather(details), wanted, iso)
    rms, largest = _in_place(plan, measured_blocks, found, field)
    progress("done", 1.0)
    return _told(field, rms, largest, notes)


def _tolerance(
    plan: Plan,
    asked: float | str | None,
    span: float,
    blocks: list[Block],
    runner: Runner,
    progress: Callable[[str, float], object],
) -> float:
    if plan.method == "interpolate":
        if asked is not None:
            raise ValueError("to interpolate leaves no residual; leave the tolerance out, or fit by 'adaptive'")
        return 0.0
    number, kind = parsed(asked)
    if kind == "mm":
        raise ValueError(f"tolerance is {asked!r}, a length; that of a volume is a density, or a share such as '0.5%'")
    if number is not None:
        if not number > 0:
            raise ValueError(f"tolerance is {asked!r}; it has to be positive")
        return number * span / 100 if kind == "%" else number
    progress("estimating the noise", 0.05)
    step = -(-len(blocks) // NOISE_BLOCKS)
    found = runner.gather([runner.submit(noise, plan, block) for block in blocks[::step]])
    # As in one piece: the rms of a leaf of noise alone stays below 1.25 of it, and clean data is met to 0.5 %.
    return max(1.25 * float(np.median(found)), 0.005 * span)


def _in_place(
    plan: Plan, blocks: list[Block], found: list[Any], field: Field
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """The errors of the blocks' leaves in the order of the field's."""
    cells = tuple(max(-(-(n - 1) // LEAF), 1) for n in plan.shape)
    rms, largest = np.zeros(cells, np.float32), np.zeros(cells, np.float32)
    for block, (part, most, _) in zip(blocks, found, strict=True):
        place = tuple(slice(v // LEAF, v // LEAF + n) for v, n in zip(block.low, part.shape, strict=True))
        rms[place], largest[place] = part, most
    at = tuple(field.leaves["cell"].T)
    return rms[at], largest[at]


def _told(field: Field, rms: Any, largest: Any, notes: list[str]) -> Field:
    rms, largest = (np.ascontiguousarray(a, np.float32) for a in (rms, largest))
    return Field(_isoclay.with_leaf_errors(field._core, rms, largest, notes))
