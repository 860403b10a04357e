"""Edits LAS and LAZ clouds in documents and reads what is exported with laspy: points that were not edited keep all they have.

  pip install -r tests/interop/requirements.txt
  python tests/interop/edited_clouds.py target/release/isoclay DIRECTORY"""
import pathlib
import subprocess
import sys

import laspy
import numpy as np
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

print('edited clouds: LAS and LAZ come back with the points and attributes that were not edited')
