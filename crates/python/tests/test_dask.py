"""Many fits, and fits by blocks, on workers that may be lost."""

import functools
import os
import shutil

import numpy as np
import pytest
from conftest import blob, sphere_points

import isoclay
from isoclay import _blocks
from isoclay import dask as isoclay_dask

distributed = pytest.importorskip("distributed")
zarr = pytest.importorskip("zarr")

SHAPE = (112, 96, 100)


@pytest.fixture(scope="module")
def client():
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
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


def test_blocks_fall_as_steeply_as_one_piece(client):
    volume = np.random.default_rng(4).normal(0, 12, SHAPE).astype(np.float32)
    volume[8:40, 8:40, 8:40] += 1000
    places = np.array([[0.0, 48, 50], [-10.0, 48, 50]])
    slopes = [
        -np.diff(field(places))[0] / 10
        for field in (
            isoclay.fit_volume(volume, method="interpolate"),
            isoclay_dask.fit_volume_blocks(volume, client=client, method="interpolate", block=32, halo=16),
        )
    ]
    assert slopes[0] > 100
    assert slopes[1] == pytest.approx(slopes[0], rel=0.3)


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


def test_a_file_has_the_bytes_of_the_field_and_is_made_on_from_what_is_there(volume, tmp_path, monkeypatch):
    wishes = {"tolerance": 10, "block": 64, "scratch": tmp_path / "parts"}
    first = isoclay_dask.fit_volume_blocks(volume, output=tmp_path / "first.iclay", **wishes)
    field = isoclay_dask.fit_volume_blocks(volume, tolerance=10, block=64)
    assert first.sha256 == field.sha256 == first.load().sha256
    assert first.coefficient_count == field.coefficient_count
    first.load().save(tmp_path / "again.iclay")
    assert (tmp_path / "first.iclay").read_bytes() == (tmp_path / "again.iclay").read_bytes()
    parts = sorted((tmp_path / "parts").iterdir())
    assert any("mend" in path.name for path in parts)

    # Nothing is fitted a second time, and what is not there is.
    def refused(*arguments, **options):
        raise RuntimeError("fitted")

    with monkeypatch.context() as patched:
        patched.setattr(_blocks, "fit_volume", refused)
        second = isoclay_dask.fit_volume_blocks(volume, output=tmp_path / "second.iclay", **wishes)
        assert second.sha256 == first.sha256
        for changed in ({"tolerance": 11}, {"affine": 2.0}):
            with pytest.raises(RuntimeError, match="fitted"):
                isoclay_dask.fit_volume_blocks(volume, output=tmp_path / "third.iclay", **{**wishes, **changed})
        with pytest.raises(RuntimeError, match="fitted"):
            isoclay_dask.fit_volume_blocks(volume + 1, output=tmp_path / "third.iclay", **wishes)
    assert not (tmp_path / "third.iclay").exists()
    parts[0].write_bytes(parts[0].read_bytes()[:-1])
    with pytest.raises(isoclay.errors.BadFile, match=parts[0].name):
        isoclay_dask.fit_volume_blocks(volume, output=tmp_path / "fourth.iclay", **wishes)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["again.iclay", "first.iclay", "parts", "second.iclay"]


class Backwards:
    """Does work as late as it can, the last first."""

    def share(self, value):
        return value

    def submit(self, work, *arguments):
        return functools.cache(lambda: work(*(self.done(argument) for argument in arguments)))

    def done(self, value):
        if isinstance(value, list):
            return [self.done(one) for one in reversed(value)][::-1]
        return value() if hasattr(value, "cache_info") else value

    def each(self, handles):
        return iter(self.done(handles))


def test_neither_order_nor_storage_shows(volume, tmp_path, monkeypatch):
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
    wishes = {"unit": unit, "tolerance": 10, "block": 64}
    field = isoclay_dask.fit_volume_blocks(volume, affine, **wishes)
    assert field.unit == "mm"
    assert isoclay_dask.fit_volume_blocks(array, affine, order=order, **wishes).sha256 == field.sha256
    monkeypatch.setattr(isoclay_dask, "_runner", lambda *_: Backwards())
    assert isoclay_dask.fit_volume_blocks(volume, affine, **wishes).sha256 == field.sha256


@pytest.mark.parametrize(
    ("n", "wishes"),
    [(256, {"method": "interpolate", "halo": 16}), (128, {"tolerance": 10.0})],
    ids=["256 voxels, met", "128 voxels, adaptive"],
)
def test_neither_workers_nor_losses_show(client, tmp_path, n, wishes):
    """In blocks of 64; of 256 voxels along each side some have neighbours all round. Adaptive fits take four times as long."""
    stored = zarr.create_array(tmp_path / "volume.zarr", shape=(n, n, n), chunks=(64, 64, 64), dtype="i2")
    noise = np.random.default_rng(5).standard_normal((n, n, n), dtype=np.float32)
    stored[...] = (blob((n, n, n)) + 12 * noise).astype(np.int16)
    marker = tmp_path / "died"
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0") as cluster,
        distributed.Client(cluster, set_as_default=False) as one,
    ):
        first = isoclay_dask.fit_volume_blocks(stored, client=one, output=tmp_path / "one.iclay", block=64, **wishes)
    mortal = Mortal(stored, marker, 64)
    second = isoclay_dask.fit_volume_blocks(mortal, client=client, output=tmp_path / "two.iclay", block=64, **wishes)
    assert marker.exists()
    assert first.sha256 == second.sha256
    assert (tmp_path / "one.iclay").read_bytes() == (tmp_path / "two.iclay").read_bytes()
    leaves = first.load().leaves
    assert leaves["samples"].sum() == n**3
    assert leaves["rms"].max() <= wishes.get("tolerance", 0.01)


class Mortal:
    """An array that kills the worker that reads more than so many voxels along an axis of it for the first time."""

    def __init__(self, array, marker, most):
        self.array, self.marker, self.most, self.shape, self.dtype = array, marker, most, array.shape, array.dtype

    def __getitem__(self, places):
        part = self.array[places]
        if max(part.shape) > self.most and not self.marker.exists():
            self.marker.write_text("")
            os._exit(1)
        return part


def test_bad_wishes_are_named(volume):
    for wishes, told in [
        ({"block": 50}, "multiple of 32"),
        ({"halo": 8}, "multiple of"),
        ({"method": "interpolate", "tolerance": 1}, "leaves no residual"),
        ({"tolerance": "1mm"}, "a length"),
    ]:
        with pytest.raises(ValueError, match=told):
            isoclay_dask.fit_volume_blocks(volume, **wishes)
