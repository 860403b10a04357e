"""What a field can be asked."""

import pickle

import numpy as np
import pytest
from conftest import blob, sphere_points

import isoclay

POINTS = np.random.default_rng(7).uniform(-0.9, 0.9, (600, 3))


def test_values_are_the_distance(ball):
    near = POINTS / np.linalg.norm(POINTS, axis=1, keepdims=True) * np.linspace(0.97, 1.03, 600)[:, None]
    assert np.abs(ball(near) - (1 - np.linalg.norm(near, axis=1))).max() < 2e-3


def test_shapes_follow_the_points(ball):
    points = POINTS.reshape(20, 30, 3)
    assert ball(points).shape == (20, 30)
    assert ball.gradient(points).shape == (20, 30, 3)
    assert ball.hessian(points).shape == (20, 30, 3, 3)
    assert ball(points[0, 0]).shape == ()
    assert ball(np.empty((0, 3))).shape == (0,)
    values, gradients = ball.value_gradient(points)
    assert np.array_equal(values, ball(points))
    assert np.array_equal(gradients, ball.gradient(points))


def test_gradient_and_hessian_match_differences():
    points = sphere_points()
    field = isoclay.fit_points(points, points, precision="f64")
    h = 1e-6
    steps = h * np.eye(3)
    gradient = np.stack([(field(POINTS + s) - field(POINTS - s)) / (2 * h) for s in steps], axis=-1)
    hessian = np.stack([(field.gradient(POINTS + s) - field.gradient(POINTS - s)) / (2 * h) for s in steps], axis=-1)
    # Differences round to 1e-16 / h, and third derivatives jump at knots.
    assert np.abs(gradient - field.gradient(POINTS)).max() < 1e-8
    assert np.abs(hessian - field.hessian(POINTS)).max() < 1e-2


def test_bounds_hold(ball):
    low, high = ball.bounds([0.2, 0.2, 0.2], [0.6, 0.6, 0.6])
    values = ball(np.random.default_rng(1).uniform(0.2, 0.6, (1000, 3)))
    assert low <= values.min() <= values.max() <= high
    with pytest.raises(ValueError, match="least corner"):
        ball.bounds([1, 0, 0], [0, 1, 1])


def test_samples_are_values_at_voxels(ball):
    affine = np.array([[0, 0.1, 0, -0.5], [0.2, 0, 0, -0.4], [0, 0, 0.15, -0.3], [0, 0, 0, 1]])
    values, same = ball.sample(affine=affine, shape=(4, 5, 6))
    assert np.array_equal(same, affine)
    ijk = np.stack(np.meshgrid(range(4), range(5), range(6), indexing="ij"), axis=-1)
    assert values == pytest.approx(ball(ijk @ affine[:3, :3].T + affine[:3, 3]), abs=1e-6)
    values, affine = ball.sample(spacing=0.1)
    reach = affine[:3, :3] @ (np.array(values.shape) - 1) + affine[:3, 3]
    assert (reach >= ball.box[1] - 1e-9).all()


def test_meshes_are_closed_and_as_fine_as_asked(ball):
    mesh = ball.mesh()
    assert mesh.is_closed
    assert mesh.volume == pytest.approx(4 / 3 * np.pi, rel=2e-3)
    assert 400 <= len(ball.mesh(triangles=500).triangles) <= 500
    coarse, fine = (len(ball.mesh(resolution=n).triangles) for n in (16, 32))
    assert 3 < fine / coarse < 5
    assert len(ball.mesh(tolerance="1%").triangles) < len(ball.mesh(tolerance="0.05%").triangles)
    with pytest.raises(ValueError, match="one of them"):
        ball.mesh(triangles=100, resolution=10)
    with pytest.raises(ValueError, match="another iso"):
        ball.mesh(iso=99)


def test_meshes_are_written(ball, tmp_path):
    mesh = ball.mesh(triangles=500)
    for name in ("m.ply", "m.stl", "m.obj", "m.glb", "m.3mf", "m.wrl"):
        mesh.save(tmp_path / name)
        assert (tmp_path / name).stat().st_size > 1000
    with pytest.raises(isoclay.errors.BadFile, match="supported"):
        mesh.save(tmp_path / "m.doc")


def test_solids_are_made_of_solids(ball):
    other = ball.moved([[1, 0, 0, 0.8], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    a, b = ball(POINTS), other(POINTS)
    assert b == pytest.approx(ball(POINTS - [0.8, 0, 0]))
    assert np.array_equal((ball | other)(POINTS), np.maximum(a, b))
    assert np.array_equal((ball & other)(POINTS), np.minimum(a, b))
    assert np.array_equal((ball - other)(POINTS), np.minimum(a, -b))
    assert np.array_equal((~ball)(POINTS), -a)
    assert ball.grown(0.1)([0, 0, 1.05]) > 0 > ball([0, 0, 1.05])
    smooth = isoclay.union(ball, other, smooth=0.2)
    assert (smooth(POINTS) >= np.maximum(a, b)).all()
    assert (ball - other).mesh(resolution=48).is_closed
    lens = (ball & other).mesh(resolution=96).volume
    assert lens == pytest.approx(np.pi * (4 + 0.8) * (2 - 0.8) ** 2 / 12, rel=0.01)


def test_fields_of_other_surfaces_combine(ball):
    volume = isoclay.fit_volume(blob((24, 24, 24)), np.array([[0.08, 0, 0, -0.9], [0, 0.08, 0, -0.9], [0, 0, 0.08, -0.9], [0, 0, 0, 1]]))
    both = ball & volume
    inside = (ball(POINTS) > 0) & (volume(POINTS) > volume.iso)
    assert np.array_equal(both(POINTS) > both.iso, inside)
    with pytest.raises(ValueError, match="with_iso"):
        volume.with_iso(None) | ball


def test_fields_are_pickled(ball):
    other = pickle.loads(pickle.dumps(ball))
    assert other.sha256 == ball.sha256
    assert other.report == ball.report
    assert np.array_equal(other.leaves, ball.leaves)
    formula = (ball - ball.grown(-0.2)).with_iso(0.01)
    copy = pickle.loads(pickle.dumps(formula))
    assert np.array_equal(copy(POINTS), formula(POINTS))
    assert copy.iso == 0.01


def test_a_formula_has_no_hash_and_says_so(ball, tmp_path):
    with pytest.raises(ValueError, match="baked"):
        (ball | ball).save(tmp_path / "x.iclay")


def test_fields_describe_themselves(ball):
    assert repr(ball).startswith("<isoclay.Field of a cloud: ")
    assert "<table>" in ball._repr_html_()
    assert ball.report["input_count"] == 3000
    assert ball.leaves["samples"].sum() == ball.report["used_count"]
    assert {isoclay.REASONS[r] for r in ball.leaves["reason"]} <= set(isoclay.REASONS)


def test_files_that_are_no_fields_are_named(tmp_path):
    (tmp_path / "x.iclay").write_text("no field")
    with pytest.raises(isoclay.errors.BadFile, match="x.iclay"):
        isoclay.Field.load(tmp_path / "x.iclay")
