#!/usr/bin/env python3
"""Writes the DICOM files of this directory and what others read from them.

Needs pydicom, numpy, SimpleITK (GDCM), pylibjpeg with its plugins, and the tools gdcmconv (libgdcm-tools), dcmconv,
dcmcjpeg (dcmtk).  `expected.json` holds, for each case, dimensions, the map from voxels to RAS millimetres, and the
CRC-32 of the densities as little-endian float32, x fastest: from SimpleITK where it can read the case as it should be,
otherwise from pydicom and the equations of DICOM PS3.3, C.7.6.2.1.1.  The key `by` tells which.
"""
import json, os, shutil, subprocess, sys, zlib
import numpy as np
import pydicom
import SimpleITK as sitk
from pydicom.encaps import encapsulate, generate_frames
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.sequence import Sequence
from pydicom.uid import (ExplicitVRLittleEndian, ImplicitVRLittleEndian, CTImageStorage, MRImageStorage,
                         EnhancedCTImageStorage, PositronEmissionTomographyImageStorage, NuclearMedicineImageStorage,
                         RTDoseStorage, RLELossless)

os.chdir(os.path.dirname(os.path.abspath(__file__)))
ROOT = "1.2.826.0.1.3680043.10.511."
expected = {}


def uid(*parts):
    return ROOT + ".".join(str(p) for p in parts)


def unit(v):
    v = np.asarray(v, float)
    return v / np.linalg.norm(v)


def ds(v):
    """Numbers with the 16 letters that a decimal string may have."""
    out = []
    for x in np.atleast_1d(v):
        for digits in range(17, 3, -1):
            s = f"{float(x):.{digits}g}"
            if len(s) <= 16:
                out.append(s)
                break
    return out if np.ndim(v) else out[0]


def picture(k, shape, top=4096):
    y, x = np.mgrid[: shape[0], : shape[1]]
    return ((37 * x * x + 101 * y + 13 * x * y + 251 * k) % top).astype(np.int64)


def base(sop, series, k, syntax=ExplicitVRLittleEndian):
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID = sop
    meta.MediaStorageSOPInstanceUID = uid(series, k + 1)
    meta.TransferSyntaxUID = syntax
    d = FileDataset(None, {}, file_meta=meta, preamble=b"\0" * 128)
    d.SOPClassUID, d.SOPInstanceUID = sop, uid(series, k + 1)
    d.StudyInstanceUID, d.SeriesInstanceUID = uid(1), uid(series)
    d.FrameOfReferenceUID = uid(2)
    d.SeriesNumber, d.InstanceNumber = series, k + 1
    d.PatientID, d.PatientName = "P", "P"
    d.Modality = "CT"
    return d


def pixels(d, a, bits=16, stored=None, signed=False):
    d.SamplesPerPixel, d.PhotometricInterpretation = 1, "MONOCHROME2"
    d.Rows, d.Columns = a.shape[-2:]
    d.BitsAllocated, d.BitsStored = bits, stored or bits
    d.HighBit, d.PixelRepresentation = d.BitsStored - 1, int(signed)
    kind = {8: "u1", 16: "<u2", 32: "<u4"}[bits]
    mask = (1 << d.BitsStored) - 1
    data = (a & mask).astype(kind).tobytes()
    d.PixelData = data + b"\0" * (len(data) % 2)
    d["PixelData"].VR = "OB" if bits == 8 else "OW"


def place(d, position, row, column, spacing):
    """spacing: between rows, between columns."""
    d.ImagePositionPatient = ds(position)
    d.ImageOrientationPatient = ds(np.concatenate([row, column]))
    d.PixelSpacing = ds(spacing)


def save(d, path):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    d.save_as(path, enforce_file_format=True)


def record(case, affine_ras, values, by):
    v = np.ascontiguousarray(values, dtype="<f4")  # z, y, x
    expected[case] = {
        "dims": list(v.shape[::-1]), "world_from_voxel": np.asarray(affine_ras)[:3].tolist(),
        "crc32": zlib.crc32(v.tobytes()), "probe": [float(v[0, 0, 0]), float(v[-1, -1, -1])], "by": by}


