"""Results as a table in a notebook. No script; the colours are those of the page, light or dark."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any, TypeAlias

from moiregauge import _words

Found: TypeAlias = Mapping[str, Any]

# `currentColor` is black on white and white on black.
STYLE = (
    "<style>.mg-r{border-collapse:collapse;background:none;color:inherit}"
    ".mg-r th,.mg-r td{padding:.25em .8em;text-align:left;border-bottom:1px solid;border-color:inherit;background:none}"
    ".mg-r{border-color:color-mix(in srgb,currentColor 25%,transparent)}"
    ".mg-r caption{text-align:left;font-weight:600;padding:.3em 0;color:inherit}"
    ".mg-c{margin:.4em 0 0;padding-left:1.2em;color:inherit}</style>"
)


def _shown(estimate: Found | None, unit: str) -> str:
    if estimate is None or estimate["value"] is None:
        return "–"
    return f"{escape(_words.estimate(estimate))} {unit}".strip()


def _drift(drift: Found | None) -> str:
    if drift is None:
        return "not determined"
    return f"{_shown(drift['x_nm_per_min'], '')}, {_shown(drift['y_nm_per_min'], 'nm/min')}"


def _row(name: str, scans: int, mean: Found | None, drift: Found | None) -> str:
    if mean is None:
        cells = ["–"] * 3
    else:
        lengths = [_words.estimate(vector["wavelength_nm"]).split(" (")[0] for vector in mean["vectors"]]
        cells = [
            _shown(mean["twist_deg"], "°"),
            _shown(mean["heterostrain_percent"], "%"),
            f"{', '.join(map(escape, lengths))} nm",
        ]
    cells = [escape(name), str(scans), _drift(drift), *cells]
    return "<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"


def _caveats(caveats: Sequence[Found]) -> str:
    if not caveats:
        return ""
    items = "".join(
        f"<li><code>{escape(c['code'])}</code> {escape(c['where'])}: {escape(c['message'])}</li>" for c in caveats
    )
    return f'<details><summary>{len(caveats)} to keep in mind</summary><ul class="mg-c">{items}</ul></details>'


def results(found: Found) -> str:
    """Those of an analysis: the sets, and all of them together."""
    head = ["Set", "Scans", "Drift x, y", "Twist", "Heterostrain", "Wavelengths"]
    sets, combined = found["sets"], found["combined"]
    # A set that has no drift has its mean all the same.
    rows = [_row(one["name"], len(one["scans"]), one["mean"] or one["uncorrected"], one["drift"]) for one in sets]
    if combined is not None and len(sets) > 1:
        rows.append(_row("all", sum(len(one["scans"]) for one in sets), combined, combined["drift"]))
    columns = "".join(f"<th>{name}</th>" for name in head)
    return (
        f'{STYLE}<table class="mg-r"><thead><tr>{columns}</tr></thead><tbody>{"".join(rows)}</tbody></table>'
        + _failed(len(found["failed"]))
        + _caveats(found["caveats"])
    )


def _failed(count: int) -> str:
    return (
        f"<p>{count} {'file' if count == 1 else 'files'} could not be used: see <code>failed</code></p>"
        if count
        else ""
    )


def map_results(found: Found) -> str:
    """Those of a map: its quantities in short."""
    rows = "".join(
        f"<tr><td>{escape(q['name'])}</td><td>{q['mean']:.6g} {escape(q['unit'])}</td>"
        f"<td>{q['spread_corrected']:.3g}</td><td>{q['noise']:.2g}</td></tr>"
        for q in found["quantities"]
    )
    columns, lines = found["nodes"]
    caption = f"{columns} × {lines} nodes, resolution {found['resolution_nm']:.3g} nm"
    head = "<th>Quantity</th><th>Mean</th><th>Varies by</th><th>Noise of a node</th>"
    return (
        f'{STYLE}<table class="mg-r"><caption>{caption}</caption><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>'
        + _failed(len(found["provenance"]["failed"]))
        + _caveats(found["caveats"])
    )
