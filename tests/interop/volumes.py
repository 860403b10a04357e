"""Reads our volumes with SimpleITK, pynrrd, nibabel and VTK and compares voxels and geometry.

  pip install -r tests/interop/requirements.txt
  cargo run --release -p formats --example write_volumes -- DIRECTORY
  python tests/interop/volumes.py DIRECTORY"""
import json
import pathlib
import sys

import nibabel
import nrrd
import numpy as np
import SimpleITK as sitk
import vtk
from vtk.util.numpy_support import vtk_to_numpy

DIMS = (71, 53, 37)
x, y, z = np.meshgrid(*map(np.arange, DIMS), indexing='ij')
LPS = np.diag([-1.0, -1.0, 1.0])


def by_itk(path):
    i = sitk.ReadImage(str(path))
    matrix = LPS @ np.array(i.GetDirection()).reshape(3, 3) @ np.diag(i.GetSpacing())
    return sitk.GetArrayFromImage(i).transpose(2, 1, 0), matrix, LPS @ i.GetOrigin()


def by_nibabel(path):
    i = nibabel.load(path)
    assert i.header.get_xyzt_units()[0] == 'mm'
    return np.asanyarray(i.dataobj), i.affine[:3, :3], i.affine[:3, 3]


def by_nrrd(path):
    values, header = nrrd.read(str(path))
    assert header['space'] == 'right-anterior-superior' and header['space units'] == ['mm'] * 3
    return values, header['space directions'].T, header['space origin']


def by_vtk(path):
    reader = vtk.vtkXMLImageDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    assert reader.GetErrorCode() == 0
    i = reader.GetOutput()
    values = vtk_to_numpy(i.GetPointData().GetScalars()).reshape(i.GetDimensions()[::-1]).transpose(2, 1, 0)
    m = i.GetDirectionMatrix()
    direction = np.array([[m.GetElement(r, c) for c in range(3)] for r in range(3)])
    return values, direction @ np.diag(i.GetSpacing()), np.array(i.GetOrigin())


READERS = {'.nii': [by_nibabel, by_itk], '.gz': [by_nibabel, by_itk], '.nrrd': [by_nrrd, by_itk],
           '.mha': [by_itk], '.vti': [by_vtk]}

directory = pathlib.Path(sys.argv[1])
checks = 0
worst = {}
for path in sorted(directory.iterdir()):
    if path.suffix not in READERS:
        continue
    name, kind = path.name.split('.')[0].split('_')
    rows = np.array(json.loads((directory / f'{name}.json').read_text()))
    is_float = kind == 'float32'
    expected = (x + 0.25 * y - 3.5 * z if is_float else (x + 2 * y + 3 * z) % 251).astype(kind)
    for read in READERS[path.suffix]:
        values, matrix, origin = read(path)
        assert values.dtype == expected.dtype and (values == expected).all(), f'{path.name} by {read.__name__}'
        corners = np.array(np.meshgrid(*[[0, n - 1] for n in DIMS])).reshape(3, -1)
        error = np.abs((matrix - rows[:, :3]) @ corners + (np.asarray(origin) - rows[:, 3])[:, None]).max()
        # The affine of NIfTI-1 is in single precision: 3333.3 is known to 1.2e-4.
        limit = 3e-4 if '.nii' in path.name else 1e-6
        assert error <= limit, f'{path.name} by {read.__name__}: corners are {error} mm off'
        key = f'{path.suffix} {read.__name__}'
        worst[key] = max(worst.get(key, 0), error)
        checks += 1
assert checks == 80, checks
for key, error in sorted(worst.items()):
    print(f'{key:18} corners within {error:.1e} mm')
print(f'{checks} readings agree')
