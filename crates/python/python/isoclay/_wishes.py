"""What all long work takes: threads, memory, progress, cancel."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable
from typing import Any, TypeAlias

from . import _isoclay

Progress: TypeAlias = Callable[[str, float], object]
"""Called with what is being done and the share of it that is done, on the calling thread."""

Tolerance: TypeAlias = float | str
"""A number, or a text such as ``"0.1%"`` or ``"0.05mm"``."""

def wishes(
    threads: int | None = None,
    memory: int | None = None,
    progress: Progress | None = None,
    cancel: _isoclay.CancelToken | None = None,
) -> dict[str, Any]:
    """The wishes of a caller as the Rust side reads them."""
    if threads is not None and threads < 1:
        raise ValueError(f"threads is {threads}; give 1 or more, or None for one a core")
    if memory is not None and memory < 1:
        raise ValueError(f"memory is {memory} bytes; give 1 or more, or None for no ceiling")
    return {"threads": threads, "memory": memory, "progress": progress, "cancel": cancel}


def tolerance(value: Tolerance | None) -> tuple[float | None, str]:
    """The number of a tolerance, and what it is in: ``"mm"``, ``"%"``, or nothing."""
    if value is None or not isinstance(value, str):
        return (None if value is None else float(value)), ""
    found = re.fullmatch(r"\s*([-+.\deE]+)\s*(%|mm|)\s*", value)
    try:
        return float(found[1]), found[2]  # type: ignore[index]
    except (TypeError, ValueError):
        raise ValueError(
            f"tolerance is {value!r}; write a number, or a text such as '0.1%' or '0.05mm'"
        ) from None


def choice(
    tolerance_: Tolerance | None,
    coefficients: int | None,
    max_depth: int | None,
    smoothing: float | None,
    precision: str,
    unit: str | None,
    name: str | None = None,
) -> dict[str, Any]:
    """What may be chosen of any fit, as the Rust side reads it."""
    if precision not in ("f32", "f64"):
        raise ValueError(f"precision is {precision!r}; write 'f32' or 'f64'")
    for option, count in (("coefficients", coefficients), ("max_depth", max_depth)):
        if count is not None and count < 0:
            raise ValueError(f"{option} is {count}; it has to be positive")
    number, tolerance_in = tolerance(tolerance_)
    arguments = {
        "tolerance": tolerance_,
        "coefficients": coefficients,
        "max_depth": max_depth,
        "smoothing": smoothing,
        "precision": precision,
    }
    given = {name: value for name, value in arguments.items() if value is not None}
    story = {"program": f"isoclay {_isoclay.__version__} (Python)", "input": name, "arguments": given}
    return {
        "tolerance": number,
        "tolerance_in": tolerance_in,
        "coefficients": coefficients,
        "max_depth": max_depth,
        "smoothing": smoothing,
        "is_double": precision == "f64",
        "unit": unit,
        "provenance": json.dumps(story),
    }


PathLike: TypeAlias = str | os.PathLike[str]
