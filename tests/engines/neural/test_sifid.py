"""SIFID: weights from a local file, features, distances. The weights here are random."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import save_file
from scipy import ndimage, signal

from poresynth import io
from poresynth.cli import main
from poresynth.engines.neural.sifid import InceptionStem, load_stem, sifid
from poresynth.errors import FileError, ParameterError
from poresynth.metrics.frechet import frechet_distance


@pytest.fixture
def weights() -> dict[str, torch.Tensor]:
    torch.manual_seed(1)
    stem = InceptionStem()
    for name, tensor in stem.state_dict().items():
        if name.endswith("running_var"):
            tensor.uniform_(0.5, 2)
        elif "running_mean" in name or name.endswith("bn.bias"):
            tensor.normal_(0, 0.1)
    return stem.state_dict()


def picture(seed: int, grain: float) -> np.ndarray:
    noise = np.random.default_rng(seed).random((96, 80, 3))
    smooth = ndimage.gaussian_filter(noise, (grain, grain, 0), mode="wrap")
    return (255 * (smooth - smooth.min()) / np.ptp(smooth)).astype(np.uint8)


@pytest.mark.parametrize("suffix", [".safetensors", ".pth"])
def test_weights_come_from_a_file_of_the_whole_network(
    weights: dict[str, torch.Tensor], suffix: str, tmp_path: Path
) -> None:
    path = tmp_path / f"inception{suffix}"
    whole = {**weights, "Mixed_5b.branch1x1.conv.weight": torch.zeros(2, 2)}
    whole = {name: t for name, t in whole.items() if "num_batches" not in name}
    save_file(whole, path) if suffix == ".safetensors" else torch.save(whole, path)
    stem = load_stem(path)
    torch.testing.assert_close(stem.Conv2d_4a_3x3.conv.weight, weights["Conv2d_4a_3x3.conv.weight"])
    assert not stem.training


@pytest.mark.parametrize("content", [b"", b"no weights", None])
def test_a_file_of_something_else_is_refused(content: bytes | None, tmp_path: Path) -> None:
    for path in (tmp_path / "weights.pth", tmp_path / "weights.safetensors"):
        if content is not None:
            path.write_bytes(content)
        with pytest.raises(FileError, match="weights"):
            load_stem(path)
    save_file({"other": torch.zeros(1)}, tmp_path / "other.safetensors")
    with pytest.raises(FileError, match="no weights of Inception"):
        load_stem(tmp_path / "other.safetensors")


def test_the_layers_are_those_of_inception_v3(weights: dict[str, torch.Tensor]) -> None:
    stem = InceptionStem()
    stem.load_state_dict(weights)
    stem.eval()
    images = torch.rand(1, 3, 75, 75) * 2 - 1
    with torch.no_grad():
        assert stem(images, "first_pool").shape == (1, 64, 17, 17)
        found = stem(images, "second_pool")
        assert found.shape == (1, 192, 15, 15)
        first = stem.Conv2d_1a_3x3(images)[0, 5].numpy()
    # The first layer by hand: a correlation, every second place, normalised, rectified.
    kernel = weights["Conv2d_1a_3x3.conv.weight"][5].numpy()
    total = sum(
        signal.correlate2d(images[0, c].numpy(), kernel[c], mode="valid")[::2, ::2]
        for c in range(3)
    )
    part = {n: weights[f"Conv2d_1a_3x3.bn.{n}"][5].numpy() for n in ("weight", "bias")}
    mean = weights["Conv2d_1a_3x3.bn.running_mean"][5].numpy()
    variance = weights["Conv2d_1a_3x3.bn.running_var"][5].numpy()
    expected = (total - mean) / np.sqrt(variance + 0.001) * part["weight"] + part["bias"]
    np.testing.assert_allclose(first, np.maximum(expected, 0), atol=1e-5)


@pytest.mark.parametrize("layer", ["first_pool", "second_pool"])
def test_the_same_is_0_the_like_is_near_the_other_is_far(
    weights: dict[str, torch.Tensor], layer: str
) -> None:
    stem = InceptionStem()
    stem.load_state_dict(weights)
    stem.eval()
    exemplar, like, other = picture(1, 2), picture(2, 2), picture(3, 0.3)
    assert sifid(exemplar, exemplar, stem, layer) == pytest.approx(0, abs=1e-8)  # type: ignore[arg-type]
    near, far = (sifid(exemplar, image, stem, layer) for image in (like, other))  # type: ignore[arg-type]
    assert far > 3 * near > 0
    with torch.no_grad():
        rows = [
            stem((torch.from_numpy(p).float() / 127.5 - 1).permute(2, 0, 1)[None], layer)[0]
            for p in (exemplar, like)
        ]
    features = [r.reshape(len(r), -1).T.numpy() for r in rows]
    assert near == pytest.approx(frechet_distance(*features), rel=1e-3)


def test_gray_images_and_slices_will_do(weights: dict[str, torch.Tensor]) -> None:
    stem = InceptionStem()
    stem.load_state_dict(weights)
    stem.eval()
    gray = picture(1, 2)[..., 0]
    assert sifid(gray, np.stack([gray] * 3, -1)[None], stem) == pytest.approx(0, abs=1e-8)
    for wrong in (gray.astype(float), gray[:20], np.zeros((40, 40, 2), np.uint8)):
        with pytest.raises(ParameterError, match="image"):
            sifid(gray, wrong, stem)


def test_the_command_line_compares_two_images(
    weights: dict[str, torch.Tensor],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    save_file(weights, "inception.safetensors")
    first, second = picture(1, 2.0), picture(2, 4.0)
    io.write("first.png", first[None])
    io.write("second.png", second[None])
    command = ["compare", "first.png", "second.png", "--sifid", "inception.safetensors"]
    assert main([*command, "--json", "figures.json"]) == 0
    expected = sifid(first, second, load_stem("inception.safetensors"))
    assert f"SIFID: {expected:.4g}" in capsys.readouterr().out
    assert json.loads(Path("figures.json").read_text())["sifid"] == pytest.approx(expected)
    io.write("volume.tif", np.zeros((8, 9, 10), np.uint8))
    assert main(["compare", "first.png", "volume.tif", *command[3:]]) == 2
    assert "volume = (8, 9, 10): must be an image for --sifid" in capsys.readouterr().err
