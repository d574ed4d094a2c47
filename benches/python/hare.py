"""A body in, a graded foam in a shell out: one command, timed, and drawn.

    python benches/python/hare.py

The body is drawn by `poresynth.shapes.figure`, so that no file is needed. Figures and picture go
into docs/shapes_and_gradation.md.
"""

from __future__ import annotations

import io
import json
import shlex
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from readme import machine, save, save_picture, update_readme

import poresynth
from poresynth import Volume, exemplars, meshes, shapes

PAGE = "docs/shapes_and_gradation.md"
HEIGHT = 40.0  # mm
VOXEL = 0.16  # mm: 252 voxels along the height
COMMAND = (
    "poresynth synthesize foam.tif -o hare.tif --mask hare.stl --mask-unit mm "
    "--porosity z=0.7:0.88 --prune --part part.stl --shell 0.6 --set part.smooth=20"
)
COLOUR = "#d8c8a8"


def make(folder: Path) -> dict[str, Any]:
    """Run the command in a folder; return its time and what the files say."""
    foam = exemplars.foam((96, 96, 96), cell=24, seed=1)
    poresynth.write(folder / "foam.tif", Volume(foam.array, VOXEL, "mm"))
    meshes.write(folder / "hare.stl", shapes.figure(HEIGHT))
    words = [sys.executable, "-m", *shlex.split(COMMAND)]
    start = time.perf_counter()
    subprocess.run(words, cwd=folder, check=True)
    seconds = time.perf_counter() - start
    made = json.loads((folder / "hare.tif.json").read_text())["poresynth"]
    return {
        "seconds": round(seconds, 1),
        "shape": made["shape"],
        "grading": made["grading"],
        "pruning": {name: made["pruning"][name] for name in ("counts", "before", "after")},
    }


def draw(folder: Path) -> bytes:
    """Draw the body, the part, and the part cut open."""
    import pyvista
    from PIL import Image

    body, part = (pyvista.read(folder / name) for name in ("hare.stl", "part.stl"))
    opened = part.clip(normal="y", origin=part.center, invert=False)
    pyvista.OFF_SCREEN = True
    plotter = pyvista.Plotter(shape=(1, 3), window_size=(1500, 560), border=False)
    z, y, x = np.array(part.center)[::-1]
    for column, shown in enumerate((body, part, opened)):
        plotter.subplot(0, column)
        plotter.set_background("white")
        plotter.add_mesh(shown, color=COLOUR, specular=0.2)
        plotter.camera_position = [(x + 60, y - 110, z + 40), (x, y, z), (0, 0, 1)]
        plotter.reset_camera()
        plotter.camera.zoom(1.3)
    stream = io.BytesIO()
    Image.fromarray(plotter.screenshot(return_img=True)).save(stream, format="png")
    return stream.getvalue()


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        figures = make(Path(name))
        save_picture("hare", draw(Path(name)))
    save("hare", figures)
    edges = " × ".join(map(str, figures["shape"]))
    before, after = (figures["pruning"][key] for key in ("before", "after"))
    text = (
        f"{edges} voxels in {figures['seconds']:.0f} s, from the body's mesh to the part's. The "
        f"porosity of windows of {figures['grading']['window']} voxels misses the gradient by "
        f"{figures['grading']['mean_absolute_error_percent']:.2f} % on average; parts "
        f"{before['components']} → {after['components']}, end points {before['end_points']} → "
        f"{after['end_points']}. {machine()}. `python benches/python/hare.py`"
    )
    print(text)
    update_readme("hare", text, PAGE)


if __name__ == "__main__":
    main()
