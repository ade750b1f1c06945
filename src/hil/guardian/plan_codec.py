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
"""How many times the instrument's limit a line is listened to, at most, until it is silent for once that limit."""


def written_plan(plan: GuardPlan) -> bytes:
    """Return the plan as JSON."""
    return json.dumps(asdict(plan), default=bytes.hex).encode()


def read_plan(data: bytes) -> GuardPlan:
    """Return the plan from its JSON.

    Raises:
        ValueError: if it is not a plan, names a port that it does not have, or expects an invalid regular expression.
        KeyError, TypeError: if a field is missing or unknown.
    """
    told = json.loads(data)
    plan = GuardPlan(
        bench=told["bench"],
        run=told["run"],
        ports=tuple(_port(port) for port in told["ports"]),
        outputs=tuple(_output(output) for output in told["outputs"]),
        cut=tuple(CutOutput(**{**cut, "cut_by": tuple(cut["cut_by"])}) for cut in told["cut"]),
        hang_s=told["hang_s"],
        latches=tuple(told["latches"]),
        journal=told["journal"],
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
    """Return the longest time that all exchanges may take [s]: no silence, bytes not taken, and no reply."""
    return LONGEST_SETTLING * code.owed_s + sum(each.quiet_s + 3 * each.within_s for each in every_exchange(code))


def _port(told: Mapping[str, Any]) -> GuardedPort:
    line = told["line"]
    rs485 = None if line["rs485"] is None else Rs485(**line["rs485"])
    return GuardedPort(**{**told, "line": SerialLine(**{**line, "rs485": rs485})})


def _output(told: Mapping[str, Any]) -> GuardedOutput:
    code = {part: tuple(_exchange(each) for each in told["code"][part]) for part in ("resync", "off", "proof")}
    who = told["code"]["who"]
    asked = None if who is None else _exchange(who)
    safe = SafeBytes(**code, owed_s=told["code"]["owed_s"], talks=told["code"]["talks"], who=asked)
    return GuardedOutput(**{**told, "code": safe, "cut_by": tuple(told["cut_by"])})


def _exchange(told: Mapping[str, Any]) -> Exchange:
    between = told["between"]
    return Exchange(
        send=bytes.fromhex(told["send"]),
        expect=bytes.fromhex(told["expect"]),
        within_s=told["within_s"],
        quiet_s=told["quiet_s"],
        between=None if between is None else (between[0], between[1]),
    )


def _compiles(output: str, exchange: Exchange) -> None:
    try:
        groups = re.compile(exchange.expect, re.DOTALL).groups
    except re.error as error:
        raise ValueError(f"{output} expects {exchange.expect!r}, which is not a regular expression: {error}") from error
    if exchange.between is not None and not groups:
        raise ValueError(f"{output} expects {exchange.expect!r} between limits, but it has no group for the number")
