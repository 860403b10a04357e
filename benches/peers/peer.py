"""One reconstruction by a peer in this process, timed without start-up, reading and writing (which favours the peer).
  peer.py NAME SETTING CLOUD.ply OUT.ply THREADS       prints one JSON object
NAME: open3d (Poisson, depth) | apss (MeshLab, grid) | poisson (MeshLab's screened Poisson, depth) | PoissonRecon | SSDRecon
(depth, or depth/samples per node; whole processes, reading and writing included, from the folder $POISSONRECON)"""
import json, os, sys
name, setting, cloud, out, threads = sys.argv[1], sys.argv[2], sys.argv[3], sys.argv[4], int(sys.argv[5])
os.environ.update(OMP_NUM_THREADS=str(threads), OMP_WAIT_POLICY='passive')
import numpy as np
from common import Clock, read_cloud, run, write_mesh
if name in ('PoissonRecon', 'SSDRecon'):
    depth, _, samples = setting.partition('/')
    program = os.path.join(os.environ.get('POISSONRECON', ''), name)
    done = run([program, '--in', cloud, '--out', out, '--depth', depth] + (['--samplesPerNode', samples] if samples else []))
    if done['code']:
        sys.exit(done['text'][-300:])
    print(json.dumps({k: done[k] for k in ('wall', 'cpu', 'peak_mib')}), flush=True)
    sys.exit()
setting = int(setting)
points, normals = read_cloud(cloud)
if name == 'open3d':
    import open3d as o3d
    given = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    given.normals = o3d.utility.Vector3dVector(normals)
    with Clock() as clock:
        mesh, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(given, depth=setting, n_threads=threads)
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.triangles)
else:
    import pymeshlab
    given = pymeshlab.MeshSet(verbose=False)
    given.add_mesh(pymeshlab.Mesh(vertex_matrix=points, v_normals_matrix=normals))
    with Clock() as clock:
        if name == 'apss':
            given.generate_marching_cubes_apss(resolution=setting)
        elif name == 'poisson':
            given.generate_surface_reconstruction_screened_poisson(depth=setting, threads=threads)
        else:
            sys.exit(f'unknown peer {name}')
    vertices, faces = given.current_mesh().vertex_matrix(), given.current_mesh().face_matrix()
if not len(faces):
    sys.exit('the peer gave no triangles')
write_mesh(out, vertices, faces)
print(json.dumps(dict(wall=clock.wall, cpu=clock.cpu, peak_mib=clock.peak_mib)), flush=True)
# Some peers crash while Python tidies up.
os._exit(0)
