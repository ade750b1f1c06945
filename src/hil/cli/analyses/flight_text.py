"""What `hil analyse flight` prints: tables for people, or one JSON document for machines."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, replace

from hil.analysis.flight import Flight, Phase
from hil.analysis.motion import AXES, Kind
from hil.cli.analyses.allan_text import heading, stated
from hil.cli.analyses.log import Log, gates_as_json, log_as_json
from hil.cli.analyses.wanted import Wanted
from hil.documents.text import fitting
from hil.model.figure import Figure, FigureStatus, encoded
from hil.report.tables import aligned

__all__ = ["Result", "as_json", "as_text"]

_HEAD = ("phase", "from [s]", "to [s]", "", "turning", "field", "ripple", "turns", "rates/field")
_REST = ("phase", "", "bias", "white noise")


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """All results of one call; the log of the rates is first, that of the magnetometer second."""

    logs: tuple[Log, ...]
    flight: Flight
    wanted: Wanted

    @property
    def doubts(self) -> tuple[str, ...]:
        """The gates that trip for the log or one of its phases, in sentences."""
        whole = [str(gate) for log in self.logs for name in ("", *log.channels) for gate in log.doubts(name)]
        each = [
            f"phase {number}, {gate}"
            for number, phase in enumerate(self.flight.phases, start=1)
            for gate in phase.gates
            if gate.ok is False
        ]
        return tuple(dict.fromkeys((*whole, *each)))

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks on the logs and on all phases, in sentences."""
        return tuple(dict.fromkeys((*(each for log in self.logs for each in log.remarks), *self.flight.remarks)))


def as_json(result: Result) -> str:
    """Return the result as one JSON document; what is not finite is null."""
    first, *others = result.logs
    gates = tuple(gate for log in others for gate in log.gates if gate not in first.gates)
    found = result.flight
    document = {
        **log_as_json(first, doubted=bool(result.doubts), gates=gates),
        "remarks": list(result.remarks),
        "field_sampling": asdict(others[0].sampling) if others and others[0].sampling else None,
        "reasons": list(result.doubts),
        "unit": found.unit,
        "window": found.window,
        "bias": dict(zip(AXES, found.bias, strict=True)),
        "noise": dict(zip(AXES, found.noise, strict=True)),
        "phases": [_phase(number, phase) for number, phase in enumerate(found.phases, start=1)],
    }
    return json.dumps(document, allow_nan=False, indent=2)


def _phase(number: int, phase: Phase) -> dict[str, object]:
    each = {name: getattr(phase, name) for name in ("turning", "field", "ripple", "turns", "agreement")}
    return {
        "phase": number,
        "kind": phase.kind.value,
        "begin": phase.begin,
        "end": phase.end,
        "first": phase.first + 1,
        "last": phase.last + 1,
        "rates": {axis: encoded(figure) for axis, figure in zip(AXES, phase.rates, strict=False)},
        "white": {axis: encoded(figure) for axis, figure in zip(AXES, phase.white, strict=False)},
        **{name: None if figure is None else encoded(figure) for name, figure in each.items()},
        "gates": gates_as_json(phase.gates),
        "remark": phase.remark,
    }


def as_text(result: Result) -> str:
    """Return the result as plain text: the phases, then what those at rest show."""
    found = result.flight
    odd = [f"phase {number}: {each.remark}" for number, each in enumerate(found.phases, start=1) if each.remark]
    told = [
        *(f"INCONCLUSIVE: {each}" for each in result.doubts),
        *(f"note: {each}" for each in (*result.remarks, *odd)),
    ]
    lines = fitting([*heading(result.logs[0]), *told], 80)
    rows = [_row(number, phase) for number, phase in enumerate(found.phases, start=1)]
    lines += ["", *aligned(rows, head=_HEAD, right=(0, 1, 2))]
    lines.append(f"phases begin and end to within {found.window:g} s; {_shares(found)}")
    rest = [(number, phase) for number, phase in enumerate(found.phases, start=1) if phase.kind is Kind.REST]
    if rest:
        rows = [
            (str(number), axis, _told(phase.rates[place]), _told(phase.white[place]))
            for number, phase in rest
            for place, axis in enumerate(AXES)
        ]
        lines += ["", *aligned(rows, head=_REST, right=(0,))]
        lines.append(f"flicker and random walk of the longest rest: hil analyse allan {_longest(result.wanted, rest)}")
    return "\n".join(lines)


def _longest(wanted: Wanted, rest: list[tuple[int, Phase]]) -> str:
    """Return the arguments of a command for the longest of the phases at rest."""
    longest = max((phase for _, phase in rest), key=lambda phase: phase.end - phase.begin)
    return replace(wanted, begin=wanted.begin + longest.begin, end=wanted.begin + longest.end).arguments()


def _row(number: int, phase: Phase) -> tuple[str, ...]:
    measured = [phase.turning, phase.field]
    ripple = "-" if phase.ripple is None or not math.isfinite(phase.ripple.value) else f"{phase.ripple.value:.2%}"
    turns = "-" if phase.turns is None or not math.isfinite(phase.turns.value) else f"{phase.turns.value:.2f}"
    ratio = phase.agreement
    agreed = "-" if ratio is None or not math.isfinite(ratio.value) else _told(ratio + 1.0)
    times = (f"{phase.begin:.4g}", f"{phase.end:.4g}")
    return (str(number), *times, phase.kind.value, *map(_told, measured), ripple, turns, agreed)


def _told(figure: Figure | None) -> str:
    if figure is None or figure.status is FigureStatus.NOT_OBSERVABLE:
        return "-"
    return stated(figure)


def _shares(found: Flight) -> str:
    whole = sum(phase.end - phase.begin for phase in found.phases)
    each = {kind: sum(phase.end - phase.begin for phase in found.phases if phase.kind is kind) / whole for kind in Kind}
    return ", ".join(f"{kind.value} {share:.0%}" for kind, share in each.items() if share)
