"""Reads the meshes of `write_scans` with other people's programs and compares every corner of every triangle.

  cargo run --release -p formats --example write_scans -- DIR && python tests/interop/meshes.py DIR

Needs requirements.txt. Exits with an error that names the file and the difference."""
import json
import sys
from pathlib import Path

import lib3mf
import numpy as np
import plyfile
import pymeshlab
import trimesh

folder = Path(sys.argv[1])
expected = json.loads((folder / 'expected.json').read_text())
faces = np.array(expected['triangles'])


def with_trimesh(path):
    mesh = trimesh.load(path, process=False, force='mesh')
    return np.array(mesh.vertices), np.array(mesh.faces), mesh


def with_meshlab(path):
    ms = pymeshlab.MeshSet()
    ms.load_new_mesh(str(path))
    mesh = ms.current_mesh()
    return mesh.transformed_vertex_matrix(), mesh.face_matrix(), None


def with_lib3mf(path):
    model = lib3mf.get_wrapper().CreateModel()
    reader = model.QueryReader('3mf')
    reader.SetStrictModeActive(True)
    reader.ReadFromFile(str(path))
    assert reader.GetWarningCount() == 0, [reader.GetWarning(i) for i in range(reader.GetWarningCount())]
    assert model.GetUnit() == lib3mf.ModelUnit.MilliMeter, model.GetUnit()
    objects = model.GetMeshObjects()
    assert objects.MoveNext()
    mesh = objects.GetCurrentMeshObject()
    assert mesh.IsValid() and mesh.IsManifoldAndOriented()
    vertices = np.array([list(v.Coordinates) for v in mesh.GetVertices()])
    return vertices, np.array([list(t.Indices) for t in mesh.GetTriangleIndices()]), None


def with_plyfile(path):
    ply = plyfile.PlyData.read(path)
    v = ply['vertex']
    colors = np.stack([v['red'], v['green'], v['blue']], axis=1)
    assert (colors == expected['colors']).all(), path
    return np.stack([v['x'], v['y'], v['z']], axis=1), np.stack(ply['face']['vertex_indices']), None


# Reader, millimetres a unit of what it gives, and whether it keeps doubles far from the origin.
readers = [
    ('ply', with_plyfile, 1, True), ('ply', with_trimesh, 1, True), ('ply', with_meshlab, 1, True),
    ('stl', with_trimesh, 1, False), ('stl', with_meshlab, 1, False),
    ('obj', with_trimesh, 1, True), ('obj', with_meshlab, 1, True),
    ('glb', with_trimesh, 1000, True), ('gltf', with_trimesh, 1000, True), ('glb', with_meshlab, 1000, True),
    ('3mf', with_lib3mf, 1, False), ('3mf', with_trimesh, 1, True), ('3mf', with_meshlab, 1, False),
    ('wrl', with_meshlab, 1, False),
]
for place in 'near', 'far':
    corners = np.array(expected[place])[faces]
    for suffix, reader, scale, keeps_doubles in readers:
        path = folder / f'mesh_{place}.{suffix}'
        vertices, triangles, mesh = reader(path)
        found = scale * vertices[triangles]
        assert found.shape == corners.shape, f'{path} by {reader.__name__}: {found.shape}'
        # Half a step of single precision at the size of the thing, or of its distance.
        size = 26 if place == 'near' or keeps_doubles else 5.4e6
        tolerance = size * 2.0 ** -23
        error = np.abs(found - corners).max()
        print(f'{path.name:16} {reader.__name__:14} error {error:.2g} mm, {tolerance:.2g} allowed')
        assert error <= tolerance, f'{path} by {reader.__name__}: {error}'
        if suffix in ('glb', 'gltf') and mesh is not None:
            assert (mesh.visual.vertex_colors[:, :3] == expected['colors']).all(), path
print('meshes: all read by others as they were written')
