"""A volume fitted block by block, from the first look to the field file.

The caller holds what is known of blocks as a whole, never their functions: it sees these as it writes the file, a plane of bricks
and a layer of leaves at a time.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from . import _blocks, _first_look, _isoclay
from ._block_plan import Job, Plan, Shelf
from ._blocks import Finished
from ._field import Field
from ._wishes import Progress, tolerance as parsed, wishes

NOISE_BLOCKS = 8
"""Blocks that are asked for the noise."""
ROUNDS = 3
"""Rounds of repair at most: the first mends what two blocks chose differently, the next what that left."""


class Runner(Protocol):
    """Where work is done."""

    def share(self, value: Any) -> Any:
        """Something that many pieces of work take, as an argument of theirs."""

    def submit(self, work: Callable[..., Any], *arguments: Any) -> Any:
        """Begins a piece of work. What it gives may be an argument of others, in lists too."""

    def each(self, handles: list[Any]) -> Iterator[Any]:
        """What pieces of work gave, in their order; it is forgotten behind."""


@dataclass(frozen=True)
class FieldFile:
    """A field that was written to a file and not held: see ``fit_volume_blocks``."""

    path: str
    """The file."""
    sha256: str
    """Names the field."""
    coefficient_count: int
    """Coefficients that it is made of."""

    def load(self) -> Field:
        """Reads it, if memory has room for it."""
        return Field.load(self.path)


def run(
    plan: Plan,
    tolerance: float | str | None,
    runner: Runner,
    progress: Progress,
    output: str | None,
    scratch: str | None,
) -> FieldFile | Field:
    """Fits a volume; the field is in ``output``, or comes back itself."""
    if scratch is not None:
        Path(scratch).mkdir(parents=True, exist_ok=True)
        scratch = os.path.abspath(scratch)
    if output is None:
        with tempfile.TemporaryDirectory(prefix="isoclay-") as directory:
            return _written(plan, tolerance, runner, progress, os.path.join(directory, "field.iclay"), scratch).load()
    if scratch is not None:
        return _written(plan, tolerance, runner, progress, output, scratch)
    where, name = os.path.split(os.path.abspath(output))
    # Pieces of work of a worker that was taken for lost may still write there.
    with tempfile.TemporaryDirectory(prefix=f".{name}.", suffix=".tmp", dir=where, ignore_cleanup_errors=True) as parts:
        return _written(plan, tolerance, runner, progress, output, parts)


def _written(
    plan: Plan, asked: float | str | None, runner: Runner, progress: Progress, output: str, scratch: str | None
) -> FieldFile:
    shared = runner.share(plan)
    progress("looking at the volume", 0.0)
    blocks = plan.blocks()
    span, iso, content = _looked_at(plan, shared, runner)
    progress("estimating the noise", 0.05)
    tolerance = _tolerance(plan, shared, asked, span, runner)
    facts = [_isoclay.__version__, plan.shape, plan.rows, plan.method, plan.block, plan.halo, tolerance, content]
    name = hashlib.sha256(json.dumps(facts).encode()).hexdigest()[:16]
    job = runner.share(Job(plan, tolerance, Shelf(scratch, name)))
    progress("fitting blocks", 0.1)
    if plan.method == "interpolate":
        ends = [runner.submit(_blocks.interpolated, job, n, block) for n, block in enumerate(blocks)]
    else:
        ends = _fitted(plan, job, runner, progress)
    found: list[Finished] = list(runner.each(ends))
    progress("writing the field", 0.9)
    # That of the edges, as of a fit in one piece: most blocks may hold nothing but noise.
    slopes = np.sort([block.slope for block in found])
    squares = np.cumsum(slopes**2)
    slope = float(slopes[np.searchsorted(squares, 0.5 * squares[-1])])
    counts = np.sum([block.counts for block in found], axis=0)
    story = {
        "program": f"isoclay {_isoclay.__version__} (Python)",
        "input_kind": "volume",
        "arguments": {"block": plan.block, "halo": plan.halo, "method": plan.method, "tolerance": tolerance},
    }
    told = {
        "path": output,
        "parts": [block.part for block in found],
        "leaves": [block.leaves for block in found],
        "digests": [block.digests for block in found],
        "cuts": plan.cuts(),
        "shape": plan.shape,
        "affine": plan.rows,
        "level_count": max([level + 1 for level, count in enumerate(counts) if count], default=1),
        "slope": slope,
        "iso": iso,
        "unit": plan.unit,
        "tolerance": tolerance,
        "notes": [f"put together from {len(blocks)} blocks of {plan.block} voxels with a halo of {plan.halo}"],
        "provenance": json.dumps(story),
    }
    sha256 = _isoclay.write_blocks(told, wishes(progress=lambda stage, share: progress(stage, 0.9 + 0.1 * share)))
    return FieldFile(output, sha256, int(counts.sum()))


def _fitted(plan: Plan, job: Any, runner: Runner, progress: Progress) -> list[Any]:
    """Fits blocks, measures them together, and mends where they do not fit each other."""
    blocks = plan.blocks()
    parts: list[list[Any]] = [[runner.submit(_blocks.fitted, job, n, block)] for n, block in enumerate(blocks)]
    near = _near(plan)
    for turn in range(ROUNDS + 1):
        found = [
            runner.submit(
                _blocks.measured, job, n, turn, block, [part for m in near[n] for part in parts[m]], turn < ROUNDS
            )
            for n, block in enumerate(blocks)
        ]
        asking = list(runner.each([runner.submit(_blocks.asks, one) for one in found]))
        progress("mending", 0.6 + 0.07 * turn)
        if not any(asking):
            break
        for own, one, asks in zip(parts, found, asking, strict=True):
            if asks:
                own.append(runner.submit(_blocks.mending, one))
    # What is mended is measured once more: the errors of the last turn are those of the sum of all parts.
    return [runner.submit(_blocks.finished, job, n, parts[n], one) for n, one in enumerate(found)]


def _near(plan: Plan) -> list[list[int]]:
    """For each block, in their order, those whose functions reach what is measured of it: itself and those round it."""
    counts = [len(cut) for cut in plan.cuts()]
    at = np.arange(np.prod(counts)).reshape(counts)
    return [
        [int(n) for n in at[tuple(slice(max(0, i - 1), i + 2) for i in place)].flat] for place in np.ndindex(*counts)
    ]


def _looked_at(plan: Plan, shared: Any, runner: Runner) -> tuple[float, float | None, str]:
    """Range of the densities, that of the surface, and a digest of all voxels."""
    counts, odd, content = np.zeros(_first_look.BINS, np.int64), 0, hashlib.sha256()
    for look in runner.each([runner.submit(_first_look.looked_at, shared, block) for block in plan.blocks()]):
        counts[look.bins] += look.counts
        odd += look.odd
        content.update(look.digest)
    if odd:
        raise ValueError(f"{odd} voxels are not finite; replace them, for example by the value of air, before fitting")
    return *_first_look.overview(counts), content.hexdigest()


def _tolerance(plan: Plan, shared: Any, asked: float | str | None, span: float, runner: Runner) -> float:
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
    blocks = plan.blocks()
    step = -(-len(blocks) // NOISE_BLOCKS)
    found = list(runner.each([runner.submit(_first_look.noise, shared, block) for block in blocks[::step]]))
    # As in one piece: the rms of a leaf of noise alone stays below 1.25 of it, and clean data is met to 0.5 %.
    return max(1.25 * float(np.median(found)), 0.005 * span)
