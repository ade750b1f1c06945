"""Every damage is told, with file, line and field, also where somebody computed all hashes again."""

from __future__ import annotations

import hashlib
import json

import pytest
from evidence_runs import begin, check, sealed_run, writable_copy, write_report

from hil.cli.main import main
from hil.documents.canonical import canonical, parse_strict
from hil.evidence.folder import CATALOGUE, JOURNAL, RESULTS, create
from hil.evidence.journal.reader import read_journal
from hil.evidence.ledger.book import Ledger
from hil.evidence.package.bag import inventory, write_manifests
from hil.evidence.package.sealing import info_of, seal
from hil.evidence.package.verification import State, verify


@pytest.fixture(scope="module")
def sealed(tmp_path_factory):
    """The folder of a sealed run, which nobody changes."""
    folder = create(tmp_path_factory.mktemp("sealed"), bench="flight", dut="SN1")
    sealed_run(folder)
    return folder


@pytest.fixture
def package(tmp_path, sealed):
    """Return a sealed package that may be changed."""
    return writable_copy(sealed, tmp_path / "reports")


def rehash(folder, change):
    """Change the bodies of a journal, and compute chain, hashes of files and manifests again, as a forger would."""
    lines, previous = [], "0" * 64
    for raw in (folder / JOURNAL).read_bytes().splitlines():
        line = parse_strict(raw)
        change(line["body"])
        if line["body"]["kind"] == "results" and (folder / RESULTS).exists():
            line["body"]["sha256"] = hashlib.sha256((folder / RESULTS).read_bytes()).hexdigest()
        if line["body"]["kind"] == "end":
            line["wall"]["files"] = inventory(folder)
        lines.append(canonical({**line, "prev": previous}))
        previous = hashlib.sha256(lines[-1]).hexdigest()
    (folder / JOURNAL).write_bytes(b"\n".join([*lines, b""]))
    write_manifests(folder, (folder / "bag-info.txt").read_bytes())


def told(folder):
    """Return what verification finds, a line each."""
    found = verify(folder)
    assert (found.state, found.verdict, found.evidence_digest) == (State.DAMAGED, "", "")
    lines = [str(finding) for finding in found.findings]
    assert not [line for line in lines if "Error" in line or "Errno" in line or str(folder) in line]
    return lines


def of_kind(kind, **fields):
    """Return a change of every event of one kind."""
    return lambda body: body.update(fields) if body["kind"] == kind else None


def number_of(folder, kind):
    """Return the numbers of the lines with events of a kind."""
    lines = (folder / JOURNAL).read_bytes().splitlines()
    return [number for number, raw in enumerate(lines, 1) if f'"kind":"{kind}"'.encode() in raw]


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"unit": "m"}, "field 'unit' is 'm', and the limit is in deg/s"),
        ({"unit": "furlong"}, "field 'unit' is 'furlong', and the limit is in deg/s"),
        ({"uncertainty": -0.01}, "field 'uncertainty' is -0.01, and must not be negative"),
        ({"dof": 0}, "field 'dof' is 0.0, and must be above zero"),
        ({"status": "guessed"}, "field 'status' is 'guessed', and must be one of measured, upper limit"),
        ({"limit": {"min": "low", "max": "0.5", "equals": None}}, "field 'limit.min' is low, and the catalogue has"),
    ],
)
def test_what_cannot_be_judged_is_told_by_line_and_field_for_every_check(package, fields, sentence):
    """One check that cannot be judged does not keep the others from being judged."""
    rehash(package, lambda body: body.update(fields) if body.get("parameter") == "rate_error" else None)
    found = told(package)
    for line in number_of(package, "check")[:2]:
        named = [each for each in found if each.startswith(f"data/journal.jsonl:{line}:1: GYR-030 rate_error: ")]
        assert any(sentence in each for each in named), found


def test_two_wrong_fields_of_one_check_are_two_findings(package):
    """Not only the first."""
    wrong = {"unit": "m", "uncertainty": -1.0}
    rehash(package, lambda body: body.update(wrong) if body.get("of") == "x" else None)
    line = number_of(package, "check")[0]
    found = [each for each in told(package) if each.startswith(f"data/journal.jsonl:{line}:")]
    assert len(found) == 2


