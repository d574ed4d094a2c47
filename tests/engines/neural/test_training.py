"""The training loop, with a network so small that every case runs in a blink."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from poresynth import io
from poresynth.engines.neural.checkpoint import CHECKPOINT
from poresynth.engines.neural.judge import Evaluation, Judge
from poresynth.engines.neural.log import mid_slices
from poresynth.engines.neural.machine import Machine
from poresynth.engines.neural.parameters import TrainingParameters
from poresynth.engines.neural.training import COLLAPSED, Training, train
from poresynth.errors import FileError, MemoryEstimateError, ParameterError, TrainingError

SOLID = np.indices((12, 12, 12)).sum(0) % 6 < 3


class Regression:
    """Learns y = Σ x; the "porosity" that it is judged by is scripted."""

    generator = "net"

    def __init__(self, scores: list[float | None] | None = None) -> None:
        torch.manual_seed(0)
        net = nn.Sequential(nn.Linear(3, 8), nn.BatchNorm1d(8), nn.Tanh(), nn.Linear(8, 1))
        self.networks = {"net": net}
        self.optimizers = {"net": torch.optim.Adam(net.parameters(), 0.02)}
        self.notes = {"begun": "flat"}
        self.scores = scores
        self.kept: list[tuple[int, dict[str, Tensor]]] = []
        self.break_at: dict[int, Any] = {}

    def prepare(self, machine: Machine) -> None:
        self.net = machine.ready(self.networks["net"])

    def run(self, machine: Machine, iteration: int, random: torch.Generator) -> dict[str, Tensor]:
        def losses() -> dict[str, Tensor]:
            x = machine.put(torch.rand(machine.part, 3, generator=random))
            return {"square": (self.net(x) - x.sum(1, keepdim=True)).square().mean()}

        found = machine.update(self.optimizers["net"], losses)
        action = self.break_at.get(iteration)
        if isinstance(action, float):
            return {"square": torch.tensor(action)}
        if action is not None:
            action()
        return found

    def evaluate(self, generator: nn.Module) -> Evaluation:
        score: float | None
        if self.scores is None:
            x = torch.linspace(0, 1, 30).reshape(10, 3)
            with torch.no_grad():
                score = float((generator.eval()(x)[:, 0] - x.sum(1)).abs().mean())
        else:
            score = self.scores.pop(0)
        porosity = 0.5 if score is None or np.isfinite(score) else 1.0
        return Evaluation({"porosity": porosity}, score, SOLID.astype(np.uint8))

    def keep(self, generator: nn.Module, evaluation: Evaluation, training: Training) -> None:
        state = {k: v.clone() for k, v in generator.state_dict().items()}
        self.kept.append((training.iteration, state))


def parameters(**changes: Any) -> TrainingParameters:
    usual = {"iterations": 12, "batch": 8, "learning_rate": 0.02, "evaluate_every": 4}
    return TrainingParameters(**{**usual, "device": "cpu", **changes})


def weights(step: Regression) -> list[Tensor]:
    return [t.clone() for t in step.networks["net"].state_dict().values()]


def same(a: list[Tensor], b: list[Tensor]) -> bool:
    return all(torch.equal(x, y) for x, y in zip(a, b, strict=True))


def test_it_learns_keeps_the_best_and_logs(tmp_path: Path) -> None:
    step = Regression()
    found = train(step, parameters(iterations=200, evaluate_every=20), folder=tmp_path)
    lines = [json.loads(line) for line in (tmp_path / "log.jsonl").read_text().splitlines()]
    assert lines == found.records
    assert [line["iteration"] for line in lines] == list(range(20, 201, 20))
    assert lines[-1]["losses"]["square"] < 0.1 * lines[0]["losses"]["square"]
    assert found.best_score == min(line["score"] for line in lines)
    assert step.kept[-1][0] == found.best_iteration
    assert (found.iteration, found.ended) == (200, "all iterations")


def test_without_a_score_the_last_is_kept(tmp_path: Path) -> None:
    step, stages = Regression([None, float("inf"), None]), []
    found = train(
        step,
        parameters(patience=1),
        folder=tmp_path,
        progress=lambda stage, _: stages.append(stage),
    )
    assert (found.iteration, found.best_iteration) == (8, 4)
    assert [line["score"] for line in found.records] == [None, None]
    assert stages[-1] == "iteration 8 of 12"
    step = Regression([None, None, None])
    train(step, parameters(iterations=4), folder=tmp_path / "part")
    found = train(step, parameters(patience=1), folder=tmp_path / "part", resume=True)
    assert (found.ended, found.best_iteration) == ("all iterations", 12)


COMPILED = pytest.mark.skipif(shutil.which("g++") is None, reason="PyTorch compiles by g++")


@pytest.mark.filterwarnings("ignore")  # Of the compiler, on its own code.
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"ema": 0.9, "schedule": "cosine"},
        {"accumulate": 4},
        {"precision": "bfloat16", "accumulate": 2, "ema": 0.9},
        {"precision": "float16", "accumulate": 2, "ema": 0.9},
        pytest.param({"compile": True, "accumulate": 2, "ema": 0.9}, marks=COMPILED),
    ],
)
def test_a_resumed_training_is_the_uninterrupted_one_bit_for_bit(
    tmp_path: Path, changes: dict[str, Any]
) -> None:
    whole = Regression()
    train(whole, parameters(**changes), folder=tmp_path / "whole")

    class StopError(Exception):
        pass

    def stop(stage: str, fraction: float) -> None:
        if fraction > 0.45:  # After iteration 6, between two comparisons.
            raise StopError

    with pytest.raises(StopError):
        train(Regression(), parameters(**changes), folder=tmp_path / "parts", progress=stop)
    again = Regression()
    found = train(again, parameters(**changes), folder=tmp_path / "parts", resume=True)
    assert found.iteration == 12
    assert same(weights(whole), weights(again))
    assert [k for k, _ in again.kept] == [k for k, _ in whole.kept if k > 6]
    for (_, a), (_, b) in zip(again.kept, whole.kept[-len(again.kept) :], strict=True):
        assert same(list(a.values()), list(b.values()))
    assert [r["iteration"] for r in found.records] == [4, 8, 12]


def test_accumulation_averages_the_gradient_of_its_parts() -> None:
    # Without batch norm the parts of a batch are worth the whole.
    results = []
    for accumulate in (1, 4):
        step = Regression()
        step.networks["net"][1] = nn.Identity()
        train(step, parameters(iterations=1, accumulate=accumulate), folder=None)
        results.append(weights(step))
    for a, b in zip(*results, strict=True):
        assert torch.allclose(a, b, atol=1e-5)


def test_the_moving_average_is_what_is_judged() -> None:
    step = Regression(scores=[3.0])
    train(step, parameters(iterations=4, ema=0.5))
    expected = Regression(scores=[])
    average = [p.detach().clone() for p in expected.networks["net"].parameters()]
    for i in range(1, 5):
        single = Regression(scores=[1.0])
        train(single, parameters(iterations=i, evaluate_every=i))
        for mean, p in zip(average, single.networks["net"].parameters(), strict=True):
            mean.lerp_(p.detach(), 0.5)
    kept = step.kept[0][1]
    names = [name for name, _ in step.networks["net"].named_parameters()]
    assert same([kept[n] for n in names], average)


def test_it_stops_when_the_comparison_no_longer_improves() -> None:
    step = Regression(scores=[5.0, 4.0, 4.5, 4.0, 6.0, 1.0])
    found = train(step, parameters(iterations=24, patience=3))
    assert (found.iteration, found.best_iteration, found.ended) == (20, 8, "no better one")


def test_a_loss_that_is_not_finite_ends_it_with_the_last_checkpoint_left(tmp_path: Path) -> None:
    step = Regression()
    step.break_at[9] = float("nan")
    with pytest.raises(TrainingError, match=r"square is not finite at iteration 10.*is kept"):
        train(step, parameters(), folder=tmp_path)
    found = train(Regression(), parameters(), folder=tmp_path, resume=True)
    assert found.iteration == 12


def test_collapse_is_given_up_only_after_several_comparisons(tmp_path: Path) -> None:
    one_phase = float("inf")
    step = Regression(scores=[5.0, one_phase, 4.0, *[one_phase] * COLLAPSED])
    with pytest.raises(TrainingError, match=r"collapsed.*was pore; the generator of iteration 12"):
        train(step, parameters(iterations=100), folder=tmp_path)


def test_a_generator_that_never_has_both_phases_is_no_result(tmp_path: Path) -> None:
    with pytest.raises(TrainingError, match=r"both phases in 12.*; no generator was kept"):
        train(Regression(scores=[float("inf")] * 3), parameters())
    with pytest.raises(TrainingError, match=r"; the last checkpoint lies in .*\. More iterations"):
        train(Regression(scores=[float("inf")] * 3), parameters(), folder=tmp_path)


def test_weights_that_are_not_finite_never_reach_a_checkpoint(tmp_path: Path) -> None:
    step = Regression()

    def spoil() -> None:
        with torch.no_grad():
            step.networks["net"][0].weight[0, 0] = torch.nan

    step.break_at[7] = spoil  # Its loss is a number still, and a comparison is due.
    with pytest.raises(TrainingError, match=r"some weights are not finite at iteration 8.*is kept"):
        train(step, parameters(), folder=tmp_path)
    whole, again = Regression(), Regression()
    train(again, parameters(), folder=tmp_path, resume=True)
    train(whole, parameters())
    assert same(weights(whole), weights(again))


NO_MEMORY = [
    torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 2 GiB"),
    RuntimeError("MPS backend out of memory (MPS allocated: 9 GB)"),
    RuntimeError("[enforce fail at alloc_cpu.cpp] DefaultCPUAllocator: can't allocate memory"),
]


@pytest.mark.parametrize("error", NO_MEMORY)
@pytest.mark.parametrize("where", ["prepare", "run", "evaluate", "keep"])
def test_too_little_memory_is_said_in_one_line(
    tmp_path: Path, error: RuntimeError, where: str
) -> None:
    train(Regression(), parameters(iterations=5), folder=tmp_path)
    step = Regression()

    def fail(*_: Any) -> Any:
        raise error

    setattr(step, where, fail)
    left = "" if where == "prepare" else r"the generator of iteration [45] is kept, and "
    message = rf"cpu has too little memory for 8 crops at once.*\. {left}the last checkpoint lies"
    with pytest.raises(MemoryEstimateError, match=message) as caught:
        train(step, parameters(), folder=tmp_path, resume=True)
    assert len(str(caught.value).splitlines()) == 1
    assert train(Regression(), parameters(), folder=tmp_path, resume=True).iteration == 12


def test_another_error_is_left_as_it_is() -> None:
    step = Regression()
    step.break_at[1] = lambda: torch.zeros(2) + torch.zeros(3)
    with pytest.raises(RuntimeError, match="size of tensor"):
        train(step, parameters())


@pytest.mark.parametrize("where", ["run", "evaluate", "keep"])
def test_ctrl_c_lets_the_iteration_finish_and_leaves_a_checkpoint(
    tmp_path: Path, where: str
) -> None:
    step = Regression()
    usual = getattr(step, where)

    def interrupted(*given: Any) -> Any:
        os.kill(os.getpid(), signal.SIGINT)
        return usual(*given)

    setattr(step, where, interrupted)
    with pytest.raises(KeyboardInterrupt):
        train(step, parameters(), folder=tmp_path)
    whole, again = Regression(), Regression()
    found = train(again, parameters(), folder=tmp_path, resume=True)
    train(whole, parameters())
    assert same(weights(whole), weights(again))
    assert [record["iteration"] for record in found.records] == [4, 8, 12]


def test_ctrl_c_before_the_first_iteration_leaves_the_checkpoint_that_was(tmp_path: Path) -> None:
    train(Regression(), parameters(iterations=5), folder=tmp_path)
    before = (tmp_path / CHECKPOINT).read_bytes()
    step = Regression()
    step.prepare = lambda machine: os.kill(os.getpid(), signal.SIGINT)  # type: ignore[method-assign]
    with pytest.raises(KeyboardInterrupt):
        train(step, parameters(), folder=tmp_path, resume=True)
    assert (tmp_path / CHECKPOINT).read_bytes() == before


@pytest.mark.skipif(sys.platform != "linux", reason="limits the size of files, as Linux does")
def test_a_full_disk_leaves_the_checkpoint_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import resource

    from poresynth.engines.neural import training

    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    usual, saves = training.save_checkpoint, []

    def save_in_little_room(*given: Any) -> None:
        saves.append(given)
        room = 1000 if len(saves) == 2 else limits[0]
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, limits[1]))
        try:
            usual(*given)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)

    monkeypatch.setattr(training, "save_checkpoint", save_in_little_room)
    with pytest.raises(FileError, match=rf"{CHECKPOINT}: .*(large|room)"):
        train(Regression(), parameters(), folder=tmp_path)
    assert not list(tmp_path.glob(".*"))
    whole, again = Regression(), Regression()
    found = train(again, parameters(), folder=tmp_path, resume=True)
    train(whole, parameters())
    assert same(weights(whole), weights(again))
    assert [record["iteration"] for record in found.records] == [4, 8, 12]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_log_that_finds_no_room_is_one_line(tmp_path: Path) -> None:
    step = Regression()
    usual = step.evaluate

    def evaluate(generator: nn.Module) -> Evaluation:
        (tmp_path / "log.jsonl").unlink()
        (tmp_path / "log.jsonl").symlink_to("/dev/full")
        return usual(generator)

    step.evaluate = evaluate  # type: ignore[method-assign]
    with pytest.raises(FileError, match=r"log\.jsonl: no room left on the disk"):
        train(step, parameters(), folder=tmp_path)


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    for place in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(FileError, match="file"):
            train(Regression(), parameters(), folder=place)
    (tmp_path / "slices").write_text("no folder")
    exemplar = SOLID.astype(np.uint8)
    with pytest.raises(FileError, match="slices"):
        train(Regression(), parameters(), folder=tmp_path, exemplar=exemplar)


def test_a_second_ctrl_c_breaks_the_iteration_off() -> None:
    step = Regression()

    def twice() -> None:
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGINT)
        raise AssertionError("went on")

    step.break_at[1] = twice
    with pytest.raises(KeyboardInterrupt):
        train(step, parameters())


@pytest.mark.parametrize("change", [{"batch": 16}, {"learning_rate": 0.1}, {"training_seed": 1}])
def test_another_training_is_not_resumed(tmp_path: Path, change: dict[str, Any]) -> None:
    train(Regression(), parameters(), folder=tmp_path)
    with pytest.raises(ParameterError, match=f"{next(iter(change))} = .* to be resumed"):
        train(Regression(), parameters(**change), folder=tmp_path, resume=True)


def test_another_exemplar_is_not_resumed(tmp_path: Path) -> None:
    train(Regression(), parameters(), folder=tmp_path, identity={"exemplar": "a"})
    with pytest.raises(ParameterError, match="exemplar = b"):
        train(Regression(), parameters(), folder=tmp_path, resume=True, identity={"exemplar": "b"})


def test_more_iterations_may_be_asked_for(tmp_path: Path) -> None:
    train(Regression(), parameters(), folder=tmp_path)
    found = train(Regression(), parameters(iterations=20), folder=tmp_path, resume=True)
    assert found.iteration == 20


def test_what_cannot_be_resumed(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="holds no checkpoint"):
        train(Regression(), parameters(), folder=tmp_path, resume=True)
    with pytest.raises(ParameterError, match="needs the folder"):
        train(Regression(), parameters(), resume=True)
    (tmp_path / CHECKPOINT).write_bytes(b"no such thing")
    with pytest.raises(FileError, match="not a checkpoint, or damaged"):
        train(Regression(), parameters(), folder=tmp_path, resume=True)


def test_a_truncated_checkpoint_is_refused(tmp_path: Path) -> None:
    train(Regression(), parameters(), folder=tmp_path)
    path = tmp_path / CHECKPOINT
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(FileError, match="damaged"):
        train(Regression(), parameters(), folder=tmp_path, resume=True)


def test_a_batch_that_the_parts_do_not_divide() -> None:
    with pytest.raises(ValueError, match="must divide the batch, 8"):
        parameters(accumulate=3)


def test_a_device_that_is_not_there() -> None:
    with pytest.raises(ParameterError, match="device = quantum"):
        train(Regression(), parameters(device="quantum"))


def test_bfloat16_trains(tmp_path: Path) -> None:
    found = train(Regression(), parameters(iterations=60, precision="bfloat16"), folder=tmp_path)
    assert found.records[-1]["score"] < found.records[0]["score"]


def test_float16_scales_the_loss_and_leaves_out_a_step_that_overflows(tmp_path: Path) -> None:
    step = Regression()
    step.networks["net"][1] = nn.Identity()  # Whose factor would hide that of the loss.
    # Its gradient is too large for half precision, its loss is not.
    usual = step.run

    def run(machine: Machine, iteration: int, random: torch.Generator) -> dict[str, Tensor]:
        before = weights(step)
        found = usual(machine, iteration, random)
        moved.append(not same(before, weights(step)))
        scales.append(machine.scaler_state()["scale"])
        return found

    moved: list[bool] = []
    scales: list[float] = []
    step.run = run  # type: ignore[method-assign]
    train(step, parameters(precision="float16", iterations=60), folder=tmp_path)
    left_out = moved.count(False)
    assert scales[0] == 2.0 ** (16 - (not moved[0]))
    assert scales[-1] == 2.0 ** (16 - left_out)
    assert moved[-1]
    assert Machine(parameters()).scaler_state() == {}


def test_pictures_show_the_volume_above_the_exemplar(tmp_path: Path) -> None:
    exemplar = np.indices((10, 12, 14)).sum(0).astype(np.uint8)
    train(Regression(), parameters(), folder=tmp_path, exemplar=exemplar)
    pictures = sorted((tmp_path / "slices").iterdir())
    assert [p.name for p in pictures] == ["000004.png", "000008.png", "000012.png"]
    shown = io.read(pictures[0]).array[0]
    assert np.array_equal(shown, mid_slices(SOLID.astype(np.uint8), exemplar))
    low, high = exemplar.min(), exemplar.max()
    expected = np.rint(255 * (exemplar[5] - float(low)) / (high - low))
    assert np.array_equal(shown[16:28, :14], expected)


def test_tensorboard_gets_the_curves_and_the_pictures(tmp_path: Path) -> None:
    events = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    exemplar = SOLID.astype(np.uint8)
    found = train(Regression(), parameters(), folder=tmp_path, exemplar=exemplar)
    board = events.EventAccumulator(str(tmp_path / "tensorboard")).Reload()
    assert [e.step for e in board.Scalars("losses/square")] == [4, 8, 12]
    values = [r["losses"]["square"] for r in found.records]
    assert [e.value for e in board.Scalars("losses/square")] == pytest.approx(values)
    assert [e.value for e in board.Scalars("figures/porosity")] == [0.5] * 3
    assert [(e.step, e.height, e.width) for e in board.Images("slices")] == [
        (step, *mid_slices(exemplar, exemplar).shape) for step in (4, 8, 12)
    ]


def test_without_tensorboard_it_says_so_and_trains(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from poresynth.engines.neural import log

    monkeypatch.setattr(log.importlib.util, "find_spec", lambda name: None)
    assert "poresynth[neural]" in (log.tensorboard_missing() or "")
    train(Regression(), parameters(), folder=tmp_path)
    assert not (tmp_path / "tensorboard").exists()


def test_two_processes_have_the_same_weights_and_see_different_crops(tmp_path: Path) -> None:
    program = """
