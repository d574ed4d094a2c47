"""The page of a report."""

from __future__ import annotations

import math
import re
from types import SimpleNamespace

from poresynth.report import html

FIGURE = SimpleNamespace(
    name="floating_parts",
    value=12,
    exemplar=3,
    low=0,
    high=6,
    mark="near",
    unit="",
    description="Pieces < 10 voxels.",
)
PICTURE = html.Picture(b"\x89PNG", 100.0, "exemplar, xy")


def page() -> str:
    body = html.verdict([FIGURE]) + html.figures_table({"Connectivity": [FIGURE]})
    body += html.legend("parts of <it>") + html.pairs([[PICTURE]], (20, "1 mm"))
    section = html.Section("Figures & more", body + html.chart("t", "s", b"light", b"dark"))
    return html.page("<title>", "sub", {"a": "1 < 2"}, [section], "end")


def test_a_page_needs_nothing_from_elsewhere() -> None:
    text = page()
    for word in ("<script", "http:", "https:", "url(", "<link", "@import"):
        assert word not in text


def test_text_is_escaped() -> None:
    text = page()
    escapes = ["&lt;title&gt;", "1 &lt; 2", "Figures &amp; more", "Pieces &lt; 10 voxels."]
    for escaped in (*escapes, "&lt;it&gt;"):
        assert escaped in text
    assert html.code("a < b && c") == "<pre><code>a &lt; b &amp;&amp; c</code></pre>"


def test_marks_have_words() -> None:
    text = html.figures_table({"Connectivity": [FIGURE]})
    assert "1 ≈ near" in html.verdict([FIGURE])
    assert "<b>≈ near</b>: within twice that" in html.legend("parts")
    assert '<td class="mark near">≈ near</td>' in text
    assert "0 to 6" in text


def test_a_figure_without_a_range_says_so() -> None:
    alone = SimpleNamespace(**{**vars(FIGURE), "exemplar": None, "low": None, "high": None})
    assert html.figures_table({"x": [alone]}).count(">–<") == 2


def test_planes_stand_beside_their_image() -> None:
    def figure(name: str, value: float, error: float | None) -> SimpleNamespace:
        more = {"name": name, "value": value, "error_percent": error}
        return SimpleNamespace(**{**vars(FIGURE), **more})

    figures = {
        f.name: f
        for f in (
            figure("porosity", 9.0, None),
            figure("holes_z", 4.0, 33.3),
            figure("holes_y", 2.0, -33.3),
            figure("holes_x", 5.0, math.inf),
            figure("tips_z", 7.0, None),
        )
    }
    text = html.planes_table(figures, [("z", "diagonal"), ("y", "x")])
    header = re.findall(r">([^<>]+)</th>", text.split("</thead>")[0])
    assert header == [
        "figure",
        "image across z",
        "across z",
        "diagonal",
        "image across y, x",
        "across y",
        "across x",
        "what it says",
    ]
    rows = re.findall(r"<tr>.*?</tr>", text.split("</thead>")[1])
    holes, tips = (
        " ".join(re.sub(r"<[^>]+>", " ", r.split('<td class="says')[0]).split()) for r in rows
    )
    assert holes == "Holes holes 3 0 to 6 ≈ 4 +33.3 % – 3 0 to 6 ≈ 2 −33.3 % ≈ 5"
    assert tips == "Tips tips 3 0 to 6 ≈ 7 – – – –"
    assert "porosity" not in text


def test_pictures_of_a_row_share_the_scale() -> None:
    wide = html.Picture(b"", 300.0, "new volume, xy")
    text = html.pairs([[PICTURE, wide]], (50.0, "50 voxels"))
    assert "width:24.250%" in text
    assert "width:72.750%" in text
    # The bar is as long in both: half of the one, a sixth of the other.
    assert "width:50.000%" in text
    assert "width:16.667%" in text
