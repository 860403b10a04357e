"""Writes the volumes of this folder with other people's programs and what those programs read back from them.

  python make_fixtures.py        (SimpleITK 2.5.7, pynrrd 1.1.3, tifffile 2026.3.3, numpy 2.4.6)

expected.json: for each file the number of voxels along x, y, z, the rows of the map from voxels to RAS world, and all
values, x fastest. Geometry and values are those that SimpleITK or tifffile gives, not those that were put in."""
import gzip
import json
import os
import shutil
import sys

import nrrd
import numpy as np
import SimpleITK as sitk
import tifffile

os.chdir(os.path.dirname(os.path.abspath(__file__)))
z, y, x = np.mgrid[:3, :4, :5]
data = x + 10 * y + 100 * z - 50
c, s, d, t = np.cos(0.3), np.sin(0.3), np.cos(0.2), np.sin(0.2)
turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, d, -t], [0, t, d]])
turn[:, 2] *= -1
spacing, origin = np.array([0.7, 1.1, 2.3]), np.array([-10.25, 20.1, 1 / 3])
expected = {}


def image(values):
    i = sitk.GetImageFromArray(values)
    i.SetDirection(turn.ravel())
    i.SetSpacing(spacing)
    i.SetOrigin(origin)
    return i


def expect(name, values, matrix, offset):
    rows = np.column_stack([matrix, offset]).tolist()
    expected[name] = {'dims': list(values.shape[::-1]), 'rows': rows, 'values': values.ravel().tolist()}


def by_itk(name):
    i = sitk.ReadImage(name)
    lps = np.diag([-1, -1, 1.0])
    matrix = lps @ np.array(i.GetDirection()).reshape(3, 3) @ np.diag(i.GetSpacing())
    expect(name, sitk.GetArrayFromImage(i), matrix, lps @ i.GetOrigin())


# MetaImage, NRRD and NIfTI by ITK.
for name, dtype, packed in [
        ('int16_zlib_itk.mha', np.int16, True), ('float64_itk.mha', np.float64, False),
        ('uint8_zraw_itk.mhd', np.uint8, True), ('int32_raw_itk.mhd', np.int32, False),
        ('float32_gzip_itk.nrrd', np.float32, True), ('uint16_raw_itk.nhdr', np.uint16, False),
        ('int16_gzip_itk.nhdr', np.int16, True), ('int16_itk.hdr', np.int16, False)]:
    source = data - data.min() if np.dtype(dtype).kind == 'u' else data
    source = source % 256 if dtype == np.uint8 else source
    sitk.WriteImage(image(source.astype(dtype)), name, packed)
    by_itk(name)

# What ITK reads and does not write: big endian, a pattern and a list of files, voxels at the end of a file,
# mirrored orientation letters that say nothing.
geometry = ('TransformMatrix = ' + ' '.join(map(repr, turn.T.ravel().tolist())) + '\nOffset = '
            + ' '.join(map(repr, origin.tolist())) + '\nCenterOfRotation = 5 6 7\nAnatomicalOrientation = RAS\n'
            'ElementSpacing = ' + ' '.join(map(repr, spacing.tolist())) + '\nDimSize = 5 4 3\n')
start = 'ObjectType = Image\nNDims = 3\nBinaryData = True\n'
for name, head, voxels, where in [
        ('int16_big_endian.mha', 'BinaryDataByteOrderMSB = True\n', '>i2', 'LOCAL'),
        ('int16_pattern.mhd', 'ElementByteOrderMSB = False\n', '<i2', 'slice_%02d.raw 7 11 2'),
        ('int16_list.mhd', 'ElementByteOrderMSB = False\n', '<i2', 'LIST\nslice_11.raw\nslice_09.raw\nslice_07.raw'),
        ('int16_at_end.mha', 'BinaryDataByteOrderMSB = False\nHeaderSize = -1\n', '<i2', 'LOCAL')]:
    body = data.astype(voxels).tobytes()
    with open(name, 'wb') as f:
        f.write((start + head + geometry + f'ElementType = MET_SHORT\nElementDataFile = {where}\n').encode())
        if where == 'LOCAL':
            f.write((b'padding' if 'at_end' in name else b'') + body)
    for k in range(3):
        data[k].astype('<i2').tofile(f'slice_{7 + 2 * k:02d}.raw')
    by_itk(name)

