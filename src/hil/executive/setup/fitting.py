"""Fitting: a plan that names part numbers is run with articles of those only."""

from __future__ import annotations

from collections.abc import Sequence

from hil.documents.suggest import did_you_mean
from hil.model.errors import Refused
from hil.model.identity import Dut, Source
from hil.requirements.catalogue import Catalogue

__all__ = ["require_fitting"]


def require_fitting(catalogue: Catalogue, dut: Dut, duts: Sequence[Dut], source: Source, register: str) -> None:
    """Require that every asked plan is for the article's part number, as far as it names any.

    Args:
        catalogue: what the asked plans hold.
        dut: the article that was asked for.
        duts: all of the register, from which others are named.
        source: where the bench is; on hardware no article is named that exists on simulated benches only.
        register: the register's path as shown to a person.

    Raises:
        Refused: with the articles that fit.
    """
    named = {plan: parts for plan in catalogue.plans if (parts := catalogue.part_numbers(plan))}
    others = {plan: parts for plan, parts in named.items() if dut.part not in parts}
    if not others:
        return
    told = "; ".join(f"{plan} is for {' or '.join(parts)}" for plan, parts in others.items())
    fitting = [
        each.serial
        for each in duts
        if all(each.part in parts for parts in named.values())
        if not (each.simulated and source is Source.HARDWARE)
    ]
    known = {part for parts in others.values() for part in parts}
    raise Refused(
        f"{dut.serial} has the part number {dut.part}, but {told}{did_you_mean(dut.part, known)}",
        f"name one that fits with --dut: {', '.join(fitting)}" if fitting else _none(register, named),
    )


def _none(register: str, named: dict[str, tuple[str, ...]]) -> str:
    if len(named) > 1 and not set.intersection(*map(set, named.values())):
        return "no article fits all of these plans; run each by itself"
    return f"no article in {register} fits; register it there"
