"""Writes the files of this folder with other people's programs: nibabel, trimesh, Open3D, MeshLab.

  python make_fixtures.py        (nibabel 5.4, trimesh 5.2, open3d 0.20, pymeshlab)

The same numbers stand in tests/suite/other_writers.rs."""
import gzip
import nibabel as nib
import numpy as np
import open3d as o3d
import pymeshlab
import trimesh

# Volumes: voxel (x, y, z) of 5 x 4 x 3 holds x + 10 y + 100 z - 50.
x, y, z = np.mgrid[:5, :4, :3]
data = x + 10 * y + 100 * z - 50
turn = np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1.0]])
oblique = np.eye(4)
oblique[:3, :3] = turn @ np.diag([1.5, 2.0, -3.0])
oblique[:3, 3] = [-10.25, 20.5, 30.75]


def save(image, name, sform=True):
    image.header.set_xyzt_units('mm')
    image.set_sform(oblique, 1 if sform else 0)
    image.set_qform(oblique, 1)
    nib.save(image, name)


save(nib.Nifti1Image(data.astype(np.int16), oblique), 'int16_nibabel.nii')
save(nib.Nifti1Image(data.astype(np.float32), oblique), 'float32_nibabel.nii.gz')
save(nib.Nifti2Image(data.astype(np.float64), oblique), 'float64_nibabel_nifti2.nii')
big = nib.Nifti1Image(data.astype('>i4'), oblique, nib.Nifti1Header(endianness='>'))
big.set_data_dtype('>i4')
save(big, 'int32_big_endian_nibabel.nii', sform=False)
scaled = nib.Nifti1Image(data.astype(np.float64) * 0.5, oblique)
scaled.set_data_dtype(np.uint8)  # nibabel chooses slope and intercept
save(scaled, 'uint8_rescaled_nibabel.nii')

# Meshes: a box of 2 x 3 x 4 about (10, 20, 30); by symmetry its vertex normals point along (+-1, +-1, +-1),
# three right angles each.
box = trimesh.creation.box((2, 3, 4))
box.apply_translation((10, 20, 30))
bare = trimesh.Trimesh(box.vertices, box.faces, process=False)
open('box_trimesh.ply', 'wb').write(bare.export(file_type='ply', vertex_normal=False))
open('box_ascii_trimesh.ply', 'wb').write(bare.export(file_type='ply', encoding='ascii', vertex_normal=False))
open('box_trimesh.obj', 'w').write(bare.export(file_type='obj', include_normals=False))
gzip.GzipFile('box_trimesh.obj.gz', 'wb', mtime=0).write(open('box_trimesh.obj', 'rb').read())

mesh = o3d.geometry.TriangleMesh(
    o3d.utility.Vector3dVector(box.vertices), o3d.utility.Vector3iVector(box.faces))
mesh.vertex_normals = o3d.utility.Vector3dVector(np.sign(box.vertices - [10, 20, 30]) / np.sqrt(3))
o3d.io.write_triangle_mesh('box_open3d.obj', mesh, write_vertex_normals=True)
cloud = o3d.geometry.PointCloud(mesh.vertices)
cloud.normals = mesh.vertex_normals
cloud.colors = o3d.utility.Vector3dVector(np.tile([1.0, 0.5, 0.0], (8, 1)))
o3d.io.write_point_cloud('points_open3d.ply', cloud)
o3d.io.write_point_cloud('points_ascii_open3d.ply', cloud, write_ascii=True)
o3d.io.write_point_cloud('points_open3d.xyzn', cloud)

ms = pymeshlab.MeshSet()
ms.add_mesh(pymeshlab.Mesh(box.vertices, box.faces, v_normals_matrix=np.sign(box.vertices - [10, 20, 30])))
ms.save_current_mesh('box_meshlab.ply', save_vertex_normal=True, save_vertex_color=True, save_vertex_quality=True)
ms.save_current_mesh('box_meshlab.obj', save_vertex_normal=True)
