"""`hil ledger`: what it lists and prints, and when it fails."""

from __future__ import annotations

import pytest
from evidence_runs import sealed_run

from hil.cli.main import main
from hil.evidence.ledger.book import head, ledger_file

NAME = "20261121T093100Z-flight-SN1-ab12cd"


def said(capsys, *arguments):
    """Return exit code, output and errors of a command."""
    with pytest.raises(SystemExit) as ended:
        main(("ledger", *arguments))
    return ended.value.code, *capsys.readouterr()


@pytest.fixture
def reports(tmp_path, monkeypatch):
    """Be in a workspace with one package."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hil.toml").touch()
    sealed_run(tmp_path / "reports" / NAME)
    return tmp_path / "reports"


def test_the_last_line_is_the_head(reports, capsys):
    """So that a script can publish it; and every entry is listed on request."""
    code, out, err = said(capsys)
    assert (code, err) == (0, "")
    assert out.splitlines()[-1] == head(reports)
    assert "intact, 2 entries" in out
    code, out, _ = said(capsys, "--log", str(reports))
    first, second = out.splitlines()[:2]
    assert (first.split()[0], first.split()[2]) == ("1", "opened")
    assert (second.split()[0], *second.split()[2:4]) == ("2", "sealed", NAME)


def test_what_is_gone_or_wrong_is_told(reports, capsys):
    """A package that is not there is no damage of the ledger; a changed line is."""
    (reports / NAME).rename(reports / "elsewhere")
    code, out, _ = said(capsys)
    assert code == 0
    assert ["not", "here", NAME] in [line.split() for line in out.splitlines()]
    path = ledger_file(reports)
    path.write_bytes(path.read_bytes().replace(b"SN1", b"SN2"))
    code, out, err = said(capsys)
    assert code == 1
    assert "DAMAGED" in out
    assert ".ledger/ledger.jsonl:2:1: the line was changed" in err
    assert said(capsys, "--head", "zz")[0] == 4
    assert "NOT CONTAINED" in said(capsys, "--head", "0" * 63 + "1")[1]
