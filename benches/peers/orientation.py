"""Orientation of clouds by other programs, as lines of CSV for `isoclay charts orient --measured`.

  orientation.py CLOUD.ply... > orientation.csv

CLOUD: binary PLY with x y z nx ny nz, the true normals; a zero normal is that of an outlier and is not judged.
spanning tree: Open3D, normals from 16 neighbours, orient_normals_consistent_tangent_plane(16) (Hoppe et al. 1992). The sign of the whole is
left open by that method, so the better of the two counts. CPU: user and system seconds of the two calls."""
import os, resource, sys
here = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, here)
import numpy as np, open3d
from common import read_cloud


def cpu():
    r = resource.getrusage(resource.RUSAGE_SELF)
    return r.ru_utime + r.ru_stime


print('cloud,method,points,wrong,cpu_seconds')
for path in sys.argv[1:]:
    positions, truth = read_cloud(path)
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(positions))
    start = cpu()
    cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(16))
    cloud.orient_normals_consistent_tangent_plane(16)
    spent = cpu() - start
    known = np.linalg.norm(truth, axis=1) > 0.5
    right = int(((np.asarray(cloud.normals) * truth).sum(1) > 0)[known].sum())
    count = int(known.sum())
    name = os.path.splitext(os.path.basename(path))[0]
    print(f'{name},spanning tree (Open3D),{count},{min(right, count - right)},{spent:.2f}', flush=True)
