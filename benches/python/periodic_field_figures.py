"""Pictures of PeriodicField: textures, volumes, density, the scale of the noise, tiles.

    PORESYNTH_DATA=… python benches/python/periodic_field_figures.py [honeycomb volumes …]

One word a picture, all by default; "table" measures volumes. Every network is trained here, on one
thread, with the preset tiny unless the tables below say otherwise. Pictures go to docs/images, what
was measured to benches/results/periodic_field_figures.json. Without the folder PORESYNTH_DATA,
textures are drawn ones, and volumes procedural.
"""

from __future__ import annotations

import argparse
import io as memory
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from matplotlib.figure import Figure
from readme import load, save, save_picture
from scipy.ndimage import uniform_filter
from texture_images import DATA, texture

from poresynth import console, io
from poresynth.engines.neural.judge import Judge
from poresynth.engines.periodic_field import PeriodicField
from poresynth.engines.periodic_field.guidance import density as eq_6
from poresynth.engines.periodic_field.guidance import ranks
from poresynth.exemplars import foam, spinodal
from poresynth.report.render3d import surface_picture
from poresynth.volume import Volume

RESULTS = "periodic_field_figures"
# What differs from the preset small.
TEXTURES: dict[str, dict[str, Any]] = {
    # The comb's own period, of two rows; an octave more would double that along x.
    "honeycomb": {"period": (49.8, 29.2), "bandwidth": 4, "spacing": 1.5},
    # Two patches of the cloth, the light one and the dark one; no peak tells them.
    "crosshatch": {"iterations": 9000, "period": (118.0, 124.0), "bandwidth": 6},
    # A fine mesh inside a wide one, whose cells are 44 pixels across.
    "veins": {
        "period": 44.0,
        "encoded": "none",
        "points": (1, 8),
        "start_model": "edges of cells",
        "critic_maps": (24, 48, 96, 96),
    },
}
SCANS = {"bone": "trabecular_bone_gray_100.tif", "Berea": "berea_sandstone_binary_200.tif"}
MEDIA: dict[str, Callable[[], Volume]] = {
    **{
        name: partial(io.read, DATA / file)
        for name, file in SCANS.items()
        if (DATA / file).exists()
    },
    "foam": lambda: foam((96, 96, 96), seed=1),
    "spinodal": lambda: spinodal((64, 64, 64), seed=1),
}
# Of the volumes in pictures.
EDGE = 96
MEASURED: dict[str, Any] = {}
FITTED: dict[str, PeriodicField] = {}

Pixels = npt.NDArray[Any]
Panel = tuple[str, Pixels]


def fit(name: str, exemplar: Volume, models: Path | None, **parameters: Any) -> PeriodicField:
    """Train once, and note the processor's seconds and how near it came."""
    torch.set_num_threads(1)
    kept = None if models is None else models / f"{name}.safetensors"
    if name not in FITTED and kept is not None and kept.exists():
        FITTED[name] = PeriodicField.load(kept, device="cpu")
        MEASURED.setdefault(name, {})
    if name not in FITTED:
        begin = time.process_time()
        with console.progress(name) as report:
            engine = PeriodicField(device="cpu", **parameters).fit(exemplar, progress=report)
        MEASURED[name] = {
            "parameters": parameters,
            "cpu_seconds": round(time.process_time() - begin, 1),
            "period": engine.period_,
            **engine.training_,
        }
        save(RESULTS, MEASURED)
        if kept is not None:
            engine.save(kept)
        FITTED[name] = engine
    return FITTED[name]


def medium(name: str, models: Path | None, seed: int = 0) -> PeriodicField:
    """Train on one of `MEDIA`."""
    return fit(f"{name}, training {seed}", MEDIA[name](), models, training_seed=seed)


def draw(name: str, rows: Sequence[Sequence[Panel]]) -> None:
    """Write a picture of rows of panels, pixel by pixel."""
    dots, gap, title = 100, 8, 20
    heights = [max(p.shape[0] for _, p in row) + title for row in rows]
    width = max(sum(p.shape[1] + gap for _, p in row) for row in rows)
    figure = Figure(figsize=(width / dots, sum(heights) / dots), dpi=dots)
    bottom = sum(heights)
    for row, height in zip(rows, heights, strict=True):
        bottom, left = bottom - height, gap // 2
        for text, pixels in row:
            h, w = pixels.shape[:2]
            top = bottom + height - title
            box = (left / width, (top - h) / sum(heights), w / width, h / sum(heights))
            axis = figure.add_axes(box)
            high = 255 if pixels.dtype == np.uint8 else None
            axis.imshow(pixels, cmap="gray", vmin=0 if high else None, vmax=high, aspect="auto")
            axis.set_title(text, fontsize=8, pad=3, loc="left")
            axis.axis("off")
            left += w + gap
    file = memory.BytesIO()
    figure.savefig(file, format="png")
    save_picture(f"periodic_field_{name}", file.getvalue())


