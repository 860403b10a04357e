"""Fits: the same as the command line's, from whatever holds the samples."""

import json
import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import nibabel
import numpy as np
import pytest
from conftest import blob, sphere_points

import isoclay


def of_program(program: Path, *arguments: str) -> dict[str, Any]:
    out = subprocess.run([program, *arguments, "--json"], check=True, capture_output=True, text=True).stdout
    return json.loads(out.splitlines()[-1])


@pytest.mark.parametrize("name", ["bunny.obj.gz", "head.nii.gz"])
def test_a_field_has_the_hash_of_the_command_line(program, data, tmp_path, name):
    told = of_program(program, "fit", str(data / name), "-o", str(tmp_path / "field.iclay"))
    assert isoclay.fit(data / name).sha256 == told["field_sha256"]
    loaded = isoclay.Field.load(tmp_path / "field.iclay")
    assert loaded.sha256 == told["field_sha256"]
    assert loaded.report["rms"] == pytest.approx(told["rms"])


def test_a_field_remembers_its_samples(program, data, tmp_path):
    scan, saved = data / "head.nii.gz", str(tmp_path / "field.iclay")
    image = nibabel.load(scan)
    for field in (isoclay.fit(scan, tolerance="8%"), isoclay.fit_volume(image, tolerance="8%")):
        field.save(saved)
        of_program(program, "check", saved, str(scan))
    voxels = np.asarray(image.dataobj).copy()
    voxels[3, 4, 5] += 1
    isoclay.fit_volume(voxels, image.affine, unit="mm", tolerance="8%").save(saved)
    done = subprocess.run([program, "check", saved, scan], capture_output=True, text=True)
    assert done.returncode == 2 and "other samples" in done.stderr


def test_an_image_gives_the_hash_of_its_file(program, data, tmp_path):
    path = data / "head.nii.gz"
    told = of_program(program, "fit", str(path), "-o", str(tmp_path / "f.iclay"), "--tolerance", "4%")
    field = isoclay.fit_volume(nibabel.load(path), tolerance="4%")
    assert field.sha256 == told["field_sha256"]
    assert field.unit == "mm"


def test_scaled_images_are_fitted_in_their_own_unit(program, tmp_path):
    image = nibabel.Nifti1Image(blob((24, 20, 22)), np.diag([2, 2, 3, 1.0]))
    image.header.set_slope_inter(0.37, -11.5)
    nibabel.save(image, tmp_path / "v.nii")
    told = of_program(program, "fit", str(tmp_path / "v.nii"), "-o", str(tmp_path / "f.iclay"))
    assert isoclay.fit_volume(nibabel.load(tmp_path / "v.nii")).sha256 == told["field_sha256"]


def test_the_command_line_reads_what_python_writes(program, ball, tmp_path):
    ball.save(tmp_path / "ball.iclay")
    told = of_program(program, "mesh", str(tmp_path / "ball.iclay"), "-o", str(tmp_path / "ball.ply"))
    assert told["field_sha256"] == ball.sha256
    assert told["triangles"] == len(ball.mesh().triangles)


def test_threads_do_not_show(ball):
    points = sphere_points()
    for threads in (1, 2, 5):
        assert isoclay.fit_points(points, points, threads=threads).sha256 == ball.sha256


def test_clouds_come_from_other_libraries(ball):
    points = sphere_points()
    open3d = SimpleNamespace(points=points.tolist(), normals=points.tolist())
    pyvista = SimpleNamespace(points=points, point_data={"Normals": points})
    trimesh = SimpleNamespace(vertices=points, vertex_normals=points)
    for cloud in (open3d, pyvista, trimesh):
        assert isoclay.fit_points(cloud).sha256 == ball.sha256


def test_meshes_come_from_other_libraries(ball):
    mesh = ball.mesh(triangles=2000)
    padded = np.hstack([np.full((len(mesh.triangles), 1), 3), mesh.triangles]).ravel()
    trimesh = SimpleNamespace(vertices=mesh.vertices, faces=mesh.triangles.astype(np.int64))
    pyvista = SimpleNamespace(points=mesh.vertices, faces=padded)
    pyvista.triangulate = lambda: pyvista
    open3d = SimpleNamespace(vertices=mesh.vertices, triangles=mesh.triangles.astype(np.int32))
    hashes = {isoclay.fit_mesh(m).sha256 for m in (mesh, trimesh, pyvista, open3d, (mesh.vertices, mesh.triangles))}
    assert len(hashes) == 1
    field = isoclay.fit_mesh(mesh)
    assert field.source == "mesh"
    assert field([0, 0, 0.9]) == pytest.approx(0.1, abs=0.01)


