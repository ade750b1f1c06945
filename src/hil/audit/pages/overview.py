"""The beginning of an audit's page: how much is closed, what must not be overlooked, and why the rest is open."""

from __future__ import annotations

from collections.abc import Iterator

from hil.audit.document import Compliance, Document, Summary
from hil.audit.pages.markup import escaped, link, plain
from hil.audit.reasons import Code

__all__ = ["TONES", "overview"]

TONES = {Compliance.YES: "good", Compliance.PARTIAL: "open", Compliance.NO: "bad"}
"""The colour of each compliance."""


def overview(document: Document) -> Iterator[str]:
    """Yield the part of the page before the requirements."""
    summary = document.summary
    share = 100 * summary.closed / summary.requirements if summary.requirements else 0.0
    whole = summary.requirements > 0 and summary.open == 0
    yield f"<h1>{escaped(document.workspace)}</h1>\n"
    yield (
        f'<section class="verdict {"good" if whole else "open"}" aria-label="Summary">'
        f'<p class="word">{summary.closed:,}<span class="of"> of {summary.requirements:,} closed</span></p>'
        f'<div class="bar" role="img" aria-label="{share:.0f} % closed"><span style="width:{share:.2f}%"></span></div>'
        '<ul class="tally">'
    )
    yield f"<li><b>{summary.open:,}</b> open</li>"
    if summary.waived:
        yield f'<li class="open"><b>{len(summary.waived):,}</b> closed by waivers</li>'
    for each in Compliance:
        count = summary.compliance.get(each.value, 0)
        yield f'<li class="{TONES[each]}"><b>{count:,}</b> compliance {each.value}</li>'
    yield "</ul></section>\n"
    yield from _notices(document)
    yield from _why(document)
    if summary.elsewhere:
        yield from _elsewhere(summary)


def _elsewhere(summary: Summary) -> Iterator[str]:
    """Yield what the simulated runs would close on hardware, and what would keep the others open."""
    names = [link(name) for name in summary.on_hardware]
    asked = f"{summary.elsewhere:,} open requirement{'' if summary.elsewhere == 1 else 's'} with simulated runs"
    would = f"{len(names):,} of {asked} would be closed"
    yield f"<details><summary>If the same runs were made on hardware, {would}</summary>"
    if names:
        yield f"<p>{', '.join(names)}</p>"
    if summary.left_open:
        lines = (
            f'<tr><td>{escaped(text)}</td><td class="num">{n:,}</td></tr>' for text, n in summary.left_open.items()
        )
        yield '<table><thead><tr><th scope="col">The others would stay open because</th><th scope="col" class="num">'
        yield f"Requirements</th></tr></thead><tbody>{''.join(lines)}</tbody></table>"
    yield "</details>\n"


_OTHERS = "Parts of other packages"


def _notices(document: Document) -> Iterator[str]:
    """Yield what must not be overlooked: exceptions, code from other packages, and damage."""
    exempted = [f"{each.package}: {each.instrument}: {each.reason}" for each in document.exceptions]
    closed = document.summary.by_exception
    by = f"{closed:,} requirement{'' if closed == 1 else 's'} closed by such a run"
    why = f"Instruments that count as hardware on the word of the bench file alone; {by}"
    others = [f"{each.package}: {each.text}" for each in document.others]
    notices = (("EXCEPTION", why, exempted), (_OTHERS, "", others), ("Not usable", "", document.problems))
    for word, told, lines in notices:
        if lines:
            items = "".join(f"<li>{escaped(each)}</li>" for each in lines)
            yield f'<section class="notice" aria-label="{word}"><strong>{word}</strong> {told}<ul>{items}</ul>'
            yield "</section>\n"


def _why(document: Document) -> Iterator[str]:
    counts = document.summary.reasons
    found = sorted(((count, code) for code, count in counts.items() if count), key=lambda each: (-each[0], each[1]))
    if not found:
        return
    most = found[0][0]
    yield (
        '<h2 id="why">Why requirements are open</h2>\n'
        '<p class="soft">A requirement may be open for several reasons.</p>'
        '<table class="why"><thead><tr><th scope="col">Reason</th><th scope="col">Meaning</th>'
        '<th scope="col" class="num">Requirements</th><th scope="col" class="track"></th></tr></thead><tbody>\n'
    )
    for count, code in found:
        shown = f'<a class="code" href="#requirements" data-code="{plain(code)}">{escaped(code)}</a>'
        yield (
            f'<tr><th scope="row">{shown}</th><td>{escaped(Code(code).meaning)}</td><td class="num">{count:,}</td>'
            f'<td class="track"><span style="width:{100 * count / most:.1f}%"></span></td></tr>\n'
        )
    yield "</tbody></table>\n"
