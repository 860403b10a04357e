"""Edits scans in documents and reads what is exported with nibabel and pydicom: geometry, tags and untouched voxels.

  pip install -r tests/interop/requirements.txt
  python tests/interop/edited.py target/release/isoclay DIRECTORY"""
import pathlib
import subprocess
import sys

import nibabel
import numpy as np
import pydicom
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.uid import (CTImageStorage, DeflatedExplicitVRLittleEndian, ExplicitVRLittleEndian,
                         ImplicitVRLittleEndian, RLELossless, generate_uid)

program, directory = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2])
directory.mkdir(parents=True, exist_ok=True)
OWN = {'SOPInstanceUID', 'SeriesInstanceUID', 'ImageType', 'SourceImageSequence', 'PixelData'}


def isoclay(*arguments):
    done = subprocess.run([program, *arguments], cwd=directory, capture_output=True, text=True)
    assert done.returncode == 0, (arguments, done.stderr)
    return done.stdout


def edited(scan, out, name):
    """Fits a scan, carves a ball out of the middle, exports; gives the middle and the reach of the ball in RAS."""
    isoclay('fit', scan, '-o', f'{name}.iclay')
    isoclay('new', f'{name}.isoclay', f'{name}.iclay', '--iso', '300')
    isoclay('export', f'{name}.isoclay', '--like', scan, '-o', f'same_{out}')
    session = '[[stroke]]\ncarve = { shape = { sphere = { radius = 6 } }, along = [[0, 0, 18]] }\n'
    (directory / 'carve.toml').write_text(session)
    isoclay('sculpt', f'{name}.isoclay', '--script', 'carve.toml')
    isoclay('export', f'{name}.isoclay', '--like', scan, '-o', out, '--fill', '-1000')
    # The ball, and the supports of the functions round it.
    return np.array([0, 0, 18]), 6 + 16


def compare(before, after, world, middle, reach, what):
    """Voxels (RAS places in `world`) outside of the ball's reach are equal, those inside it are carved."""
    distance = np.abs(world - middle).max(axis=-1)
    assert np.array_equal(before[distance > reach], after[distance > reach]), what
    deep = np.linalg.norm(world - middle, axis=-1) < 4
    assert deep.sum() > 100 and (before[deep] > 300).mean() > 0.9, what
    assert (after[deep & (before > 300)] < 0).all(), what
    assert (before != after).mean() < 0.5, what


# A ball of bone in air, as a volume of 40 voxels across.
count = 40
axis = np.arange(count) - (count - 1) / 2
z, y, x = np.meshgrid(axis, axis, axis, indexing='ij')
depth = 15 - np.sqrt(x**2 + y**2 + z**2)
rng = np.random.default_rng(1)
voxels = np.clip(-1000 + 2000 * np.clip(0.5 + depth / 2, 0, 1) + rng.normal(0, 5, depth.shape), -1024, 3000)
voxels = voxels.round().astype(np.int16)
spacing = (1.25, 0.8, 0.8)

affine = np.diag([-0.8, 0.8, 1.25, 1.0])
affine[:3, 3] = [axis[-1] * 0.8, axis[0] * 0.8, 18 + axis[0] * 1.25]
for stored, slope in ((np.int16, None), (np.float32, None), (np.int16, 0.5)):
    image = nibabel.Nifti1Image((voxels / (slope or 1)).astype(stored).transpose(2, 1, 0), affine)
    image.header.set_xyzt_units('mm')
    image.header['descrip'] = b'kept as it is'
    image.header.extensions.append(nibabel.nifti1.Nifti1Extension('comment', b'and this'))
    if slope:
        image.header.set_slope_inter(slope, 0)
    name = f'{np.dtype(stored).name}_{slope}'
    nibabel.save(image, directory / f'{name}.nii')
    middle, reach = edited(f'{name}.nii', f'out_{name}.nii.gz', name)
    old = nibabel.load(directory / f'{name}.nii')
    for out in (f'same_out_{name}.nii.gz', f'out_{name}.nii.gz'):
        new = nibabel.load(directory / out)
        assert new.header == old.header and np.array_equal(new.affine, old.affine), out
        assert [e.get_content() for e in new.header.extensions] == [e.get_content() for e in old.header.extensions]
        before, after = (np.asanyarray(i.dataobj) for i in (old, new))
        if out.startswith('same'):
            assert np.array_equal(before, after), out
            continue
        places = np.stack(np.meshgrid(*map(np.arange, before.shape), indexing='ij'), axis=-1)
        compare(before, after, nibabel.affines.apply_affine(old.affine, places), middle, reach, out)