def test_normals_are_estimated_when_asked(ball):
    points = sphere_points()
    with pytest.raises(ValueError, match="unoriented='winding'"):
        isoclay.fit_points(points)
    field = isoclay.fit_points(points, unoriented="winding")
    assert field.report["signs"]["route"] == "winding number"
    assert field([0, 0, 0.9]) > 0 > field([0, 0, 1.1])


def test_neither_layout_nor_type_of_a_volume_shows():
    whole = blob((30, 26, 28))
    affine = np.array([[0, -1.5, 0, 4], [2, 0, 0, 5], [0, 0, 1, -6], [0, 0, 0, 1.0]])
    first = isoclay.fit_volume(whole, affine).sha256
    same = [
        np.asfortranarray(whole),
        whole.astype(np.float32),
        np.asfortranarray(whole, dtype=np.float32),
        whole.astype(np.int32),
        whole.astype(">i2"),
        np.repeat(whole, 2, axis=1)[:, ::2],
    ]
    for volume in same:
        assert isoclay.fit_volume(volume, affine).sha256 == first
    turned = whole.transpose(2, 1, 0)
    assert isoclay.fit_volume(turned, affine, order="zyx").sha256 == first
    assert isoclay.fit_volume(np.ascontiguousarray(turned), affine, order="zyx").sha256 == first


def test_voxels_lie_where_the_affine_says():
    whole = blob((20, 24, 22))
    affine = np.array([[0, -1.5, 0, 4], [2, 0, 0, 5], [0, 0, 1, -6], [0, 0, 0, 1.0]])
    field = isoclay.fit_volume(whole, affine, method="interpolate")
    for i, j, k in [(3, 5, 7), (19, 0, 21), (10, 12, 11)]:
        world = (affine @ [i, j, k, 1])[:3]
        assert field(world) == pytest.approx(whole[i, j, k], abs=0.05)


def test_tolerances_have_units():
    points = sphere_points()
    in_mm = isoclay.fit_points(points, points, tolerance="10 mm", unit="m")
    assert in_mm.report["tolerance"] == pytest.approx(0.01)
    share = isoclay.fit_points(points, points, tolerance="1%")
    assert share.report["tolerance"] == pytest.approx(0.01 * np.linalg.norm(np.ptp(points, axis=0)))
    with pytest.raises(ValueError, match="unit"):
        isoclay.fit_points(points, points, tolerance="1mm")
    with pytest.raises(ValueError, match="0.1%"):
        isoclay.fit_points(points, points, tolerance="much")


@pytest.mark.parametrize(
    ("call", "error", "told"),
    [
        (lambda: isoclay.fit_points(np.zeros((4, 3)), np.ones((4, 3))), isoclay.errors.NotEnoughSamples, "at least"),
        (lambda: isoclay.fit_points(np.zeros((4, 2))), ValueError, r"\(n, 3\)"),
        (lambda: isoclay.fit_points(sphere_points(), np.ones((2, 3))), ValueError, "one each"),
        (lambda: isoclay.fit_points(sphere_points(), sphere_points(), coefficients=5), isoclay.errors.BadOption, "42875"),
        (lambda: isoclay.fit_points(sphere_points(), sphere_points(), threads=0), ValueError, "1 or more"),
        (lambda: isoclay.fit_points(sphere_points(), sphere_points(), memory=1000), MemoryError, "ceiling"),
        (lambda: isoclay.fit_volume(np.full((8, 8, 8), np.nan)), isoclay.errors.Degenerate, "not finite"),
        (lambda: isoclay.fit_volume(np.zeros((8, 8, 8)), np.zeros((4, 4))), ValueError, "last row"),
        (lambda: isoclay.fit_volume(np.zeros((8, 8))), ValueError, "three axes"),
        (lambda: isoclay.fit_volume(np.zeros((8, 8, 8), complex)), TypeError, "real numbers"),
        (lambda: isoclay.fit_volume(np.zeros((8, 8, 8)), order="kji"), ValueError, "'zyx'"),
        (lambda: isoclay.fit_mesh(([[0, 0, 0]], [[0, 1, 2]])), ValueError, "corner 1"),
        (lambda: isoclay.fit("/not/there.ply"), OSError, "there.ply"),
    ],
)
def test_what_is_wrong_is_named(call, error, told):
    with pytest.raises(error, match=told):
        call()
