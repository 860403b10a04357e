"""One run of another program in this process, timed without start-up, reading and writing (which favours it).
  peer.py installed                                    prints one JSON object: versions of the programs that are here
  peer.py NAME SETTING INPUT OUT.ply THREADS           prints one JSON object: wall, cpu, peak_mib; of volumes also the errors
NAME: Open3D (Poisson, depth) | MeshLab (screened Poisson, depth) | APSS (MeshLab, cells) | PoissonRecon | SSDRecon (depth; whole
processes, reading and writing included, from the folder $POISSONRECON or the PATH), of a PLY with normals;
SciPy (interpolate, or voxels from knot to knot for least squares), of an NRRD of float32."""
import importlib.metadata, importlib.util, json, os, shutil, sys


def program(name):
    folder = os.environ.get('POISSONRECON')
    return shutil.which(name, path=folder) if folder else shutil.which(name)


def installed():
    found = {}
    for name, module in [('Open3D', 'open3d'), ('MeshLab', 'pymeshlab'), ('APSS', 'pymeshlab'), ('SciPy', 'scipy')]:
        if importlib.util.find_spec(module) and importlib.util.find_spec('numpy'):
            found[name] = importlib.metadata.version(module)
    if importlib.util.find_spec('numpy'):
        found.update({name: '' for name in ('PoissonRecon', 'SSDRecon') if program(name)})
    return found


if sys.argv[1:] == ['installed']:
    print(json.dumps(installed()))
    sys.exit()
name, setting, given, out, threads = sys.argv[1], sys.argv[2], sys.argv[3], sys.argv[4], int(sys.argv[5])
os.environ.update(OMP_NUM_THREADS=str(threads), OPENBLAS_NUM_THREADS=str(threads), OMP_WAIT_POLICY='passive')
import numpy as np
from common import Clock, read_cloud, read_nrrd, run, write_mesh


def cloud(points, normals):
    """Vertices and triangles, and the clock."""
    if name == 'Open3D':
        import open3d as o3d
        pcd = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
        pcd.normals = o3d.utility.Vector3dVector(normals)
        with Clock() as clock:
            mesh, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(pcd, depth=int(setting), n_threads=threads)
        return np.asarray(mesh.vertices), np.asarray(mesh.triangles), clock
    import pymeshlab
    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(pymeshlab.Mesh(vertex_matrix=points, v_normals_matrix=normals))
    with Clock() as clock:
        if name == 'APSS':
            meshes.generate_marching_cubes_apss(resolution=int(setting))
        else:
            meshes.generate_surface_reconstruction_screened_poisson(depth=int(setting), threads=threads)
    mesh = meshes.current_mesh()
    return mesh.vertex_matrix(), mesh.face_matrix(), clock


def volume(densities):
    """Coefficients, the spline's values at the voxels, and the clock."""
    if setting == 'interpolate':
        from scipy import ndimage
        with Clock() as clock:
            coefficients = ndimage.spline_filter(densities, order=3, output=np.float32, mode='mirror')
        values = coefficients.astype(np.float64)
        for axis in range(3):
            values = ndimage.correlate1d(values, [1 / 6, 4 / 6, 1 / 6], axis=axis, mode='mirror')
        return coefficients.size, values, clock
    from scipy.interpolate import BSpline
    from scipy.linalg import solveh_banded

    def basis(n):
        """Cubic B-splines of n voxels, a knot every so many."""
        spans = max(int(np.ceil((n - 1) / float(setting))), 1)
        knots = (n - 1) / spans * np.arange(-3, spans + 4)
        return BSpline.design_matrix(np.clip(np.arange(n, dtype=float), 0, (n - 1) * (1 - 1e-12)), knots, 3).tocsr()

    def fitted(values, b, axis):
        """The normal equations of an axis: exact, as the grid is separable."""
        values = np.moveaxis(values, axis, 0)
        right = b.T @ values.reshape(values.shape[0], -1)
        gram = (b.T @ b).toarray()
        bands = np.zeros((4, len(gram)))
        for i in range(4):
            bands[3 - i, i:] = np.diagonal(gram, i)
        bands[3] += 1e-12
        return np.moveaxis(solveh_banded(bands, right).reshape((-1,) + values.shape[1:]), 0, axis)

    bases = [basis(n) for n in densities.shape]
    with Clock() as clock:
        coefficients = densities.astype(np.float64)
        for axis, b in enumerate(bases):
            coefficients = fitted(coefficients, b, axis)
    values = coefficients
    for axis, b in enumerate(bases):
        moved = np.moveaxis(values, axis, 0)
        values = np.moveaxis((b @ moved.reshape(moved.shape[0], -1)).reshape((-1,) + moved.shape[1:]), 0, axis)
    return coefficients.size, values, clock


if name in ('PoissonRecon', 'SSDRecon'):
    done = run([program(name), '--in', given, '--out', out, '--depth', setting, '--threads', str(threads)])
    if done['code']:
        done = run([program(name), '--in', given, '--out', out, '--depth', setting])
    if done['code']:
        sys.exit(done['text'][-300:])
    told = {k: done[k] for k in ('wall', 'cpu', 'peak_mib')}
elif name == 'SciPy':
    densities = read_nrrd(given)
    count, values, clock = volume(densities)
    errors = np.abs(values - densities)
    told = dict(wall=clock.wall, cpu=clock.cpu, peak_mib=clock.peak_mib, coefficients=int(count), rms=float(np.sqrt((errors**2).mean())),
                p95=float(np.percentile(errors, 95)), max=float(errors.max()))
elif name in ('Open3D', 'MeshLab', 'APSS'):
    vertices, faces, clock = cloud(*read_cloud(given))
    if not len(faces):
        sys.exit('it gave no triangles')
    write_mesh(out, vertices, faces)
    told = dict(wall=clock.wall, cpu=clock.cpu, peak_mib=clock.peak_mib)
else:
    sys.exit(f'unknown program {name}')
print(json.dumps(told), flush=True)
# Some crash while Python tidies up.
os._exit(0)