import sys
sys.path.insert(0, sys.argv[1])
import torch, torch.distributed as dist
from poresynth.engines.neural import training
from test_training import Regression, parameters, weights
out, drawn = {}, []
class Two(Regression):
    def run(self, machine, iteration, random):
        drawn.append(machine.put(torch.rand(3, generator=random)).tolist())
        out["rank"] = machine.rank
        return super().run(machine, iteration, random)
step = Two()
found = training.train(step, parameters(batch=16), folder=__import__("pathlib").Path(sys.argv[2]))
torch.save((weights(step), drawn[0], found.iteration), f"{sys.argv[2]}/{out['rank']}.pt")
"""
    script = tmp_path / "two.py"
    script.write_text(program)
    launcher = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node=2"]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [*launcher, script, Path(__file__).parent, tmp_path],
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    (a, drawn_a, n), (b, drawn_b, _) = (torch.load(tmp_path / f"{rank}.pt") for rank in (0, 1))
    assert n == 12
    assert same(a, b)
    assert drawn_a != drawn_b


# --- the judge --------------------------------------------------------------------------------


def test_a_volume_is_alike_itself_and_white_noise_is_not(rng: np.random.Generator) -> None:
    from poresynth.exemplars import spinodal

    solid = spinodal((48, 48, 48), porosity=0.6, wavelength=12).array > 125
    judge = Judge(solid)
    own, noise = judge(solid, solid), rng.permutation(solid.ravel()).reshape(solid.shape)
    assert own.score == 0
    assert own.figures["porosity_error_percent"] == 0
    white = judge(noise, noise)
    assert white.figures["porosity_error_percent"] == 0
    assert white.figures["covariance_error_percent"] == pytest.approx(100, abs=5)
    assert white.figures["axis_repeat"] < 0.05


def test_a_lattice_shows_in_the_axis_repeat() -> None:
    lattice = (np.indices((48, 48, 48)) // 6 % 2).sum(0) > 1
    assert Judge(lattice)(lattice, lattice).figures["axis_repeat"] > 0.4


def test_one_phase_has_no_score() -> None:
    judge = Judge(SOLID)
    for phase, name in ((True, "solid"), (False, "pore")):
        found = judge(np.full((8, 8, 8), phase), SOLID)
        assert found.score == np.inf
        assert found.one_phase == name
