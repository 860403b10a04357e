"""What is seen of a volume before it is fitted: the range of its densities, its surface, its noise."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ._block_plan import Block, Doubles, Plan
from ._fit import fit_volume

BINS = 1 << 16


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
