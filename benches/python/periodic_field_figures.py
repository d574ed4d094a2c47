"""Pictures of PeriodicField: textures, volumes, density, the scale of the noise, tiles.

    PORESYNTH_DATA=… python benches/python/periodic_field_figures.py [--only density tile …]

Every network is trained here, with the preset tiny unless the table below says otherwise. Pictures
go to docs/images, what was measured to benches/results/periodic_field_figures.json.
"""

from __future__ import annotations

import argparse
import io as memory
import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import numpy as np
import torch
from matplotlib import pyplot as plt
from readme import RESULTS, save, save_picture

from poresynth import io
from poresynth.engines.neural.judge import Judge
from poresynth.engines.periodic_field import PeriodicField
from poresynth.exemplars import foam
from poresynth.preprocess import downsample
from poresynth.volume import Volume

DATA = Path(os.environ.get("PORESYNTH_DATA", "."))
# Colour textures: half of the pixels along an edge, and what differs from the preset tiny.
TEXTURES: dict[str, tuple[str, dict[str, Any]]] = {
    "honeycomb": (
        "honeycombed_0003.jpg",
        {"bandwidth": 2, "width": 64, "spacing": 3.0, "reach": 40, "period_rate": 1e-4},
    ),
    "crosshatch": ("crosshatched_0014.jpg", {"width": 64, "bandwidth": 2}),
    "veins": ("veined_0106.jpg", {"width": 64, "reach": 48}),
}
MEASURED: dict[str, Any] = {}

Panel = tuple[str, np.ndarray]


def texture(name: str) -> Volume:
    return downsample(io.read(DATA / "2d" / TEXTURES[name][0]), 2, labels=False)


def fit(name: str, exemplar: Volume, **parameters: Any) -> PeriodicField:
    """Train, on one thread, and note how long it took and how near it came."""
    torch.set_num_threads(1)
    begin = time.process_time()
    engine = PeriodicField(**parameters).fit(exemplar)
    MEASURED[name] = {
        "parameters": parameters,
        "cpu_seconds": round(time.process_time() - begin, 1),
        "period": engine.period_,
        "figures": engine.training_["figures"],
        "kept": engine.training_["kept"],
    }
    print(name, json.dumps(MEASURED[name]), flush=True)
    return engine


def draw(name: str, rows: list[list[Panel]], scale: float = 2.4) -> None:
    """Write a picture of rows of panels."""
    columns = max(map(len, rows))
    size = (scale * columns, (scale + 0.25) * len(rows))
    figure, axes = plt.subplots(len(rows), columns, figsize=size, squeeze=False)
    for axis in axes.ravel():
        axis.axis("off")
    for line, row in zip(axes, rows, strict=True):
        for axis, (title, pixels) in zip(line, row, strict=False):
            high = 255 if pixels.dtype == np.uint8 else None
            axis.imshow(pixels, cmap="gray", vmin=0 if high else None, vmax=high)
            axis.set_title(title, fontsize=8)
    figure.tight_layout(pad=0.3)
    file = memory.BytesIO()
    figure.savefig(file, format="png", dpi=110)
    plt.close(figure)
    save_picture(name, file.getvalue())


