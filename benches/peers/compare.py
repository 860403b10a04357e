"""Time and error of isoclay beside other programs, on the same cloud, run in turn.

  compare.py CLOUD.ply TRUTH.ply [--clean CLEAN.ply] [--isoclay PROGRAM] [--runs 5] [--threads 1,2] [--json OUT.json]
             [--ours "--max-depth 7" --ours "--max-depth 8 --tolerance 0.003%" ...] [--peers open3d:8,apss:128,...]

CLOUD: binary PLY with x y z nx ny nz; TRUTH: binary PLY of triangles; CLEAN: the points without noise or holes (default: CLOUD).
Each --ours is the options of `isoclay fit`, after `|` those of `isoclay mesh`; without one, a list of its own.
Ours: `isoclay fit` and `isoclay mesh` as whole processes, reading and writing included, their user and system seconds summed.
Peers: the call alone. Each round runs every program once; medians over the rounds. Errors are exact distances on the written triangles
in 1e-4 of the diagonal: fwd from the clean points to the result, bwd from 100,000 samples of the result to the truth."""
import argparse, json, os, platform, statistics, subprocess, sys, tempfile
here = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, here)
import numpy as np
from common import Surface, errors, read_cloud, read_mesh, run

OURS = ['--max-depth 6', '--max-depth 7', '--max-depth 8', '--max-depth 8 --tolerance 0.003%', '']
PEERS = 'open3d:6,open3d:7,open3d:8,open3d:9,open3d:10,apss:128,apss:256,poisson:8,poisson:10'

arg = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
arg.add_argument('cloud')
arg.add_argument('truth')
arg.add_argument('--clean')
arg.add_argument('--isoclay', default=os.path.join(here, '../../target/release/isoclay'))
arg.add_argument('--ours', action='append')
arg.add_argument('--peers', default=PEERS)
arg.add_argument('--runs', type=int, default=5)
arg.add_argument('--threads', default='1,2')
arg.add_argument('--timeout', type=float, default=600)
arg.add_argument('--json')
arg = arg.parse_args()

clean, _ = read_cloud(arg.clean or arg.cloud)
diagonal = float(np.linalg.norm(np.ptp(clean, axis=0)))
truth = Surface(*read_mesh(arg.truth))
scratch = tempfile.TemporaryDirectory()
out, field = os.path.join(scratch.name, 'out.ply'), os.path.join(scratch.name, 'field.iclay')


def ours(options, threads):
    fit, _, mesh = options.partition('|')
    parts = [run([arg.isoclay, 'fit', arg.cloud, '-o', field, '--threads', threads, *fit.split()]),
             run([arg.isoclay, 'mesh', field, '-o', out, '--threads', threads, *mesh.split()])]
    for p in parts:
        if p['code']:
            raise RuntimeError(p['text'][-300:])
    a, b = parts
    return dict(cpu=a['cpu'] + b['cpu'], wall=a['wall'] + b['wall'], peak_mib=max(a['peak_mib'], b['peak_mib']), fit_cpu=a['cpu'])


def peer(spec, threads):
    name, setting = spec.split(':')
    done = subprocess.run([sys.executable, os.path.join(here, 'peer.py'), name, setting, arg.cloud, out, threads],
                          capture_output=True, text=True, timeout=arg.timeout, env={**os.environ, 'OMP_NUM_THREADS': threads, 'OMP_WAIT_POLICY': 'passive'})
    lines = [l for l in done.stdout.splitlines() if l.startswith('{"wall"')]
    if not lines:
        raise RuntimeError((done.stderr or done.stdout)[-300:])
    return json.loads(lines[-1])


jobs = [(who, setting, threads) for threads in arg.threads.split(',')
        for who, setting in [('isoclay', o) for o in (OURS if arg.ours is None else arg.ours)] + [('peer', p) for p in arg.peers.split(',') if p]]
rows = {job: [] for job in jobs}
measured, failed = {}, {}
for turn in range(arg.runs):
    for job in jobs:
        if job in failed:
            continue
        who, setting, threads = job
        if os.path.exists(out):
            os.remove(out)
        try:
            row = ours(setting, threads) if who == 'isoclay' else peer(setting, threads)
            row['load'] = os.getloadavg()[0]
            rows[job].append(row)
            # The result does not depend on the thread count of ours, and hardly on that of the peers.
            if (who, setting) not in measured:
                measured[who, setting] = errors(clean, truth, read_mesh(out), diagonal)
        except (RuntimeError, subprocess.TimeoutExpired) as e:
            failed[job] = str(e)
            print(f'{job}: {e}', file=sys.stderr, flush=True)

table = []
for job in jobs:
    if rows[job]:
        who, setting, threads = job
        median = {k: statistics.median(r[k] for r in rows[job]) for k in rows[job][0]}
        table.append(dict(program=who if who == 'isoclay' else setting.split(':')[0], setting=setting if who == 'isoclay' else setting.split(':')[1],
                          threads=int(threads), runs=len(rows[job]), **median, **measured[who, setting]))
print(f'{os.path.basename(arg.cloud)}: {len(read_cloud(arg.cloud)[0])} points; medians of {arg.runs}; {platform.machine()}, {os.cpu_count()} cores, '
      f'load {min(r["load"] for j in rows.values() for r in j):.1f} to {max(r["load"] for j in rows.values() for r in j):.1f}\n')
print('| program | setting | threads | CPU s | wall s | peak MiB | triangles | fwd rms | fwd p95 | fwd max | bwd p95 |')
print('| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |')
for r in table:
    print(f"| {r['program']} | {r['setting'] or 'default'} | {r['threads']} | {r['cpu']:.2f} | {r['wall']:.2f} | {r['peak_mib']:.0f} | {r['triangles'] / 1000:.0f} k "
          f"| {r['fwd_rms']:.2f} | {r['fwd_p95']:.2f} | {r['fwd_max']:.1f} | {r['bwd_p95']:.2f} |")
if arg.json:
    with open(arg.json, 'w') as f:
        json.dump(dict(cloud=os.path.basename(arg.cloud), diagonal=diagonal, rows=table, failed=[[*k, v] for k, v in failed.items()]), f, indent=1)
