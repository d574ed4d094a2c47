"""Pictures of PeriodicField: textures, volumes, density, the scale of the noise, tiles.

    PORESYNTH_DATA=… python benches/python/periodic_field_figures.py [--only density tile …]

Every network is trained here, on one thread, with the preset tiny unless the tables below say
otherwise. Pictures go to docs/images, what was measured to
benches/results/periodic_field_figures.json.
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
from scipy.ndimage import uniform_filter

from poresynth import io
from poresynth.engines.neural.judge import Judge
from poresynth.engines.periodic_field import PeriodicField
from poresynth.engines.periodic_field.guidance import _ranks
from poresynth.engines.periodic_field.guidance import density as eq_6
from poresynth.exemplars import foam, spinodal
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
MEDIA: dict[str, Callable[[], Volume]] = {
    "bone": lambda: io.read(DATA / "trabecular_bone_gray_100.tif"),
    "Berea": lambda: io.read(DATA / "berea_sandstone_binary_200.tif"),
    "foam": lambda: foam((96, 96, 96), seed=1),
    "spinodal": lambda: spinodal((64, 64, 64), seed=1),
}
MEASURED: dict[str, Any] = {}
# Where networks are kept, and taken from on another run.
MODELS: Path | None = None

Panel = tuple[str, np.ndarray]


def texture(name: str) -> Volume:
    return downsample(io.read(DATA / "2d" / TEXTURES[name][0]), 2, labels=False)


def fit(name: str, exemplar: Volume, **parameters: Any) -> PeriodicField:
    """Train, on one thread, and note how long it took and how near it came; once, if kept."""
    torch.set_num_threads(1)
    kept = None if MODELS is None else MODELS / f"{name}.safetensors"
    if kept is not None and kept.exists():
        return PeriodicField.load(kept, device="cpu")
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
    save("periodic_field_figures", MEASURED)
    if kept is not None:
        engine.save(kept)
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
    """Two trainings of each medium, two samples of each training."""
    rows = []
    for name, read in MEDIA.items():
        exemplar, found = read(), []
        for training_seed in (0, 1):
            engine = fit(f"{name}, training {training_seed}", exemplar, training_seed=training_seed)
            judge = Judge(engine._phases.phase > 0)
            for seed in (1, 2):
                made = engine.sample((128, 128, 128), seed=seed)
                solid = engine._phases.phase_of(made.array) > 0
                found.append(judge(solid, made.array).figures)
                if training_seed == 0 and seed == 1:
                    shown = made.array
        solid = engine._phases.phase > 0
        noise = np.random.default_rng(1).random(solid.shape) < solid.mean()
        MEASURED[name] = {
            "sampled": found,
            "exemplar": judge(solid, solid).figures,
            "white_noise": judge(noise, noise).figures,
        }
        print(name, json.dumps(MEASURED[name]), flush=True)
        own = exemplar.array[:128, :128, :128]
        titles = [f"{name}, {axis}" for axis in "zyx"]
        panels = [*zip(titles, slices(own), strict=True)]
        panels += zip(["new"] * 3, slices(shown), strict=True)
        rows.append(panels)
    draw("periodic_field_volumes", rows, 1.7)


def density() -> None:
    exemplar = foam((96, 96, 96), seed=1)
    engine = fit("density", exemplar, guidance="density")
    found = MEASURED["density"]
    own = patches(engine._phases.phase > 0, engine.parameters_.crop)
    sweep = []
    for factor in (0.0, 0.25, 0.5, 0.75, 1.0):
        fields = [
            engine.sample_field((64, 64, 64), seed=seed, guidance=factor).array for seed in (1, 2)
        ]
        share = float(np.mean([field > 0 for field in fields]))
        found.setdefault("solid_fraction", {})[str(factor)] = share
        found.setdefault("patches_of_the_exemplar", {})[str(factor)] = own(factor)
        sweep.append((f"density {factor:g}: solid {share:.2f}", fields[0][32] > 0))
    field = engine.sample_field((64, 64, 320), seed=3, guidance=(0.0, 1.0)).array
    found["gradient"] = [float((p > 0).mean()) for p in np.split(field, 5, axis=2)]
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


def patches(solid: np.ndarray, edge: int) -> Callable[[float], float]:
    """Mean share of solid of the exemplar's patches that are about so dense by Eq. 6."""
    rank = _ranks(eq_6(solid, edge), edge)
    share = uniform_filter(solid.astype(float), edge)
    inside = (slice(edge // 2, -(edge - edge // 2)),) * 3
    rank, share = rank[inside], share[inside]

    def at(factor: float) -> float:
        near = np.argsort(np.abs(rank - factor), axis=None)[: rank.size // 20]
        return float(share.ravel()[near].mean())

    return at


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
    shape = (1, 96, 96)
    varied = engine.sample(shape, seed=5, boundary="periodic").array[0]
    mirrored = engine.sample(shape, seed=5, mirrored=True, cut_at="exemplar").array[0]
    own = image.array[0][:96, :96]
    row = [("exemplar, 2 × 2 tiles: seams", np.tile(own, (2, 2)))]
    row += [("periodic, 2 × 2 tiles", np.tile(varied, (2, 2)))]
    row += [("mirrored, 2 × 2 tiles", np.tile(mirrored, (2, 2)))]
    comb = texture("honeycomb")
    gray = fit("constant latent", comb.with_array(comb.array.mean(-1).astype(np.uint8)))
    shape = (1, *(round(t) for t in gray.period_))
    constant = gray.sample(shape, seed=5, latent="constant", boundary="periodic").array[0]
    row += [("constant latent, 4 × 4 tiles", np.tile(constant, (4, 4)))]
    draw("periodic_field_tiles", [row])
    image_steps = [seam(tile) for tile in tiles_of(image.array[0], 96)]
    periodic = [
        seam(engine.sample((1, 96, 96), seed=seed, boundary="periodic").array[0])
        for seed in range(40)
    ]
    MEASURED["tile"]["step_at_seam"] = {
        name: {"mean": float(np.mean(v)), "error": float(np.std(v) / np.sqrt(len(v)))}
        for name, v in (("exemplar", image_steps), ("periodic", periodic))
    }


def tiles_of(image: np.ndarray, edge: int) -> list[np.ndarray]:
    """All tiles side by side that an image has room for."""
    rows, columns = (n // edge for n in image.shape)
    return [
        image[y * edge : (y + 1) * edge, x * edge : (x + 1) * edge]
        for y in range(rows)
        for x in range(columns)
    ]


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
    arguments.add_argument("--models", type=Path, help="folder that keeps the networks")
    given = arguments.parse_args()
    global MODELS
    MODELS = given.models
    earlier = RESULTS / "periodic_field_figures.json"
    if earlier.exists():
        MEASURED.update(json.loads(earlier.read_text())["figures"])
    for name in given.only:
        FIGURES[name]()
        save("periodic_field_figures", MEASURED)


if __name__ == "__main__":
    main()