def itk_affine(image):
    d = np.array(image.GetDirection()).reshape(3, 3) * np.array(image.GetSpacing())
    a = np.eye(4)
    a[:3, :3], a[:3, 3] = d, image.GetOrigin()
    return np.diag([-1, -1, 1, 1]) @ a


def by_itk(case, files):
    """Files in the order of GDCM's sorting by position."""
    if len(files) > 1:
        reader = sitk.ImageSeriesReader()
        names = sitk.ImageSeriesReader.GetGDCMSeriesFileNames(os.path.dirname(files[0]))
        assert sorted(names) == sorted(os.path.abspath(f) for f in files) or sorted(names) == sorted(files), names
        reader.SetFileNames(names)
        # The third axis through the positions, whether or not it is at a right angle to the others.
        reader.ForceOrthogonalDirectionOff()
        image = reader.Execute()
    else:
        image = sitk.ReadImage(files[0])
    record(case, itk_affine(image), sitk.GetArrayFromImage(image).astype("f4"), "SimpleITK " + sitk.Version_VersionString())


def by_pydicom(case, planes):
    """planes: (dataset, frame or None, position) sorted by the caller; the map goes through first and last."""
    d = planes[0][0]
    o = np.array([float(x) for x in d.ImageOrientationPatient])
    s = [float(x) for x in d.PixelSpacing]
    first, last = (np.array([float(x) for x in p]) for p in (planes[0][2], planes[-1][2]))
    a = np.eye(4)
    a[:3, 0], a[:3, 1] = o[:3] * s[1], o[3:] * s[0]
    a[:3, 2], a[:3, 3] = (last - first) / (len(planes) - 1), first
    values = []
    for d, frame, _ in planes:
        p = d.pixel_array if frame is None else d.pixel_array[frame]
        slope, cut = float(getattr(d, "RescaleSlope", 1)), float(getattr(d, "RescaleIntercept", 0))
        values.append((p.astype("f8") * slope + cut).astype("f4"))
    record(case, np.diag([-1, -1, 1, 1]) @ a, np.array(values), "pydicom " + pydicom.__version__)


for name in os.listdir("."):
    if os.path.isdir(name):
        shutil.rmtree(name)

# An oblique CT whose files run against the normal, numbered in a third order.
row = unit([0.96, 0.2, -0.1])
column = unit(np.cross(np.cross(row, [0.1, 1, 0.2]), row))
normal = np.cross(row, column)
files = []
for k in range(6):
    d = base(CTImageStorage, 10, k)
    d.SeriesDescription, d.InstanceNumber = "oblique", [3, 1, 6, 2, 5, 4][k]
    d.RescaleSlope, d.RescaleIntercept, d.RescaleType = "1", "-1024", "HU"
    d.SliceThickness, d.SliceLocation = "9", str(7 * k % 5)
    place(d, np.array([-120.25, -80.5, 400.125]) - 2.75 * k * normal, row, column, [0.7, 0.6])
    pixels(d, picture(k, (8, 10)), stored=12)
    files.append(f"ct/IM{k:04}.dcm")
    save(d, files[-1])
by_itk("ct", files)

# Signed numbers, implicit, coronal, names without an extension.
files = []
for k in range(4):
    d = base(MRImageStorage, 11, k, ImplicitVRLittleEndian)
    d.Modality = "MR"
    place(d, [10, -20 + 1.5 * k, 30], np.array([1, 0, 0]), np.array([0, 0, -1]), [1.25, 0.9])
    pixels(d, picture(k, (7, 9), 65536) - 32768, signed=True)
    files.append(f"signed/{k}")
    save(d, files[-1])
by_itk("signed", files)

