"""Writes the scans and meshes of this folder with other people's programs, and scans.json with what they hold.

  python make_scans.py    (laspy 2.7 with lazrs, pye57 0.4, pypcd4 1.5, open3d 0.20, trimesh 5.2, pymeshlab 2025.7,
                           lib3mf 2.5, plyfile 1.1)

Clouds are a helix far from the origin; meshes the box of make_fixtures.py."""
import ctypes
import json

import laspy
import lib3mf
import numpy as np
import open3d as o3d
import plyfile
import pye57
import pymeshlab
import trimesh
from pypcd4 import Encoding, MetaData, PointCloud

N = 30
t = np.arange(N) * 0.4
helix = np.stack([np.cos(t), np.sin(t), 0.1 * t], axis=1)
normals = np.stack([np.cos(t), np.sin(t), 0 * t], axis=1)
far = helix.round(3) + [1_000_000.0, 5_400_000.0, 120.0]
expected = {}


def points(name, positions, normals=None, unit='file unit', tolerance=0.0):
    expected[name] = dict(positions=np.asarray(positions).tolist(), unit=unit, tolerance=tolerance,
                          normals=None if normals is None else np.asarray(normals).tolist())


def mesh(name, vertices, faces, unit='file unit', tolerance=0.0, colors=None):
    expected[name] = dict(vertices=np.asarray(vertices).tolist(), faces=np.asarray(faces).tolist(), unit=unit,
                          tolerance=tolerance, colors=colors)


# PCD: pypcd4 writes what the header says, open3d with normals.
for encoding in Encoding.ASCII, Encoding.BINARY, Encoding.BINARY_COMPRESSED:
    name = f'helix_{encoding.value}_pypcd4.pcd'
    cloud = PointCloud.from_points(far, ('x', 'y', 'z'), (np.float64,) * 3)
    cloud.save(name, encoding=encoding)
    points(name, far, tolerance=1e-2 if encoding == Encoding.ASCII else 0)
o3 = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(helix))
o3.normals = o3d.utility.Vector3dVector(normals)
for name, options in [('helix_ascii_open3d.pcd', dict(write_ascii=True)), ('helix_open3d.pcd', {}),
                      ('helix_compressed_open3d.pcd', dict(compressed=True))]:
    o3d.io.write_point_cloud(name, o3, **options)
    points(name, helix, normals, tolerance=1e-6)

# LAS and LAZ: old and new point formats, other scales per axis, extra bytes, a coordinate system in metres.
for point_format, version in [(1, '1.2'), (3, '1.3'), (6, '1.4'), (7, '1.4')]:
    for suffix in 'las', 'laz':
        header = laspy.LasHeader(point_format=point_format, version=version)
        header.scales, header.offsets = [0.001, 0.01, 0.0001], [1e6, 5.4e6, 100.0]
        las = laspy.LasData(header)
        if point_format == 6:
            for axis in 'XYZ':
                las.add_extra_dim(laspy.ExtraBytesParams(f'Normal{axis}', 'f4'))
        las.x, las.y, las.z = far.T
        las.intensity = np.arange(N)
        if point_format == 6:
            las.NormalX, las.NormalY, las.NormalZ = normals.T.astype(np.float32)
        name = f'helix_format{point_format}_laspy.{suffix}'
        las.write(name)
        points(name, np.array(las.xyz), normals if point_format == 6 else None, tolerance=1e-9)
header = laspy.LasHeader(point_format=0, version='1.2')
header.scales, header.offsets = [0.001] * 3, [1e6, 5.4e6, 100.0]
keys = np.array([1, 1, 0, 2, 1024, 0, 1, 1, 3076, 0, 1, 9001], dtype='<u2').tobytes()
header.vlrs.append(laspy.VLR('LASF_Projection', 34735, 'GeoTIFF keys', keys))
las = laspy.LasData(header)
las.x, las.y, las.z = far.T
las.write('helix_metres_laspy.laz')
points('helix_metres_laspy.laz', 1000 * far, unit='mm', tolerance=1e-6)

# E57 by libE57, in single precision: two scans, one of them moved by its pose, with points marked as invalid.
e57 = pye57.E57('scans_pye57.e57', mode='w')
half = 0.5 ** 0.5
for k, (rotation, translation) in enumerate([([1, 0, 0, 0], [0, 0, 0]), ([half, 0, 0, half], [1e6, 5.4e6, 120])]):
    state = np.zeros(N, dtype=np.uint8)
    state[3 * k] = 2
    e57.write_scan_raw(dict(cartesianX=helix[:, 0], cartesianY=helix[:, 1], cartesianZ=helix[:, 2],
                            cartesianInvalidState=state), name=f'station {k}',
                       rotation=np.array(rotation, float), translation=np.array(translation, float))
e57.close()
turned = np.stack([-helix[:, 1], helix[:, 0], helix[:, 2]], axis=1) + [1e6, 5.4e6, 120]
both = np.concatenate([np.delete(helix, 0, 0), np.delete(turned, 3, 0)])
points('scans_pye57.e57', 1000 * both, unit='mm', tolerance=1e-4)

