"""Scenes played step by step."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _isoclay
from ._field import Field
from ._wishes import Progress, wishes


@dataclass(frozen=True)
class Region:
    """The part of a field that moves, as it is at a moment: a lattice of samples."""

    positions: npt.NDArray[np.float64]
    """World places of the samples, ``(nx, ny, nz, 3)``."""
    densities: npt.NDArray[np.float64]
    """Their densities, ``(nx, ny, nz)``."""


class Simulation:
    """A part of a field as elastic matter or clay, moved by a scene: pulls, paint, constraints over time."""

    def __init__(self, field: Field, scene: str | Mapping[str, Any] | os.PathLike[str]) -> None:
        """A scene at its start.

        Args:
            field: What moves; a scene's own ``field`` is left aside.
            scene: A mapping of tables, the text of a scene, TOML, or the path of a file with one. The guide lists what it
                may say.

        Raises:
            isoclay.errors.BadScript: Of a scene that cannot be played on this field.
        """
        if isinstance(scene, os.PathLike):
            text = Path(scene).read_text(encoding="utf-8")
        elif isinstance(scene, str):
            text = scene
        else:
            text = json.dumps({"field": "", **scene})
        self._core = _isoclay.CoreSimulation(field._core, text)

    def step(self, count: int = 1, *, threads: int | None = None) -> list[dict[str, Any]]:
        """Up to so many steps; what each did: time, iterations, energies, work and so on."""
        return [json.loads(line) for line in self._core.step(count, wishes(threads))]

    def run(
        self,
        *,
        threads: int | None = None,
        progress: Progress | None = None,
        cancel: _isoclay.CancelToken | None = None,
    ) -> list[dict[str, Any]]:
        """All steps that are left."""
        lines = self._core.step(np.iinfo(np.int32).max, wishes(threads, None, progress, cancel))
        return [json.loads(line) for line in lines]

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """One step after the other."""
        while not self.is_over:
            yield from self.step()

    @property
    def is_over(self) -> bool:
        """Whether the scene is over."""
        return self._core.is_over

    @property
    def notes(self) -> list[str]:
        """What is to be told of it."""
        return self._core.notes

    @property
    def field(self) -> Field:
        """The field with all changes so far."""
        return Field(self._core.field())

    @property
    def region(self) -> Region:
        """The part that moves, as it is now."""
        return Region(self._core.positions(), self._core.densities())
