"""A selection as one HTML page that needs no network: the trade table first, then places, exclusions and inputs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from pathlib import Path

from hil.audit.pages.markup import asset, escaped, plain
from hil.documents.text import counted
from hil.report.numbers import measured
from hil.selection.document import Cell, Document, Excluded, Share, Standing

__all__ = ["as_html"]

_MISSING = '<span class="missing">not recorded</span>'
_WIDTH, _HEIGHT, _EDGE = 160.0, 14.0, 4.0  # size of the drawing of a value, in its own units
_FEW = 2  # candidates that are named side by side
_COMBINED = {"worst": "the worst axis counts", "mean": "the mean of the magnitudes of the axes counts"}


def as_html(document: Document) -> str:
    """Return the page; equal documents give equal text."""
    return "".join(
        (
            _top(document),
            "<main>",
            f"<h1>{escaped(document.title)}</h1>\n",
            *_warnings(document.warnings),
            *_trade(document),
            *(text for cell in document.cells for text in _places(cell, document.confidence)),
            *_excluded(document.excluded),
            *_packages(document),
            _method(document),
            "</main></body>\n</html>\n",
        )
    )


def _top(document: Document) -> str:
    style = f"{asset('page.css')}\n{(Path(__file__).parent / 'page.css').read_text(encoding='utf-8').strip()}"
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n"
        f"<title>Selection · {plain(document.title)}</title>\n<style>\n{style}\n</style>\n</head>\n<body>\n"
        '<header class="masthead"><p class="kind">Selection</p>'
        f'<p class="soft">from {counted(len(document.packages), "package")}</p></header>\n'
    )


def _warnings(warnings: Sequence[str]) -> Iterator[str]:
    if warnings:
        items = "".join(f"<li>{_first_word(each)}</li>" for each in warnings)
        yield f'<section class="notice" aria-label="What to know first"><ul>{items}</ul></section>\n'


def _first_word(text: str) -> str:
    word, mark, rest = text.partition(": ")
    return f"<strong>{escaped(word)}</strong>{mark}{escaped(rest)}" if word.isupper() else escaped(text)


def _trade(document: Document) -> Iterator[str]:
    """Yield the trade table: a row for each role, a column for each criterion, with the best candidate."""
    names = list(dict.fromkeys(cell.criterion for cell in document.cells))
    heads = "".join(f'<th scope="col">{escaped(name)}</th>' for name in names)
    yield f'<table class="trade"><thead><tr><th></th>{heads}<th scope="col">Overall</th></tr></thead><tbody>\n'
    for role in document.candidates:
        cells = {cell.criterion: cell for cell in document.cells if cell.role == role}
        inner = "".join(_best(cells[name]) if name in cells else "<td></td>" for name in names)
        overall = _overall([each for each in document.shares if each.role == role])
        yield f'<tr><th scope="row">{escaped(role.replace("_", " "))}</th>{inner}{overall}</tr>\n'
    yield "</tbody></table>\n"
    if len(document.candidates) > 1 and (shares := [each for each in document.shares if not each.role]):
        told = "; ".join(f"{escaped(each.candidate)} {_range(each)}" for each in shares)
        yield f'<p class="all"><b>All roles in one part</b>, by the share of the weights that each wins: {told}.</p>\n'


def _best(cell: Cell) -> str:
    of_all = len(cell.standings) + len(cell.unjudged)
    label = f'data-name="{plain(cell.criterion)}"'
    if not cell.standings:
        return f'<td {label}><b class="open">none</b><span class="badge open">0 of {of_all} judged</span></td>'
    first = cell.standings[0]
    names = " or ".join(map(escaped, cell.best))
    tied = '<span class="soft">cannot be told apart</span>' if len(cell.best) > 1 else ""
    if len(cell.best) == len(cell.standings) > _FEW:
        names, tied = "all alike", f'<span class="soft">{names}: cannot be told apart</span>'
    missing = ", ".join(escaped(each.candidate) for each in cell.unjudged)
    partly = f'<span class="badge open">{len(cell.standings)} of {of_all} judged</span>' if cell.unjudged else ""
    partly += f'<span class="told">not judged: {missing}</span>' if cell.unjudged else ""
    notes = "".join(f'<span class="told">{escaped(note)}</span>' for note in cell.notes)
    value = escaped(measured(first.value, first.expanded, cell.unit))
    sure = _sure(first) if len(cell.standings) > 1 else '<span class="soft">the only one</span>'
    return (
        f'<td {label}><b class="{"good" if not cell.unjudged and len(cell.best) == 1 else "open"}">{names}</b>{tied}'
        f'<span class="value">{value}</span>{sure}{partly}{notes}</td>'
    )


def _sure(first: Standing) -> str:
    share = 100.0 * first.probability
    return (
        f'<span class="sure"><span class="bar" role="presentation"><span style="width:{share:.1f}%"></span></span>'
        f"{_percent(first.probability)}{'' if first.rank == first.last else f' {escaped(first.candidate)}'}</span>"
    )


def _overall(shares: Sequence[Share]) -> str:
    told = "".join(f"<li>{escaped(each.candidate)} {_range(each)}</li>" for each in shares)
    return f'<td class="overall" data-name="Overall"><ol>{told}</ol></td>'


def _range(share: Share) -> str:
    inner = f' <span class="soft">({_percent(share.low)} to {_percent(share.high)})</span>'
    return f"<b>{_percent(share.share)}</b>{inner if share.low != share.high else ''}"


def _percent(part: float) -> str:
    """Return a probability in percent: nothing short of certainty is 100 %."""
    if 0.0 < part < 0.001 or 0.999 < part < 1.0:
        return "&lt; 0.1 %" if part < 0.5 else "&gt; 99.9 %"
    return f"{100.0 * part:.3g} %"


def _places(cell: Cell, confidence: float) -> Iterator[str]:
    """Yield all places of a cell, and the candidates without one."""
    name = f"{cell.role.replace('_', ' ').capitalize()}: {cell.criterion[:1].lower()}{cell.criterion[1:]}"
    weight = f", weight {cell.weight:g}" if cell.weight != 1.0 else ""
    unit = f" in {cell.unit}" if cell.unit != "1" else ""
    about = f"{cell.parameter}{unit}; {_COMBINED[cell.combine]}{weight}; intervals of {100.0 * confidence:g} %"
    yield f'<h2>{escaped(name)}</h2>\n<p class="soft">{escaped(about)}</p>\n'
    yield "".join(f'<p class="note">{escaped(note)}.</p>\n' for note in cell.notes)
    yield (
        '<table class="places"><thead><tr><th scope="col">Place</th><th scope="col">Candidate</th><th scope="col">Value'
        '</th><th scope="col" class="drawn"></th><th scope="col">Best</th><th scope="col">Axis</th>'
        '<th scope="col">Not told apart from</th></tr></thead><tbody>\n'
    )
    reach = max((each.value + each.expanded for each in cell.standings), default=0.0)
    reach = min(reach, 3.0 * max((each.value for each in cell.standings), default=0.0)) or 1.0
    for each in cell.standings:
        place = str(each.rank) if each.rank == each.last else f"{each.rank} to {each.last}"
        sure = _percent(each.probability) if len(cell.standings) > 1 else "the only one"
        yield (
            f'<tr><td class="place">{place}</td><th scope="row">{escaped(each.candidate)}</th>'
            f'<td data-name="Value">{escaped(measured(each.value, each.expanded, "1"))}</td>'
            f'<td class="drawn">{_drawn(each, reach)}</td><td data-name="Best">{sure}</td>'
            f'<td data-name="Axis">{escaped(each.of) or "mean"}</td>'
            f'<td data-name="Not told apart from">{escaped(", ".join(each.ties)) or "none"}</td></tr>\n'
        )
    for missing in cell.unjudged:
        why = "".join(f"<li>{escaped(reason)}</li>" for reason in missing.reasons)
        yield (
            f'<tr class="unjudged"><td class="place"></td><th scope="row">{escaped(missing.candidate)}</th>'
            f'<td colspan="5"><b class="open">not judged</b><ul>{why}</ul></td></tr>\n'
        )
    yield "</tbody></table>\n"


def _drawn(standing: Standing, reach: float) -> str:
    """Return the drawing of a value with its interval, on an axis from zero."""
    scale = (_WIDTH - 2.0 * _EDGE) / reach
    low, at, high = (
        _EDGE + scale * min(max(value, 0.0), reach)
        for value in (standing.value - standing.expanded, standing.value, standing.value + standing.expanded)
    )
    middle = _HEIGHT / 2.0
    return (
        f'<svg viewBox="0 0 {_WIDTH:g} {_HEIGHT:g}" role="img" aria-label="value and interval">'
        f'<path class="zero" d="M{_EDGE:g} 0V{_HEIGHT:g}"/><path d="M{low:.1f} {middle:g}H{high:.1f}"/>'
        f'<circle cx="{at:.1f}" cy="{middle:g}" r="3"/></svg>'
    )


def _excluded(excluded: Sequence[Excluded]) -> Iterator[str]:
    yield '<h2 id="excluded">What did not count</h2>\n'
    if not excluded:
        yield "<p>Nothing: every figure of every package counted.</p>\n"
        return
    yield (
        '<table class="excluded"><thead><tr><th scope="col">Run</th><th scope="col">Candidate</th>'
        '<th scope="col">What</th><th scope="col">Why</th></tr></thead><tbody>\n'
    )
    ordered = sorted(excluded, key=lambda each: (each.run, each.candidate, each.reason, each.what))
    for (run, candidate, reason), group in groupby(ordered, key=lambda each: (each.run, each.candidate, each.reason)):
        what = _listed(each.what for each in group)
        cells = (("Candidate", candidate), ("What", what), ("Why", reason))
        inner = "".join(f'<td data-name="{name}">{escaped(text)}</td>' for name, text in cells)
        yield f'<tr><th scope="row">{escaped(run)}</th>{inner}</tr>\n'
    yield "</tbody></table>\n"


def _listed(whats: Iterable[str]) -> str:
    """Return parameters and axes in a line, each parameter once."""
    axes: dict[str, list[str]] = {}
    for parameter, _, axis in (each.partition(" of ") for each in whats):
        axes.setdefault(parameter, []).append(axis)
    return "; ".join(f"{name} of {', '.join(its)}".removesuffix(" of ") for name, its in axes.items())


def _packages(document: Document) -> Iterator[str]:
    yield (
        '<h2 id="packages">Inputs</h2>\n'
        '<table class="packages"><thead><tr><th scope="col">Run</th>'
        '<th scope="col">Source</th><th scope="col">Bench</th><th scope="col">Unit</th><th scope="col">Purpose</th>'
        '<th scope="col" class="num">Figures</th><th scope="col">Evidence digest</th></tr></thead><tbody>\n'
    )
    for each in document.packages:
        source = each.source if each.source in {"", "hardware"} else each.source.upper()
        facts = (("Source", source), ("Bench", each.bench), ("Unit", each.serial), ("Purpose", each.purpose))
        inner = "".join(f'<td data-name="{name}">{escaped(text) or _MISSING}</td>' for name, text in facts)
        yield (
            f'<tr><th scope="row">{escaped(each.run)}</th>{inner}<td class="num" data-name="Figures">{each.used}</td>'
            f'<td class="mono" data-name="Evidence digest">{escaped(each.digest) or "not verified"}</td></tr>\n'
        )
    yield f'</tbody></table>\n<p>Criteria, SHA-256: <span class="mono">{escaped(document.criteria)}</span></p>\n'


def _method(document: Document) -> str:
    return (
        '<h2 id="method">Method</h2>\n'
        "<p>The smallest magnitude is the best. Candidates that cannot be told apart at "
        f"{100.0 * document.confidence:g} % share their places. The probability of being the best is that among the "
        "candidates that were judged, from Student's distributions of all figures, taken as independent. Overall is "
        "the share of the weights that a candidate wins by these probabilities. The range beside it is what it "
        "wins if all candidates that were not judged are better, and if none is.</p>\n"
        f"<p>hil {escaped(document.version)}. Equal packages and criteria give the same page, byte for byte.</p>\n"
    )
