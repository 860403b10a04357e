"""Documents and simulations."""

import pickle
import subprocess

import nibabel
import numpy as np
import pytest
from conftest import sphere_points

import isoclay

STROKE = {"add": {"shape": {"sphere": {"radius": 0.2}}, "along": [[0, 0, 1.0]]}}
SCENE = {
    "region": {"min": [-0.5, -0.5, 0.1], "max": [0.5, 0.5, 1.14], "level": 0},
    "material": {"mass": 0.05, "damping": 1.0},
    "pull": [{"at": [0.0, 0.0, 1.0], "radius": 0.12, "strength": 0.4}],
    "time": {"duration": 1.0, "step": 0.05},
}


@pytest.fixture
def document(ball, tmp_path):
    with isoclay.Document.new(tmp_path / "d.isoclay", {"ball": ball}) as document:
        yield document


def test_edits_are_made_undone_and_made_again(document, ball):
    assert document["ball"].sha256 == ball.sha256
    document.sculpt(STROKE)
    after = document["ball"]
    assert after([0, 0, 1.1]) > 0 > ball([0, 0, 1.1])
    assert [edit.is_done for edit in document.history] == [True]
    assert document.history[0].sha256 == document.sha256
    assert document.replay() == 1
    assert document.undo() == 1
    assert document["ball"].sha256 == ball.sha256
    assert document.undo() == 0
    assert document.redo() == 1
    assert document["ball"].sha256 == after.sha256


def test_objects_come_and_go(document, ball):
    document["other"] = ball
    assert document.names == ["ball", "other"]
    with pytest.raises(ValueError, match="object="):
        document.sculpt(STROKE)
    document.sculpt(STROKE, object="other")
    assert document["ball"].sha256 == ball.sha256 != document["other"].sha256
    del document["other"]
    assert "other" not in document
    with pytest.raises(isoclay.errors.DocumentProblem, match="other"):
        document["other"]


def test_the_command_line_goes_on_with_it(program, document, ball):
    document.sculpt(STROKE)
    expected = document["ball"].sha256
    with pytest.raises(isoclay.errors.DocumentProblem, match="open in another"):
        isoclay.Document(document.path)
    document.close()
    with pytest.raises(ValueError, match="closed"):
        document.sculpt(STROKE)
    subprocess.run([program, "replay", document.path], check=True, capture_output=True)
    subprocess.run([program, "undo", document.path], check=True, capture_output=True)
    with isoclay.Document(document.path) as again:
        assert again["ball"].sha256 == ball.sha256
        again.redo()
        assert again["ball"].sha256 == expected


def test_a_pickled_document_is_a_copy(document, ball):
    document.sculpt(STROKE)
    with pickle.loads(pickle.dumps(document)) as copy:
        assert copy.sha256 == document.sha256
        assert len(copy.history) == 1
        copy.undo()
        assert copy["ball"].sha256 == ball.sha256
    assert document["ball"].sha256 != ball.sha256


def test_a_scan_is_written_with_the_edits(program, data, tmp_path):
    scan = data / "head.nii.gz"
    with isoclay.Document.new(tmp_path / "h.isoclay", {"head": isoclay.fit(scan, tolerance="4%")}) as document:
        document.export("head", tmp_path / "same.nii", like=scan)
        images = [nibabel.load(path) for path in (scan, tmp_path / "same.nii")]
        assert np.array_equal(*(np.asarray(image.dataobj) for image in images))
        middle = document["head"].box.mean(axis=0).tolist()
        document.sculpt({"carve": {"shape": {"sphere": {"radius": 12.0}}, "along": [middle]}})
        notes = document.export("head", tmp_path / "carved.nii", like=scan, fill=-7)
        assert "voxels changed" in notes[0] and "-7" in notes[1]
        changed = np.asarray(nibabel.load(tmp_path / "carved.nii").dataobj) != np.asarray(images[0].dataobj)
        assert 1000 < changed.sum() < 20_000
        with pytest.raises(ValueError, match="give the whole scan"):
            document.export("head", tmp_path / "other.nii", like=tmp_path / "carved.nii")
        document["head"].mesh(resolution=8).save(tmp_path / "mesh.stl")
        with pytest.raises(ValueError, match="neither"):
            document.export("head", tmp_path / "other.stl", like=tmp_path / "mesh.stl")
        with pytest.raises(ValueError, match="like="):
            document.export("head", tmp_path / "other.iclay", fill=3)
        assert document.export("head", tmp_path / "field.iclay") == []
    call = [program, "export", tmp_path / "h.isoclay", "--like", scan, "--fill", "-7", "-o", tmp_path / "program.nii"]
    subprocess.run(call, check=True, capture_output=True)
    assert (tmp_path / "program.nii").read_bytes() == (tmp_path / "carved.nii").read_bytes()


