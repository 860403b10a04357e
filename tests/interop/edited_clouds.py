"""Edits LAS, LAZ and E57 clouds in documents and reads what is exported with laspy and pye57: points that were not edited keep all they have.

  pip install -r tests/interop/requirements.txt
  python tests/interop/edited_clouds.py target/release/isoclay DIRECTORY"""
import pathlib
import subprocess
import sys

import laspy
import numpy as np
import pye57
from laspy.vlrs.vlrlist import VLRList

program, directory = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2])
directory.mkdir(parents=True, exist_ok=True)


def isoclay(*arguments):
    done = subprocess.run([program, *arguments], cwd=directory, capture_output=True, text=True)
    assert done.returncode == 0, (arguments, done.stderr)


# A ball with a colour, a time and an intensity for each point.
count, middle, radius = 20_000, np.array([100.0, 50.0, -30.0]), 20.0
rng = np.random.default_rng(1)
normals = rng.normal(size=(count, 3))
normals /= np.linalg.norm(normals, axis=1)[:, None]

for point_format, version in ((3, '1.2'), (7, '1.4')):
    header = laspy.LasHeader(point_format=point_format, version=version)
    header.scales, header.offsets = [0.0001] * 3, [100.0, 0.0, 0.0]
    header.add_extra_dims([laspy.ExtraBytesParams(f'Normal{axis}', np.float32) for axis in 'XYZ'])
    cloud = laspy.LasData(header)
    cloud.xyz = middle + radius * normals
    for axis, column in zip('XYZ', normals.T):
        cloud[f'Normal{axis}'] = column.astype(np.float32)
    cloud.intensity, cloud.gps_time = rng.integers(0, 60_000, count), rng.uniform(0, 1e6, count)
    cloud.red, cloud.classification = rng.integers(0, 65_536, count), rng.integers(0, 30, count)
    cloud.return_number = cloud.number_of_returns = np.ones(count, np.uint8)
    if version == '1.4':
        cloud.evlrs = VLRList([laspy.VLR('isoclay', 7, 'kept', b'behind the points')])
    for suffix in ('las', 'laz'):
        name = f'cloud_{point_format}.{suffix}'
        cloud.write(directory / name)
        isoclay('fit', name, '-o', f'{name}.iclay')
        isoclay('new', f'{name}.isoclay', f'{name}.iclay')
        isoclay('export', f'{name}.isoclay', '--like', name, '-o', f'same_{name}')
        assert (directory / name).read_bytes() == (directory / f'same_{name}').read_bytes(), name
        top = (middle + [0, 0, radius]).tolist()
        session = f'[[stroke]]\ninflate = {{ along = [{top}], radius = 8, by = 1 }}\n'
        (directory / 'inflate.toml').write_text(session)
        isoclay('sculpt', f'{name}.isoclay', '--script', 'inflate.toml')
        isoclay('export', f'{name}.isoclay', '--like', name, '-o', f'out_{name}')
        old, new = (laspy.read(directory / f) for f in (name, f'out_{name}'))
        assert new.header.are_points_compressed == (suffix == 'laz'), name
        shift = np.linalg.norm(new.xyz[:count] - old.xyz, axis=1)
        far = np.linalg.norm(old.xyz - top, axis=1) > 12
        assert (shift[far] == 0).all() and 0.8 < shift.max() < 1.2, (name, shift[far].max(), shift.max())
        assert np.array_equal(new.points.array[:count][far], old.points.array[far]), name
        for kept in ('intensity', 'gps_time', 'red', 'classification'):
            assert np.array_equal(new[kept][:count], old[kept]), (name, kept)
        assert new.header.point_count == len(new.points) and np.allclose(new.header.maxs, new.xyz.max(axis=0)), name
        if version == '1.4':
            assert new.evlrs[0].record_data_bytes() == b'behind the points', name

# Two scans in metres, the second from a place of its own, that share the ball between them. Its edit is in the second.
turn = np.array([0.5 ** 0.5, 0, 0, 0.5 ** 0.5])
place = np.array([2.0, -1.0, 0.5])
upper = normals[:, 2] > -0.2
halves = [(normals[~upper], None, None), (normals[upper], turn, place)]
name = 'cloud.e57'
(directory / name).unlink(missing_ok=True)
file = pye57.E57(str(directory / name), mode='w')
for points, rotation, translation in halves:
    local = points.copy()
    if rotation is not None:
        local = (points - place) @ np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    n = len(local)
    scan = {f'cartesian{axis}': column for axis, column in zip('XYZ', np.ascontiguousarray(local.T))}
    scan |= {'intensity': rng.uniform(0, 1, n), 'rowIndex': np.arange(n) // 100, 'columnIndex': np.arange(n) % 100}
    scan |= {f'color{c}': rng.integers(0, 256, n) for c in ('Red', 'Green', 'Blue')}
    file.write_scan_raw(scan, rotation=rotation, translation=translation)
file.close()
isoclay('fit', name, '-o', 'e57.iclay', '--unoriented')
isoclay('new', 'e57.isoclay', 'e57.iclay')
isoclay('export', 'e57.isoclay', '--like', name, '-o', 'same.e57')
assert (directory / name).read_bytes() == (directory / 'same.e57').read_bytes()
(directory / 'inflate.toml').write_text('[[stroke]]\ninflate = { along = [[0, 0, 1000]], radius = 400, by = 50 }\n')
isoclay('sculpt', 'e57.isoclay', '--script', 'inflate.toml')
isoclay('export', 'e57.isoclay', '--like', name, '-o', 'out.e57')
old, new = (pye57.E57(str(directory / f)) for f in (name, 'out.e57'))
assert new.scan_count == 2
for i in range(2):
    before, after = old.read_scan_raw(i), new.read_scan_raw(i)
    assert list(before) == list(after)
    n = len(before['cartesianX'])
    xyz = [np.stack([scan[f'cartesian{axis}'][:n] for axis in 'XYZ'], axis=1) for scan in (before, after)]
    shift = np.linalg.norm(xyz[1] - xyz[0], axis=1)
    far = np.linalg.norm(halves[i][0] - [0, 0, 1], axis=1) > 0.7
    assert (shift[far] == 0).all() and (shift.max() > 0.04) == (i == 1), (i, shift.max())
    for key in before:
        if not key.startswith('cartesian'):
            assert np.array_equal(before[key], after[key][:n]), (i, key)
    head = new.get_header(i)
    assert head.point_count == len(after['cartesianX'])
    # pye57 takes its bounds before it rounds, and turns them.
    bounds = [after['cartesianX'].min(), after['cartesianZ'].max()]
    assert i == 0 or np.array_equal([head.xMinimum, head.zMaximum], bounds), bounds

print('edited clouds: LAS, LAZ and E57 come back with the points and attributes that were not edited')
