from __future__ import annotations

import sys
import time

import pytest
import sweeps

from hil.documents.text import name_problem
from hil.model.errors import ConfigurationError, HilError
from hil.requirements.catalogue import load_catalogue
from hil.requirements.requirement import Decision, Kind, Method


def findings(load, *args, **options):
    """Return the findings that loading raises."""
    with pytest.raises(ConfigurationError) as error:
        load(*args, **options)
    return [str(finding) for finding in error.value.findings]


def one_entry(extra, requirement_id="EPS-BAT-010"):
    """Return a plan with one limit requirement and whatever is added to it."""
    return (
        f"schema: hil/requirements/1\nrequirements:\n- id: {requirement_id}\n  rev: 1\n  text: It shall.\n"
        f"  method: test\n{extra}"
    )


def test_a_plan_is_read_as_it_is_written(workspace):
    """Every field of the notation arrives."""
    catalogue = workspace.load()
    assert catalogue.ids == ("ADCS-GYR-030", "ADCS-GYR-010", "ADCS-GYR-011")
    assert catalogue.plans == ("gyro",)
    assert catalogue.document("gyro").issue == "1.0"
    requirement = catalogue.requirement("ADCS-GYR-030")
    assert (requirement.kind, requirement.method, requirement.rev) == (Kind.LIMIT, Method.TEST, 1)
    assert (requirement.level, requirement.stage, requirement.plan) == ("equipment", "acceptance", "gyro")
    assert requirement.over == {"board": ("x_plus", "x_minus")}
    assert (requirement.place.path, requirement.place.line) == ("testplans/gyro/requirements.yaml", 4)
    limit = catalogue.limit("ADCS-GYR-030", "rate_error")
    assert (limit.minimum, limit.maximum, limit.min_tur, limit.of) == ("-0.5", "0.5", "2", ("x", "y", "z"))
    assert limit.decision is Decision.GUARDED
    assert catalogue.limit("ADCS-GYR-030", "direction").equals == "clockwise"
    records = catalogue.requirement("ADCS-GYR-010").records
    assert records is not None
    assert (records.rate_hz, records.duration_s, records.max_gap_s) == (100.0, 14400.0, 0.1)
    parent = catalogue.parent("ADCS-001")
    assert parent is not None
    assert parent.kind is Kind.PARENT


def test_a_requirement_names_any_recording_that_a_case_can_make(workspace):
    """One rule for the name, wherever it stands."""
    workspace.edit("recording: rest,", "recording: warm-up 1,")
    records = workspace.load(locked=False).requirement("ADCS-GYR-010").records
    assert records is not None
    assert (records.recording, name_problem(records.recording)) == ("warm-up 1", "")


def test_unknown_ids_and_parameters_name_the_nearest(workspace):
    """A misspelt id is an error that helps, and a KeyError for who asks so."""
    catalogue = workspace.load()
    with pytest.raises(HilError, match="no requirement 'ADCS-GYR-O30' in gyro, did you mean 'ADCS-GYR-030'"):
        catalogue.requirement("ADCS-GYR-O30")
    with pytest.raises(KeyError):
        catalogue.requirement("ADCS-001")
    with pytest.raises(HilError, match="has no parameter 'rate_eror', did you mean 'rate_error'"):
        catalogue.limit("ADCS-GYR-030", "rate_eror")


@pytest.mark.parametrize(
    ("limits", "expected"),
    [
        ('{parameter: a, unit: V, min: "2", max: "1"}', "min 2 of 'a' is above max 1"),
        ('{parameter: a, unit: V, min: "1e2", max: "99.9"}', "min 1e2 of 'a' is above max 99.9"),
        (
            '{parameter: a, unit: V, min: "2", max: "2.0"}',
            "min and max of 'a' are the same: no value with an uncertainty",
        ),
        ('{parameter: a, unit: V, min: "1e-400"}', "is too small for a number"),
        ('{parameter: a, unit: ohm*foo/foo, max: "1"}', "'ohm*foo/foo' is not a known unit"),
        ('{parameter: a, unit: V, max: "1", min_tur: "2"}', "min_tur of 'a' needs both min and max"),
        ('{parameter: a, unit: V, min: "0", max: "1", min_tur: "0"}', "min_tur of 'a' must be above zero"),
        ('{parameter: a, unit: furlong, max: "1"}', "'furlong' is not a known unit"),
        ('{parameter: a, max: "1"}', "'a' has a limit and no unit"),
        ("{parameter: a, unit: V}", "'a' of EPS-BAT-010 needs min, max or equals"),
        ("{parameter: a, unit: V, equals: up}", "'a' equals a word, so it has no unit"),
        ("{parameter: a, unit: V, max: 1.10}", '`1.10` would lose its digits as a number, write it in quotes: "1.10"'),
        ("{parameter: a, unit: V, max: 1}", "'max' must be a number in quotes, found `1`, write it in quotes: \"1\""),
        ('{parameter: a, unit: V, max: "NaN"}', "'max' must be a decimal number in quotes"),
        ('{parameter: a, unit: V, maxx: "1", min: "0"}', "unknown key 'maxx', did you mean 'max'?"),
        ('{parameter: a, unit: V, max: "1", decision: gaurded}', "found `gaurded`, did you mean 'guarded'?"),
        ('{parameter: a, unit: V, max: "1", of: [x, x]}', "duplicate name 'x'"),
        ('{parameter: a, unit: V, max: "1", of: []}', "'of' needs at least one name"),
        ('{parameter: a, unit: V, max: "1"}\n  - {parameter: a, unit: V, min: "0"}', "duplicate parameter 'a'"),
    ],
)
def test_wrong_limits_are_errors_at_load(workspace, limits, expected):
    """Whatever could not be judged later is found now, with its place."""
    workspace.file.write_text(one_entry(f"  kind: limit\n  limits:\n  - {limits}\n"))
    found = findings(workspace.load)
    assert any(expected in finding for finding in found), found
    assert all(finding.startswith("testplans/gyro/requirements.yaml:") for finding in found)


