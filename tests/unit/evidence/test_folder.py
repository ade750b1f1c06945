"""The folder of a run: its name, its space, and who holds it."""

from __future__ import annotations

import errno
import os
import re

import pytest

from hil.evidence.folder import RESERVE, create, free_reserve, hold, is_held, require_space
from hil.model.errors import EvidenceError, Refused


def test_a_run_gets_a_folder_of_its_own(tmp_path):
    """Two runs of one second have two folders, with data, inbox and reserve from the start."""
    first, second = (create(tmp_path / "reports", bench="flight", dut="SN1") for _ in range(2))
    assert first != second
    assert re.fullmatch(r"\d{8}T\d{6}Z-flight-SN1-[0-9a-f]{6}", first.name)
    assert (first / "data/recordings").is_dir()
    assert (first / "inbox/files").is_dir()
    assert (first / RESERVE).stat().st_size == 8_000_000


@pytest.mark.parametrize("name", ["../../etc", "a b/c", "..", "", "é\n", "x" * 300])
def test_names_cannot_lead_elsewhere(tmp_path, name):
    """Bench and serial number give safe characters only, whatever they hold."""
    folder = create(tmp_path, bench=name, dut=name)
    assert folder.parent == tmp_path
    assert re.fullmatch(r"[A-Za-z0-9._-]{1,120}", folder.name)


def test_a_place_that_cannot_be_written_is_named(tmp_path):
    """A file where the reports should be is an error with what to do, not a traceback."""
    (tmp_path / "reports").write_text("in the way")
    with pytest.raises(EvidenceError, match="--output"):
        create(tmp_path / "reports", bench="b", dut="d")


def test_a_run_without_space_is_refused_with_both_numbers(tmp_path):
    """The refusal names what is free and what is needed, also for a place that is not there yet."""
    require_space(tmp_path / "not/yet", 1000)
    with pytest.raises(Refused, match=r"MB are free, and this run may need 1000000000008 MB"):
        require_space(tmp_path / "not/yet", 10**18)


def test_the_reserve_is_given_back_once(tmp_path):
    """A second full disk finds no reserve any more."""
    folder = create(tmp_path, bench="b", dut="d")
    assert free_reserve(folder / RESERVE)
    assert not free_reserve(folder / RESERVE)
    assert not free_reserve(None)


def test_one_process_holds_a_folder(tmp_path):
    """While it is held nobody else gets it; afterwards anybody does, and nothing is left behind."""
    assert not is_held(tmp_path)
    with hold(tmp_path):
        assert is_held(tmp_path)
        with pytest.raises(Refused, match="another process"), hold(tmp_path):
            pass
    assert not is_held(tmp_path)
    with pytest.raises(EvidenceError, match="cannot be opened"):
        is_held(tmp_path / "missing")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_nobody_may_open_is_told_by_name_and_reason(tmp_path, monkeypatch):
    """Whoever runs the tests may open anything, so the system refuses by a test's own word."""

    def refuse(path, *_):
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(EvidenceError) as told:
        is_held(tmp_path)
    assert told.value.message == f"{tmp_path}: cannot be opened: Permission denied"
    assert told.value.hint == "name a folder of reports/ that you may read"
