from __future__ import annotations

import json
import unicodedata

import pytest
from click.testing import CliRunner

from hil.cli.commands.requirements import command
from hil.model.errors import ConfigurationError, Refused


def only_finding(workspace):
    """Return the one finding of loading the plan."""
    with pytest.raises(ConfigurationError) as error:
        workspace.load()
    assert len(error.value.findings) == 1
    return str(error.value)


@pytest.fixture
def hil(workspace, monkeypatch):
    """Runs `hil requirements` inside the workspace."""
    monkeypatch.chdir(workspace.root)

    def run(*arguments):
        return CliRunner().invoke(command, arguments)

    return run


def test_a_locked_plan_loads(workspace):
    """The lock says format, revision and fingerprint per id."""
    workspace.load()
    lock = json.loads((workspace.plan / "requirements.lock.json").read_text())
    assert lock["format"] == 1
    assert set(lock["requirements"]) == {"ADCS-GYR-030", "ADCS-GYR-010", "ADCS-GYR-011"}
    assert lock["requirements"]["ADCS-GYR-010"]["rev"] == 1


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        ("less than 0.5", "less than 0.6", "text"),
        ('max: "0.5"', 'max: "0.50"', 'limits.rate_error.max: "0.5" -> "0.50"'),
        ("unit: deg/s,", "unit: rad/s,", 'limits.rate_error.unit: "deg/s" -> "rad/s"'),
        ("decision: guarded", "decision: simple", 'limits.rate_error.decision: "guarded" -> "simple"'),
        ("of: [x, y, z], unit: deg/s,", "of: [x, y], unit: deg/s,", "limits.rate_error.of"),
        ("stage: acceptance", "stage: qualification", 'stage: "acceptance" -> "qualification"'),
        ("equals: clockwise", "equals: counterclockwise", "limits.direction.equals"),
        ("[x_plus, x_minus]", "[x_plus]", "over."),
        ("duration: 4 h", "duration: 3 h", "records.duration_s: 14400.0 -> 10800.0"),
    ],
)
def test_a_meaning_that_changes_needs_a_new_revision(workspace, old, new, field):
    """Text, limits, units, decision, denominator, stage, coverage and records are meaning; the field is named."""
    workspace.edit(old, new)
    found = only_finding(workspace)
    assert "changed without a new rev (" in found
    assert field in found
    assert found.endswith("): raise `rev` to 2, then run `hil requirements lock testplans/gyro`")


def test_a_lock_of_before_says_what_it_can(workspace, hil):
    """A lock without the fields still refuses, and the diff says that it does not know them."""
    lock = workspace.plan / "requirements.lock.json"
    document = json.loads(lock.read_text())
    for entry in document["requirements"].values():
        del entry["meaning"], entry["explanation"]
    lock.write_text(json.dumps(document))
    workspace.edit("duration: 4 h", "duration: 3 h")
    assert "changed without a new rev: raise `rev` to 2" in only_finding(workspace)
    assert "which fields is not known" in hil("diff", "gyro").output


def test_a_lock_that_was_edited_by_hand_is_no_lock(workspace):
    """A meaning must have the fingerprint that stands beside it."""
    lock = workspace.plan / "requirements.lock.json"
    lock.write_text(lock.read_text().replace("deg/s", "rad/s"))
    found = only_finding(workspace)
    assert "not a lock of format 1 as it was written; restore it from version control" in found


def test_a_damaged_lock_is_not_written_over(workspace, hil):
    """The command would forget what was locked; it refuses as a run does, and does not advise itself."""
    lock = workspace.plan / "requirements.lock.json"
    lock.write_text("{")
    found = str(hil("lock", "gyro").exception)
    assert "restore it from version control" in found
    assert "hil requirements lock" not in found
    assert lock.read_text() == "{"


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("section 30", "section 31"),
        ("shall differ from", "shall   differ\n    from"),
        ("parents: [ADCS-001]", "rationale: Because."),
        ("of: [x, y, z], unit: deg/s,", "of: [z, y, x], unit: deg/s,"),
        ("kind: limit", "anomaly: The source says degrees.\n  kind: limit"),
        ("duration: 4 h", "duration: 240 min"),
    ],
)
def test_explanations_and_spacing_may_change(workspace, old, new):
    """What is not meaning loads under the same lock."""
    workspace.edit(old, new)
    workspace.load()