@pytest.mark.parametrize(
    ("extra", "expected"),
    [
        ("  kind: limit\n", "EPS-BAT-010 is of kind limit and has no limits"),
        ("  kind: record\n", "EPS-BAT-010 is of kind record and has no records"),
        ("  kind: characterise\n", "EPS-BAT-010 is of kind characterise, name its parameters"),
        ("  kind: parent\n", "'kind' must be one of limit, record, characterise, found `parent`"),
        ("  kind: characterise\n  limits: [{parameter: a, unit: V, max: '1'}]\n", "make it of kind limit"),
        ("  kind: limit\n  limits: [{parameter: a, unit: V, max: '1'}]\n  rev: 1\n", "duplicate key 'rev'"),
        ("  kind: limit\n  limits: [{parameter: a, unit: V, max: '1'}]\n  over: {board: []}\n", "at least one value"),
        ("  kind: limit\n  limits: [{parameter: a, unit: V, max: '1'}]\n  parents: [ADCS-O01]\n",
         "parent 'ADCS-O01' of EPS-BAT-010 does not exist, did you mean 'ADCS-001'?"),
        ("  kind: record\n  records: {recording: rest, channels: [x], duration: 4 hours}\n", "the unit 'hours'"),
        ("  kind: record\n  records: {recording: rest, channels: [], duration: 4 h}\n", "'channels' needs at least"),
        ("  kind: record\n  records: {recording: warm/up, channels: [x]}\n",
         "'recording' names no recording: a name has no slash"),
        ("  kind: record\n  records: {recording: rest, channels: [x], duration: 0 s}\n",
         "'duration' of records must be longer than zero"),
        ("  kind: record\n  records: {recording: rest, channels: [x], max_gap: 0 s}\n",
         "'max_gap' of records must be longer than zero"),
    ],
)  # fmt: skip
def test_wrong_requirements_are_errors_at_load(workspace, extra, expected):
    """What a kind needs must be there, parents must exist."""
    workspace.file.write_text(one_entry(extra))
    assert any(expected in finding for finding in findings(workspace.load))


@pytest.mark.parametrize(
    "wrong",
    [
        "eps-010",
        "EPS",
        "EPS-1",
        "EPS-123456",
        "EPS_010",
        f"{'E' * 61}-010",
        f"{'E' * 100_000}-010",
        "\N{CYRILLIC CAPITAL LETTER IE}PS-010",
        "EPS-010/..",
        "1PS-010",
    ],
)
def test_ids_have_one_shape(workspace, wrong):
    """Letters that only look alike, slashes and dots are refused, and what no page has room for; each in short."""
    workspace.file.write_text(one_entry("  kind: limit\n  limits: [{parameter: a, unit: V, max: '1'}]\n", wrong))
    found = findings(workspace.load)
    assert any("'id' must be an id such as ADCS-GYR-010" in finding for finding in found)
    assert max(map(len, found)) < 400


def test_all_errors_come_at_once(workspace):
    """Several files, several entries, one error."""
    workspace.edit('min: "-0.5"', 'min: "0.7"')
    workspace.edit("rate: 100 Hz", "rate: 100")
    workspace.edit("kind: characterise", "kind: characterize")
    workspace.above.write_text("schema: hil/requirements/1\nrequirements:\n- {id: ADCS-001, rev: x, text: T}\n")
    found = findings(workspace.load)
    assert [finding.split(":")[0:2] for finding in found] == [
        ["testplans/gyro/requirements.yaml", "14"],
        ["testplans/gyro/requirements.yaml", "22"],
        ["testplans/gyro/requirements.yaml", "26"],
        ["testplans/requirements.yaml", "3"],
    ]


