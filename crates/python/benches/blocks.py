"""What a fit by blocks costs: CPU time and memory of a block by its size and halo, and of the steps that the caller does.

    python crates/python/benches/blocks.py

The volume is three blocks along each side, and the one in the middle is fitted. Every block is a process of its own with one thread, as a worker would have. The volume is a noisy head of int16.
"""

import json
import pickle
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from isoclay._blocks import Plan, block_fitted, block_measured, histogram


def head(n: int) -> np.ndarray:
    """A rounded solid with ripples and noise, int16."""
    axis = np.linspace(-1, 1, n, dtype=np.float32)
    x, y, z = axis[:, None, None], axis[None, :, None], axis[None, None, :]
    d = 1000 * np.tanh(8 * (0.75 - np.sqrt(x**2 + 1.3 * y**2 + z**2)))
    d = d + 80 * np.sin(31 * x) * np.cos(27 * y) * np.sin(23 * z)
    noise = np.random.default_rng(0).standard_normal((n, n, n), dtype=np.float32)
    return (d + 10 * noise).astype(np.int16)


def peak_kib() -> int:
    """Most memory that this process has held."""
    with open("/proc/self/status", encoding="ascii") as status:
        return next(int(line.split()[1]) for line in status if line.startswith("VmHWM:"))


def one(path: str, block: int, halo: int, method: str) -> None:
    """The middle block in this process; prints what it took."""
    volume = np.load(path, mmap_mode="r")
    plan = Plan(volume, np.eye(4), "xyz", method, block, halo, None, 1)
    blocks = plan.blocks(halo)
    middle = next(b for b in blocks if all(lo <= n // 2 < hi for lo, hi, n in zip(b.low, b.high, volume.shape, strict=True)))
    before, start = peak_kib(), time.process_time()
    histogram(plan, next(b for b in plan.blocks(0) if b.low == middle.low))
    seen = time.process_time()
    field = block_fitted(plan, middle, 20.0)
    fitted = time.process_time()
    peak = peak_kib()
    start_measuring = time.process_time()
    if method == "adaptive":
        block_measured(plan, middle, [field], 20.0, False)
    measured = time.process_time() - start_measuring
    size = len(pickle.dumps(field))
    voxels = float(np.prod(np.subtract(middle.high, middle.low)))
    print(
        json.dumps(
            {
                "block": block,
                "halo": halo,
                "method": method,
                "voxels": voxels,
                "look_s": seen - start,
                "fit_s": fitted - seen,
                "measure_s": measured,
                "rss_mib": (peak - before) / 1024,
                "coefficients_a_voxel": field.coefficient_count / voxels,
                "bytes_a_coefficient": size / field.coefficient_count,
            }
        )
    )


def main() -> None:
    print("| method | block | halo | µs a voxel to fit | to measure | MiB | coefficients a voxel | bytes a coefficient |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    adaptive = [(64, 32, "adaptive"), (96, 32, "adaptive"), (128, 32, "adaptive"), (128, 64, "adaptive")]
    interpolate = [(64, 16, "interpolate"), (128, 16, "interpolate"), (128, 32, "interpolate")]
    with tempfile.TemporaryDirectory() as directory:
        for block, halo, method in sorted([*adaptive, *interpolate], key=lambda row: row[0]):
            path = Path(directory) / f"{block}.npy"
            if not path.exists():
                np.save(path, head(3 * block))
            call = [sys.executable, __file__, "--one", str(path), str(block), str(halo), method]
            r = json.loads(subprocess.run(call, check=True, capture_output=True, text=True).stdout)
            cost = (r["look_s"] + r["fit_s"]) / r["voxels"] * 1e6
            again = r["measure_s"] / r["voxels"] * 1e6
            print(
                f"| {method} | {block} | {halo} | {cost:.2f} | {again:.2f} | {r['rss_mib']:.0f} |"
                f" {r['coefficients_a_voxel']:.3f} | {r['bytes_a_coefficient']:.1f} |",
                flush=True,
            )


if __name__ == "__main__":
    if sys.argv[1:2] == ["--one"]:
        one(sys.argv[2], int(sys.argv[3]), int(sys.argv[4]), sys.argv[5])
    else:
        main()
