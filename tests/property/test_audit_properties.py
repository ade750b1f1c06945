"""The audit: what is taken away closes nothing, a FAIL closes nothing, and order does not matter."""

from __future__ import annotations

from dataclasses import replace

import msgspec
from audited import ASKED, DUT, INSTRUMENT, PARENT, certificate, package, result, seal_of, world_of
from hypothesis import given
from hypothesis import strategies as st

from hil.audit.engine import audit
from hil.audit.inputs import Asked, Package, Policy, Register, World
from hil.audit.remembered import remember
from hil.audit.tables import as_csv, as_json
from hil.documents.canonical import canonical, parse_strict
from hil.evidence.ledger.entries import Baseline
from hil.model.identity import Purpose, Source, UnitEvent
from hil.registers.instruments import AsFound, AsLeft

_OTHER = "LOAD-020"
_results = st.builds(
    result,
    verdict=st.sampled_from(["PASS", "PASS", "RECORDED", "INCONCLUSIVE", "FAIL"]),
    failed=st.booleans(),
    fingerprint=st.sampled_from([ASKED.fingerprint, ASKED.fingerprint, "0" * 64]),
    eligible=st.sampled_from([True, True, False]),
)


@st.composite
def _packages(draw: st.DrawFn) -> tuple[Package, ...]:
    """Draw packages of which some close a requirement, some speak against it, and some are worth nothing."""
    count = draw(st.integers(1, 5))
    return tuple(
        package(
            f"run-{number}",
            f"2026-0{draw(st.integers(1, 9))}-{draw(st.integers(10, 28))}",
            source=draw(st.sampled_from([Source.HARDWARE, Source.HARDWARE, Source.SIMULATED])),
            purpose=draw(st.sampled_from([Purpose.ACCEPTANCE, Purpose.DEVELOPMENT])),
            results={name: draw(_results) for name in draw(st.sets(st.sampled_from([ASKED.id, _OTHER]), min_size=1))},
        )
        for number in range(count)
    )


@st.composite
def _worlds(draw: st.DrawFn) -> World:
    """Draw a world whose packages are all known to the ledger."""
    packages = draw(_packages())
    asked = (PARENT, ASKED, msgspec.structs.replace(ASKED, id=_OTHER))
    disposed = {each.digest: frozenset({"nonconformance"}) for each in packages if draw(st.booleans())}
    return replace(world_of(packages), asked=asked, policy=Policy(valid=disposed))


def _closed(world: World) -> set[str]:
    return {row.id for row in audit(world).rows if row.closed}


@given(world=_worlds(), data=st.data())
def test_removing_evidence_never_closes_anything(world, data):
    """Packages, their results, and units and instruments of the registers are taken away: nothing closes by it."""
    kept = data.draw(st.sets(st.sampled_from(range(len(world.packages)))))
    fewer = replace(world, packages=tuple(world.packages[place] for place in kept))
    assert _closed(fewer) <= _closed(world)
    assert _closed(replace(world, register=Register())) <= _closed(world)
    cut = world.entries[: data.draw(st.integers(0, len(world.entries)))]
    assert _closed(replace(world, entries=cut)) <= _closed(world)


@given(world=_worlds(), day=st.integers(10, 28))
def test_adding_a_fail_never_closes_anything(world, day):
    """A package that failed is added, on any day, known to the ledger or not."""
    failed = result(verdict="FAIL", failed=True, eligible=False)
    added = package("run-9", f"2026-05-{day}", results={ASKED.id: failed, _OTHER: failed})
    more = replace(world, packages=(*world.packages, added))
    known = replace(more, entries=(*world.entries, seal_of(added, len(world.entries) + 1)))
    assert _closed(more) <= _closed(world)
    assert _closed(known) <= _closed(world)
    assert not {ASKED.id, _OTHER, PARENT.id} & _closed(known)


@given(world=_worlds(), data=st.data())
def test_shuffled_input_gives_identical_output(world, data):
    """Requirements, packages and registers in any order give the same bytes."""
    shuffled = replace(
        world,
        asked=tuple(data.draw(st.permutations(world.asked))),
        packages=tuple(data.draw(st.permutations(world.packages))),
    )
    assert as_json(audit(shuffled)) == as_json(audit(world))
    assert as_csv(audit(shuffled)) == as_csv(audit(world))