# A gantry tilted by 18 degrees: the table moves along z, the planes look elsewhere.
row, column = np.array([1.0, 0, 0]), np.array([0, np.cos(np.radians(18)), np.sin(np.radians(18))])
files = []
for k in range(5):
    d = base(CTImageStorage, 12, k)
    d.RescaleSlope, d.RescaleIntercept, d.GantryDetectorTilt = "1", "-1000", "18"
    place(d, [-5, -6, 100 + 3 * k], row, column, [0.8, 0.8])
    pixels(d, picture(k, (8, 8)), stored=12)
    files.append(f"tilted/{k}.dcm")
    save(d, files[-1])
by_itk("tilted", files)

# Slices 2, 2, 3 and 5 mm apart; densities that are linear along z, which resampling has to keep.
for k, z in enumerate([0, 2, 4, 7, 12]):
    d = base(CTImageStorage, 13, k)
    d.RescaleSlope, d.RescaleIntercept = "0.5", "-20"
    place(d, [0, 0, z], np.array([1, 0, 0]), np.array([0, 1, 0]), [1, 1])
    y, x = np.mgrid[:5, :6]
    pixels(d, 100 + 40 * z + 3 * x + 7 * y)
    save(d, f"uneven/{k}.dcm")

# Each slice of PET has a slope of its own.
files = []
for k in range(4):
    d = base(PositronEmissionTomographyImageStorage, 14, k)
    d.Modality, d.Units = "PT", "BQML"
    d.RescaleSlope, d.RescaleIntercept = ds(0.37 * (k + 1)), "0"
    place(d, [-30, 5, -4 * k], np.array([1, 0, 0]), np.array([0, 1, 0]), [4.0625, 4.0625])
    pixels(d, picture(k, (6, 6), 32768), signed=True)
    files.append(f"pet/{k}.dcm")
    save(d, files[-1])
by_pydicom("pet", [(pydicom.dcmread(f), None, pydicom.dcmread(f).ImagePositionPatient) for f in files[::-1]])

# A scout in the directory and under the series of a CT, and a stranger's file.
for k in range(3):
    d = base(CTImageStorage, 15, k)
    place(d, [0, 0, 2 * k], np.array([1, 0, 0]), np.array([0, 1, 0]), [1, 1])
    pixels(d, picture(k, (5, 6)))
    save(d, f"mixed/{k}.dcm")
d = base(CTImageStorage, 15, 3)
d.ImageType = ["ORIGINAL", "PRIMARY", "LOCALIZER"]
place(d, [0, 0, 9], np.array([1, 0, 0]), np.array([0, 0, -1]), [1, 1])
pixels(d, picture(3, (5, 6)))
save(d, "mixed/scout.dcm")


# Enhanced CT: frames in disorder, geometry in functional groups, and a private sequence of unknown representation.
def enhanced(series):
    d = base(EnhancedCTImageStorage, series, 0)
    order = [2, 0, 4, 1, 3]
    d.NumberOfFrames = len(order)
    shared = Dataset()
    o, m, t = Dataset(), Dataset(), Dataset()
    o.ImageOrientationPatient = ds(np.concatenate([row, column]))
    m.PixelSpacing, m.SliceThickness, m.SpacingBetweenSlices = ds([0.75, 0.5]), "1", "1"
    t.RescaleSlope, t.RescaleIntercept, t.RescaleType = "2", "-500", "HU"
    shared.PlaneOrientationSequence = Sequence([o])
    shared.PixelMeasuresSequence = Sequence([m])
    shared.PixelValueTransformationSequence = Sequence([t])
    d.SharedFunctionalGroupsSequence = Sequence([shared])
    frames = []
    for k in order:
        f, p, c = Dataset(), Dataset(), Dataset()
        p.ImagePositionPatient = ds(np.array([3.5, -2.25, 7]) + 2.5 * k * np.cross(row, column))
        c.StackID, c.InStackPositionNumber = "1", k + 1
        f.PlanePositionSequence, f.FrameContentSequence = Sequence([p]), Sequence([c])
        frames.append(f)
    d.PerFrameFunctionalGroupsSequence = Sequence(frames)
    pixels(d, np.array([picture(k, (6, 8)) for k in order]), stored=12)
    return d, order


