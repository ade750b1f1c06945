"""The frozen files of a run as plain objects: what plans and bench said when it began."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping

from hil.documents.findings import Findings
from hil.documents.node import Mapping as MappingNode
from hil.documents.node import Node, Scalar, Sequence
from hil.documents.strict_yaml import parse_yaml
from hil.report.material import Body, Material, inner, inners, text, texts
from hil.report.numbers import limit_text
from hil.requirements.requirement import Decision

__all__ = ["demands", "documents", "parse", "plan_files", "requirement_entries", "unspoken"]


def parse(content: str, shown: str) -> Body:
    """Return a YAML document as plain objects; an empty object where it is absent or cannot be read.

    Every scalar is its text as written: a report shows what a file says, it does not compute with it.
    """
    node = parse_yaml(content.encode(), shown, Findings()) if content else None
    value = _plain(node) if node is not None else {}
    return value if isinstance(value, Mapping) else {}


def plan_files(material: Material, name: str) -> Iterator[tuple[str, Body]]:
    """Give every plan that was frozen with its file of that name; an empty object where it has none."""
    for plan in material.names("catalogue"):
        relative = f"catalogue/{plan}/{name}"
        yield plan, parse(material.text(relative), relative)


def documents(material: Material) -> tuple[tuple[str, Body], ...]:
    """Return by plan what document its requirements are from: `id`, `issue` and `title`."""
    files = plan_files(material, "requirements.yaml")
    return tuple((plan, inner(file, "document")) for plan, file in files if inners(file, "requirements"))


def requirement_entries(material: Material) -> Mapping[str, Body]:
    """Return by id the entries of requirements as their files have them."""
    files = plan_files(material, "requirements.yaml")
    return {text(entry, "id"): entry for _, file in files for entry in inners(file, "requirements")}


def unspoken(entries: Mapping[str, Body], spoken: Container[str]) -> tuple[tuple[str, str], ...]:
    """Return the requirements of the plans that a run is silent about, with why: the method, or `withdrawn`."""
    return tuple(
        (name, "withdrawn" if text(entry, "withdrawn") == "true" else text(entry, "method"))
        for name, entry in sorted(entries.items())
        if name not in spoken
    )


def demands(entry: Body) -> tuple[str, ...]:
    """Return what a requirement asks for, a line each: its limits, what it wants recorded, and for which variants."""
    limits = tuple(_limit(limit) for limit in inners(entry, "limits"))
    records = inner(entry, "records")
    over = inner(entry, "over")
    variants = tuple(f"for each {name} of {', '.join(texts(over, name))}" for name in over)
    return (*limits, *((_records(records),) if records else ()), *variants)


def _limit(limit: Body) -> str:
    bounds = limit_text({name: limit[name] for name in ("min", "max", "equals") if name in limit}, text(limit, "unit"))
    of = f" [{', '.join(texts(limit, 'of'))}]" if texts(limit, "of") else ""
    tur = f", TUR at least {text(limit, 'min_tur')}" if text(limit, "min_tur") else ""
    usual = Decision.SIMPLE if "equals" in limit else Decision.GUARDED  # as the catalogue's reader has it
    rule = f", {text(limit, 'decision') or usual}" if bounds else ""
    return f"{text(limit, 'parameter')}{of} {bounds or 'recorded, without a limit'}{rule}{tur}"


def _records(records: Body) -> str:
    gap = text(records, "max_gap")
    parts = (
        ", ".join(texts(records, "channels")),
        text(records, "rate"),
        text(records, "duration"),
        f"gaps up to {gap}" if gap else "",
    )
    return f"recording {text(records, 'recording')}: {'; '.join(part for part in parts if part)}"


def _plain(node: Node) -> object:
    if isinstance(node, MappingNode):
        return {key.text: _plain(value) for key, value in node.entries}
    if isinstance(node, Sequence):
        return [_plain(item) for item in node.items]
    return node.text if isinstance(node, Scalar) else ""
