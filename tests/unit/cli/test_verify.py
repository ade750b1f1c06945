"""What `hil verify` adds to verification: a replay, and the lines of a transcript that are damaged."""

from __future__ import annotations

import shutil

import pytest
from evidence_runs import sealed_run
from workspaces import ROOT

from hil.cli.main import main
from hil.evidence.folder import JOURNAL, TRANSCRIPT, create


def said(capsys, *arguments):
    """Return exit code, output and errors of one command."""
    with pytest.raises(SystemExit) as left:
        main(arguments)
    told = capsys.readouterr()
    assert "Traceback" not in told.out + told.err
    return left.value.code, told.out, told.err


@pytest.mark.system
def test_a_package_that_verifies_and_does_not_replay_is_not_good(capsys, tmp_path):
    """A whole forgery: every hash fits, and its cases cannot be run; one exit code says so."""
    folder = create(tmp_path / "reports", bench="flight", dut="SN1")
    sealed_run(folder)
    assert said(capsys, "verify", str(folder))[0] == 0
    code, out, err = said(capsys, "verify", str(folder), "--replay")
    assert (code, out.splitlines()[0]) == (1, f"{folder.name}: SEALED")
    assert "\nreplay           not possible\n" in out
    assert "data/" in err


def test_several_packages_get_a_line_each(capsys, tmp_path):
    """The exit code is the worst, and one that is damaged does not hide those after it."""
    folders = [tmp_path / "reports" / name for name in "abc"]
    for folder in folders:
        sealed_run(folder)
    code, out, _ = said(capsys, "verify", *map(str, folders))
    assert (code, out) == (0, "a  SEALED  PASS\nb  SEALED  PASS\nc  SEALED  PASS\n")
    journal = folders[1] / JOURNAL
    journal.chmod(0o644)
    journal.write_bytes(journal.read_bytes()[:-100])
    code, out, _ = said(capsys, "verify", *map(str, folders))
    lines = out.splitlines()
    assert (code, lines[0], lines[1], lines[-1]) == (1, "a  SEALED  PASS", "b  DAMAGED", "c  SEALED  PASS")
    assert lines[2].startswith("  data/journal.jsonl: ")
    assert said(capsys, "verify", str(folders[0]), "nothing", str(folders[2]))[0] == 4
    code, out, _ = said(capsys, "verify", *map(str, folders[::2]), "--report")
    assert (code, out.count("its report DIFFERS")) == (1, 2)


def test_the_damaged_lines_of_a_transcript_are_named(capsys, tmp_path):
    """One byte of a recorded reply is changed: the line is named, and nothing is replayed."""
    copy = shutil.copytree(ROOT / "reports/reference", tmp_path / "copy", copy_function=shutil.copyfile)
    lines = (copy / TRANSCRIPT).read_bytes().splitlines(keepends=True)
    lines[6] = lines[6].replace(b"\t", b" ", 1)
    (copy / TRANSCRIPT).write_bytes(b"".join(lines))
    code, out, err = said(capsys, "verify", str(copy), "--replay")
    assert (code, out) == (1, "copy: DAMAGED\n")
    assert "data/transcript.tsv:7:1: the line is damaged: " in err
    assert "not replayed: only what a sealed package holds can be compared with it" in err
