"""What the command line says on the way."""

from __future__ import annotations

import pytest

from poresynth import console


@pytest.fixture(autouse=True)
def plain(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("FORCE_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE"):
        monkeypatch.delenv(name, raising=False)


def test_an_error_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    console.error("shape = 3:\n  must be larger")
    assert capsys.readouterr().err == "poresynth: error: shape = 3: must be larger\n"


def test_without_a_terminal_a_line_comes_every_tenth(capsys: pytest.CaptureFixture[str]) -> None:
    with console.progress("synthesis") as report:
        for i in range(1001):
            report("level 1", i / 1000)
    said = capsys.readouterr()
    lines = said.err.splitlines()
    assert said.out == ""
    assert len(lines) == 11
    assert lines[0] == "poresynth: synthesis: 0 % (level 1)"
    assert lines[-1] == "poresynth: synthesis: 100 % (level 1)"


def test_the_end_is_said_once(capsys: pytest.CaptureFixture[str]) -> None:
    with console.progress("synthesis") as report:
        for fraction in (0.95, 1.0, 1.0):
            report("end", fraction)
    assert len(capsys.readouterr().err.splitlines()) == 2


def test_a_terminal_gets_a_bar(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    with console.progress("synthesis") as report:
        report("level 1", 0.5)
        report("level 0", 1.0)
    said = capsys.readouterr()
    assert said.out == ""
    assert "synthesis" in said.err
    assert "100%" in said.err


def test_an_interruption_goes_through(capsys: pytest.CaptureFixture[str]) -> None:
    def work() -> None:
        with console.progress("synthesis") as report:
            report("level 1", 0.5)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        work()


def test_figures_are_a_table_with_marks_in_words(capsys: pytest.CaptureFixture[str]) -> None:
    rows = [("porosity", "0.81", "pass"), ("seam", "1.4", "off"), ("novelty_12", "0.5", "info")]
    console.figures("Beside the exemplar", rows, ("figure", "new volume", "mark"))
    out = capsys.readouterr().out
    for word in ("Beside the exemplar", "porosity", "0.81", "✓ pass", "✗ off"):
        assert word in out
    assert "info" not in out
