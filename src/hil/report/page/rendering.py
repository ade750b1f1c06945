"""The page: one HTML file that needs no network and no script, on a screen and on A4."""

from __future__ import annotations

import re
from pathlib import Path

from hil.report.page.view import RunView

__all__ = ["TEMPLATES", "render"]

_MOST_FAILED = 12  # checks, and cases, that are named beside the verdict; the sections below name all
TEMPLATES = Path(__file__).parent / "templates"
# Controls, and marks that reorder or hide text: they are shown by their number, never obeyed.
_UNSEEN = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\xad\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb\ud800-\udfff]"
)


def render(view: RunView) -> str:
    """Return the page; the same view gives the same text."""
    import jinja2  # noqa: PLC0415 - only where a page is made

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        finalize=_visible,
        optimized=False,  # the template is rendered once; folding its constants takes longer than it saves
    )
    page = environment.get_template("report.html").render(run=view, most_failed=_MOST_FAILED)
    return re.sub(r"\n\s*\n+", "\n", page)


def _visible(value: object) -> object:
    """Return a text with what cannot be seen made visible; markup is ours and stays."""
    if not isinstance(value, str) or hasattr(value, "__html__"):
        return value
    return _UNSEEN.sub(lambda match: f"[U+{ord(match[0]):04X}]", str(value))
