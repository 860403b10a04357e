"""Files and clocks for runs of other programs. Needs numpy."""
import os, re, resource
import numpy as np

# ---------------------------------------------------------------- files
TYPES = {'char': 'i1', 'int8': 'i1', 'uchar': 'u1', 'uint8': 'u1', 'short': '<i2', 'int16': '<i2', 'ushort': '<u2', 'uint16': '<u2',
         'int': '<i4', 'int32': '<i4', 'uint': '<u4', 'uint32': '<u4', 'float': '<f4', 'float32': '<f4', 'double': '<f8', 'float64': '<f8'}


def read_ply(path):
    """Binary little-endian PLY of triangles or of points alone: (properties by name, triangles)."""
    data = open(path, 'rb').read()
    end = data.index(b'end_header\n') + 11
    head = data[:end].decode('ascii').split('\n')
    if 'format binary_little_endian 1.0' not in head:
        raise SystemExit(f'{path}: only binary little-endian PLY is read here')
    element, counts, fields = None, {}, {}
    for line in head:
        word = line.split()
        if word[:1] == ['element']:
            element = word[1]
            counts[element], fields[element] = int(word[2]), []
        elif word[:1] == ['property']:
            fields[element].append(word[1:])
    vertex = np.dtype([(f[-1], TYPES[f[0]]) for f in fields['vertex']])
    table = np.frombuffer(data, vertex, counts['vertex'], end)
    count = counts.get('face', 0)
    if not count:
        return table, np.zeros((0, 3), np.int64)
    face = np.dtype([('n', TYPES[fields['face'][0][1]]), ('i', TYPES[fields['face'][0][2]], 3)])
    faces = np.frombuffer(data, face, count, end + counts['vertex'] * vertex.itemsize)
    if (faces['n'] != 3).any():
        raise SystemExit(f'{path}: a face is not a triangle')
    return table, faces['i'].astype(np.int64)


def positions(table):
    return np.stack([table[k] for k in 'xyz'], 1).astype(float)


def read_cloud(path):
    table, _ = read_ply(path)
    return positions(table), np.stack([table[k] for k in ('nx', 'ny', 'nz')], 1).astype(float)


def read_nrrd(path):
    """Volume of float32, little-endian, plain or packed, as [k, j, i]."""
    import gzip
    head, _, rest = open(path, 'rb').read().partition(b'\n\n')
    keys = dict(line.split(': ', 1) for line in head.decode().split('\n')[1:] if ': ' in line and not line.startswith('#'))
    if keys['type'] != 'float' or keys.get('endian', 'little') != 'little':
        raise SystemExit(f'{path}: only little-endian float32 is read here')
    data = gzip.decompress(rest) if keys['encoding'] == 'gzip' else rest
    return np.frombuffer(data, '<f4').reshape([int(n) for n in keys['sizes'].split()][::-1])


def write_mesh(path, points, faces):
    rows = np.zeros(len(faces), [('n', 'u1'), ('i', '<i4', 3)])
    rows['n'], rows['i'] = 3, faces
    with open(path, 'wb') as f:
        f.write(('ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty float x\nproperty float y\nproperty float z\n'
                 'element face %d\nproperty list uchar int vertex_indices\nend_header\n' % (len(points), len(faces))).encode())
        f.write(np.ascontiguousarray(points, '<f4').tobytes())
        f.write(rows.tobytes())


# ---------------------------------------------------------------- clocks
def run(command, env=None):
    """Runs a command: wall, user and system seconds, peak MiB, exit code, what it printed."""
    import subprocess, tempfile, time
    with tempfile.TemporaryFile() as out:
        start = time.perf_counter()
        # GNU time, because the peak of a direct child would start at this process's own size.
        gnu = '/usr/bin/time'
        peak = tempfile.NamedTemporaryFile(mode='r')
        prefix = [gnu, '-q', '-o', peak.name, '-f', '%M'] if os.path.exists(gnu) else []
        child = subprocess.Popen(prefix + list(command), stdout=out, stderr=subprocess.STDOUT, env={**os.environ, **(env or {})})
        _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        wall = time.perf_counter() - start
        out.seek(0)
        text = out.read().decode(errors='replace')
        kib = float((peak.read().split() or [usage.ru_maxrss])[-1])
    return dict(wall=wall, cpu=usage.ru_utime + usage.ru_stime, peak_mib=kib / 1024, code=child.returncode, text=text)


class Clock:
    """Wall and CPU seconds of a block in this process, and the process's peak memory since the block began."""
    def __enter__(self):
        import time
        try:
            open('/proc/self/clear_refs', 'w').write('5')
        except OSError:
            pass
        self.usage, self.start = resource.getrusage(resource.RUSAGE_SELF), time.perf_counter()
        return self

    def __exit__(self, *_):
        import time
        self.wall = time.perf_counter() - self.start
        usage = resource.getrusage(resource.RUSAGE_SELF)
        self.cpu = usage.ru_utime + usage.ru_stime - self.usage.ru_utime - self.usage.ru_stime
        self.peak_mib = int(re.search(r'VmHWM:\s+(\d+)', open('/proc/self/status').read()).group(1)) / 1024
