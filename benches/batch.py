#!/usr/bin/env python3
"""A batch of hundreds of mixed inputs, left to itself, killed, resumed, measured. Needs Python alone.

  benches/batch.py [--isoclay PROGRAM] [--count 200] [--kills 12] [--seed 1] [--memory 2GiB] [--keep DIR]

Inputs: variants of the repository's data and phantoms, as clouds, meshes, volumes and a DICOM series, each tenth of them broken in its
own way. Asserts: all end; the report names every failure, and no other; killed and resumed the result has the same bits; the
memory of all processes together stays below --memory. Prints the throughput of one and two jobs, and what a batch costs beyond the
single fits, with and without a report."""
import argparse, hashlib, json, os, pathlib, random, resource, shutil, signal, subprocess, sys, tempfile, threading, time

root = pathlib.Path(__file__).resolve().parent.parent
arg = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
arg.add_argument('--isoclay', default=root / 'target/release/isoclay', type=pathlib.Path)
arg.add_argument('--count', type=int, default=200)
arg.add_argument('--kills', type=int, default=12)
arg.add_argument('--seed', type=int, default=1)
arg.add_argument('--memory', default='2GiB')
arg.add_argument('--keep', type=pathlib.Path, help='where inputs and results stay; else they go at the end')
arg = arg.parse_args()
isoclay = str(arg.isoclay.resolve())
rng = random.Random(arg.seed)
held = None if arg.keep else tempfile.TemporaryDirectory()
work = arg.keep.resolve() if arg.keep else pathlib.Path(held.name)
work.mkdir(parents=True, exist_ok=True)


def ask(*words):
    done = subprocess.run([isoclay, *map(str, words), '--json'], capture_output=True, text=True)
    assert done.returncode == 0, (words, done.stderr)
    return json.loads(done.stdout.splitlines()[-1])


# ---------------------------------------------------------------- inputs
CLOUDS = ['ply', 'xyz', 'pcd', 'las', 'e57']
MESHES = ['ply', 'stl', 'obj', 'glb', '3mf']
VOLUMES = ['nii.gz', 'nrrd', 'mha']