@given(world=_worlds())
def test_a_recall_never_closes_anything(world):
    """An instrument is found out of tolerance."""
    dmm = world.register.instruments["dmm-1"]
    bad = certificate("C-2", "2026-12-01", "2027-12-01", as_found=AsFound.OUT_OF_TOLERANCE)
    recalled = replace(dmm, certificates=(*dmm.certificates, bad))
    after = replace(world, register=replace(world.register, instruments={"dmm-1": recalled}))
    assert not _closed(after)


_EVENTS = tuple(
    UnitEvent(kind=kind, date=f"2026-0{month}-15", text="done", reference="NCR-1", reverify=reverify)
    for month, kind, reverify in ((2, "repair", True), (5, "demate", False), (7, "rework", True))
)
_CERTIFICATES = tuple(
    certificate(f"C-{month}", f"2026-0{month}-10", "2027-01-10", as_found=found, as_left=left)
    for month in (3, 6, 8)
    for found in (AsFound.IN_TOLERANCE, AsFound.OUT_OF_TOLERANCE)
    for left in (AsLeft.ADJUSTED, AsLeft.OUT_OF_TOLERANCE)
)


@st.composite
def _remembering(draw: st.DrawFn) -> World:
    """Draw a world with a history in its registers, which the ledger remembers as it is."""
    world = draw(_worlds())
    dates = {each.date: each for each in draw(st.lists(st.sampled_from(_CERTIFICATES), max_size=3))}
    instrument = replace(INSTRUMENT, certificates=(*INSTRUMENT.certificates, *(dates[day] for day in sorted(dates))))
    dut = replace(DUT, events=tuple(draw(st.lists(st.sampled_from(_EVENTS), unique=True))))
    known = replace(world, register=Register(duts={dut.serial: dut}, instruments={instrument.id: instrument}))
    return replace(known, remembered=remember(_BASELINES, lambda entry, _: _contents(known)[entry.subject]))


_BASELINES = tuple(Baseline(subject=each, object=each) for each in ("catalogue", "units", "instruments"))


def _contents(world: World) -> dict[str, tuple[object, ...]]:
    register = world.register
    return {
        "catalogue": world.asked,
        "units": tuple(register.duts.values()),
        "instruments": tuple(register.instruments.values()),
    }


@given(world=_remembering(), data=st.data())
def test_removing_requirements_or_entries_of_registers_never_closes_anything(world, data):
    """Requirements, links, events, certificates and what they found are taken out, changed or withdrawn."""
    dut, instrument = world.register.duts[DUT.serial], world.register.instruments[INSTRUMENT.id]
    events = tuple(each for each in dut.events if data.draw(st.booleans()))
    certificates = [
        replace(each, as_found=AsFound.IN_TOLERANCE, as_left=AsLeft.ADJUSTED) if data.draw(st.booleans()) else each
        for each in instrument.certificates
        if data.draw(st.booleans())
    ]
    register = Register(
        duts={dut.serial: replace(dut, events=events)},
        instruments={instrument.id: replace(instrument, certificates=tuple(certificates))},
    )

    def taken_out(each: Asked) -> list[Asked]:
        how = data.draw(st.sampled_from(["kept", "gone", "withdrawn", "unlinked"]))
        changed = {"withdrawn": {"withdrawn": True}, "unlinked": {"parents": ()}}.get(how, {})
        return [] if how == "gone" else [msgspec.structs.replace(each, **changed)]

    asked = tuple(left for each in world.asked for left in taken_out(each))
    assert _closed(replace(world, register=register)) <= _closed(world)
    assert _closed(replace(world, asked=asked)) <= _closed(world)
    assert _closed(replace(world, asked=asked, register=register)) <= _closed(world)
    shuffled = replace(world, asked=tuple(data.draw(st.permutations(asked))), register=register)
    assert as_json(audit(shuffled)) == as_json(audit(replace(world, asked=asked, register=register)))


@given(text=st.text(st.characters(codec="utf-8"), max_size=40))
def test_the_json_is_canonical(text):
    """Whatever a requirement says, the document is the canonical JSON of what it reads as."""
    world = replace(world_of([package()]), asked=(msgspec.structs.replace(ASKED, text=text),))
    data = as_json(audit(world))
    assert canonical(parse_strict(data)) == data
