"""Reads the clouds of `write_scans` with other people's programs and compares every point and normal.

  cargo run --release -p formats --example write_scans -- DIR && python tests/interop/points.py DIR

Needs requirements.txt. Exits with an error that names the file and the difference."""
import json
import sys
from pathlib import Path

import laspy
import numpy as np
import plyfile
import pye57
from pypcd4 import PointCloud

folder = Path(sys.argv[1])
expected = json.loads((folder / 'expected.json').read_text())
normals = np.array(expected['normals'])


def ply(path):
    v = plyfile.PlyData.read(path)['vertex']
    return np.stack([v[c] for c in ('x', 'y', 'z', 'nx', 'ny', 'nz')], axis=1)


def pcd(path):
    return PointCloud.from_path(path).numpy(('x', 'y', 'z', 'normal_x', 'normal_y', 'normal_z'))


def las(path):
    las = laspy.read(path)
    keys = next(v for v in las.header.vlrs if v.record_id == 34735)
    units = [k.value_offset for k in keys.geo_keys if k.id == 3076]
    assert units == [9001], f'{path}: the unit of length is {units}, not metres'
    assert las.header.point_count == las.header.number_of_points_by_return[0] == len(normals)
    xyz = np.array(las.xyz)
    assert (las.header.mins <= xyz.min(0) + 1e-9).all() and (las.header.maxs >= xyz.max(0) - 1e-9).all(), path
    return np.column_stack([xyz, las.NormalX, las.NormalY, las.NormalZ])


def e57(path):
    file = pye57.E57(str(path))
    assert file.scan_count == 1
    # Its normals are of an extension that is known by name alone.
    names = {f'nor:normal{c}' for c in 'XYZ'}
    assert names <= set(file.get_header(0).point_fields), file.get_header(0).point_fields
    scan = file.read_scan_raw(0, ignore_unsupported_fields=True)
    xyz = np.stack([scan[f'cartesian{c}'] for c in 'XYZ'], axis=1)
    header = file.get_header(0)
    assert np.allclose([header.xMinimum, header.yMaximum], [xyz[:, 0].min(), xyz[:, 1].max()], rtol=0, atol=1e-9)
    return np.column_stack([xyz, normals])


# Reader, millimetres a unit, and the largest error allowed: half a step of what the format holds near and far.
float_step, laz_step = 26 * 2.0 ** -24, 0.5e-7
readers = [('ply', ply, 1, float_step, 0), ('pcd', pcd, 1, float_step, 0), ('xyz', np.loadtxt, 1, 0, 0),
           ('las', las, 1000, laz_step, laz_step), ('laz', las, 1000, laz_step, laz_step), ('e57', e57, 1000, 0, 0)]
for place in 'near', 'far':
    points = np.array(expected[place])
    for suffix, reader, scale, *allowed in readers:
        path = folder / f'cloud_{place}.{suffix}'
        found = np.asarray(reader(path), dtype=float)
        assert found.shape == (len(points), 6), f'{path}: {found.shape}'
        error = np.abs(scale * found[:, :3] - points).max()
        # Metres and back are two roundings of doubles.
        tolerance = allowed[place == 'far'] + (4 * np.spacing(np.abs(points).max()) if scale > 1 else 0)
        turned = np.abs(found[:, 3:] - normals).max()
        print(f'{path.name:16} error {error:.2g} mm, {tolerance:.2g} allowed; of normals {turned:.2g}')
        assert error <= tolerance, f'{path}: {error}'
        assert turned <= 1e-7, f'{path}: normals {turned}'
print('points: all read by others as they were written')
