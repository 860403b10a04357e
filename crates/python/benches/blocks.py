"""What a fit by blocks costs: CPU time and memory of a block by its size and halo, and of the steps that the caller does.

    python crates/python/benches/blocks.py
    python crates/python/benches/blocks.py --chart docs/charts/blocks.svg

The volume is three blocks along each side, int16 with noise, and the one in the middle is fitted. Every row is a process of its own
with one thread, as a worker would have. The chart takes matplotlib.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from isoclay import _blocks, _blocks_run
from isoclay.dask import _Here

ROWS = [
    ("adaptive", 32, (64, 96, 128)),
    ("adaptive", 64, (64, 96, 128)),
    ("interpolate", 16, (64, 96, 128)),
    ("interpolate", 32, (64, 96, 128)),
]
TOLERANCE = 20.0
MEASURED = 32
"""The halo of the rows that are measured too: a measurement does not depend on it, and takes the fits of all neighbours."""


def head(n: int) -> np.ndarray:
    """A rounded solid with ripples and noise, int16."""
    axis = np.linspace(-1, 1, n, dtype=np.float32)
    x, y, z = axis[:, None, None], axis[None, :, None], axis[None, None, :]
    d = 1000 * np.tanh(8 * (0.75 - np.sqrt(x**2 + 1.3 * y**2 + z**2)))
    d = d + 80 * np.sin(31 * x) * np.cos(27 * y) * np.sin(23 * z)
    noise = np.random.default_rng(0).standard_normal((n, n, n), dtype=np.float32)
    return (d + 10 * noise).astype(np.int16)


def peak_kib() -> int:
    """Most memory that this process has held, since the last :func:`forget_peak`."""
    with open("/proc/self/status", encoding="ascii") as status:
        return next(int(line.split()[1]) for line in status if line.startswith("VmHWM:"))


def forget_peak() -> int:
    """Memory held now."""
    Path("/proc/self/clear_refs").write_text("5")
    return peak_kib()


class Timed:
    """Seconds of the processor and growth of memory in its ``with``."""

    def __enter__(self) -> "Timed":
        self.before, self.start = forget_peak(), time.process_time()
        return self

    def __exit__(self, *_: object) -> None:
        self.seconds, self.mib = time.process_time() - self.start, (peak_kib() - self.before) / 1024


def one(path: str, block: int, halo: int, method: str) -> None:
    """The middle block in this process; prints what it took."""
    volume = np.load(path, mmap_mode="r")
    plan = _blocks.Plan(volume, np.eye(4), "xyz", method, block, halo, None, 1)
    job = _blocks.Job(plan, TOLERANCE, _blocks.Shelf(None, ""))
    blocks = plan.blocks()
    middle = len(blocks) // 2
    with Timed() as looked:
        _blocks.looked_at(plan, blocks[middle])
    with Timed() as fit:
        if method == "adaptive":
            part = _blocks.fitted(job, middle, blocks[middle])
        else:
            part = _blocks.interpolated(job, middle, blocks[middle]).part
    seconds, mib = {"fit": looked.seconds + fit.seconds, "measure": 0.0}, fit.mib
    if method == "adaptive" and halo == MEASURED:
        parts = [part if n == middle else _blocks.fitted(job, n, b) for n, b in enumerate(blocks)]
        with Timed() as measuring:
            _blocks.measured(job, middle, 0, blocks[middle], parts, False)
        seconds["measure"], mib = measuring.seconds, max(mib, measuring.mib)
    done = _blocks.finished(job, middle, [part], (b"", None))
    print(
        json.dumps(
            {
                "voxels": float(np.prod(np.subtract(blocks[middle].high, blocks[middle].low))),
                "seconds": seconds,
                "mib": mib,
                "coefficients": sum(done.counts),
                "bytes": len(part),
            }
        )
    )


def joined(path: str, method: str, block: int) -> None:
    """Writes a field from the parts of 27 blocks; prints what that alone took."""
    volume = np.load(path, mmap_mode="r")
    plan = _blocks.Plan(volume, np.eye(4), "xyz", method, block, 32, None, 1)
    with tempfile.TemporaryDirectory(dir=Path(path).parent) as directory:
        tolerance = TOLERANCE if method == "adaptive" else None
        output = str(Path(directory) / "field.iclay")
        state = {}

        def told(stage: str, share: float) -> None:
            if stage == "writing the field" and not state:
                state.update(before=forget_peak(), start=time.process_time())

        made = _blocks_run.run(plan, tolerance, _Here(), told, output, str(Path(directory) / "parts"))
        seconds, mib = time.process_time() - state["start"], (peak_kib() - state["before"]) / 1024
        size = os.path.getsize(output)
    count = made.coefficient_count
    print(json.dumps({"seconds": seconds, "mib": mib, "coefficients": count, "leaves": volume.size / 64, "bytes": size}))


def called(*arguments: object) -> dict:
    """What this file prints in a process of its own."""
    call = [sys.executable, __file__, *map(str, arguments)]
    return json.loads(subprocess.run(call, check=True, capture_output=True, text=True).stdout)


def drawn(path: str, found: dict) -> None:
    """The chart: time against memory, by block and halo."""
    import matplotlib

    matplotlib.use("svg")
    import matplotlib.pyplot as plt
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    plt.rcParams.update({"font.family": "sans-serif", "font.size": 10, "svg.fonttype": "none", "svg.hashsalt": "isoclay"})
    figure, axes = plt.subplots(figsize=(960 / 72, 656 / 72))
    colours = ["#0072B2", "#D55E00", "#009E73", "#CC79A7"]
    for (method, halo, blocks), colour in zip(ROWS, colours, strict=True):
        rows = [found[method, block, halo] for block in blocks]
        costs = [sum(r["seconds"].values()) / r["voxels"] * 1e6 for r in rows]
        sizes = [r["mib"] for r in rows]
        axes.plot(sizes, costs, "o-", color=colour, label=f"{method}, halo {halo}")
        for block, size, cost in zip(blocks, sizes, costs, strict=True):
            axes.annotate(str(block), (size, cost), (6, 6), textcoords="offset points", color=colour)
    axes.set(xscale="log", yscale="log")
    for axis, marks in ((axes.xaxis, [20, 50, 100, 200, 500]), (axes.yaxis, [0.1, 0.2, 0.5, 1, 2, 5])):
        axis.set_major_locator(FixedLocator(marks))
        axis.set_minor_locator(NullLocator())
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_title("a block of a volume: time against memory, by the voxels along it and along its halo", fontsize=16)
    axes.set_xlabel("memory of a worker above that of Python, MiB", fontsize=12)
    axes.set_ylabel("CPU time of a fit and a measurement, µs a voxel of the block", fontsize=12)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.09), ncols=4, frameon=False)
    figure.savefig(path, metadata={"Date": None}, bbox_inches="tight")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--chart", help="an SVG file to draw as well")
    chart = parser.parse_args().chart
    print("| method | block | halo | µs a voxel to fit | to measure | MiB | coefficients a voxel | bytes a coefficient |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    found = {}
    with tempfile.TemporaryDirectory() as directory:

        def volume(block: int) -> Path:
            path = Path(directory) / f"{block}.npy"
            if not path.exists():
                np.save(path, head(3 * block))
            return path

        for method, halo, blocks in ROWS:
            for block in blocks:
                r = found[method, block, halo] = called("--one", volume(block), block, halo, method)
                if method == "adaptive" and halo != MEASURED:
                    r["seconds"]["measure"] = found[method, block, MEASURED]["seconds"]["measure"]
                fit, measure = (r["seconds"][step] / r["voxels"] * 1e6 for step in ("fit", "measure"))
                print(
                    f"| {method} | {block} | {halo} | {fit:.2f} | {f'{measure:.2f}' if measure else ''} | {r['mib']:.0f} |"
                    f" {r['coefficients'] / r['voxels']:.3f} | {r['bytes'] / r['coefficients']:.1f} |",
                    flush=True,
                )
        for method in ("adaptive", "interpolate"):
            r = called("--joined", volume(96), method, 96)
            print(
                f"{method}: {r['seconds']:.2f} s to write {r['coefficients']} coefficients and {r['leaves']:.0f} leaves,"
                f" {r['mib']:.0f} MiB, {r['bytes'] / 1e6:.1f} MB"
            )
    if chart:
        drawn(chart, found)


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["--one", path, block, halo, method]:
            one(path, int(block), int(halo), method)
        case ["--joined", path, method, block]:
            joined(path, method, int(block))
        case _:
            main()
