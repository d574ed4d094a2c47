"""Without the extra: the other engines work, and the neural ones say what they need."""

from __future__ import annotations

import subprocess
import sys

HIDE = """
import importlib.util, sys
found = importlib.util.find_spec
importlib.util.find_spec = lambda name, *a: None if name in HIDDEN else found(name, *a)
class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in HIDDEN:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Hidden())
"""


def said_without(package: str, *arguments: str) -> tuple[int, str]:
    start = "from poresynth.cli import main"
    code = f"HIDDEN = [{package!r}]{HIDE}{start}\nsys.exit(main({arguments!r}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    return done.returncode, done.stderr


def test_a_neural_engine_without_pytorch_is_one_line_with_the_remedy() -> None:
    for package in ("torch", "safetensors"):
        code, said = said_without(package, "train", "none.tif", "-o", "model")
        assert code == 2
        assert said.splitlines() == [
            "poresynth: error: a neural engine needs an optional package: "
            "pip install 'poresynth[neural]'"
        ]


def test_the_other_engines_do_without() -> None:
    words = ["synthesize", "none.tif", "-o", "new.tif", "--shape", "8", "8", "8"]
    code, said = said_without("torch", *words)
    assert code == 2
    assert "none.tif: no such file" in said


def test_importing_loads_no_network_library_until_an_engine_is_asked_for() -> None:
    code = "import sys, poresynth.engines, poresynth.cli, poresynth.workflow.models\n"
    code += "assert 'torch' not in sys.modules\n"
    code += "poresynth.engines.get_engine('scaffoldgan')\nassert 'torch' in sys.modules"
    subprocess.run([sys.executable, "-W", "error", "-c", code], check=True)
