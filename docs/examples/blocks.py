"""A volume fitted block by block on a cluster of processes. Run it from the root of the repository."""

import sys
from pathlib import Path

import nibabel
import numpy as np
from distributed import Client, LocalCluster

import isoclay
from isoclay.dask import fit_many, fit_volume_blocks


def main(out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    image = nibabel.load("data/head.nii.gz")
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster, Client(cluster) as client:
        # %% Many files: what fails is told, and stops nothing
        for outcome in fit_many(["data/bunny.obj.gz", "data/README.md"], client, output=out / "fields"):
            print(outcome.path, outcome.saved or outcome.error)

        # %% One volume, in blocks; a zarr or dask array goes in the same way, read by the workers
        voxels = np.asarray(image.dataobj)
        saved = fit_volume_blocks(
            voxels, image.affine, client=client, tolerance="2%", block=64, output=out / "head-blocks.iclay"
        )
        field = saved.load()
        print(field, field.report["rms"], field.notes)
        field.mesh(triangles=20_000).save(out / "head-blocks.ply")
        assert isinstance(field, isoclay.Field) and field.sha256 == saved.sha256


# Workers import this file: only the first process does the work.
if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out"))
