"""The page of a report: what stands on it, in which order, in which words."""

from __future__ import annotations

import datetime
import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from poresynth.errors import ParameterError
from poresynth.report import beside_images, beside_volume, html, parts
from poresynth.volume import Volume, as_volume

if TYPE_CHECKING:
    from poresynth.comparison import Comparison
    from poresynth.metrics.sections import Images

__all__ = ["render"]


def render(
    exemplar: Images,
    volume: Volume,
    comparison: Comparison,
    energy: Sequence[Any] | None,
    configuration: Mapping[str, Any] | None,
    command: str | None,
    now: datetime.datetime,
) -> str:
    """Return the page; see `poresynth.report.write_report` for the parameters."""
    from poresynth import __version__

    content = _content(exemplar, volume, comparison, energy)
    origin = volume.metadata.get("poresynth", {})
    facts = {
        "exemplar": content.exemplar,
        "new volume": parts.describe(volume),
        "engine": _engine(origin),
        "seed": str(origin.get("seed", "not recorded")),
        "boundary": str(origin.get("boundary", "not recorded")),
        "made with": f"poresynth {origin.get('version', '(not recorded)')}",
        "reported": f"{now:%Y-%m-%d %H:%M %Z}, poresynth {__version__}",
        "synthesised": str(origin.get("field_reason", origin.get("mode_reason", "not recorded"))),
    }
    sections = list(content.sections)
    if configuration is not None:
        sections.append(html.Section("Configuration", html.code(_toml(configuration))))
    if command is not None:
        sections.append(html.Section("The command that repeats the run", html.code(command)))
    return html.page(
        content.title,
        content.subtitle,
        facts,
        sections,
        f"poresynth {__version__}. The same numbers for programs: report.json.",
    )


def _content(
    exemplar: Any, volume: Volume, comparison: Comparison, energy: Sequence[Any] | None
) -> html.Content:
    """Return what there is to say of this kind of comparison."""
    from poresynth.comparison import SectionComparison, VolumeComparison
    from poresynth.metrics.sections import as_images

    if isinstance(comparison, SectionComparison):
        return beside_images.content(as_images(exemplar), volume, comparison, energy)
    if isinstance(comparison, VolumeComparison):
        return beside_volume.content(as_volume(exemplar), volume, comparison, energy)
    kind = type(comparison).__name__
    raise ParameterError("comparison", kind, "must be what poresynth.compare returns")


def _toml(document: Mapping[str, Any]) -> str:
    """Write a configuration as it can be given back: plain values are the same in JSON and TOML."""

    def line(key: str, value: Any) -> str:
        return f"{key} = {json.dumps(value, ensure_ascii=False)}"

    plain, tables = [], []
    for key, value in document.items():
        if isinstance(value, Mapping):
            tables += ["", f"[{key}]", *(line(*item) for item in value.items())]
        else:
            plain.append(line(key, value))
    return "\n".join([*plain, *tables])


def _engine(origin: Mapping[str, Any]) -> str:
    if "engine" not in origin:
        return "not recorded"
    preset = origin.get("parameters", {}).get("preset")
    return f"{origin['engine']}, preset {preset}" if preset else str(origin["engine"])