# NRRD by pynrrd; x is the first axis there. Values by SimpleITK again, but where it has no notion of a space.
matrix = turn @ np.diag(spacing)
for name, dtype, encoding, endian, space in [
        ('float64_big_endian_pynrrd.nrrd', '>f8', 'raw', 'big', 'left-posterior-superior'),
        ('int16_text_pynrrd.nrrd', '<i2', 'text', 'little', 'right-anterior-superior'),
        ('uint32_gzip_big_endian_pynrrd.nrrd', '>u4', 'gzip', 'big', 'left-anterior-superior')]:
    source = data - data.min() if 'u' in dtype else data
    header = {'space': space, 'space directions': matrix.T, 'space origin': origin, 'encoding': encoding,
              'endian': endian, 'kinds': ['domain'] * 3, 'space units': ['mm'] * 3}
    nrrd.write(name, source.astype(dtype).transpose(2, 1, 0), header, compression_level=9)
    by_itk(name)
header = {'spacings': spacing, 'units': ['cm'] * 3, 'encoding': 'raw'}
nrrd.write('int8_spacings_pynrrd.nrrd', (data % 100).astype(np.int8).transpose(2, 1, 0), header)
back, _ = nrrd.read('int8_spacings_pynrrd.nrrd')
expect('int8_spacings_pynrrd.nrrd', back.transpose(2, 1, 0), np.diag(spacing * 10), [0, 0, 0])

# TIFF by tifffile.
known = dict(imagej=True, resolution=(1 / 0.25, 1 / 0.5), metadata={'unit': 'mm', 'spacing': 2.5, 'axes': 'ZYX'})
grey = dict(photometric='minisblack')
wide = np.concatenate([np.concatenate([data] * 5, 2)] * 5, 1)  # 25 x 20: more than one tile
for name, values, options in [
        ('uint16_imagej.tif', (data - data.min()).astype(np.uint16), known),
        ('float32_big_endian_imagej.tif', data.astype(np.float32), dict(known, byteorder='>')),
        ('float32_bigtiff_deflate_float_predictor.tif', data.astype(np.float32),
         dict(grey, bigtiff=True, compression='zlib', predictor=3)),
        ('float64_strips_deflate.tif', data.astype(np.float64), dict(grey, compression='zlib', rowsperstrip=3)),
        ('int16_big_endian_lzw_predictor.tif', data.astype(np.int16),
         dict(grey, byteorder='>', compression='lzw', predictor=2)),
        ('uint8_tiles_lzw.tif', (wide % 256).astype(np.uint8), dict(grey, compression='lzw', tile=(16, 16))),
        ('int32_tiles_deflate_predictor.tif', wide.astype(np.int32),
         dict(grey, compression='zlib', predictor=2, tile=(16, 16))),
        ('int8_packbits.tif', (data % 100).astype(np.int8), dict(grey, compression='packbits'))]:
    tifffile.imwrite(name, values, **options)
    lengths = [0.25, 0.5, 2.5] if 'imagej' in name else [1, 1, 1]
    expect(name, tifffile.imread(name), np.diag(lengths), [0, 0, 0])

# ImageJ's own form beyond 4 GB: one page, the voxels of the others behind it.
with tifffile.TiffWriter('uint16_one_page_imagej.tif', byteorder='>') as f:
    f.write((data - data.min())[0].astype('>u2'), resolution=(2, 4), resolutionunit=1, metadata=None,
            description='ImageJ=1.54f\nimages=3\nslices=3\nunit=micron\nspacing=3.0\nloop=false\n', **grey)
with tifffile.TiffFile('uint16_one_page_imagej.tif') as f:
    end = f.pages[0].dataoffsets[0] + f.pages[0].databytecounts[0]
with open('uint16_one_page_imagej.tif', 'r+b') as f:
    f.truncate(end)
    f.seek(end)
    f.write((data - data.min())[1:].astype('>u2').tobytes())
expect('uint16_one_page_imagej.tif', tifffile.imread('uint16_one_page_imagej.tif'),
       np.diag([0.5e-3, 0.25e-3, 3e-3]), [0, 0, 0])

shutil.rmtree('uint16_folder', ignore_errors=True)
os.mkdir('uint16_folder')
for k in range(3):
    tifffile.imwrite(f'uint16_folder/slice{8 + k}.tif', (data - data.min())[k].astype(np.uint16), **grey)
expect('uint16_folder', (data - data.min()).astype(np.uint16), np.eye(3), [0, 0, 0])

with open('int16_itk.nrrd.gz', 'wb') as f:
    sitk.WriteImage(image(data.astype(np.int16)), 'plain.nrrd', False)
    f.write(gzip.compress(open('plain.nrrd', 'rb').read(), mtime=0))
by_itk('plain.nrrd')
expected['int16_itk.nrrd.gz'] = expected.pop('plain.nrrd')
os.remove('plain.nrrd')

with open('expected.json', 'w') as f:
    json.dump(expected, f, indent=0)
print(sys.version.split()[0], sitk.Version.VersionString(), nrrd.__version__, tifffile.__version__, np.__version__)