def test_every_field_of_a_line_that_is_no_event_is_told(package):
    """Missing, unknown and mistyped ones, of every damaged line."""

    def change(body):
        if body["kind"] == "case-end":
            body.update(attempt="first", verdict="SPLENDID", more=1)
            del body["reasons"]
        of_kind("host-gate", ok=1)(body)

    rehash(package, change)
    found = told(package)
    (end,), (gate,) = number_of(package, "case-end"), number_of(package, "host-gate")
    assert (
        f"data/journal.jsonl:{end}:1: case-end: unknown field 'more'; field 'attempt' must be a whole number,"
        " found text; field 'verdict' has the unknown value 'SPLENDID'; field 'reasons' is missing"
    ) in found
    assert f"data/journal.jsonl:{gate}:1: host-gate: field 'ok' must be true or false, found a whole number" in found


@pytest.mark.parametrize("fresh", [False, True])
def test_missing_results_are_told_and_the_rest_is_still_looked_at(package, fresh):
    """A wrong check elsewhere is found as well, and no error of the machine is printed."""
    (package / RESULTS).unlink()
    if fresh:
        rehash(package, lambda body: body.update(unit="m") if body.get("of") == "x" else None)
    found = told(package)
    assert any(line.startswith("data/results.json: ") and "missing" in line for line in found) or fresh
    assert any("field 'unit' is 'm'" in line for line in found) is fresh


def test_every_field_of_the_results_that_was_changed_is_told(package):
    """Values, missing and further fields, and lists of another length, with what the journal gives."""
    results = json.loads((package / RESULTS).read_bytes())
    results["verdict"] = "RECORDED"
    results["cases"][0]["checks"][1]["value"] = 0.25
    results["requirements"][1]["reasons"] = ["none"]
    results["more"] = {"a": 1}
    del results["safe"]
    (package / RESULTS).write_bytes(canonical(results))
    rehash(package, of_kind("note"))
    found = [line.removeprefix("data/results.json:1:1: ") for line in told(package) if "results.json:1:1" in line]
    assert 'field \'verdict\' is "RECORDED", and the journal gives "PASS"' in found
    assert "field 'cases[0].checks[1].value' is 0.25, and the journal gives -0.2" in found
    assert "field 'requirements[1].reasons' has 1 entries, and the journal gives 0" in found
    assert "field 'safe' is missing" in found
    assert "field 'more' is not what the journal gives: none" in found


def test_of_an_empty_journal_nothing_is_said_that_it_does_not_show(package):
    """Frozen files and results are not called wrong because nothing is there to compare them with."""
    (package / JOURNAL).write_bytes(b"")
    write_manifests(package, (package / "bag-info.txt").read_bytes())
    assert told(package) == [
        "data/journal.jsonl: expected the event run first, and results and end last, each once",
        "bag-info.txt: cannot be checked: the journal has no events",
        "data/journal.jsonl: its second event does not name what was frozen",
        "data/journal.jsonl: its last event does not name the files: they were compared with the manifest only",
        "data/results.json: cannot be compared with the journal, which is damaged",
    ]


def test_results_that_are_no_json_are_told_by_their_place(package):
    """Line and column where reading ended."""
    data = (package / RESULTS).read_bytes()
    (package / RESULTS).write_bytes(data[:-1])
    assert any(line.startswith(f"data/results.json:1:{len(data)}: not JSON: ") for line in told(package))


def test_a_damaged_catalogue_does_not_keep_recordings_from_being_compared(package):
    """What is derived from it cannot be; everything else is."""
    (package / CATALOGUE).write_bytes(b'{"format":1,"requirements":{"GYR-030":{"limits":[{"of":7}]}}}')
    path = package / "data/recordings/001-rest.h5"
    path.write_bytes(path.read_bytes()[:-1])
    found = told(package)
    assert any("catalogue.json: requirements.GYR-030: field 'limits[0].of' must be a list" in line for line in found)
    assert any("001-rest.h5" in line for line in found)