def test_ids_are_unique_in_the_whole_workspace(workspace):
    """Duplicates in the file, in a plan beside, above, and by case only; both places are named."""
    limit = "  kind: limit\n  limits: [{parameter: a, unit: V, max: '1'}]\n"
    workspace.add("battery", one_entry(limit, "ADCS-GYR-011"))
    found = findings(workspace.load)
    assert len(found) == 1
    assert found[0].startswith("testplans/gyro/requirements.yaml:23:7: duplicate requirement id 'ADCS-GYR-011'")
    assert found[0].endswith("already at testplans/battery/requirements.yaml:3")
    workspace.edit("id: ADCS-GYR-011", "id: ADCS-GYR-030")
    assert "already at testplans/gyro/requirements.yaml:4" in findings(workspace.load)[0]
    workspace.edit("id: ADCS-GYR-010", "id: ADCS-001")
    assert any("already at testplans/requirements.yaml:3" in finding for finding in findings(workspace.load))


def test_errors_of_plans_beside_do_not_stop_this_one(workspace):
    """A half-written plan beside is its own business, unless its ids cannot be read at all."""
    beside = workspace.add("battery", one_entry("  kind: nonsense\n"))
    workspace.load()
    (beside / "requirements.yaml").write_text("requirements: [")
    assert "testplans/battery/requirements.yaml:" in findings(workspace.load)[0]


def test_parents_must_not_run_in_a_circle(workspace):
    """The circle is printed; a requirement that is its own parent is one too."""
    limit = "  kind: limit\n  limits: [{parameter: a, unit: V, max: '1'}]\n"
    workspace.file.write_text(one_entry(f"{limit}  parents: [EPS-001]\n"))
    workspace.above.write_text(
        "schema: hil/requirements/1\nrequirements:\n"
        "- {id: EPS-001, rev: 1, text: A, parents: [EPS-002]}\n- {id: EPS-002, rev: 1, text: B, parents: [EPS-001]}\n"
    )
    found = findings(workspace.load)
    assert found == [
        "testplans/requirements.yaml:3:8: parents form a circle: EPS-001 -> EPS-002 -> EPS-001",
    ]
    workspace.file.write_text(one_entry(f"{limit}  parents: [EPS-BAT-010]\n"))
    assert "EPS-BAT-010 -> EPS-BAT-010" in findings(workspace.load)[0]


def test_a_long_chain_of_parents_is_no_problem(workspace):
    """More generations than Python can recurse, in a soak ten thousand, are walked without recursion."""
    many = sweeps.chosen(2 * sys.getrecursionlimit(), 10_000)
    lines = [f"- {{id: A-{i:05}, rev: 1, text: T, parents: [A-{i + 1:05}]}}" for i in range(many)]
    workspace.above.write_text(
        "\n".join(["schema: hil/requirements/1", "requirements:", *lines, f"- {{id: A-{many:05}, rev: 1, text: T}}"])
    )
    workspace.edit("parents: [ADCS-001]", "parents: [A-00000]")
    before = time.perf_counter()
    workspace.load(locked=False)
    assert time.perf_counter() - before < 20


def test_a_missing_plan_is_a_finding(workspace):
    """No traceback for a folder that is not there."""
    found = findings(load_catalogue, workspace.root, [workspace.root / "testplans" / "none"])
    assert found == ["testplans/none/requirements.yaml: the file is missing"]


def test_plans_may_be_given_relative_to_the_workspace(workspace):
    """The same plan twice is one plan."""
    paths = [workspace.root / "testplans" / "gyro", "testplans/gyro"]
    assert load_catalogue(workspace.root, paths).plans == ("gyro",)


def test_the_digest_follows_the_meaning(workspace):
    """A limit changes it, an explanation does not."""
    before = workspace.load(locked=False).digest
    workspace.edit("section 30", "section 31")
    assert workspace.load(locked=False).digest == before
    workspace.edit('max: "0.5"', 'max: "0.4"')
    assert workspace.load(locked=False).digest != before


@pytest.mark.parametrize(
    "change",
    [
        ("kind: record", "kind: recrod"),
        ("kind: limit", "kind: lmit"),
        ("limits:", "limit:"),
        ("records:", "record:"),
    ],
)
def test_a_mistake_in_a_requirement_is_told_once(workspace, change):
    """What its kind needs is asked once kind and parts can be read."""
    workspace.edit(*change)
    told = findings(workspace.load, locked=False)
    assert told
    assert [found for found in told if "did you mean" not in found] == []


@pytest.mark.parametrize("value", ["[]", '[""]', "BAT-1", "{}"])
def test_the_part_numbers_of_a_plan_are_named_or_left_out(workspace, value):
    """A plan for nothing could never run; where none is named it is for any."""
    assert workspace.load().part_numbers("gyro") == ()
    workspace.edit("\nrequirements:\n", f"\npart_numbers: {value}\nrequirements:\n")
    (found,) = findings(workspace.load, locked=False)
    assert found.startswith("testplans/gyro/requirements.yaml:3:")
    assert "part_numbers" in found or "must not be empty" in found


@pytest.mark.parametrize("character", ["\xad", "\u3164", "\ufe0f", "\U000e0041"])
def test_a_text_holds_nothing_that_nobody_sees(workspace, character):
    """Two texts that look alike say the same."""
    workspace.edit("text: The ", f"text: The {character}")
    with pytest.raises(HilError, match=f"text holds character U\\+{ord(character):04X}, which is invisible"):
        workspace.load(locked=False)