def surface(solid: npt.NDArray[np.bool_], pixel: float = 1.0) -> Pixels:
    """The surface of a solid on white."""
    picture = surface_picture(solid, (1.0, 1.0, 1.0), pixel)
    opacity = picture[..., 3:] / 255
    return np.rint(picture[..., :3] * opacity + 255 * (1 - opacity)).astype(np.uint8)


def coloured(name: str, models: Path | None) -> PeriodicField:
    """Train on one of `TEXTURES`."""
    return fit(name, texture(name), models, preset="small", **TEXTURES[name])


def image(name: str, models: Path | None) -> None:
    """A texture and, to the same scale, a field four times as wide as a crop of it."""
    made = coloured(name, models).sample((1, 512, 512), seed=1)
    crop = texture(name).array[0, :128, :128]
    draw(name, [[(f"{name}, 128²", crop), ("new, 512²", made.array[0])]])


def volumes(models: Path | None) -> None:
    """A slice and the surface of each medium, and of a new volume."""
    rows = []
    for name in MEDIA:
        if name == "spinodal":
            continue
        engine, own = medium(name, models), MEDIA[name]().array[:EDGE, :EDGE, :EDGE]
        made = engine.sample((EDGE, EDGE, EDGE), seed=1).array
        row = []
        for title, array in ((f"{name}, {EDGE}³", own), ("new", made)):
            solid = engine._phases.phase_of(array) > 0
            row += [(title, enlarged(gray(array[EDGE // 2]))), (" ", surface(solid, 0.7))]
        rows.append(row)
    draw("volumes", rows)


def gray(pixels: Pixels) -> Pixels:
    """Values from the least to the most as 0 … 255."""
    low, high = float(pixels.min()), float(pixels.max())
    return np.rint(255 * ((pixels - low) / (high - low))).astype(np.uint8)


def enlarged(pixels: Pixels) -> Pixels:
    """Twice as many pixels along an edge."""
    return pixels.repeat(2, 0).repeat(2, 1)


def table(models: Path | None) -> None:
    """Two trainings of each medium, two samples of each training."""
    for name, read in MEDIA.items():
        exemplar, found = read(), []
        for training_seed in (0, 1):
            engine = medium(name, models, training_seed)
            solid = engine._phases.phase > 0
            judge = Judge(solid)
            for seed in (1, 2):
                made = engine.sample(exemplar.shape, seed=seed)
                new = engine._phases.phase_of(made.array) > 0
                found.append(judge(new, made.array).figures)
        noise = np.random.default_rng(1).random(solid.shape) < solid.mean()
        MEASURED[name] = {
            "sampled": found,
            "exemplar": judge(solid, solid).figures,
            "white_noise": judge(noise, noise).figures,
        }
        save(RESULTS, MEASURED)


def density(models: Path | None) -> None:
    """Surfaces of one field, guided by a number, and by a gradient along x."""
    exemplar = foam((96, 96, 96), seed=1)
    short = {"iterations": 400, "start_iterations": 150, "places": 384, "grids": 32}
    engine = fit("density", exemplar, models, guidance="density", **short)
    found = MEASURED["density"]
    own = patches(engine._phases.phase > 0, engine.parameters_.crop)
    row = []
    for factor in (0.0, 0.25, 0.5, 0.75, 1.0):
        fields = [
            engine.sample_field((64, 64, 64), seed=seed, guidance=factor).array for seed in (1, 2)
        ]
        share = float(np.mean([field > 0 for field in fields]))
        found.setdefault("solid_fraction", {})[str(factor)] = share
        found.setdefault("patches_of_the_exemplar", {})[str(factor)] = own(factor)
        row.append((f"density {factor:g}: solid {share:.2f}", surface(fields[0] > 0, 0.7)))
    field = engine.sample_field((64, 64, 320), seed=3, guidance=(0.0, 1.0)).array
    found["gradient"] = [float((p > 0).mean()) for p in np.split(field, 5, axis=2)]
    draw("density", [row, [("density from 0 to 1 along x", surface(field > 0, 0.5))]])


def patches(solid: npt.NDArray[np.bool_], edge: int) -> Callable[[float], float]:
    """Mean share of solid of the exemplar's patches that are about so dense by Eq. 6."""
    rank = ranks(eq_6(solid, edge), edge)
    share = uniform_filter(solid.astype(float), edge)
    inside = (slice(edge // 2, -(edge - edge // 2)),) * 3
    rank, share = rank[inside], share[inside]

    def at(factor: float) -> float:
        near = np.argsort(np.abs(rank - factor), axis=None)[: rank.size // 20]
        return float(share.ravel()[near].mean())

    return at


def noise(models: Path | None) -> None:
    """One foam at three scales of its noise field."""
    engine = medium("foam", models)
    slices, surfaces = [], []
    for scale in (0.5, 1.0, 2.0):
        solid = engine.sample_field((128, 128, 128), seed=4, noise_scale=scale).array > 0
        slices.append((f"noise scale {scale:g}", enlarged(gray(solid[64]))))
        surfaces.append((" ", surface(solid, 0.7)))
    draw("noise", [slices, surfaces])


def tiles(models: Path | None) -> None:
    """An image and three fields side by side with themselves, and what differs at the seams."""
    path = DATA / "2d" / "sandstone.png"
    exemplar = io.read(path) if path.exists() else Volume(foam((96, 192, 192)).array[:1])
    engine = fit("tile", exemplar, models)
    edge = 96
    periodic = partial(engine.sample, (1, edge, edge), boundary="periodic")
    own = exemplar.array[0, :edge, :edge]
    mirrored = engine.sample((1, edge, edge), seed=5, mirrored=True, cut_at="exemplar").array[0]
    row = [
        ("exemplar, 2 × 2 tiles: seams", np.tile(own, (2, 2))),
        ("periodic, 2 × 2 tiles", np.tile(periodic(seed=5).array[0], (2, 2))),
        ("mirrored, 2 × 2 tiles", np.tile(mirrored, (2, 2))),
    ]
    comb = coloured("honeycomb", models)
    y, x = (round(n * t) for n, t in zip((2, 3), comb.period_, strict=True))
    whole = partial(comb.sample, (1, y, x), seed=5, boundary="periodic")
    row += [
        ("a comb, 2 × 2 tiles: seams", np.tile(comb.exemplar_.array[0, :y, :x], (2, 2, 1))),
        ("periodic, 2 × 2 tiles", np.tile(whole().array[0], (2, 2, 1))),
        ("constant latent, 2 × 2 tiles", np.tile(whole(latent="constant").array[0], (2, 2, 1))),
    ]
    draw("tiles", [row[:3], row[3:]])
    across = {
        "exemplar": [seam(tile) for tile in tiles_of(exemplar.array[0], edge)],
        "periodic": [seam(periodic(seed=seed).array[0]) for seed in range(40)],
    }
    MEASURED["tile"]["step_at_seam"] = {
        name: {"mean": float(np.mean(v)), "error": float(np.std(v) / np.sqrt(len(v)))}
        for name, v in across.items()
    }


def tiles_of(pixels: Pixels, edge: int) -> list[Pixels]:
    """All tiles side by side that an image has room for."""
    rows, columns = (n // edge for n in pixels.shape)
    return [
        pixels[y * edge : (y + 1) * edge, x * edge : (x + 1) * edge]
        for y in range(rows)
        for x in range(columns)
    ]


def seam(pixels: Pixels) -> float:
    """Share of pixels that differ across the seam, over that between any neighbours inside."""
    across = np.mean(pixels[0] != pixels[-1]) + np.mean(pixels[:, 0] != pixels[:, -1])
    inside = np.mean(pixels[1:] != pixels[:-1]) + np.mean(pixels[:, 1:] != pixels[:, :-1])
    return float(across / inside)


FIGURES: dict[str, Callable[[Path | None], None]] = {
    **{name: partial(image, name) for name in TEXTURES},
    "volumes": volumes,
    "density": density,
    "noise": noise,
    "tiles": tiles,
    "table": table,
}


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("figures", nargs="*", choices=[[], *FIGURES], default=[])
    arguments.add_argument("--models", type=Path, help="folder that keeps the networks")
    given = arguments.parse_args()
    MEASURED.update(load(RESULTS) or {})
    for name in given.figures or FIGURES:
        FIGURES[name](given.models)
        save(RESULTS, MEASURED)


if __name__ == "__main__":
    main()
