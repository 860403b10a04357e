#!/usr/bin/env bash
# Installs the programs that isoclay is measured against into a virtual environment. Not part of the tests.
#   benches/peers/install.sh [FOLDER]       (default: benches/peers/venv)
#
# Debian needs, for the libraries that Open3D, MeshLab and VTK load at run time, and for peak memory:
#   apt-get install python3-venv libusb-1.0-0 libgl1 libgomp1 libx11-6 libxrender1 libegl1 time
#
# PoissonRecon and SSDRecon themselves are in neither Debian nor PyPI (Open3D and MeshLab both carry the screened Poisson
# reconstruction of the same authors). With g++, libpng-dev, libjpeg-dev and zlib1g-dev:
#   git clone https://github.com/mkazhdan/PoissonRecon && make -C PoissonRecon poissonrecon ssdrecon
#   POISSONRECON=PoissonRecon/Bin/Linux isoclay compare --python benches/peers/venv/bin/python --peers PoissonRecon:8,SSDRecon:8
set -euo pipefail
venv=${1:-"$(dirname "$0")/venv"}
python3 -m venv "$venv"
"$venv/bin/pip" install --quiet \
  'numpy>=2' 'scipy>=1.15' 'nibabel>=5' 'open3d==0.20.*' 'pymeshlab==2025.7.*' \
  'vtk>=9.4' 'scikit-image>=0.25' 'SimpleITK>=2.4' 'libigl>=2.6'
"$venv/bin/python" - <<'PY'
import importlib.metadata as m
for name in ("open3d", "pymeshlab", "vtk", "scikit-image", "SimpleITK", "scipy", "libigl"):
    print(name, m.version(name))
PY
