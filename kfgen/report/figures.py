"""Drawings: matplotlib to inline SVG whose colours and letters are the page's own, in light and in dark."""

from __future__ import annotations

import html
import io
import re
from collections.abc import Callable
from importlib.util import find_spec
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kfgen.errors import KfgenError
from kfgen.report.blocks import Picture

Array = NDArray[np.float64]

# what matplotlib draws with -> what the page calls it
COLOURS = {
    "ink": "#010101", "faint": "#020202", "estimate": "#030303", "band": "#040404", "truth": "#050505",
    "measured": "#060606", "bad": "#070707", "smooth": "#080808", "paper": "#090909",
}  # fmt: skip
INK, FAINT, ESTIMATE, BAND, TRUTH, MEASURED, BAD, SMOOTH, PAPER = COLOURS.values()
MODES = (ESTIMATE, MEASURED, TRUTH, SMOOTH, BAD, BAND, FAINT, INK)
SIZE = (4.9, 2.3)
POINTS = 500  # of a line


def require_matplotlib() -> None:
    """KfgenError where matplotlib is not installed."""
    if find_spec("matplotlib") is None:
        raise KfgenError("the report needs matplotlib; install it with `pip install 'kfgen[plot]'`")


def picture(
    draw: Callable[[Any], None], title: str, description: str, key: str, size: tuple[float, float] = SIZE
) -> Picture:
    """What `draw` does on axes. title, description: for who does not see it. key: makes its ids its own."""
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullFormatter

    settings: Any = {
        "svg.fonttype": "none", "svg.hashsalt": key, "font.size": 9, "axes.edgecolor": FAINT, "axes.labelcolor": INK,
        "xtick.color": INK, "ytick.color": INK, "text.color": INK, "axes.grid": True, "grid.color": FAINT,
        "grid.alpha": 0.35, "grid.linewidth": 0.5, "axes.spines.top": False, "axes.spines.right": False,
        "axes.axisbelow": True, "legend.frameon": False, "legend.fontsize": 8, "path.simplify": True,
        "axes.xmargin": 0.01, "lines.linewidth": 1.2, "axes.formatter.useoffset": False,
    }  # fmt: skip
    with matplotlib.rc_context(settings):
        figure = Figure(figsize=size)
        FigureCanvasSVG(figure)
        axes = figure.add_subplot()
        draw(axes)
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_minor_formatter(NullFormatter())
        # fixed margins: a layout that measures all its letters takes as long as the drawing
        width, height = size
        figure.subplots_adjust(left=0.85 / width, right=1 - 0.1 / width, top=1 - 0.27 / height, bottom=0.45 / height)
        handles, labels = axes.get_legend_handles_labels()
        if labels:
            figure.legend(handles, labels, loc="upper right", ncols=min(len(labels), 5), borderaxespad=0.1)
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    return Picture(_inline(buffer.getvalue(), title, description, key), title)


def _inline(svg: str, title: str, description: str, key: str) -> str:
    """An SVG document as a part of the page."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r"<!--.*?-->", "", svg, flags=re.DOTALL)
    box = re.search(r'viewBox="([^"]+)"', svg)
    assert box is not None
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" viewBox="{box.group(1)}" '
        f'role="img" aria-labelledby="{key}-t {key}-d"><title id="{key}-t">{html.escape(title)}</title>'
        f'<desc id="{key}-d">{html.escape(description)}</desc>'
    )
    body = svg[svg.index(">") + 1 :]
    body = re.sub(r'<g id="[^"]*">', "<g>", body)  # every drawing has an axes_1; nothing refers to these
    body = re.sub(
        r"font-family:[^;\"]*;?|font: ([\d.]+)px [^;\"]*", lambda m: f"font-size: {m[1]}px" if m[1] else "", body
    )
    body = body.replace("stroke-linejoin: round", "").replace("stroke-linecap: square", "")
    for name, colour in COLOURS.items():
        body = body.replace(colour, f"var(--{name})")
    return head + re.sub(r"\n\s*", "\n", body)


def thin(t: Array, *lines: Array, points: int = POINTS) -> tuple[Array, ...]:
    """Fewer points of lines over t that keep their extremes: of each stretch the least and the largest of the first."""
    rows = len(t)
    if rows <= points:
        return (t, *lines)
    edges = np.linspace(0, rows, points // 2 + 1).astype(int)
    keep: list[int] = []
    first = np.where(np.isfinite(lines[0]), lines[0], 0.0)
    for a, b in pairwise(edges.tolist()):
        keep += sorted({a + int(np.argmin(first[a:b])), a + int(np.argmax(first[a:b]))})
    chosen = np.array(keep)
    return (t[chosen], *(line[chosen] for line in lines))


def few(t: Array, z: Array, points: int = POINTS) -> tuple[Array, Array]:
    """At most so many of the dots that are there."""
    there = np.flatnonzero(np.isfinite(z))
    there = there[:: max(1, -(-len(there) // points))]
    return t[there], z[there]