def test_a_value_that_is_not_a_number_may_have_the_ratio_that_earlier_versions_wrote(tmp_path):
    """Their packages verify as they did."""
    folder = create(tmp_path / "reports", bench="flight", dut="SN1")
    journal = begin(folder)
    check(journal, None, tur=51.0)
    seal(folder, journal, exit_code=1, write_reports=write_report)
    assert verify(folder).findings == ()


def whole_but_for(folder, results):
    """Return what verification finds where only the results are others, and everything that names them follows."""
    (folder / RESULTS).write_bytes(results)
    rehash(folder, lambda _: None)
    write_manifests(folder, info_of(folder, folder.name, read_journal(folder / JOURNAL)))
    return verify(folder, Ledger(reports=folder.parent)).findings


@pytest.fixture(scope="module")
def simulated_run(tmp_path_factory):
    """The folder of a sealed run on a simulated bench, which nobody changes."""
    folder = create(tmp_path_factory.mktemp("simulated"), bench="flight", dut="SN1")
    sealed_run(folder, source="simulated")
    return folder


@pytest.fixture
def simulated(tmp_path, simulated_run):
    """Return a sealed package that says why it closes nothing, and may be changed."""
    return writable_copy(simulated_run, tmp_path / "reports")


@pytest.mark.parametrize(
    ("place", "key"),
    [("conditions", "text"), ("requirements", "reasons"), ("requirements", "conditions")],
)
def test_sentences_of_another_version_of_hil_are_no_damage(simulated, place, key):
    """Names of conditions, what is proven, and how many reasons there are do not depend on how they are worded."""
    results = parse_strict((simulated / RESULTS).read_bytes())
    for each in results[place]:
        if key == "conditions":
            for condition in each[key]:
                condition["text"] = f"in other words: {condition['text']}"
        else:
            each[key] = [f"in other words: {text}" for text in each[key]] if key == "reasons" else "in other words"
    assert whole_but_for(simulated, canonical(results)) == ()


def _reworded_and_proven(results):
    next(each for each in results["conditions"] if not each["proven"]).update(proven=True, text="it is proven")


def _reworded_and_renamed(results):
    results["requirements"][0]["conditions"][0]["name"] = "another"


def _fewer_reasons(results):
    next(each for each in results["requirements"] if each["reasons"])["reasons"].pop()


def _no_sentence(results):
    results["conditions"][0]["text"] = 7


@pytest.mark.parametrize("change", [_reworded_and_proven, _reworded_and_renamed, _fewer_reasons, _no_sentence])
def test_what_sentences_stand_for_is_compared(simulated, change):
    """Another condition, another proof, a reason less, or no sentence: damaged."""
    results = parse_strict((simulated / RESULTS).read_bytes())
    change(results)
    assert {each.path for each in whole_but_for(simulated, canonical(results))} == {RESULTS}


def test_results_that_are_not_canonical_are_damaged(simulated):
    """Equal content with other spacing is not what a seal writes."""
    results = parse_strict((simulated / RESULTS).read_bytes())
    (found,) = whole_but_for(simulated, json.dumps(results).encode())
    assert found.message == "not canonical JSON"


@pytest.mark.parametrize(("field", "value"), [("source", ["hardware"]), ("plans", 1), ("software", [])])
def test_a_forged_head_of_a_run_is_told_by_every_command(package, capsys, field, value):
    """A list for a word, a number for a list: no command ends in a traceback, and none gives a verdict."""
    rehash(package, of_kind("run", **{field: value}))
    assert any(line.startswith("data/journal.jsonl:1:") and f"'{field}'" in line for line in told(package))
    for command in ("export", "report", "verify"):
        with pytest.raises(SystemExit) as left:
            main((command, str(package), *(["--csv"] if command == "export" else [])))
        said = capsys.readouterr()
        assert left.value.code in {1, 4}, (command, said)
        assert f"'{field}'" in said.out + said.err, command
        assert "Traceback" not in said.out + said.err
