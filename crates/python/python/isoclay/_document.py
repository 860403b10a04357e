"""Documents: objects that are edited, and a file that keeps every edit."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import warnings
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _isoclay
from ._field import Field
from ._wishes import PathLike, Progress, wishes


@dataclass(frozen=True)
class Edit:
    """What is told of an edit."""

    title: str
    """What it did, in a few words."""
    time: datetime
    """When it was made."""
    is_done: bool
    """Whether it is done, or undone."""
    sha256: str
    """Names all objects after it."""
    command: dict[str, Any]
    """What was asked for: enough to do it again."""


class Document:
    """Objects under names, and a file ``.isoclay`` that has every edit before it shows.

    A document belongs to who has it open, until :meth:`close`; use it in a ``with`` statement. A pickled document is a copy
    of its file: what it comes back as lives in a temporary directory.
    """

    def __init__(self, path: PathLike) -> None:
        """Opens a document. What a crash or damage took from it is told by a :class:`UserWarning`."""
        self._path = Path(path)
        self._core, lost = _isoclay.CoreDocument.open(self._path)
        if lost is not None:
            warnings.warn(f"{self._path}: {lost}", stacklevel=2)

    @classmethod
    def new(cls, path: PathLike, fields: Mapping[str, Field] | None = None, *, elastic: bool = False) -> Document:
        """Makes a document of fields under their names. They are clay, which keeps its shape, or spring back if elastic."""
        made = [(name, field._core) for name, field in (fields or {}).items()]
        core = _isoclay.CoreDocument.create(Path(path), made, elastic)
        return cls._of(core, Path(path))

    @classmethod
    def _of(cls, core: _isoclay.CoreDocument, path: Path) -> Document:
        document = cls.__new__(cls)
        document._core, document._path = core, path
        return document

    @property
    def path(self) -> Path:
        """The file."""
        return self._path

    def close(self) -> None:
        """Lets others open it. Nothing is lost: every edit is in the file already."""
        self._core.close()

    def __enter__(self) -> Document:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickled, (self._path.name, self._path.read_bytes())

    # Objects

    @property
    def names(self) -> list[str]:
        """Names of the objects."""
        return self._core.names()

    def __getitem__(self, name: str) -> Field:
        """The field of an object as it is now, in its own world."""
        return Field(self._core.field(name))

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __len__(self) -> int:
        return len(self.names)

    def __setitem__(self, name: str, field: Field) -> None:
        """Puts a field in, as an edit."""
        self.put(name, field)

    def __delitem__(self, name: str) -> None:
        """Takes an object out, as an edit."""
        self._core.remove(name)

    def put(self, name: str, field: Field, *, elastic: bool = False) -> None:
        """Puts a field in, as an edit, in place of an object that has the name."""
        self._core.put(name, field._core, elastic)

    def placement(self, name: str) -> npt.NDArray[np.float64]:
        """The map from the world of an object to that of the document, 4 by 4."""
        return np.vstack([self._core.placement(name), [0, 0, 0, 1]])

    # Edits

    def sculpt(
        self,
        script: str | Mapping[str, Any] | Sequence[Mapping[str, Any]] | os.PathLike[str],
        *,
        object: str | None = None,
        threads: int | None = None,
        progress: Progress | None = None,
        cancel: _isoclay.CancelToken | None = None,
    ) -> list[str]:
        """Works on an object with tools; every stroke is an edit. Returns what is to be told of them.

        Args:
            script: Strokes as mappings, such as ``{"carve": {"shape": ..., "along": ...}}``, one or several; or the text of a session or a
                scene, TOML; or the path of a file with one. The guide lists what they may say.
            object: The object to work on, where there are several and the script names none.

        Raises:
            isoclay.errors.BadScript: Of a script that cannot be done. Strokes before that one are done.
        """
        label = ""
        if isinstance(script, os.PathLike):
            label, text = Path(script).name, Path(script).read_text(encoding="utf-8")
        elif isinstance(script, str):
            text = script
        else:
            strokes = [script] if isinstance(script, Mapping) else script
            text = "\n".join(json.dumps(dict(stroke)) for stroke in strokes)
        return self._core.sculpt(text, object, label, wishes(threads, None, progress, cancel))[1]

    def undo(self, count: int = 1) -> int:
        """Undoes up to so many edits; how many they were."""
        return self._core.undo(count)

    def redo(self, count: int = 1) -> int:
        """Does up to so many edits again that were undone; how many they were."""
        return self._core.redo(count)

    @property
    def history(self) -> list[Edit]:
        """The edits, the oldest first, those that are undone at the end."""
        return [
            Edit(title, datetime.fromtimestamp(time, UTC), is_done, sha256, json.loads(command))
            for title, time, is_done, sha256, command in self._core.history()
        ]

    @property
    def sha256(self) -> str:
        """Names all objects with their placements: equal for equal ones, to the bit."""
        return self._core.sha256()

    def replay(self, *, threads: int | None = None, progress: Progress | None = None) -> int:
        """Does all edits again from the first state, and compares to the bit; how many they were.

        Raises:
            isoclay.errors.DocumentProblem: Of an edit that gives something else than is stored.
        """
        return self._core.replay(wishes(threads, None, progress))

    def export(
        self, name: str, path: PathLike, *, like: PathLike | None = None, fill: float | None = None
    ) -> list[str]:
        """Writes an object as it is now as a field file; returns what is to be told.

        Args:
            like: The scan that the object was fitted to, a volume or a cloud: it is written with the edits in place of the field,
                in its own format, and what was not touched stays as it is.
            fill: Density of what was carved from a volume: air if it is not given, -1000 HU, or where the unit is not known what
                1 % of the voxels are below.

        Raises:
            ValueError: Of a scan that the object was not fitted to.
            isoclay.errors.DocumentProblem: Of an object that cannot be written back.
        """
        if like is not None:
            return self._core.export_like(name, Path(like), fill, Path(path))
        if fill is not None:
            raise ValueError("fill is for a scan with edits; give it by like=")
        self[name].save(path)
        return []

    def __repr__(self) -> str:
        if self._core.is_closed:
            return f"<isoclay.Document {self._path}, closed>"
        done, undone, _ = self._core.counts()
        return f"<isoclay.Document {self._path}: {', '.join(self.names)}; {done} edits, {undone} undone>"


def _unpickled(name: str, data: bytes) -> Document:
    scratch = Path(tempfile.mkdtemp(prefix="isoclay-"))
    path = scratch / name
    path.write_bytes(data)
    core, _ = _isoclay.CoreDocument.open(path)
    document = Document._of(core, path)
    weakref.finalize(document, shutil.rmtree, scratch, ignore_errors=True)
    return document