def test_composed_and_decomposed_letters_are_the_same_text(workspace):
    """The fingerprint is taken of the normalised text, and line ends do not matter."""
    workspace.edit("The calibrated", "The Örsted calibrated")
    workspace.lock()
    text = unicodedata.normalize("NFD", workspace.file.read_text())
    workspace.file.write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    workspace.load()


def test_a_revision_without_a_new_meaning_is_refused(workspace):
    """A new rev would throw away evidence for nothing."""
    workspace.edit("id: ADCS-GYR-011\n  rev: 1", "id: ADCS-GYR-011\n  rev: 2")
    assert "went from 1 to 2, but its meaning is the same: set it back" in only_finding(workspace)


def test_a_revision_never_goes_back(workspace):
    """Also where the meaning changed."""
    workspace.edit("id: ADCS-GYR-011\n  rev: 1", "id: ADCS-GYR-011\n  rev: 3")
    workspace.lock()
    workspace.edit("id: ADCS-GYR-011\n  rev: 3", "id: ADCS-GYR-011\n  rev: 2")
    workspace.edit("shall be characterised", "shall be known")
    assert "went back from 3 to 2, revisions only grow" in only_finding(workspace)


def test_a_new_requirement_or_revision_has_to_be_locked(workspace):
    """The finding says the command."""
    workspace.edit("id: ADCS-GYR-011", "id: ADCS-GYR-012")
    with pytest.raises(ConfigurationError) as error:
        workspace.load()
    found = str(error.value)
    assert "ADCS-GYR-012 is not locked, run `hil requirements lock testplans/gyro`" in found
    assert "ADCS-GYR-011 was removed from the plan, keep it there with `withdrawn: true`" in found
    workspace.edit("id: ADCS-GYR-012\n  rev: 1", "id: ADCS-GYR-011\n  rev: 2")
    workspace.edit("shall be characterised", "shall be known")
    assert "rev 2 of ADCS-GYR-011 is not locked, run `hil requirements lock" in only_finding(workspace)


def test_a_withdrawn_requirement_stays_in_the_plan(workspace):
    """Withdrawing is no change of meaning."""
    workspace.edit("id: ADCS-GYR-011", "withdrawn: true\n  id: ADCS-GYR-011")
    assert workspace.load().requirement("ADCS-GYR-011").withdrawn


def test_what_was_withdrawn_does_not_come_back(workspace, hil):
    """Once it is locked as withdrawn, a requirement is asked for by another id only, in runs and by the command."""
    workspace.edit("id: ADCS-GYR-011", "withdrawn: true\n  id: ADCS-GYR-011")
    assert hil("lock", "gyro").exit_code == 0
    workspace.edit("withdrawn: true\n  id: ADCS-GYR-011", "id: ADCS-GYR-011")
    assert "ADCS-GYR-011 was withdrawn, and its id is never reused" in only_finding(workspace)
    assert "never reused" in str(hil("lock", "gyro").exception)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (None, "the plan is not locked, run `hil requirements lock testplans/gyro`"),
        ("{", ".json:1:2: cannot be read: not JSON"),
        ('{"format": 1, "format": 1}', "duplicate key 'format'"),
        ('{"format": 2, "requirements": {}}', ":1:12: is not a lock of format 1"),
        (
            '{"format": 1, "requirements": {"A-01": {"rev": true, "fingerprint": ""}}}',
            ":1:48: is not a lock of format 1",
        ),
        ("[]", ":1:1: is not a lock of format 1"),
    ],
)
def test_a_missing_or_damaged_lock_is_one_finding(workspace, text, expected):
    """It names the lock file and what to do."""
    lock = workspace.plan / "requirements.lock.json"
    lock.unlink() if text is None else lock.write_text(text)
    finding = only_finding(workspace)
    assert finding.startswith("testplans/gyro/requirements.lock.json:")
    assert expected in finding