# Meshes.
box = trimesh.creation.box((2, 3, 4))
box.apply_translation((10, 20, 30))
box = trimesh.Trimesh(box.vertices, box.faces, process=False)
for name, kind in [('box_ascii_trimesh.stl', 'stl_ascii'), ('box_trimesh.stl', 'stl'), ('box_trimesh.glb', 'glb')]:
    content = box.export(file_type=kind)
    open(name, 'wb').write(content.encode() if isinstance(content, str) else content)
    mm = 1000 if name.endswith('glb') else 1
    mesh(name, mm * box.vertices, box.faces, unit='mm' if mm > 1 else 'file unit')
for name, content in box.export(file_type='gltf').items():
    open('box_trimesh.gltf' if name.endswith('.gltf') else name, 'wb').write(content)
mesh('box_trimesh.gltf', 1000 * box.vertices, box.faces, unit='mm')

# 3MF by the reference implementation: inches, a component in a component, each moved and turned.
wrapper = lib3mf.get_wrapper()
model = wrapper.CreateModel()
model.SetUnit(lib3mf.ModelUnit.Inch)
part = model.AddMeshObject()
part.SetGeometry([lib3mf.Position((ctypes.c_float * 3)(*v)) for v in box.vertices],
                 [lib3mf.Triangle((ctypes.c_uint32 * 3)(*f)) for f in box.faces])


def transform(m):
    result = lib3mf.Transform()
    for row in range(4):
        for column in range(3):
            result.Fields[row][column] = m[column][row]
    return result


turn = trimesh.transformations.rotation_matrix(np.pi / 2, [0, 0, 1]).round(12)
shift = trimesh.transformations.translation_matrix([5, 6, 7])
inner = model.AddComponentsObject()
inner.AddComponent(part, transform(turn))
outer = model.AddComponentsObject()
outer.AddComponent(inner, transform(shift))
outer.AddComponent(part, wrapper.GetIdentityTransform())
model.AddBuildItem(outer, transform(turn))
model.QueryWriter('3mf').WriteToFile('boxes_inch_lib3mf.3mf')
moved = trimesh.transform_points(box.vertices, turn @ shift @ turn)
moved = np.concatenate([moved, trimesh.transform_points(box.vertices, turn)])
mesh('boxes_inch_lib3mf.3mf', 25.4 * moved, np.concatenate([box.faces, box.faces + 8]), unit='mm', tolerance=1e-4)

# PLY of the other byte order.
for order, name in [('>', 'box_big_endian_plyfile.ply'), ('<', 'box_little_endian_plyfile.ply')]:
    vertex = np.array([tuple(v) + (200, 100, 50) for v in box.vertices],
                      dtype=[(c, 'f8') for c in 'xyz'] + [(c, 'u1') for c in ('red', 'green', 'blue')])
    face = np.array([(f,) for f in box.faces], dtype=[('vertex_indices', 'i4', (3,))])
    elements = [plyfile.PlyElement.describe(vertex, 'vertex'), plyfile.PlyElement.describe(face, 'face')]
    plyfile.PlyData(elements, byte_order=order).write(name)
    mesh(name, box.vertices, box.faces, colors=[[200, 100, 50]] * 8)

o3box = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(box.vertices), o3d.utility.Vector3iVector(box.faces))
o3box.compute_triangle_normals()
o3d.io.write_triangle_mesh('box_open3d.stl', o3box)
mesh('box_open3d.stl', box.vertices, box.faces)
colors = np.linspace(0, 1, 24).reshape(8, 3)
o3box.vertex_colors = o3d.utility.Vector3dVector(colors)
o3d.io.write_triangle_mesh('box_colors_open3d.glb', o3box)
mesh('box_colors_open3d.glb', 1000 * box.vertices, box.faces, unit='mm')

# A scene: two boxes, one turned, mirrored and moved, in nodes inside of nodes.
scene = trimesh.Scene()
small = trimesh.Trimesh(box.vertices, box.faces, process=False)
scene.add_geometry(small, node_name='a', geom_name='box')
place = trimesh.transformations.compose_matrix(scale=[-1, 2, 1], angles=[0.1, 0.2, 0.3], translate=[100, 0, 0])
scene.add_geometry(small, node_name='b', geom_name='box', parent_node_name='a', transform=place)
open('scene_trimesh.glb', 'wb').write(scene.export(file_type='glb'))
both = scene.to_geometry() if hasattr(scene, 'to_geometry') else scene.dump(concatenate=True)
mesh('scene_trimesh.glb', 1000 * both.vertices, both.faces, unit='mm', tolerance=1e-2)

ms = pymeshlab.MeshSet()
ms.add_mesh(pymeshlab.Mesh(box.vertices, box.faces))
for name in 'box_meshlab.wrl', 'box_meshlab.stl', 'box_meshlab.3mf':
    try:
        ms.save_current_mesh(name)
    except Exception as e:
        print(name, e)
        continue
    mesh(name, box.vertices, box.faces, unit='mm' if name.endswith('3mf') else 'file unit', tolerance=1e-6)

json.dump(expected, open('scans.json', 'w'))
