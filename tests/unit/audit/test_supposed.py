"""What changed files would reopen, and what runs that are not sealed say, read from a workspace on the disk."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import pytest
from audited import codes, package, result, seal_of
from evidence_runs import begin, case_end, check
from workspaces import make

from hil.audit.cache import Cache
from hil.audit.changes import changes
from hil.audit.engine import audit
from hil.audit.inputs import Instrument
from hil.audit.packages import read_packages
from hil.audit.reading import Folders, read_world
from hil.audit.recorded import encoded, record
from hil.audit.supposed import suppose
from hil.evidence.folder import create
from hil.evidence.ledger.book import append, put_object, read
from hil.evidence.ledger.entries import Baseline
from hil.model.errors import Refused

CASE = """
@pytest.mark.requirement("T-010")
def test_one(check):
    check("T-010", "ratio", 1.0)
"""
NO_CACHE = Cache(None, "")
NO_REPORTS = encoded("nonconformances", ())
LATER = """\
    - number: SPECIMEN-2026-2
      laboratory: Specimen laboratory of the reference workspace
      file: certificates/psu-01-2026.txt
      sha256: 31bc9769247c692869b3e3e3eb58ebbd16a7de48748cf1844e2553724c023b40
      date: "2026-11-01"
      due: "2027-11-01"
      as_found: out of tolerance
      as_left: adjusted
      ranges: []
"""


@pytest.fixture
def folders(tmp_path):
    """Return the folders of a workspace."""
    root = make(tmp_path / "workspace", CASE).root
    return Folders(
        root=root, testplans=root / "testplans", fixtures=root / "fixtures", reports=root / "reports", name="w"
    )


def closed(folders):
    """Return the workspace with a package that closes T-010, measured with PSU-01."""
    world = read_world(folders, NO_CACHE, version="1.0", locked=False)
    asked = next(each for each in world.asked if each.id == "T-010")
    dut = world.register.duts["SIM-ADCS-1"]
    one = package(
        day="2026-10-05",
        serial=dut.serial,
        part=dut.part,
        hardware=dut.hardware,
        firmware=dut.firmware,
        analysis=world.analysis,
        instruments={"psu1": Instrument(certificate="certificates/psu-01-2026.txt", entry="PSU-01")},
        results={"T-010": result(fingerprint=asked.fingerprint, rev=asked.rev, instruments=("psu1",))},
    )
    found = replace(world, packages=(one,), entries=(seal_of(one),))
    assert codes(found, "T-010") == []
    return found


def reopened(world, folders, changed):
    """Return what a change reopens, each with the codes of its new reasons."""
    before, after = map(audit, suppose(world, folders, str(changed)))
    return {each.id: [reason.code for reason in each.gained] for each in changes(before, after)}


def test_a_changed_requirement_in_its_place_is_compared_with_its_lock(folders):
    """Another limit reopens what was closed; another wording of another requirement does not."""
    world = closed(folders)
    file = folders.testplans / "small/requirements.yaml"
    text = file.read_text(encoding="utf-8")
    assert reopened(world, folders, file) == {}
    file.write_text(text.replace('min: "0.5", max: "1.5"', 'min: "0.6", max: "1.5"', 1), encoding="utf-8")
    now = read_world(folders, NO_CACHE, version="1.0", locked=False)
    assert reopened(replace(world, asked=now.asked), folders, file) == {"T-010": ["SUSPECT_REQ"]}


def test_a_changed_catalogue_of_another_name_takes_the_place_of_its_document(folders, tmp_path):
    """A draft beside the workspace: the document's id says which one it would replace."""
    world = closed(folders)
    text = (folders.testplans / "small/requirements.yaml").read_text(encoding="utf-8")
    draft = tmp_path / "draft.yaml"
    draft.write_text(text.replace('min: "0.5", max: "1.5"', 'min: "0.6", max: "1.5"', 1), encoding="utf-8")
    assert reopened(world, folders, draft) == {"T-010": ["SUSPECT_REQ"]}


@pytest.mark.parametrize("in_place", [False, True])
def test_a_certificate_that_finds_an_instrument_out_of_tolerance_reopens(folders, tmp_path, in_place):
    """Everything since the last good one; in its place it is compared with what was entered into the ledger."""
    world = closed(folders)
    file = folders.fixtures / "instruments.yaml"
    text = file.read_text(encoding="utf-8") + LATER
    if in_place:
        record(folders.reports, world, audit(world))
        file.write_text(text, encoding="utf-8")
        now = read_world(folders, NO_CACHE, version="1.0")
        entries = (*world.entries, *read(folders.reports).entries)
        world = replace(world, register=now.register, entries=entries)
    else:
        file = tmp_path / "instruments.yaml"
        file.write_text(text, encoding="utf-8")
    assert reopened(world, folders, file) == {"T-010": ["CAL_RETRO"]}