def test_a_changed_lock_is_told_at_its_line(workspace):
    """The fingerprint that its meaning does not have."""
    lock = workspace.plan / "requirements.lock.json"
    text = lock.read_text()
    number = next(n for n, line in enumerate(text.split("\n"), 1) if "fingerprint" in line)
    lock.write_text(text.replace('"fingerprint": "', '"fingerprint": "0', 1))
    assert only_finding(workspace).startswith(f"testplans/gyro/requirements.lock.json:{number}:")


def test_a_folder_in_the_place_of_the_lock_is_told(workspace):
    """Not with the words of the operating system."""
    lock = workspace.plan / "requirements.lock.json"
    lock.unlink()
    lock.mkdir()
    assert only_finding(workspace) == "testplans/gyro/requirements.lock.json: this is not a file"


def test_wrong_requirements_are_told_before_the_lock_is_compared(workspace):
    """A wrong entry would look like a changed one."""
    workspace.edit('min: "-0.5"', 'min: "0.9"')
    assert "is above max" in only_finding(workspace)


def test_the_lock_command_accepts_what_a_run_will_accept(workspace, hil):
    """After a new revision the lock is written, and the plan loads."""
    workspace.edit("id: ADCS-GYR-011\n  rev: 1", "id: ADCS-GYR-011\n  rev: 2")
    workspace.edit("shall be characterised", "shall be known")
    result = hil("lock", "gyro")
    assert result.output == "testplans/gyro/requirements.lock.json: 3 requirements locked\n"
    assert result.exit_code == 0
    assert workspace.load().requirement("ADCS-GYR-011").rev == 2


def test_the_lock_command_does_not_cover_up(workspace, hil):
    """A changed meaning under the same rev stays an error, and the lock stays as it was."""
    before = (workspace.plan / "requirements.lock.json").read_bytes()
    workspace.edit("shall be characterised", "shall be known")
    result = hil("lock", "testplans/gyro")
    assert isinstance(result.exception, ConfigurationError)
    assert "raise `rev` to 2" in str(result.exception)
    workspace.edit("id: ADCS-GYR-011", "id: ADCS-GYR-012")
    assert "was removed from the plan" in str(hil("lock", "testplans/gyro").exception)
    assert (workspace.plan / "requirements.lock.json").read_bytes() == before


def test_the_diff_command_tells_kinds_of_change_apart(workspace, hil):
    """Added, removed, semantic and editorial, by id."""
    assert hil("diff", "testplans/gyro").output == "testplans/gyro: no changes\n"
    workspace.edit("section 30", "section 31")
    workspace.edit("duration: 4 h", "duration: 3 h")
    workspace.edit("id: ADCS-GYR-011", "id: ADCS-GYR-012")
    assert hil("diff", "testplans/gyro").output.splitlines() == [
        "testplans/gyro: semantic  ADCS-GYR-010 (still rev 1, a new rev is needed)",
        "  records.duration_s: 14400.0 -> 10800.0",
        "testplans/gyro: removed   ADCS-GYR-011 (was rev 1)",
        "testplans/gyro: added     ADCS-GYR-012 (rev 1)",
        "testplans/gyro: editorial ADCS-GYR-030 (rev 1)",
        '  source: "characterisation report, section 30" -> "characterisation report, section 31"',
    ]


def test_the_diff_command_takes_a_plan_without_lock_as_all_new(workspace, hil):
    """Every requirement is added then."""
    (workspace.plan / "requirements.lock.json").unlink()
    assert hil("diff", "gyro").output.count("added") == 3


def test_the_commands_have_help_with_an_example(hil):
    """A person finds the way from the command line alone."""
    for arguments in (("--help",), ("lock", "--help"), ("diff", "--help")):
        result = hil(*arguments)
        assert result.exit_code == 0
        assert "Example:\n" in result.output


def test_the_commands_name_the_plans_there_are(hil):
    """A misspelt plan is refused with the nearest."""
    result = hil("lock", "testplans/gyr")
    assert isinstance(result.exception, Refused)
    assert "there is no plan 'testplans/gyr', did you mean 'gyro'?" in str(result.exception)
