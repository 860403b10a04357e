"""From an MRI head to a mesh, and back to voxels. Run it from the root of the repository."""

# %% Fit: the affine of the image places the field in the world, in mm
import sys
from pathlib import Path

import nibabel
import numpy as np

import isoclay

out = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
out.mkdir(parents=True, exist_ok=True)
image = nibabel.load("data/head.nii.gz")
field = isoclay.fit_volume(image, progress=lambda stage, share: print(f"{share:4.0%} {stage}"))
print(field)
print({name: round(field.report[name], 3) for name in ("rms", "p95", "max", "tolerance")})

# %% The surface where air and tissue part best, no more triangles than asked for
mesh = field.mesh(triangles=60_000)
print(len(mesh.triangles), "triangles, closed:", mesh.is_closed)
mesh.save(out / "head.ply")

# %% Values, slopes, and sound bounds anywhere
middle = field.box.mean(axis=0)
print("density", field(middle), "gradient", field.gradient(middle))
print("within 5 mm between", field.bounds(middle - 5, middle + 5))

# %% The field at other voxels: twice as coarse, written as an image
values, affine = field.sample(spacing=4.0)
nibabel.save(nibabel.Nifti1Image(values, affine), out / "coarse.nii.gz")

# %% The same at the image's own voxels: how far off the fit is
residual = field.sample(like=image)[0] - np.asarray(image.dataobj)
print("rms at the voxels", float(np.sqrt(np.mean(residual**2))))

# %% A picture: in a notebook, `field` alone shows one
(out / "head.png").write_bytes(field._repr_png_() or b"")