def test_an_instrument_that_is_taken_out_of_the_register_reopens(folders, tmp_path):
    """Nobody can say any more whether it was in calibration."""
    file = tmp_path / "instruments.yaml"
    text = (folders.fixtures / "instruments.yaml").read_text(encoding="utf-8")
    file.write_text(text.replace("PSU-01:", "PSU-09:"), encoding="utf-8")
    assert reopened(closed(folders), folders, file) == {"T-010": ["STALE_CAL"]}


def test_another_analysis_reopens(folders):
    """The word stands for a file that no workspace holds."""
    assert reopened(closed(folders), folders, "analysis") == {"T-010": ["STALE_ANALYSIS"]}


def interrupted(reports, measured):
    """Write a run on hardware that judged one axis and was interrupted, and return what an audit reads of it."""
    folder = create(reports, bench="flight", dut="SN1")
    journal = begin(folder)
    check(journal, measured)
    if measured == 0.2:
        case_end(journal)
    (found,) = read_packages(reports, NO_CACHE)
    return found


def test_an_unsealed_run_closes_nothing_and_its_fail_counts(tmp_path):
    """What it measured is read from its journal: a good value is INTEGRITY at best, and a FAIL stands."""
    good, bad = interrupted(tmp_path / "good", 0.1), interrupted(tmp_path / "bad", 3.0)
    assert (good.sealed, good.digest, good.named) == (bad.sealed, bad.digest, bad.named) == (False, "", "")
    assert good.problem
    assert (good.results["GYR-030"].failed, bad.results["GYR-030"].failed) == (False, True)
    assert not good.results["GYR-030"].eligible
    assert msgspec.structs.asdict(bad)["source"] == "hardware"


WAIVER = """\
schema: hil/waivers/1
waivers:
- id: W-1
  title: accepted for this mission
  date: "2026-10-07"
  until: "2999-01-01"
  by: Ada
  requirement: T-010
  rev: {rev}
  fingerprint: {fingerprint}
  units: [{{part: "{part}", serial: "{serial}"}}]
  reason: it is enough
"""
REPORT = """\
schema: hil/nonconformances/1
nonconformances:
- id: NCR-1
  title: it sagged
  date: "2026-10-06"
  by: Ada
  requirements: [T-010]
  units: [{{part: "{part}", serial: "{serial}"}}]
"""


def test_a_supposed_report_opens_and_a_supposed_waiver_is_told(folders, tmp_path):
    """A report that names a requirement reopens it; a waiver that nobody has approved closes nothing, and says so."""
    world = closed(folders)
    asked = next(each for each in world.asked if each.id == "T-010")
    one = world.packages[0]
    facts = {"rev": asked.rev, "fingerprint": asked.fingerprint, "part": one.part, "serial": one.serial}
    (tmp_path / "reports.yaml").write_text(REPORT.format(**facts), encoding="utf-8")
    assert reopened(world, folders, tmp_path / "reports.yaml") == {"T-010": ["OPEN_NCR"]}
    (tmp_path / "waived.yaml").write_text(WAIVER.format(**facts), encoding="utf-8")
    before, after = map(audit, suppose(world, folders, str(tmp_path / "waived.yaml")))
    (change,) = changes(before, after)
    assert (change.id, change.what, change.gained) == ("T-010", "changed", ())
    assert change.told


def test_a_report_in_its_place_is_compared_with_what_was_recorded(folders):
    """What the ledger has is what it said before."""
    world = closed(folders)
    file = folders.fixtures / "nonconformances.yaml"
    file.write_text("schema: hil/nonconformances/1\nnonconformances: {}\n", encoding="utf-8")
    with pytest.raises(Refused, match="the ledger has no nonconformances to compare with"):
        suppose(world, folders, str(file))
    record(folders.reports, world, audit(world))
    append(folders.reports, Baseline(subject="nonconformances", object=put_object(folders.reports, NO_REPORTS)))
    one = world.packages[0]
    file.write_text(REPORT.format(part=one.part, serial=one.serial), encoding="utf-8")
    now = read_world(folders, NO_CACHE, version="1.0")
    entries = (*world.entries, *read(folders.reports).entries)
    assert reopened(replace(world, filed=now.filed, entries=entries), folders, file) == {"T-010": ["OPEN_NCR"]}
