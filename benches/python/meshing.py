"""Time and peak memory of the surface of a large volume, beside public libraries, and its checks.

    python benches/python/meshing.py [--edge 400] [--repeats 3]

The volume is a gray spinodal structure of trabecular bone's porosity, uint8. Every run has a
process of its own; its peak memory is read, the volume and the imports included. Figures go to
benches/results/meshing.json.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from readme import save

from poresynth import exemplars
from poresynth.fabrication import make_part, surface_of
from poresynth.meshes import Mesh, check, isosurface, write
from poresynth.meshes.checks import count_edges
from poresynth.preprocess import threshold

WAVELENGTH = 16.0
POROSITY = 0.8


def ours(gray: np.ndarray, level: float) -> Mesh:
    return isosurface(gray, level)


def skimage(gray: np.ndarray, level: float) -> Mesh:
    from skimage import measure

    padded = np.pad(gray, 1).astype(np.float32)  # Its surfaces end at the border.
    vertices, faces, *_ = measure.marching_cubes(padded, level)
    return Mesh(vertices, faces)


def pyvista(gray: np.ndarray, level: float) -> Mesh:
    import pyvista

    padded = np.pad(gray, 1)
    grid = pyvista.ImageData(dimensions=padded.shape[::-1])
    grid.point_data["gray"] = padded.ravel()
    surface = grid.contour([level], scalars="gray", method="flying_edges")
    return Mesh(np.asarray(surface.points), surface.regular_faces)


def checked(gray: np.ndarray, level: float) -> Mesh:
    """Lay the surface, and check it but for crossings, which it cannot have."""
    mesh = isosurface(gray, level)
    assert check(mesh, find_crossings=False).printable
    return mesh


def written(gray: np.ndarray, level: float) -> Mesh:
    """From the volume to a binary STL: loose parts, closed pores, surface, checks, file."""
    surface = surface_of(make_part(gray, threshold=level))
    assert surface.report.printable
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder) / "part.stl", surface.mesh)
    return surface.mesh


RUNS: dict[str, Callable[[np.ndarray, float], Mesh]] = {
    "poresynth: surface": ours,
    "scikit-image: surface": skimage,
    "PyVista, flying edges: surface": pyvista,
    "poresynth: surface and checks": checked,
    "poresynth: volume to STL": written,
}


def run(name: str, path: str, level: float) -> dict[str, Any]:
    gray = np.load(path)
    RUNS[name](gray[:40, :40, :40], level)  # imports
    start = time.perf_counter()
    mesh = RUNS[name](gray, level)
    seconds = time.perf_counter() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    edges = count_edges(mesh.faces)
    return {
        "triangles": len(mesh.faces),
        "seconds": round(seconds, 3),
        "peak_bytes": peak,
        "open_edges": edges.open,
        "crowded_edges": edges.crowded,
    }


def make(path: str, edge: int) -> float:
    """Write the volume, and return its threshold."""
    gray = exemplars.spinodal((edge,) * 3, porosity=POROSITY, wavelength=WAVELENGTH, seed=1).array
    np.save(path, gray)
    return threshold(gray[:100])


def apart(task: Callable[..., Any], *arguments: Any) -> Any:
    """Run a task in a process of its own, which begins with no memory but its own."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(task, arguments)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--edge", type=int, default=400)
    parser.add_argument("--repeats", type=int, default=3)
    arguments = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "gray.npy")
        level = apart(make, path, arguments.edge)
        for name in RUNS:
            found = [apart(run, name, path, level) for _ in range(arguments.repeats)]
            row = {"run": name, "edge": arguments.edge, **found[0]}
            row["seconds"] = statistics.median(each["seconds"] for each in found)
            row["peak_bytes"] = max(each["peak_bytes"] for each in found)
            rows.append(row)
            print(
                f"{name:32} {row['seconds']:7.1f} s  {row['peak_bytes'] / 1e9:5.2f} GB  "
                f"{row['triangles']:>10,} triangles  {row['open_edges']} open and "
                f"{row['crowded_edges']} crowded edges",
                flush=True,
            )
    save("meshing", rows)


if __name__ == "__main__":
    main()
