"""What evidence from a simulated bench leaves open: what the same run on hardware would close, and what not."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from hil.audit.conditions import Claim
from hil.audit.document import OnHardware, Row
from hil.audit.reasons import Code, Reason
from hil.evidence.results.eligibility import MODELS
from hil.model.identity import Model, Source

__all__ = ["by_children", "on_hardware"]

_OF_UNIT = frozenset({Code.WRONG_DUT, Code.STALE_DUT})


def on_hardware(
    claims: Sequence[Claim], reasons: Sequence[Sequence[Reason]], others: Iterable[Reason], below: Sequence[Row]
) -> OnHardware | None:
    """Return what the newest run elsewhere would leave open if it were made on hardware; None if there is none.

    Nothing is guessed: only what comes from the simulation itself is left out. The verdict is taken as it is.

    Args:
        claims: what the packages say of the requirement, the oldest first.
        reasons: why each of them does not close it.
        others: what stands against the requirement whatever the evidence.
        below: the rows of the requirements below it.
    """
    for claim, its in reversed(tuple(zip(claims, reasons, strict=True))):
        if claim.package.source not in {Source.HARDWARE, ""}:
            left = (*others, *_left(claim, its), *_unit(claim), *_below(below))
            return OnHardware(package=claim.package.folder, reasons=tuple(dict.fromkeys(left)))
    return None


def by_children(below: Sequence[Row]) -> OnHardware | None:
    """Return what runs of the requirements below one would leave open in it; None if no run of them was elsewhere."""
    if not any(row.on_hardware for row in below):
        return None
    return OnHardware(reasons=tuple(_below(below)))


def _left(claim: Claim, reasons: Iterable[Reason]) -> Iterator[Reason]:
    """Give the reasons that do not come from the simulation; a unit that is simulated, too, stands for another one."""
    for reason in reasons:
        of_unit = reason.code in _OF_UNIT and claim.package.simulated_unit
        if reason.code is not Code.SIM_ONLY and not of_unit:
            yield reason


def _unit(claim: Claim) -> Iterator[Reason]:
    """Say that there is nothing to test, where a unit was simulated and the register has none in its place."""
    if not claim.package.simulated_unit:
        return
    parts = claim.asked.part_numbers or (claim.package.part,)
    models = {str(purpose): model for purpose, model in MODELS.items()}
    wanted = models.get(claim.asked.stage) or models.get(claim.package.purpose)
    there = (dut.model for dut in claim.world.register.duts.values() if dut.part in parts and not dut.simulated)
    if not any(model is wanted or (wanted is None and model in {Model.QM, Model.FM}) for model in there):
        text = f"the register has no {wanted or 'QM or FM'} of the part {' or '.join(parts)}"
        yield Reason(code=Code.WRONG_DUT, text=text)


def _below(rows: Iterable[Row]) -> Iterator[Reason]:
    for row in rows:
        if not row.closed and (row.on_hardware is None or row.on_hardware.reasons):
            yield Reason(code=Code.CHILD_OPEN, text=f"{row.id} would stay open", origin=row.id)