def test_a_cloud_is_written_with_the_edits(tmp_path):
    points = sphere_points()
    np.savetxt(tmp_path / "ball.xyz", np.hstack([points, points]))
    field = isoclay.fit(tmp_path / "ball.xyz")
    with isoclay.Document.new(tmp_path / "b.isoclay", {"ball": field}) as document:
        document.sculpt(STROKE)
        notes = document.export("ball", tmp_path / "new.xyz", like=tmp_path / "ball.xyz")
        assert "points moved" in notes[0]
        assert np.loadtxt(tmp_path / "new.xyz")[:, 2].max() > 1.15
        document["late"] = field
        with pytest.raises(isoclay.errors.DocumentProblem, match="was not there"):
            document.export("late", tmp_path / "late.xyz", like=tmp_path / "ball.xyz")


def test_bad_scripts_are_named(document):
    with pytest.raises(isoclay.errors.BadScript, match="wrong"):
        document.sculpt({**STROKE, "wrong": 1})
    with pytest.raises(isoclay.errors.BadScript, match="line 1"):
        document.sculpt("[[stroke]")
    assert document.history == []


def test_formulas_become_splines_that_are_sculpted(document, ball):
    hollow = ball - ball.grown(-0.3)
    with pytest.raises(ValueError, match="baked"):
        document["hollow"] = hollow
    baked = hollow.baked(tolerance=0.005)
    surface = hollow.mesh(resolution=48).vertices
    values, gradients = baked.value_gradient(surface)
    assert np.percentile(np.abs(values) / np.linalg.norm(gradients, axis=1), 99) < 0.005
    assert baked([0, 0, 0]) < 0 < baked([0, 0.85, 0])
    document["hollow"] = baked
    assert document["hollow"].sha256 == baked.sha256


def test_scenes_are_played_step_by_step(ball):
    simulation = isoclay.Simulation(ball, SCENE)
    before = simulation.region
    assert before.positions.shape == (*before.densities.shape, 3)
    assert before.densities == pytest.approx(ball(before.positions), abs=1e-5)
    first = simulation.step()[0]
    assert (first["step"], first["time"]) == (1, 0.05)
    lines = simulation.run()
    assert simulation.is_over
    assert lines[-1]["time"] == 1.0
    assert len(lines) == 19
    assert np.abs(simulation.region.densities - before.densities).max() == pytest.approx(lines[-1]["max_change"])
    moved = simulation.field
    assert moved([0, 0, 1.0]) > ball([0, 0, 1.0]) + 1e-3
    again = isoclay.Simulation(ball, SCENE)
    assert len(list(again)) == 20
    assert again.field.sha256 == moved.sha256


def test_bad_scenes_are_named(ball):
    with pytest.raises(isoclay.errors.BadScript, match="duration"):
        isoclay.Simulation(ball, {**SCENE, "time": {"step": 0.1}})
    with pytest.raises(isoclay.errors.BadScript, match="line 2"):
        isoclay.Simulation(ball, 'field = ""\nregion = 3\n')