def good(n, folder):
    """A scan that no other is like."""
    kind = n % 4
    if kind == 0:
        solid = ['sphere', 'torus', 'gyroid', 'tetrahedron'][n // 4 % 4]
        ending, made = CLOUDS[n // 4 % len(CLOUDS)], folder / f'{solid}-{n}.ply'
        noise = ['0', '0.2%', '1%'][n // 16 % 3]
        ask('phantom', solid, '-o', made, '--count', rng.randint(2000, 12000), '--seed', n, *(['--noise', noise] if noise != '0' else []))
        return made if ending == 'ply' else converted(made, ending)
    if kind == 1:
        field = work / f'{n}.iclay'
        ask('fit', root / 'data/bunny.obj.gz', '-o', field, '--max-depth', 6 + n // 4 % 2)
        made = folder / f'bunny-{n}.{MESHES[n // 4 % len(MESHES)]}'
        ask('mesh', field, '-o', made, '--triangles', rng.randint(1500, 12000))
        field.unlink()
        return made
    if kind == 2:
        made = folder / f'head-{n}.nii'
        ask('phantom', 'head', '-o', made, '--size', rng.randint(20, 56), '--seed', n)
        return converted(made, VOLUMES[n // 4 % len(VOLUMES)])
    if n // 4 % 5 == 0:
        made = folder / f'series-{n}'
        shutil.copytree(root / 'crates/formats/tests/data/dicom/ct', made)
        return made
    first, steps = rng.randint(0, 30), rng.randint(2, 3)
    made = folder / f'part-{n}.nrrd'
    ask('convert', root / 'data/head.nii.gz', made, '--region', f'{first}:{first + 60},0:96,10:90', '--stride', steps)
    return made


def converted(made, ending):
    out = made.with_name(made.name.split('.')[0] + '.' + ending)
    ask('convert', made, out)
    made.unlink()
    return out


def broken(n, folder, scan):
    """A scan that cannot be fitted, out of one that can."""
    data = scan.read_bytes() if scan.is_file() else b''
    if scan.is_dir():
        shutil.rmtree(scan)
    else:
        scan.unlink()
    name, content = [
        ('cut.ply', b'ply\nformat binary_little_endian 1.0\nelement vertex 900\nproperty float x\nproperty float y\nproperty float z\n'
                    b'property float nx\nproperty float ny\nproperty float nz\nend_header\n' + bytes(500)),
        ('empty.ply', b''),
        ('nan.xyz', b'\n'.join(b'nan 0 1 0 0 1' for _ in range(50))),
        ('noise.nii', bytes(rng.randrange(256) for _ in range(900))),
        ('words.stl', b'these are words and no triangles'),
        ('half.nii.gz', data[:len(data) // 2] if data else b'\x1f\x8b'),
        ('flat.xyz', b'\n'.join(b'%d %d 0 0 0 1' % (i, i) for i in range(3))),
        ('zeros.xyz', b'\n'.join(b'0 0 0 0 0 1' for _ in range(400))),
        ('sizes.nrrd', b'NRRD0004\ntype: float\ndimension: 3\nsizes: 100000 100000 100000\nencoding: raw\nendian: little\n\n' + bytes(64)),
        ('other.pcd', b'# .PCD v0.7\nVERSION 0.7\nFIELDS x y\nSIZE 4 4\nTYPE F F\nCOUNT 1 1\nWIDTH 9\nHEIGHT 1\nPOINTS 9\nDATA ascii\n'),
    ][n // 10 % 10]
    made = folder / f'{n}-{name}'
    made.write_bytes(content)
    return made


scans = work / 'scans'
if not scans.exists():
    for n in range(arg.count):
        folder = scans / f'patient {n % 7}'
        folder.mkdir(parents=True, exist_ok=True)
        made = good(n, folder)
        if n % 10 == 3:
            broken(n, folder, made)
bad = sorted(str(p.relative_to(work)) for p in scans.rglob('*') if p.is_file() and p.name.split('-', 1)[-1] in (
    'cut.ply', 'empty.ply', 'nan.xyz', 'noise.nii', 'words.stl', 'half.nii.gz', 'flat.xyz', 'zeros.xyz', 'sizes.nrrd', 'other.pcd'))
print(f'{arg.count} inputs, {len(bad)} of them broken')


# ---------------------------------------------------------------- runs
def tree(parent):
    """A process and all that it started."""
    kids = {}
    for stat in pathlib.Path('/proc').glob('[0-9]*/stat'):
        try:
            kids.setdefault(int(stat.read_text().rsplit(') ', 1)[1].split()[1]), []).append(int(stat.parent.name))
        except (OSError, IndexError):
            pass
    found = [parent]
    for p in found:
        found += kids.get(p, [])
    return found


def resident(p):
    try:
        return int(pathlib.Path(f'/proc/{p}/statm').read_text().split()[1]) * resource.getpagesize()
    except (OSError, IndexError):
        return 0


def batch(out, *options, kill_after=None):
    """Seconds by the clock and of the processor, peak of the memory of all its processes, and whether it came to its end."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    child = subprocess.Popen([isoclay, 'batch', 'scans', '-o', str(out), '--json', *map(str, options)], cwd=work, stdout=subprocess.DEVNULL,
                             stderr=subprocess.PIPE, text=True)
    peak, over = [0], threading.Event()

    def watch():
        while not over.wait(0.02):
            peak[0] = max(peak[0], sum(map(resident, tree(child.pid))))

    watcher = threading.Thread(target=watch)
    watcher.start()
    if kill_after is not None:
        try:
            child.wait(kill_after)
        except subprocess.TimeoutExpired:
            child.send_signal(signal.SIGKILL)
    stderr = child.communicate()[1]
    over.set()
    watcher.join()
    assert 'panicked' not in stderr, stderr
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return dict(wall=time.perf_counter() - start, cpu=cpu, peak=peak[0], code=child.returncode)


def results(out):
    kept = [p for p in sorted(out.rglob('*')) if p.suffix in ('.iclay', '.png')]
    return {str(p.relative_to(out)): hashlib.sha256(p.read_bytes()).hexdigest() for p in kept}


def fresh(name):
    shutil.rmtree(work / name, ignore_errors=True)
    return work / name


ceiling = int(arg.memory.removesuffix('GiB')) << 30
whole = batch(fresh('whole'), '--jobs', 2, '--threads', 1, '--memory', arg.memory)
assert whole['code'] == 3, whole
summary = json.loads((work / 'whole/summary.json').read_text())
entries = summary['entries']
failed = sorted(e['input'] for e in entries if e['state'] != 'done')
assert failed == bad, set(failed) ^ set(bad)
assert sorted(f['input'] for f in summary['failures'] if f['reason']) == bad
report = (work / 'whole/report.html').read_text()
assert all(pathlib.Path(name).name in report for name in bad)
assert whole['peak'] <= ceiling, whole
print(f"unattended: {len(entries) - len(failed)} done, {len(failed)} failed with reasons, {whole['wall']:.1f} s, peak of all processes "
      f"{whole['peak'] / 2**20:.0f} MiB of {arg.memory}")

out, kills = fresh('killed'), 0
while True:
    end = batch(out, '--jobs', 2, '--threads', 1, '--memory', arg.memory, '--resume',
                kill_after=whole['wall'] * rng.uniform(0.02, 2.0 / arg.kills) if kills < arg.kills else None)
    if end['code'] == 3:
        break
    assert end['code'] == -signal.SIGKILL, end
    kills += 1
assert results(out) == results(work / 'whole')
left = [p.name for p in out.rglob('*') if p.name.startswith('.')]
assert not left, left
print(f'killed {kills} times and resumed: {len(results(out))} fields and pictures with the same bits, nothing left behind')

good_ones = [e['input'] for e in entries if e['state'] == 'done']
before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
for name in good_ones:
    ask('fit', work / name, '-o', work / 'single.iclay', '--threads', 1)
after = resource.getrusage(resource.RUSAGE_CHILDREN)
single = dict(wall=time.perf_counter() - start, cpu=after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
one = batch(fresh('one'), '--jobs', 1, '--threads', 1, '--no-report')
two = batch(fresh('two'), '--jobs', 2, '--threads', 1, '--no-report')
with_report = batch(fresh('reported'), '--jobs', 1, '--threads', 1)
print(f"single fits {single['wall']:.1f} s, {single['cpu']:.1f} CPU s")
for what, run in [('one job, no report', one), ('two jobs, no report', two), ('one job, report', with_report)]:
    print(f"{what}: {run['wall']:.1f} s, {run['cpu']:.1f} CPU s, {100 * (run['wall'] / single['wall'] - 1):+.1f} % of the single fits by the clock, "
          f"{100 * (run['cpu'] / single['cpu'] - 1):+.1f} % by the processor")
print(f"two jobs against one: {one['wall'] / two['wall']:.2f} times as fast")