def slice_of(k, syntax):
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID = CTImageStorage
    meta.MediaStorageSOPInstanceUID = f'1.2.826.0.1.3680043.8.498.1.{k + 1}'
    meta.TransferSyntaxUID = syntax
    d = Dataset()
    d.file_meta = meta
    d.SpecificCharacterSet = 'ISO_IR 192'
    d.ImageType = ['ORIGINAL', 'PRIMARY', 'AXIAL']
    d.SOPClassUID, d.SOPInstanceUID = CTImageStorage, meta.MediaStorageSOPInstanceUID
    d.StudyInstanceUID, d.SeriesInstanceUID = '1.2.3.4', '1.2.3.4.5'
    d.FrameOfReferenceUID = '1.2.3.4.6'
    d.Modality, d.PatientName, d.PatientID = 'CT', 'Müller^Jürgen', '77'
    d.SeriesNumber, d.InstanceNumber, d.SliceThickness = 3, k + 1, spacing[0]
    d.ImagePositionPatient = [-axis[-1] * 0.8, axis[0] * 0.8, 18 + axis[k] * spacing[0]]
    d.ImageOrientationPatient = [1, 0, 0, 0, 1, 0]
    d.PixelSpacing, d.Rows, d.Columns = list(spacing[1:]), count, count
    d.SamplesPerPixel, d.PhotometricInterpretation = 1, 'MONOCHROME2'
    d.BitsAllocated, d.BitsStored, d.HighBit, d.PixelRepresentation = 16, 12, 11, 0
    d.RescaleSlope, d.RescaleIntercept, d.RescaleType = 1, -1024, 'HU'
    d.WindowCenter, d.WindowWidth = [40, 400], [350, 2000]
    code = Dataset()
    code.CodeValue, code.CodingSchemeDesignator, code.CodeMeaning = 'T-11100', 'SRT', 'Skull'
    d.AnatomicRegionSequence = [code]
    block = d.private_block(0x0029, 'ISOCLAY TEST', create=True)
    block.add_new(0x01, 'LO', 'private')
    block.add_new(0x02, 'OB', bytes(range(7)) + b'\0')
    d.PixelData = (voxels[k].astype(np.int32) + 1024).astype(np.uint16).tobytes()
    d['PixelData'].VR = 'OW'
    if syntax == RLELossless:
        meta.TransferSyntaxUID = ExplicitVRLittleEndian
        d.compress(RLELossless)
        d.SOPInstanceUID = meta.MediaStorageSOPInstanceUID = f'1.2.826.0.1.3680043.8.498.1.{k + 1}'
    return d


for syntax in (ExplicitVRLittleEndian, ImplicitVRLittleEndian, DeflatedExplicitVRLittleEndian, RLELossless):
    name = syntax.name.split()[0].lower()
    series = directory / name
    series.mkdir(exist_ok=True)
    for k in range(count):
        slice_of(k, syntax).save_as(series / f'{k:03}.dcm', enforce_file_format=True)
    middle, reach = edited(name, f'out_{name}', f'dicom_{name}')
    for out in (f'same_out_{name}', f'out_{name}'):
        stacks, instances, all_series = [[], []], set(), set()
        for k in range(count):
            old, new = (pydicom.dcmread(directory / d / f'{k:03}.dcm') for d in (name, out))
            assert new.file_meta.TransferSyntaxUID == ExplicitVRLittleEndian
            assert new.file_meta.MediaStorageSOPInstanceUID == new.SOPInstanceUID != old.SOPInstanceUID
            assert new.ImageType == ['DERIVED', 'PRIMARY', 'AXIAL']
            assert new.SourceImageSequence[0].ReferencedSOPInstanceUID == old.SOPInstanceUID
            assert new.SourceImageSequence[0].ReferencedSOPClassUID == old.SOPClassUID
            for element in old:
                if element.keyword not in OWN:
                    assert element.value == new[element.tag].value, (out, element)
            assert {e.tag for e in new} - {e.tag for e in old} <= {new['SourceImageSequence'].tag}, out
            instances.add(new.SOPInstanceUID)
            all_series.add(new.SeriesInstanceUID)
            for stack, d in zip(stacks, (old, new)):
                stack.append(d.pixel_array.astype(int) + int(d.RescaleIntercept))
        assert len(instances) == count and len(all_series) == 1 and '1.2.3.4.5' not in all_series
        before, after = map(np.array, stacks)
        if out.startswith('same'):
            assert np.array_equal(before, after), out
            continue
        world = np.stack([-x * 0.8, -y * 0.8, 18 + z * 1.25], axis=-1)
        compare(before, after, world, middle, reach, out)

print('edited scans: NIfTI and DICOM come back with their geometry, their tags and their untouched voxels')
