"""`hil audit` itself: what it says, its files, its exit codes, and mistakes in its options."""

from __future__ import annotations

import json
import os

import pytest
from workspaces import make

from hil.cli.main import main
from hil.evidence.ledger.book import append, ledger_file, read
from hil.evidence.ledger.entries import Baseline, Explained, Sealed, Status

CASE = """
@pytest.mark.requirement("T-010")
def test_one(check):
    check("T-010", "ratio", 1.0)
"""
GONE = Sealed(
    run="gone", evidence="b" * 64, content="c" * 64, verdict="FAIL", source="hardware", bench="adcs", dut="FM-1"
)


def audit(capsys, *arguments):
    """Return exit code, output and errors of an audit of the present workspace."""
    with pytest.raises(SystemExit) as left:
        main(("audit", *arguments))
    told = capsys.readouterr()
    assert "Traceback" not in told.out + told.err
    return left.value.code, told.out, told.err


@pytest.fixture(autouse=True)
def workspace(tmp_path, monkeypatch):
    """Be in a workspace with one plan, whose cache is its own."""
    made = make(tmp_path / "workspace", CASE)
    monkeypatch.chdir(made.root)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return made


def test_what_is_open_is_told_in_the_last_lines_and_by_strict(capsys):
    """How many, compliance, why, and the gaps; only --strict makes what is open an exit code."""
    code, out, err = audit(capsys)
    assert (code, err) == (0, "")
    told = out.splitlines()
    assert told[0] == "workspace: 0 of 6 requirements closed, 6 open"
    assert told[1] == "compliance: 0 yes, 0 partial, 6 no"
    assert told[3:6] == [
        "Open because (a requirement may be open for several reasons)",
        "  Evidence not sufficient",
        "    6  NO_EVIDENCE  no package has evidence for it",
    ]
    assert audit(capsys, "--strict") == (1, out, "")


def test_a_package_of_hardware_that_is_gone_is_damage(capsys, workspace):
    """The ledger saw it sealed: exit code 2, whatever else is asked for."""
    append(workspace.reports, GONE)
    code, out, _ = audit(capsys)
    assert code == 2
    assert "gone was sealed with FM-1 on adcs and is not there: its outcome is unknown" in out
    assert audit(capsys, "--strict")[0] == 2


@pytest.mark.timeout(20)
@pytest.mark.parametrize("make_it", [os.mkfifo, os.mkdir])
@pytest.mark.parametrize("name", ["requirements.lock.json", "requirements.yaml", "test_others.py"])
def test_what_is_no_file_is_not_waited_for(capsys, monkeypatch, workspace, name, make_it):
    """A pipe has no end; one in the place of a document is an error, and one like a case is none."""
    path = workspace.plan / name
    path.unlink(missing_ok=True)
    make_it(path)
    code, _, err = audit(capsys)
    assert code == (0 if name == "test_others.py" else 4)
    assert bool(err) == bool(code)


def test_a_damaged_ledger_is_damage(capsys, workspace):
    """One byte of a line: the line is named."""
    append(workspace.reports, GONE)
    file = ledger_file(workspace.reports)
    file.write_bytes(file.read_bytes().replace(b'"FM-1"', b'"FM-2"'))
    code, out, _ = audit(capsys)
    assert code == 2
    assert "Not usable\n  .ledger/ledger.jsonl:2:1: the line was changed" in out


def test_a_file_that_is_wrong_ends_the_audit(capsys, workspace):
    """A catalogue that changed without a new lock: exit code 4, and the file is named."""
    workspace.change("testplans/small/requirements.yaml", {"The voltage shall be known.": "The voltage shall be 5 V."})
    code, out, err = audit(capsys)
    assert (code, out) == (4, "")
    assert "testplans/small/requirements.yaml:" in err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--as-of", "yesterday"), "--as-of yesterday is not a day\n     write it as 2026-11-22"),
        (("--as-of", "9999-12-31"), "--as-of 9999-12-31 is not over yet: it is 2"),
        (("--as-of", "2026-02-30"), "--as-of 2026-02-30 is not a day"),
        (("--as-of", "2026-01-01"), "no catalogue was recorded up to 2026-01-01: there is none yet"),
        (("--record", "--as-of", "2026-01-01"), "--record enters the present state only"),
        (("--record", "--if", "analysis"), "--record enters the present state only"),
        (("--if", "analysis", "--format", "csv"), "--if prints what would change, and writes no files"),
        (("--format", "pdf"), "there is no format 'pdf'\n     there are: csv, html, json, xlsx"),
        (("--format", "csv", "--format", "json"), "2 formats cannot go to standard output together"),
        (("--if", "fixtures/duts.yaml"), "the ledger has no units to compare with"),
        (("--if", "testplans/small/parameters.yaml"), "parameters.yaml is neither a requirements.yaml nor a register"),
        (("--if", "nothing.yaml"), "nothing.yaml"),
    ],
    ids=lambda each: " ".join(each) if isinstance(each, tuple) else "",
)
def test_options_that_make_no_sense_are_sentences_and_exit_code_4(capsys, arguments, message):
    """Each says what to write instead, and nothing is printed or entered."""
    code, out, err = audit(capsys, *arguments)
    assert (code, out) == (4, "")
    assert message in err


