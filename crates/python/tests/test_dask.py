"""Many fits, and fits by blocks, on workers that may be lost."""

import os
import shutil

import numpy as np
import pytest
from conftest import blob, sphere_points

import isoclay
from isoclay import dask as isoclay_dask

distributed = pytest.importorskip("distributed")
zarr = pytest.importorskip("zarr")

SHAPE = (112, 96, 100)


@pytest.fixture(scope="module")
def client():
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


@pytest.fixture(scope="module")
def volume():
    noise = np.random.default_rng(3).normal(0, 12, SHAPE)
    return (blob(SHAPE) + noise).astype(np.int16)


def test_many_files_are_fitted_and_bad_ones_named(client, data, tmp_path):
    shutil.copy(data / "bunny.obj.gz", tmp_path / "a.obj.gz")
    points = sphere_points()
    np.savetxt(tmp_path / "b.xyz", np.hstack([points, points]))
    (tmp_path / "c.ply").write_text("no cloud")
    paths = [tmp_path / "a.obj.gz", tmp_path / "b.xyz", tmp_path / "c.ply", tmp_path / "gone.nii"]
    outcomes = isoclay_dask.fit_many(paths, client, output=tmp_path / "out")
    assert [o.error is None for o in outcomes] == [True, True, False, False]
    assert isinstance(outcomes[2].error, isoclay.errors.BadFile)
    assert outcomes[0].sha256 == isoclay.fit(data / "bunny.obj.gz").sha256
    assert isoclay.Field.load(outcomes[1].saved).sha256 == outcomes[1].sha256
    here = isoclay_dask._Here().submit(isoclay_dask._outcome, str(paths[1]), None, {})
    assert here.field.sha256 == here.sha256 == outcomes[1].sha256


def test_blocks_interpolate_as_one_piece(client, volume):
    whole = isoclay.fit_volume(volume, method="interpolate")
    blocks = isoclay_dask.fit_volume_blocks(volume, client=client, method="interpolate", block=64, halo=16)
    points = np.random.default_rng(1).uniform(0, np.array(SHAPE) - 1, (20000, 3))
    spread = float(np.ptp(volume))
    assert np.abs(whole(points) - blocks(points)).max() < 1e-6 * spread
    assert blocks.coefficient_count == whole.coefficient_count
    assert blocks.iso == pytest.approx(whole.iso, rel=0.05)
    assert blocks.leaves["samples"].sum() == volume.size


def test_blocks_keep_the_tolerance_and_are_no_worse_at_their_borders(client, volume):
    whole = isoclay.fit_volume(volume, tolerance=20)
    blocks = isoclay_dask.fit_volume_blocks(volume, client=client, tolerance=20, block=64)
    leaves = blocks.leaves
    assert leaves["rms"].max() <= 20
    assert np.array_equal(np.unique(leaves["cell"], axis=0), np.unique(whole.leaves["cell"], axis=0))
    residual = volume - blocks.sample(affine=np.eye(4), shape=SHAPE)[0]
    rms = float(np.sqrt(np.mean(residual**2)))
    assert blocks.report["rms"] == pytest.approx(rms, rel=1e-3)
    assert rms <= 1.01 * whole.report["rms"]
    at_border = (np.abs(leaves["cell"][:, 0] - 15.5) < 1) | (np.abs(leaves["cell"][:, 1] - 15.5) < 1)
    mean = lambda some: float(np.sqrt(np.mean(leaves["rms"][some] ** 2)))  # noqa: E731
    assert mean(at_border) <= 1.02 * mean(~at_border)


def test_neither_workers_nor_losses_nor_storage_show(client, volume, tmp_path):
    here = isoclay_dask.fit_volume_blocks(volume, tolerance=30, block=64, client=None)
    there = isoclay_dask.fit_volume_blocks(volume, tolerance=30, block=64, client=client)
    assert here.sha256 == there.sha256
    group = zarr.open_group(tmp_path / "image.zarr", mode="w")
    stored = group.create_array("0", shape=SHAPE[::-1], chunks=(32, 32, 32), dtype="i2")
    stored[...] = volume.transpose(2, 1, 0)
    group.attrs["ome"] = {
        "version": "0.5",
        "multiscales": [
            {
                "axes": [{"name": n, "type": "space", "unit": "millimeter"} for n in "zyx"],
                "datasets": [
                    {
                        "path": "0",
                        "coordinateTransformations": [
                            {"type": "scale", "scale": [2.0, 1.0, 0.5]},
                            {"type": "translation", "translation": [5.0, 6.0, 7.0]},
                        ],
                    }
                ],
            }
        ],
    }
    array, affine, order, unit = isoclay_dask.ome_zarr(tmp_path / "image.zarr")
    assert np.array_equal(affine, [[0.5, 0, 0, 7], [0, 1, 0, 6], [0, 0, 2, 5], [0, 0, 0, 1]])
    marker = tmp_path / "died"
    fields = [
        isoclay_dask.fit_volume_blocks(source, affine, order=order, unit=unit, tolerance=30, block=64, client=client)
        for source in (array, Mortal(array, marker))
    ]
    assert marker.exists()
    assert fields[0].sha256 == fields[1].sha256
    assert fields[0].unit == "mm"


class Mortal:
    """An array whose first reader among the workers dies."""

    def __init__(self, array, marker):
        self.array, self.marker, self.shape, self.dtype = array, marker, array.shape, array.dtype

    def __getitem__(self, places):
        if not self.marker.exists():
            self.marker.write_text("")
            os._exit(1)
        return self.array[places]


def test_bad_wishes_are_named(volume):
    for wishes, told in [
        ({"block": 50}, "multiple of 32"),
        ({"halo": 8}, "multiple of"),
        ({"method": "interpolate", "tolerance": 1}, "leaves no residual"),
        ({"tolerance": "1mm"}, "a length"),
    ]:
        with pytest.raises(ValueError, match=told):
            isoclay_dask.fit_volume_blocks(volume, **wishes)
