"""Memory: what is there, and refusal of what does not fit."""

from __future__ import annotations

from pathlib import Path

import pytest

from poresynth import resources
from poresynth.errors import MemoryEstimateError


def test_what_fits_passes_and_what_does_not_is_refused_with_both_numbers(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(resources, "available_memory", lambda: 2_000_000)
    resources.check_memory(1_999_999, "a volume")
    with pytest.raises(MemoryEstimateError, match=r"a volume needs about 3 GB .* 2 MB"):
        resources.check_memory(3_000_000_000, "a volume")


def test_nothing_is_refused_where_the_memory_is_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resources, "available_memory", lambda: None)
    resources.check_memory(10**18, "a volume")


def test_this_machine_has_memory() -> None:
    free = resources.available_memory()
    assert free is None or free > 10_000_000


def test_a_containers_limit_counts(tmp_path: Path) -> None:
    assert resources._container_memory(tmp_path) is None
    (tmp_path / "memory.current").write_text("700\n")
    (tmp_path / "memory.max").write_text("max\n")
    assert resources._container_memory(tmp_path) is None
    (tmp_path / "memory.max").write_text("1000\n")
    assert resources._container_memory(tmp_path) == 300
    (tmp_path / "memory.max").write_text("500\n")
    assert resources._container_memory(tmp_path) == 0


@pytest.mark.parametrize(
    ("count", "text"), [(0, "0 B"), (1500, "1.5 kB"), (2.5e9, "2.5 GB"), (4e16, "4e+04 TB")]
)
def test_bytes_are_written_for_people(count: float, text: str) -> None:
    assert resources.format_bytes(count) == text
