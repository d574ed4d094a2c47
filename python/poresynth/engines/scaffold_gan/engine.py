"""Volumes from a volume: generative adversarial networks with a structural loss."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any, ClassVar, Literal, cast

import torch
from torch import nn

from poresynth.engines.base import ProgressCallback
from poresynth.engines.neural.engine import Boundary, NeuralEngine, Shape
from poresynth.engines.neural.noise import mix_seed
from poresynth.engines.neural.tiles import Tiles
from poresynth.engines.neural.training import Step
from poresynth.engines.scaffold_gan.calibration import calibrate
from poresynth.engines.scaffold_gan.networks import Generator
from poresynth.engines.scaffold_gan.parameters import ScaffoldParameters, resolve
from poresynth.engines.scaffold_gan.step import ScaffoldStep
from poresynth.engines.scaffold_gan.tiles import GeneratorTiles, tile_edge
from poresynth.errors import ParameterError
from poresynth.volume import Volume

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["ScaffoldGAN"]


class ScaffoldGAN(NeuralEngine):
    """Synthesise volumes with a generator that was trained against a discriminator.

    The method of Zhang, Yang, Li, Wu and Wang, *ScaffoldGAN: Synthesis of scaffold materials based
    on generative adversarial networks* (2021), with the networks that it compares with. Training
    takes minutes to hours; then a volume of any size takes seconds. A volume is a window of an
    endless one: `sample` says how windows of one seed fit together.

    Where the paper is silent, or cannot be meant as it is printed, a parameter's text says what was
    chosen and why.

    Parameters
    ----------
    preset : {"tiny", "small", "paper"}, default "small"
        Where the parameters that are not given come from. ``"tiny"``: crops of 32³, minutes on a
        CPU. ``"small"``: crops of 64³ and half of the paper's feature maps. ``"paper"``: the
        networks, batch and iterations of scaffoldgan_2021, for GPUs of a data centre: a batch of
        100 crops is some 9 TFLOP, so that its 40,000 iterations cannot have taken the 4 hours on a
        GTX 1080 that the paper states.
    variant : {"full", "structural", "gram", "adversarial", "patchgan", "extended"}, default "full"
        The losses, by the rows of the paper's Table 1. ``"adversarial"`` is the 3D-GAN baseline,
        ``"patchgan"`` judges patches, ``"gram"`` adds L_g, ``"structural"`` adds L_s, ``"full"``
        both. ``"extended"`` adds ours: sliced Wasserstein, soft porosity with the output's bias,
        and two-point.
    threshold : float, optional
        Gray value that parts pore from solid; Otsu's of the exemplar by default.
    solid : {"bright", "dark"}, default "bright"
        Which side of the threshold is solid.
    kind : {"auto", "gray", "binary", "label"}, default "auto"
        What the exemplar's values mean. Two values are binary, up to 16 integers labels, all else
        gray. Labels are learnt as one channel each.
    latent : int, default 100
        Values of a latent, uniform in [−1, 1]; the paper says uniform, DCGAN says where.
    generator_maps : tuple of int, default (512, 256, 128, 64)
        Feature maps of the generator's layers but the last. Their number sets the edge of the
        crops: 4 voxels, doubled once for each.
    discriminator_maps : tuple of int, default (64, 128, 256, 512)
        Feature maps of the discriminator's layers but the last.
    latents : {"endless", "one"}, default "endless"
        What a crop is made of in training. ``"one"`` latent and zeros around it, as in the paper;
        but no voxel of a larger volume is ever made so, for there latents overlap. ``"endless"``
        trains on what is sampled: a window of a lattice of latents, which takes about 1.3 times as
        long an iteration and needs fewer of them.
    stride : int, default 2
        Crops begin at multiples of it (§4.1).
    symmetry : {"none", "flips", "rotations", "full"}, default "none"
        Symmetric copies of the crops: 1, 8, 24 or 48. The paper has none; its preset too.
    keep_axis : {"z", "y", "x"}, optional
        Keep only symmetries that map this axis to itself, for a material with a direction.
    momentum : float, default 0.5
        β₁ of Adam, as in DCGAN; β₂ is 0.999.
    discriminator_rate : float, optional
        Learning rate of the discriminator; the generator's by default.
    generator_loss : {"non_saturating", "saturating"}, default "non_saturating"
        −log D(G(z)) as in DCGAN, whose settings the paper takes; or log(1 − D(G(z))) as its Eq. 1
        is printed, whose gradient vanishes while the discriminator is sure.
    patch_halvings : int, default 2
        Layers of stride 2 of a PatchGAN's discriminator: of five layers two see patches of 46
        voxels. The 2D original's three see 70, more than a crop.
    structural_weight : float
        λ_s, by the variant: 1.
    regions : tuple of int, default (8, 4, 2)
        Edges of the cubical regions of layers l₀, l₁, l₂, which are the steps between them too.
    region_shapes : {"cubes", "cuboids", "both"}, default "cubes"
        Cuboids are 2 : 1 : ½, long along each axis in turn (§2.3 names no ratios).
    table : int, optional
        Most regions of a layer's look-up table, at anchors that are drawn before training; all of
        the batch by default.
    gram_weight : float
        λ_g, by the variant: 0.1.
    gram_slices : int, default 4
        Slices across each axis; the paper says "multiple".
    porosity_weight, output_bias
        For one-sided exemplars (90 % void), which a generator meets with all void: the squared
        error of the soft porosity, and an output that begins at the exemplar's mean. By the
        variant: 0 and False; of ``"extended"`` 10 and True.
    two_point_weight : float
        Of the normalised covariance. By the variant: 0; of ``"extended"`` 1.
    sliced_weight, sliced_iterations
        Of the sliced-Wasserstein distance of 24 random filters of 6³ at two scales, which falls to
        nothing in so many iterations (a quarter of all by default): a fast start. By the variant:
        0; of ``"extended"`` 1.
    iterations : int
        At most; by the preset.
    batch : int
        Crops of an iteration, over all devices and accumulation steps; by the preset.
    accumulate : int, default 1
        Parts that a batch is computed in, one after the other, for less memory. Look-up table and
        Gram matrices of training samples are then those of the last part.
    learning_rate : float
        By the preset: 2e-4 as in DCGAN, 1e-3 of ``"tiny"``.
    schedule : {"constant", "cosine"}, default "constant"
        The learning rate over the iterations.
    ema : float
        Decay of the moving average of the generator's weights, which is then what is kept; by the
        preset: 0 (none) of the paper's.
    precision : {"float32", "bfloat16", "float16"}, default "float32"
        Of convolutions in training; sampling is float32.
    channels_last : bool, default False
        Memory order that reduced precision on a GPU wants.
    compile : bool, default False
        Let PyTorch compile the networks.
    device : str, default "auto"
        A GPU if there is one.
    evaluate_every : int
        Iterations between comparisons with the exemplar; by the preset.
    patience : int
        Comparisons without a better one that end a training; 0 never. By the preset.
    training_seed : int, default 0
        Of weights, crops and noise.

    Attributes
    ----------
    exemplar_ : Volume
        The exemplar.
    parameters_ : ScaffoldParameters
        All parameters, with those of preset and variant.
    threshold_ : float or None
        Gray value that parts pore from solid; None for labels.
    porosity_ : float
        The exemplar's porosity.
    generator_ : Generator
        The generator of the best comparison, its batch norms calibrated on a lattice of latents.
    training_ : dict
        Iterations, which generator was kept, its figures, seconds, and why the training ended.

    Examples
    --------
    >>> from poresynth.engines.scaffold_gan import ScaffoldGAN
    >>> from poresynth.exemplars import spinodal
    >>> engine = ScaffoldGAN(preset="tiny", iterations=4, evaluate_every=4, device="cpu")
    >>> try:
    ...     engine = engine.fit(spinodal((40, 40, 40)))
    ... except RuntimeError:  # Four iterations seldom make two phases.
    ...     pass
    """

    engine: ClassVar[str] = "scaffoldgan"
    parameters_: ScaffoldParameters

    def __init__(
        self,
        *,
        preset: Literal["tiny", "small", "paper"] = "small",
        variant: Literal["adversarial", "patchgan", "gram", "structural", "full", "extended"]
        | None = None,
        threshold: float | None = None,
        solid: Literal["bright", "dark"] | None = None,
        kind: Literal["auto", "gray", "binary", "label"] | None = None,
        latent: int | None = None,
        generator_maps: Sequence[int] | None = None,
        discriminator_maps: Sequence[int] | None = None,
        latents: Literal["one", "endless"] | None = None,
        stride: int | None = None,
        symmetry: Literal["none", "flips", "rotations", "full"] | None = None,
        keep_axis: Literal["z", "y", "x"] | None = None,
        momentum: float | None = None,
        discriminator_rate: float | None = None,
        generator_loss: Literal["non_saturating", "saturating"] | None = None,
        patch_halvings: int | None = None,
        structural_weight: float | None = None,
        regions: Sequence[int] | None = None,
        region_shapes: Literal["cubes", "cuboids", "both"] | None = None,
        table: int | None = None,
        gram_weight: float | None = None,
        gram_slices: int | None = None,
        porosity_weight: float | None = None,
        output_bias: bool | None = None,
        two_point_weight: float | None = None,
        sliced_weight: float | None = None,
        sliced_iterations: int | None = None,
        iterations: int | None = None,
        batch: int | None = None,
        accumulate: int | None = None,
        learning_rate: float | None = None,
        schedule: Literal["constant", "cosine"] | None = None,
        ema: float | None = None,
        precision: Literal["float32", "bfloat16", "float16"] | None = None,
        channels_last: bool | None = None,
        compile: bool | None = None,  # noqa: A002
        device: str | None = None,
        evaluate_every: int | None = None,
        patience: int | None = None,
        training_seed: int | None = None,
    ) -> None:
        given = dict(locals())
        del given["self"]
        self.parameters: dict[str, Any] = given

    def _resolve(self, exemplar: Volume) -> ScaffoldParameters:
        return resolve(self.parameters)

    def _check(self, exemplar: Volume) -> None:
        crop = self.parameters_.crop
        if min(exemplar.shape) < crop:
            raise ParameterError(
                "exemplar",
                exemplar.shape,
                f"must have at least {crop} voxels along each axis, the edge of a crop; 32 are "
                "enough for preset = tiny, 16 for two generator_maps",
            )

    def check_shape(self, shape: Shape, boundary: Boundary) -> None:
        """Raise `ParameterError` for a volume that no training of these parameters could make."""
        unit = 1 << len(resolve(self.parameters).generator_maps)
        if boundary == "periodic" and any(n % unit for n in shape):
            allowed = f"must be multiples of {unit} along each axis for a periodic volume"
            raise ParameterError("shape", shape, allowed)

    def _generator(self) -> Generator:
        p = self.parameters_
        return Generator(p.latent, p.generator_maps, self._scaling.channels)

    def _step(self, field: torch.Tensor, progress: ProgressCallback | None) -> Step:
        threshold = self._scaling.threshold
        return ScaffoldStep(self.parameters_, field, threshold, self._evaluate, self._keep)

    def _calibrate(self, generator: nn.Module) -> None:
        seed = mix_seed(self.parameters_.training_seed, 0xCA11)
        calibrate(cast(Generator, generator), seed)

    def _tiles(
        self, generator: nn.Module, seed: int, shape: Shape, boundary: Boundary, options: Any = None
    ) -> Tiles:
        self.check_shape(shape, boundary)
        period = shape if boundary == "periodic" else None
        return GeneratorTiles(cast(Generator, generator), seed, self.parameters_.crop, period)

    def _tile_memory(self) -> int:
        """Return four times the largest layer, input and output, and what the library keeps.

        Measured on a CPU: 26 MB of the preset tiny (here 31), 153 of small (204) and 301 of paper
        (391).
        """
        p = self.parameters_
        edge = tile_edge(p.crop)
        voxels, widths = [], [*p.generator_maps, self._scaling.channels]
        for layer, width in enumerate(widths):
            doublings = len(p.generator_maps) - layer
            voxels.append(width * ((edge >> doublings) + 2) ** 3)
        largest = max(a + b for a, b in itertools.pairwise(voxels))
        return 4 * 4 * largest + (16 << 20)