row, column = unit([0.9, 0.3, 0.1]), None
column = unit(np.cross(np.cross(row, [0, 1, 0.3]), row))
d, order = enhanced(16)
inner = Dataset()
inner.PatientComments = "hidden"
d.add_new(0x00090010, "LO", "NOBODY")
d.add_new(0x00091001, "SQ", Sequence([inner]))
d[0x00091001].is_undefined_length = True
inner.is_undefined_length_sequence_item = True
save(d, "enhanced/frames.dcm")
flat = Dataset()
flat.ImageOrientationPatient = d.SharedFunctionalGroupsSequence[0].PlaneOrientationSequence[0].ImageOrientationPatient
planes = []
d = pydicom.dcmread("enhanced/frames.dcm")
d.ImageOrientationPatient = flat.ImageOrientationPatient
d.PixelSpacing, d.RescaleSlope, d.RescaleIntercept = ds([0.75, 0.5]), "2", "-500"
for k in range(5):
    at = order.index(k)
    group = d.PerFrameFunctionalGroupsSequence[at]
    planes.append((d, at, group.PlanePositionSequence[0].ImagePositionPatient))
by_pydicom("enhanced", planes)
# The same frames compressed, one fragment each, and with a frame in two fragments.
d, _ = enhanced(17)
d.compress(RLELossless)
save(d, "compressed/rle.dcm")
for series, name, table in ((18, "split", True), (21, "untabled", False)):
    d, _ = enhanced(series)
    path = f"compressed/{name}.dcm"
    save(d, path)
    subprocess.run(["dcmcjpeg", "+e1", path, path], check=True)
    d = pydicom.dcmread(path)
    frames = list(generate_frames(d.PixelData, number_of_frames=5))
    d.PixelData = encapsulate(frames, fragments_per_frame=2, has_bot=table)
    save(d, path)
for name in ("rle", "split", "untabled"):
    expected[f"compressed/{name}.dcm"] = expected["enhanced"]

# Nuclear medicine and a dose grid: only the first frame has a position.
d = base(NuclearMedicineImageStorage, 19, 0)
d.Modality, d.NumberOfFrames, d.SpacingBetweenSlices, d.SliceThickness = "NM", 4, "3.5", "3.5"
d.PixelSpacing = ds([2.5, 2.25])
detector = Dataset()
detector.ImagePositionPatient, detector.ImageOrientationPatient = ds([-1, -2, -3]), ds([1, 0, 0, 0, 1, 0])
d.DetectorInformationSequence = Sequence([detector])
pixels(d, np.array([picture(k, (4, 5), 256) for k in range(4)]), bits=8)
save(d, "nm/frames.dcm")
by_itk("nm", ["nm/frames.dcm"])

d = base(RTDoseStorage, 20, 0)
d.Modality, d.NumberOfFrames = "RTDOSE", 4
d.GridFrameOffsetVector, d.DoseGridScaling = ds([0, 2, 4, 6]), ds(1.25e-5)
d.FrameIncrementPointer = 0x3004000C
place(d, [5, 6, 7], np.array([1, 0, 0]), np.array([0, 1, 0]), [3, 3])
pixels(d, np.array([picture(k, (4, 5), 10**6) for k in range(4)]), bits=32)
save(d, "dose/dose.dcm")
# SimpleITK leaves the scale of a dose grid out.
record("dose", itk_affine(sitk.ReadImage("dose/dose.dcm")), (d.pixel_array.astype("f8") * 1.25e-5).astype("f4"),
       "SimpleITK, values by pydicom")


