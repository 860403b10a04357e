"""A volume larger than what a process may hold, fitted by two workers into a file.

    python crates/python/benches/large.py 1024 --directory /var/tmp/large

The volume is zarr, int16, smooth shapes with noise, made slab by slab and kept for the next time. Prints time, the most memory that
each worker and the caller held, and what came out; fails if one of them held more than the ceiling.
"""

import argparse
import itertools
import os
import shutil
import time
from pathlib import Path

import numpy as np
import zarr
from distributed import Client, LocalCluster

from isoclay.dask import fit_volume_blocks

CHUNK = 64


def made(path: Path, n: int) -> zarr.Array:
    """The volume: four rounded solids in air, with ripples and noise."""
    if path.exists():
        return zarr.open_array(path, mode="r")
    making = path.with_suffix(".making")
    shutil.rmtree(making, ignore_errors=True)
    array = zarr.create_array(making, shape=(n, n, n), chunks=(CHUNK,) * 3, dtype="i2", compressors=None)
    axis = np.linspace(-1, 1, n, dtype=np.float32)
    y, z = axis[None, :, None], axis[None, None, :]
    random = np.random.default_rng(0)
    for start in range(0, n, CHUNK):
        for first in range(start, start + CHUNK, 8):
            x = axis[first : first + 8, None, None]
            d = np.full((len(axis[first : first + 8]), n, n), -1000, np.float32)
            for cy, cz in itertools.product((-0.45, 0.45), repeat=2):
                r = np.sqrt((0.6 * x) ** 2 + 1.3 * (y - cy) ** 2 + (z - cz) ** 2)
                np.maximum(d, 1000 * np.tanh(12 * (0.38 - r)), out=d)
            d += 60 * np.sin(0.2 * n * x) * np.cos(0.17 * n * y) * np.sin(0.15 * n * z)
            d += 10 * random.standard_normal(d.shape, dtype=np.float32)
            slab = d.astype(np.int16) if first == start else np.concatenate([slab, d.astype(np.int16)])
        array[start : start + CHUNK] = slab
    making.rename(path)
    return zarr.open_array(path, mode="r")


def peak_mib(pid: int | str = "self") -> float:
    """Most memory that a process has held."""
    with open(f"/proc/{pid}/status", encoding="ascii") as status:
        return next(int(line.split()[1]) for line in status if line.startswith("VmHWM:")) / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("n", type=int, nargs="?", default=1024, help="voxels along each side, a multiple of 64")
    parser.add_argument("--directory", type=Path, required=True, help="for the volume and the field; 2 bytes a voxel, and 1 to spare")
    parser.add_argument("--block", type=int, default=96)
    parser.add_argument("--halo", type=int, default=32)
    parser.add_argument("--method", default="adaptive")
    parser.add_argument("--ceiling", type=float, default=512, help="MiB that a process may hold")
    asked = parser.parse_args()
    asked.directory.mkdir(parents=True, exist_ok=True)
    source = asked.directory / f"volume-{asked.n}.zarr"
    if not source.exists():
        # In a process of its own, whose memory is not the caller's.
        pid = os.fork()
        if pid == 0:
            made(source, asked.n)
            os._exit(0)
        os.waitpid(pid, 0)
    volume = made(source, asked.n)
    stages: dict[str, float] = {}
    start = time.perf_counter()
    tolerance = 15.0 if asked.method == "adaptive" else None
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, memory_limit=None, dashboard_address=":0") as cluster,
        Client(cluster) as client,
    ):
        field = fit_volume_blocks(
            volume,
            client=client,
            method=asked.method,
            tolerance=tolerance,
            block=asked.block,
            halo=asked.halo,
            output=asked.directory / f"field-{asked.n}.iclay",
            progress=lambda stage, share: stages.setdefault(stage, time.perf_counter() - start),
        )
        took = time.perf_counter() - start
        workers, busy = client.run(peak_mib), sum(client.run(time.process_time).values()) + time.process_time()
        caller = peak_mib()
    print(f"{asked.n}^3, {asked.method}, blocks of {asked.block} with a halo of {asked.halo}: {took:.0f} s, {busy:.0f} of the processor")
    print("stages begin at " + ", ".join(f"{stage} {second:.0f} s" for stage, second in stages.items()))
    print("peak MiB of the workers " + ", ".join(f"{mib:.0f}" for mib in workers.values()) + f"; of the caller {caller:.0f}")
    size = os.path.getsize(field.path)
    print(f"{field.coefficient_count} coefficients, {size / 1e6:.1f} MB, field_sha256 {field.sha256}")
    most = max([caller, *workers.values()])
    if most > asked.ceiling:
        raise SystemExit(f"a process held {most:.0f} MiB, more than {asked.ceiling:.0f}")


if __name__ == "__main__":
    main()