def slices(volume: np.ndarray) -> list[np.ndarray]:
    z, y, x = (n // 2 for n in volume.shape[:3])
    return [volume[z], volume[:, y], volume[:, :, x]]


def textures() -> None:
    rows = []
    for name, (_, parameters) in TEXTURES.items():
        exemplar = texture(name)
        settings = {"iterations": 1000, "evaluate_every": 1000, **parameters}
        made = fit(name, exemplar, **settings).sample((1, 512, 512), seed=1)
        crop = exemplar.array[0, :128, :128]
        rows.append(
            [
                (f"{name}: a crop of 128²", crop),
                ("512², to the same scale", made.array[0]),
            ]
        )
    draw("periodic_field_textures", rows, 3.2)


def volumes() -> None:
    exemplars = {
        "bone": io.read(DATA / "trabecular_bone_gray_100.tif"),
        "Berea": io.read(DATA / "berea_sandstone_binary_200.tif"),
        "foam": foam((96, 96, 96), seed=1),
    }
    rows = []
    for name, exemplar in exemplars.items():
        engine = fit(name, exemplar)
        made = engine.sample((128, 128, 128), seed=1)
        judge = Judge(engine._phases.phase > 0)
        solid = engine._phases.phase_of(made.array) > 0
        MEASURED[name]["sampled"] = judge(solid, made.array).figures
        own = exemplar.array[:128, :128, :128]
        titles = [f"{name}, {axis}" for axis in "zyx"]
        panels = [*zip(titles, slices(own), strict=True)]
        panels += zip(["new"] * 3, slices(made.array), strict=True)
        rows.append(panels)
    draw("periodic_field_volumes", rows, 1.7)


def density() -> None:
    engine = fit("density", foam((96, 96, 96), seed=1), guidance="density", iterations=800)
    sweep = []
    for factor in (0.0, 0.25, 0.5, 0.75, 1.0):
        field = engine.sample_field((64, 64, 64), seed=2, guidance=factor).array
        share = float((field > 0).mean())
        MEASURED["density"].setdefault("solid_fraction", {})[str(factor)] = share
        sweep.append((f"density {factor:g}: solid {share:.2f}", field[32] > 0))
    field = engine.sample_field((64, 64, 320), seed=3, guidance=(0.0, 1.0)).array
    MEASURED["density"]["gradient"] = [float((p > 0).mean()) for p in np.split(field, 5, axis=2)]
    figure, axes = plt.subplots(2, 5, figsize=(10, 4.2))
    for axis, (title, pixels) in zip(axes[0], sweep, strict=True):
        axis.imshow(pixels, cmap="gray")
        axis.set_title(title, fontsize=8)
    for axis in axes.ravel():
        axis.axis("off")
    wide = figure.add_subplot(2, 1, 2)
    wide.imshow(field[32] > 0, cmap="gray")
    wide.set_title("density from 0 to 1 along x", fontsize=8)
    wide.axis("off")
    file = memory.BytesIO()
    figure.savefig(file, format="png", dpi=100)
    plt.close(figure)
    save_picture("periodic_field_density", file.getvalue())


def noise() -> None:
    engine = fit("noise scale", foam((96, 96, 96), seed=1))
    row = []
    for scale in (0.5, 1.0, 2.0):
        made = engine.sample((128, 128, 128), seed=4, noise_scale=scale)
        row.append((f"noise scale {scale:g}", made.array[64]))
    draw("periodic_field_noise_scale", [row])


def tile() -> None:
    image = io.read(DATA / "2d" / "sandstone.png")
    engine = fit("tile", image)
    shape = (1, *(round(t) for t in engine.period_))
    constant = engine.sample(shape, seed=5, latent="constant", boundary="periodic").array[0]
    large = (1, *(2 * n for n in shape[1:]))
    varied = engine.sample(large, seed=5, boundary="periodic").array[0]
    mirrored = engine.sample(large, seed=5, mirrored=True, cut_at="exemplar").array[0]
    own = image.array[0][: large[1], : large[2]]
    row = [("exemplar, tiled: seams", np.tile(own, (2, 2)))]
    row += [("constant latent, 4 × 4 tiles", np.tile(constant, (4, 4)))]
    row += [("periodic, 2 × 2 tiles", np.tile(varied, (2, 2)))]
    row += [("mirrored, 2 × 2 tiles", np.tile(mirrored, (2, 2)))]
    draw("periodic_field_tiles", [row])
    MEASURED["tile"]["step_at_seam"] = {
        title: seam(pixels) for title, pixels in (("exemplar", own), ("periodic", varied))
    }


def seam(pixels: np.ndarray) -> float:
    """Share of pixels that differ across the seam, over that between any neighbours inside."""
    across = np.mean(pixels[0] != pixels[-1]) + np.mean(pixels[:, 0] != pixels[:, -1])
    inside = np.mean(pixels[1:] != pixels[:-1]) + np.mean(pixels[:, 1:] != pixels[:, :-1])
    return float(across / inside)


FIGURES: dict[str, Callable[[], None]] = {
    "density": density,
    "volumes": volumes,
    "noise": noise,
    "tile": tile,
    "textures": textures,
}


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--only", nargs="+", choices=FIGURES, default=list(FIGURES))
    given = arguments.parse_args()
    earlier = RESULTS / "periodic_field_figures.json"
    if earlier.exists():
        MEASURED.update(json.loads(earlier.read_text())["figures"])
    for name in given.only:
        FIGURES[name]()
        save("periodic_field_figures", MEASURED)


if __name__ == "__main__":
    main()