# One picture in each transfer syntax, each a series of its own in the same directory.
def one(series, name, a, **how):
    d = base(CTImageStorage, series, 0)
    d.RescaleSlope, d.RescaleIntercept, d.SliceThickness = "1", "-100", "1"
    place(d, [1, 2, 3], np.array([1, 0, 0]), np.array([0, 1, 0]), [0.5, 0.5])
    pixels(d, a, **how)
    save(d, f"syntax/{name}.dcm")
    return f"syntax/{name}.dcm"


smooth = lambda top: (top // 2 + (top // 3) * np.sin(np.mgrid[:12, :16][0] / 3) * np.cos(np.mgrid[:12, :16][1] / 4)).astype(int)
ways = {
    "explicit": None,
    "implicit": ["dcmconv", "+ti"], "big": ["dcmconv", "+tb"], "deflated": ["dcmconv", "+td"],
    "rle": ["gdcmconv", "--rle"], "jpeg-lossless": ["dcmcjpeg", "+el"], "jpeg-sv1": ["dcmcjpeg", "+e1"],
    "jpeg2000": ["gdcmconv", "--j2k"], "jpeg-ls": ["gdcmconv", "--jpegls"],
}
series = 30
for kind, how in {"u12": dict(stored=12), "s16": dict(signed=True), "u8": dict(bits=8)}.items():
    a = {"u12": smooth(4096), "s16": picture(5, (12, 16), 3000) - 1500, "u8": smooth(256)}[kind]
    plain = one(series, f"explicit-{kind}", a, **how)
    by_itk(plain, [plain])
    for way, command in ways.items():
        series += 1
        if command is None:
            continue
        path = f"syntax/{way}-{kind}.dcm"
        source = one(series, f"{way}-{kind}", a, **how)
        done = subprocess.run([*command, source, "out.dcm"], capture_output=True, text=True)
        if done.returncode != 0 or not os.path.exists("out.dcm"):
            print("cannot", way, kind, done.stderr.strip()[:200], file=sys.stderr)
            os.remove(source)
            continue
        os.replace("out.dcm", path)
        check = pydicom.dcmread(path)
        assert np.array_equal(check.pixel_array.astype(int), pydicom.dcmread(plain).pixel_array.astype(int)), path
        expected[path] = expected[plain] | {"by": expected[plain]["by"] + ", and pydicom on the compressed file"}
    series += 1

# Lossy ones: what others decode, within what the rounding of a transform may differ.
a = smooth(256)
for way, command in {"jpeg-baseline": ["dcmcjpeg", "+eb", "+q", "90"], "jpeg2000-lossy": ["gdcmconv", "--j2k", "--lossy"]}.items():
    series += 1
    source = one(series, way, a, bits=8)
    subprocess.run([*command, source, "out.dcm"], check=True)
    os.replace("out.dcm", source)
    d = pydicom.dcmread(source)
    # The tools may change the numbers stored, and the rescaling with them.
    decoded = d.pixel_array.astype("f8") * float(d.RescaleSlope) + float(d.RescaleIntercept)
    record(source, np.eye(4), decoded[None], "pydicom with pylibjpeg")
    expected[source]["values"] = [float(v) for v in decoded.ravel()]
    expected[source]["world_from_voxel"] = expected["syntax/explicit-u8.dcm"]["world_from_voxel"]
# Twelve bits by the extended process, which is not read.
series += 1
source = one(series, "jpeg-extended", smooth(4096), stored=12)
subprocess.run(["dcmcjpeg", "+ee", source, "out.dcm"], check=True)
os.replace("out.dcm", source)

# Colour is no density.
d = base(CTImageStorage, 70, 0)
place(d, [0, 0, 0], np.array([1, 0, 0]), np.array([0, 1, 0]), [1, 1])
pixels(d, picture(0, (4, 4 * 3), 256), bits=8)
d.SamplesPerPixel, d.PhotometricInterpretation, d.PlanarConfiguration, d.Columns = 3, "RGB", 0, 4
save(d, "colour/rgb.dcm")

with open("expected.json", "w") as f:
    json.dump(expected, f, indent=0)
    f.write("\n")
