"""The guardian's plan as JSON with bytes in hexadecimal, the form in which it is passed to its process."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from hil.model.safing import CutOutput, Exchange, GuardedOutput, GuardedPort, GuardPlan, SafeBytes
from hil.model.serial_line import Rs485, SerialLine

__all__ = ["LONGEST_SETTLING", "every_exchange", "read_plan", "seconds_of", "written_plan"]

LONGEST_SETTLING = 6
"""Longest wait for a line to be silent for the instrument's limit, as a multiple of that limit."""


def written_plan(plan: GuardPlan) -> bytes:
    """Return the plan as JSON."""
    return json.dumps(asdict(plan), default=bytes.hex).encode()


def read_plan(data: bytes) -> GuardPlan:
    """Return the plan from its JSON.

    Raises:
        ValueError: if it is not a plan, names an unknown port, or expects an invalid regular expression.
        KeyError, TypeError: if a field is missing or unknown.
    """
    fields = json.loads(data)
    plan = GuardPlan(
        bench=fields["bench"],
        run=fields["run"],
        ports=tuple(_port(port) for port in fields["ports"]),
        outputs=tuple(_output(output) for output in fields["outputs"]),
        cut=tuple(CutOutput(**{**cut, "cut_by": tuple(cut["cut_by"])}) for cut in fields["cut"]),
        hang_s=fields["hang_s"],
        latches=tuple(fields["latches"]),
        journal=fields["journal"],
    )
    devices, proven = {port.device for port in plan.ports}, {output.output for output in plan.outputs}
    for each in plan.cut:
        if not each.cut_by or not proven.issuperset(each.cut_by):
            raise ValueError(f"{each.output} is cut off by nothing that is guarded")
    for output in plan.outputs:
        if output.device not in devices:
            raise ValueError(f"{output.output} belongs to {output.device}, which has no port")
        for exchange in (*every_exchange(output.code), *filter(None, (output.code.who,))):
            _compiles(output.output, exchange)
    return plan


def every_exchange(code: SafeBytes) -> tuple[Exchange, ...]:
    """Return all exchanges of an output, in order."""
    return (*code.resync, *code.off, *code.proof)


def seconds_of(code: SafeBytes) -> float:
    """Return the longest time that all exchanges may take [s]: line never silent, bytes not taken, no reply."""
    return LONGEST_SETTLING * code.owed_s + sum(each.quiet_s + 3 * each.within_s for each in every_exchange(code))


def _port(fields: Mapping[str, Any]) -> GuardedPort:
    line = fields["line"]
    rs485 = None if line["rs485"] is None else Rs485(**line["rs485"])
    return GuardedPort(**{**fields, "line": SerialLine(**{**line, "rs485": rs485})})


def _output(fields: Mapping[str, Any]) -> GuardedOutput:
    code = {part: tuple(_exchange(each) for each in fields["code"][part]) for part in ("resync", "off", "proof")}
    who = fields["code"]["who"]
    asked = None if who is None else _exchange(who)
    safe = SafeBytes(**code, owed_s=fields["code"]["owed_s"], talks=fields["code"]["talks"], who=asked)
    return GuardedOutput(**{**fields, "code": safe, "cut_by": tuple(fields["cut_by"])})


def _exchange(fields: Mapping[str, Any]) -> Exchange:
    between = fields["between"]
    return Exchange(
        send=bytes.fromhex(fields["send"]),
        expect=bytes.fromhex(fields["expect"]),
        within_s=fields["within_s"],
        quiet_s=fields["quiet_s"],
        between=None if between is None else (between[0], between[1]),
    )


def _compiles(output: str, exchange: Exchange) -> None:
    try:
        groups = re.compile(exchange.expect, re.DOTALL).groups
    except re.error as error:
        raise ValueError(f"{output} expects {exchange.expect!r}, which is not a regular expression: {error}") from error
    if exchange.between is not None and not groups:
        raise ValueError(f"{output} expects {exchange.expect!r} between limits, but it has no group for the number")
