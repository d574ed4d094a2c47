"""The picture of docs/fabrication.md: a body, a foam in its shape, thickened, and under a shell.

python benches/python/part_picture.py
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from readme import save_picture

from poresynth import exemplars, meshes, shapes
from poresynth.fabrication import make_part
from poresynth.report.render3d import surface_picture
from poresynth.report.slices import png

VOXEL = 0.16  # mm
MINIMUM = 0.8
SHELL = 0.8
PIXEL = 0.62  # voxels


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hare.stl"
        meshes.write(path, shapes.figure())
        domain = shapes.read_domain(path, voxel_size=VOXEL, unit="mm", body_unit="mm")
    body = domain.mask.array
    foam = exemplars.foam(
        domain.mask.shape, porosity=0.88, cell=26, seed=1, voxel_size=VOXEL, unit="mm"
    )
    thick = make_part(foam, domain=domain, min_thickness=MINIMUM)
    shelled = make_part(foam, domain=domain, min_thickness=MINIMUM, shell=SHELL).inside
    shelled[:, shelled.shape[1] // 2 :] = False
    panels = [body, thick.before, thick.inside, shelled]
    pictures = [surface_picture(panel, (VOXEL,) * 3, PIXEL) for panel in panels]
    save_picture("part", png(beside(pictures)))


def beside(pictures: list[np.ndarray]) -> np.ndarray:
    """Put pictures side by side on white, without their empty margins."""
    cut = []
    for picture in pictures:
        columns = np.flatnonzero(picture[..., 3].any(axis=0))
        cut.append(picture[:, max(columns[0] - 12, 0) : columns[-1] + 12])
    row = np.concatenate(cut, axis=1).astype(float)
    rows = np.flatnonzero(row[..., 3].any(axis=1))
    row = row[max(rows[0] - 12, 0) : rows[-1] + 12]
    opacity = row[..., 3:] / 255
    return np.rint(row[..., :3] * opacity + 255 * (1 - opacity)).astype(np.uint8)


if __name__ == "__main__":
    main()
