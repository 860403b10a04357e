"""A bunny of clay: solids made of solids, a document with a history, a scene over time. Run it from the root of the repository."""

# %% Fit a cloud
import sys
from pathlib import Path

import isoclay

out = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
out.mkdir(parents=True, exist_ok=True)
bunny = isoclay.fit("data/bunny.obj.gz")

# %% Take one solid out of another: a shell, open where a second bunny stands in the way
shell = bunny - bunny.grown(-0.4)
aside = bunny.moved([[1, 0, 0, 2.5], [0, 1, 0, 0], [0, 0, 1, 1], [0, 0, 0, 1]])
cut = (shell - aside).mesh(resolution=120)
cut.save(out / "shell.ply")
print("shell", len(cut.triangles), "triangles of volume", round(cut.volume, 2))

# %% Sculpt, with every stroke kept
path = out / "clay.isoclay"
path.unlink(missing_ok=True)
with isoclay.Document.new(path, {"bunny": bunny}) as document:
    document.sculpt({"carve": {"shape": {"sphere": {"radius": 0.35}}, "along": [[-1.0, 7.0, 2.2], [1.5, 5.5, 2.5]]}})
    document.sculpt(Path("docs/gallery/drilled.toml"))
    for edit in document.history:
        print(edit.title, edit.sha256[:12])
    print("edits done again with the same bits:", document.replay())
    document.undo()
    document["bunny"].mesh().save(out / "carved.ply")

# %% Pull at it for a while
scene = {
    "region": {"min": [-2.5, 6.0, 0.5], "max": [0.5, 9.0, 3.5], "level": 0},
    "material": {"mass": 0.05, "damping": 1.0},
    "pull": [{"at": [-1.0, 7.5, 2.2], "radius": 0.4, "strength": 0.5}],
    "time": {"duration": 0.5, "step": 0.05},
}
simulation = isoclay.Simulation(bunny, scene)
for line in simulation:
    print(f"{line['time']:.2f} s: {line['iterations']} iterations, work {line['work']:.3g}")
simulation.field.save(out / "pulled.iclay")
