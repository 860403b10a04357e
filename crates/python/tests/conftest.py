"""What the tests share."""

import math
from pathlib import Path

import numpy as np
import pytest

import isoclay

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="session")
def data() -> Path:
    """The scans of the repository."""
    return ROOT / "data"


@pytest.fixture(scope="session")
def program() -> Path:
    """The command line."""
    path = ROOT / "target/release/isoclay"
    if not path.exists():
        pytest.fail(f"{path} is not there; build it: cargo build --release -p isoclay")
    return path


def sphere_points(count: int = 3000) -> np.ndarray:
    """Evenly spread points of the unit sphere."""
    k = np.arange(count) + 0.5
    z, angle = 1 - 2 * k / count, math.pi * (1 + math.sqrt(5)) * k
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1)


def blob(shape: tuple[int, int, int]) -> np.ndarray:
    """Densities -1000 to 1000 of something round, int16, ``[i, j, k]``."""
    axes = np.meshgrid(*[np.linspace(-1, 1, n) for n in shape], indexing="ij")
    d = 1000 * np.tanh(6 * (0.7 - np.sqrt(axes[0] ** 2 + 1.4 * axes[1] ** 2 + axes[2] ** 2)))
    return (d + 40 * np.sin(23 * axes[0]) * np.cos(17 * axes[2])).astype(np.int16)


@pytest.fixture(scope="session")
def ball() -> isoclay.Field:
    points = sphere_points()
    return isoclay.fit_points(points, points)