def test_what_was_recorded_can_be_asked_for_later(capsys, workspace):
    """--record enters the state once; --as-of its day tells the same, but for cases, which only sources of now tell."""
    code, before, err = audit(capsys, "--record")
    assert (code, err) == (0, "recorded: 4 baselines, 6 changes of status\n")
    entries = read(workspace.reports).entries
    assert [len([each for each in entries if isinstance(each, kind)]) for kind in (Baseline, Status)] == [4, 6]
    assert audit(capsys, "--record") == (0, before, "recorded: 0 baselines, 0 changes of status\n")
    day = entries[-1].utc[:10]
    told = audit(capsys, "--as-of", day)[1].splitlines()
    assert told[0] == f"workspace at the end of {day}: 0 of 6 requirements closed, 6 open"
    assert told[1:4] == before.splitlines()[1:4]


def test_files_are_written_where_they_are_wanted(capsys, workspace):
    """Every format in one folder, which is made; one format alone is standard output, the same bytes."""
    output = workspace.root / "build/audit"
    formats = [word for each in ("csv", "html", "json", "xlsx") for word in ("--format", each)]
    code, out, _ = audit(capsys, *formats, "--output", str(output))
    assert code == 0
    assert out.startswith("workspace: 0 of 6 requirements closed")
    assert sorted(each.name for each in output.iterdir()) == ["audit.csv", "audit.html", "audit.json", "audit.xlsx"]
    for form in ("csv", "json"):
        assert audit(capsys, "--format", form)[1].encode() == (output / f"audit.{form}").read_bytes()
    alone = (output / "audit.json").read_text(encoding="utf-8")
    assert [each["id"] for each in json.loads(alone)["rows"]] == [f"T-0{n}0" for n in (1, 2, 3, 4, 5, 7)]


def test_the_settings_name_the_ledger_that_counts(capsys, workspace):
    """With another folder of reports there is a new ledger, or none: that is damage, and every requirement is open."""
    append(workspace.reports, Baseline(subject="analysis", object="a" * 64))
    settings, text = workspace.root / "hil.toml", (workspace.root / "hil.toml").read_text()
    named = f'ledger = "{read(workspace.reports).hashes[0]}"\n'
    settings.write_text(named + text)
    assert audit(capsys)[0] == 0
    settings.write_text(f'{named}reports = "elsewhere"\n{text}')
    code, out, _ = audit(capsys)
    assert code == 2
    assert "the ledger of elsewhere is not there, and the settings of the workspace name the one that begins" in out
    append(workspace.root / "elsewhere", Baseline(subject="analysis", object="a" * 64))
    assert "this is another folder of reports, or a new ledger" in audit(capsys)[1]


def test_what_is_gone_is_explained_by_name_and_with_a_reason(capsys, workspace):
    """`--record` alone tells it and changes nothing; options that make no sense together are refused."""
    assert audit(capsys, "--record")[0] == 0
    duts = workspace.root / "fixtures/duts.yaml"
    before = "schema: hil/duts/1\nduts:\n- {serial: FM-1, part: ADCS-2, model: FM, hardware: C, firmware: ''}\n"
    repair = '[{kind: repair, date: "2026-11-01", text: J3, reference: N-1, reverify: true}]'
    duts.write_text(before.replace("''}", f"'', events: {repair}}}"))
    assert audit(capsys, "--record")[0] == 0
    duts.write_text(before)
    assert (
        "repair on 2026-11-01: it was removed or changed, and the reason is not on record"
        in audit(capsys, "--record")[1]
    )
    assert audit(capsys, "--because", "a mistake", "--by", "Ada")[0] == 4
    assert audit(capsys, "--record", "--because", "a mistake")[0] == 4
    code, out, err = audit(capsys, "--record", "--because", "a mistake", "--by", "Ada")
    assert (code, "nobody has said why" in out) == (0, False)
    assert "repair on 2026-11-01" in err
    assert [(each.by, each.text) for each in read(workspace.reports).of(Explained)] == [("Ada", "a mistake")]


def test_a_ledger_that_the_settings_do_not_name_is_told_and_counts_for_strict(capsys, workspace):
    """Another one in its place would be believed; the line to add is there to be copied, and ends it."""
    append(workspace.reports, Baseline(subject="signers", object="a" * 64))
    append(workspace.reports, Baseline(subject="signers", object="b" * 64))
    told = audit(capsys, "--strict")[1].splitlines()[-1]
    assert told.startswith("NOT PINNED: the settings of the workspace name no ledger")
    first = read(workspace.reports).hashes[0]
    assert told.endswith(f'add to hil.toml: ledger = "{first}"')
    code, out, err = audit(capsys, "--format", "json")
    assert (code, err.strip()) == (0, told)
    json.loads(out)
    settings = workspace.root / "hil.toml"
    settings.write_text(f'{settings.read_text() if settings.exists() else ""}\nledger = "{first}"\n')
    assert "NOT PINNED" not in audit(capsys)[1]


def test_strict_counts_a_ledger_that_is_not_pinned(capsys, workspace, monkeypatch):
    """Also where every requirement is closed."""
    append(workspace.reports, Baseline(subject="signers", object="a" * 64))
    for file in (workspace.root / "testplans").rglob("requirements*"):
        file.unlink()
    assert audit(capsys)[0] == 0
    assert audit(capsys, "--strict")[0] == 1
    settings = workspace.root / "hil.toml"
    text = settings.read_text() if settings.exists() else ""
    settings.write_text(f'{text}\nledger = "{read(workspace.reports).hashes[0]}"\n')
    assert audit(capsys, "--strict")[0] == 0
