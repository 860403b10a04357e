"""Many fits, and fits of volumes larger than memory, on the workers of Dask.

Both take a ``distributed.Client``, or the current one, or work here and now where there is none. Run workers with one thread a
process (``LocalCluster(threads_per_worker=1)``); each fit works with ``threads`` threads of its own. A lost worker's fits are
done again elsewhere; the result does not depend on it, to the bit. See ``docs/scaling.md``.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, overload

import numpy as np

from ._block_plan import Plan
from ._blocks_run import FieldFile, run
from ._field import Field
from ._fit import fit
from ._inputs import matrix
from ._wishes import PathLike, Progress

_AT_ONCE = 64
"""Results that are asked for at once."""

__all__ = ["FieldFile", "Outcome", "fit_many", "fit_volume_blocks", "ome_zarr"]


@dataclass(frozen=True)
class Outcome:
    """What became of a file."""

    path: str
    """The file."""
    field: Field | None
    """Its field; none if it failed, or was saved."""
    saved: str | None
    """The field file, if one was asked for."""
    sha256: str | None
    """Names the field."""
    error: Exception | None
    """Why there is none."""


def fit_many(
    paths: Iterable[PathLike],
    client: Any = None,
    *,
    output: PathLike | None = None,
    retries: int = 2,
    threads: int = 1,
    **options: Any,
) -> list[Outcome]:
    """Fits many files, each isolated from the others: one bad file is an :class:`Outcome` with an error.

    Args:
        paths: Files that :func:`isoclay.fit` reads, as the workers see them.
        client: A ``distributed.Client``.
        output: A directory, as the workers see it, for field files; without it the fields come back themselves. Two files of
            one name are told apart by a number.
        retries: How often a fit is tried again after a failure that is not the file's own.
        threads: Of each fit.
        options: Those of :func:`isoclay.fit`.
    """
    names = [os.fspath(path) for path in paths]
    targets: list[str | None] = [None] * len(names)
    if output is not None:
        Path(output).mkdir(parents=True, exist_ok=True)
        targets = [str(Path(output) / name) for name in _distinct(names)]
    runner, chosen = _runner(_client(client), retries), {"threads": threads, **options}
    return list(runner.each([runner.submit(_outcome, *pair, chosen) for pair in zip(names, targets, strict=True)]))


def _distinct(paths: Sequence[str]) -> list[str]:
    taken: set[str] = set()
    names = []
    for path in paths:
        stem = Path(path).name.split(".")[0] or "scan"
        name, number = f"{stem}.iclay", 1
        while name in taken:
            number += 1
            name = f"{stem}-{number}.iclay"
        taken.add(name)
        names.append(name)
    return names


def _outcome(path: str, target: str | None, options: dict[str, Any]) -> Outcome:
    try:
        field = fit(path, **options)
        if target is not None:
            field.save(target)
    except (ValueError, OSError, MemoryError) as error:
        return Outcome(path, None, None, None, error)
    return Outcome(path, field if target is None else None, target, field.sha256, None)


def _client(client: Any) -> Any:
    if client is not None:
        return client
    try:
        from distributed import get_client

        return get_client()
    except (ImportError, ValueError):
        return None


class _Here:
    """Work done at once, by the caller."""

    def share(self, value: Any) -> Any:
        return value

    def submit(self, work: Callable[..., Any], *arguments: Any) -> Any:
        return work(*arguments)

    def each(self, handles: list[Any]) -> Iterator[Any]:
        return iter(handles)


class _There:
    """Work done by the workers of a client."""

    def __init__(self, client: Any, retries: int) -> None:
        self.client, self.retries = client, retries

    def share(self, value: Any) -> Any:
        # As the result of a task it is made again where the worker that has it is lost.
        return self.submit(_same, value)

    def submit(self, work: Callable[..., Any], *arguments: Any) -> Any:
        return self.client.submit(work, *arguments, retries=self.retries, pure=False)

    def each(self, handles: list[Any]) -> Iterator[Any]:
        for start in range(0, len(handles), _AT_ONCE):
            some = handles[start : start + _AT_ONCE]
            # Their results leave the workers as soon as they are here.
            handles[start : start + _AT_ONCE] = [None] * len(some)
            yield from self.client.gather(some)


def _same(value: Any) -> Any:
    return value


def _runner(client: Any, retries: int) -> _Here | _There:
    return _Here() if client is None else _There(client, retries)


@overload
def fit_volume_blocks(
    volume: Any,
    affine: Any = None,
    *,
    output: None = None,
    client: Any = None,
    order: Literal["xyz", "zyx"] = "xyz",
    method: Literal["adaptive", "interpolate"] = "adaptive",
    tolerance: float | str | None = None,
    block: int = 128,
    halo: int = 32,
    unit: str | None = None,
    scratch: PathLike | None = None,
    retries: int = 2,
    threads: int = 1,
    progress: Progress | None = None,
) -> Field: ...
@overload
def fit_volume_blocks(
    volume: Any,
    affine: Any = None,
    *,
    output: PathLike,
    client: Any = None,
    order: Literal["xyz", "zyx"] = "xyz",
    method: Literal["adaptive", "interpolate"] = "adaptive",
    tolerance: float | str | None = None,
    block: int = 128,
    halo: int = 32,
    unit: str | None = None,
    scratch: PathLike | None = None,
    retries: int = 2,
    threads: int = 1,
    progress: Progress | None = None,
) -> FieldFile: ...
def fit_volume_blocks(
    volume: Any,
    affine: Any = None,
    *,
    output: PathLike | None = None,
    client: Any = None,
    order: Literal["xyz", "zyx"] = "xyz",
    method: Literal["adaptive", "interpolate"] = "adaptive",
    tolerance: float | str | None = None,
    block: int = 128,
    halo: int = 32,
    unit: str | None = None,
    scratch: PathLike | None = None,
    retries: int = 2,
    threads: int = 1,
    progress: Progress | None = None,
) -> Field | FieldFile:
    """Fits a volume block by block, so that no worker holds more than a block with its halo and the functions round it.

    With ``output`` the field goes to a file in a stream, and nobody holds it: the caller has a plane of bricks at a time. Without,
    the field comes back, and the caller has to have room for it.

    Args:
        volume: Anything with a shape, a dtype and slices, such as an array of zarr, dask or NumPy, read by the workers.
        affine: Map from voxel indices ``(i, j, k)`` to the world, 4 by 4, or spacings.
        output: A field file, ``.iclay``, written all or nothing: the bytes that :meth:`isoclay.Field.save` writes.
        client: A ``distributed.Client``.
        order: ``"xyz"`` for ``[i, j, k]``, ``"zyx"`` for ``[k, j, i]``.
        method: ``"interpolate"`` is the fit in one piece but for rounding; ``"adaptive"`` keeps the same tolerance in every
            leaf with coefficients of its own.
        tolerance: Root mean square of the residuals in a leaf: a density, or ``"0.5%"`` of the range. What the noise of up to
            eight blocks justifies if not given.
        block: Voxels along a block, a multiple of 32.
        halo: Voxels that a block sees of its neighbours, a multiple of 32, or of 16 to interpolate.
        unit: Of lengths.
        scratch: A directory, as the workers see it, for what is known of each block. It stays, and a fit of the same voxels in
            the same way that was cut off goes on from there. If it is not given, ``output`` has one beside it for a while, and
            without ``output`` the workers hold it in memory.
        retries: How often a block is tried again.
        threads: Of each fit.
        progress: Called with a stage and the share done.
    """
    plan = Plan(volume, matrix(affine), order, method, block, halo, unit, threads)
    runner = _runner(_client(client), retries)
    names = (None if path is None else os.fspath(path) for path in (output, scratch))
    return run(plan, tolerance, runner, progress or (lambda stage, share: None), *names)


def ome_zarr(group: Any, level: int = 0) -> tuple[Any, np.ndarray[Any, Any], Literal["zyx"], str | None]:
    """The array of a level of an OME-Zarr image, with its affine, order and unit as :func:`fit_volume_blocks` takes them.

    Args:
        group: A ``zarr.Group``, or what ``zarr.open_group`` takes.
        level: 0 is the finest.
    """
    if not hasattr(group, "attrs"):
        import zarr

        group = zarr.open_group(group, mode="r")
    attributes = dict(group.attrs)
    images = attributes.get("ome", attributes).get("multiscales")
    if not images:
        raise ValueError("the group has no multiscales; it is no image of OME-Zarr")
    image = images[0]
    axes = [axis if isinstance(axis, dict) else {"name": axis} for axis in image["axes"]]
    names = [axis["name"] for axis in axes]
    if names[-3:] != ["z", "y", "x"]:
        raise ValueError(f"the axes are {names}; an image with z, y, x at the end is needed")
    data = image["datasets"][level]
    scale, shift = np.ones(len(axes)), np.zeros(len(axes))
    # Those of the level come first.
    for step in [*data.get("coordinateTransformations", []), *image.get("coordinateTransformations", [])]:
        if step["type"] == "scale":
            scale, shift = scale * step["scale"], shift * step["scale"]
        elif step["type"] == "translation":
            shift = shift + step["translation"]
    array = group[data["path"]]
    if any(n != 1 for n in array.shape[:-3]):
        raise ValueError(f"the image has {dict(zip(names, array.shape, strict=True))}; give one volume of it: slice the array")
    if array.ndim > 3:
        array = _Last3(array)
    affine = np.diag([*scale[-3:][::-1], 1.0])
    affine[:3, 3] = shift[-3:][::-1]
    units = {axis.get("unit") for axis in axes[-3:]}
    known = {"micrometer": "um", "millimeter": "mm", "centimeter": "cm", "meter": "m"}
    return array, affine, "zyx", known.get(units.pop() or "") if len(units) == 1 else None


class _Last3:
    """The only volume of an array with more axes before it."""

    def __init__(self, array: Any) -> None:
        self.array, self.shape, self.dtype = array, array.shape[-3:], array.dtype

    def __getitem__(self, places: tuple[slice, ...]) -> Any:
        return self.array[(0,) * (self.array.ndim - 3) + places]
