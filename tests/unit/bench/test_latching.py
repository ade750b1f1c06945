"""A latched bench is driven by nobody until somebody takes the latch back."""

from __future__ import annotations

import hashlib
import json
import stat
import time
from dataclasses import asdict, replace
from pathlib import Path

import pytest
from tmpfiles import another_user, as_root, folder_for_all, make_old

from hil.bench.lease import clear_latches_of, keep_latched, latch_bench, latch_unsafe_end, latches_of, refuse_latched
from hil.guardian.latch import Latch, path_of
from hil.model.errors import Refused
from hil.wire.keys import keys_of

LATCH = Latch(
    bench="battery",
    run="/reports/20261121T093100Z-battery-x-cd60b0",
    why="the executive died",
    since="2026-11-21T09:40:00Z",
    outputs=("supply.charge",),
)


def test_a_latched_bench_is_refused(tmp_path):
    """One latch of its leases is enough; who, when, why and which outputs are told, and how it is acknowledged."""
    refuse_latched(["port a", "port b"], tmp_path)
    latch_bench(["port b", "port c"], LATCH, tmp_path)
    refuse_latched(["port a"], tmp_path)
    with pytest.raises(Refused) as refused:
        refuse_latched(["port a", "port b"], tmp_path)
    assert refused.value.message == (
        f"bench 'battery' is latched since 2026-11-21T09:40:00Z by {LATCH.run}: the executive died; "
        "not proven safe: supply.charge"
    )
    assert f'hil ack {LATCH.run} --by NAME --text "what was seen and done"' in refused.value.hint


def test_latches_are_found_by_their_run(tmp_path):
    """By its path or its name, and no other's are taken back."""
    other = Latch(bench="adcs", run="/reports/other", why="hang", since="2026-11-21T09:40:00Z", outputs=())
    latch_bench(["a", "b"], LATCH, tmp_path)
    latch_bench(["c"], other, tmp_path)
    assert set(latches_of(LATCH.run, tmp_path).values()) == {LATCH}
    assert clear_latches_of("20261121T093100Z-battery-x-cd60b0", tmp_path) == (LATCH, LATCH)
    refuse_latched(["a", "b"], tmp_path)
    with pytest.raises(Refused, match="bench 'adcs'"):
        refuse_latched(["c"], tmp_path)
    assert clear_latches_of("nobody", tmp_path / "missing") == ()


def test_a_latch_that_cannot_be_read_latches(tmp_path):
    """Nobody knows what it was about, so a person removes the file; no run has left it."""
    path_of("a", tmp_path).write_text("{")
    with pytest.raises(Refused, match="it is damaged") as refused:
        refuse_latched(["a"], tmp_path)
    assert str(path_of("a", tmp_path)) in refused.value.hint
    assert latches_of("", tmp_path) == {}


def test_an_unsafe_end_latches_what_the_guardian_has_not(tmp_path):
    """What a guardian wrote says more, and stays."""
    latch_bench(["a"], LATCH, tmp_path)
    latch_unsafe_end(["a", "b"], bench="battery", run=Path(LATCH.run), why="not proven", folder=tmp_path)
    found = latches_of(LATCH.run, tmp_path)
    assert found[path_of("a", tmp_path)] == LATCH
    assert (found[path_of("b", tmp_path)].why, found[path_of("b", tmp_path)].run) == ("not proven", LATCH.run)


def test_an_armed_bench_stays_latched_whatever_happens_to_the_files(tmp_path):
    """What is there becomes as if just written and keeps what a guardian wrote; what is gone is written again."""
    latch_bench(["a"], LATCH, tmp_path)
    make_old(tmp_path, days=60)
    armed = replace(LATCH, why="it was armed")
    keep_latched(["a", "b"], armed, tmp_path, alone=True)
    found = latches_of(LATCH.run, tmp_path)
    assert found == {path_of("a", tmp_path): LATCH, path_of("b", tmp_path): armed}
    assert all(time.time() - path.stat().st_mtime < 60 for path in found)
    assert stat.S_IMODE(path_of("b", tmp_path).stat().st_mode) == 0o1644


@as_root
def test_another_user_is_told_whose_latch_it_is():
    """Who drives next asks that user what happened."""
    with folder_for_all() as place:
        latch_bench(["a"], LATCH, place / "latches")
        with another_user(), pytest.raises(Refused, match=f"by {LATCH.run} of user root: the executive died"):
            refuse_latched(["a"], place / "latches")


@pytest.mark.parametrize(
    "port", ["TCPIP::192.168.10.21::5025::SOCKET", "/dev/serial/by-id/usb-FTDI-if00", "/dev/i2c-1"]
)
def test_a_latch_that_an_earlier_version_left_still_latches(tmp_path, monkeypatch, port):
    """It had the port's name as the bench file writes it, one file for all users, and lay below /var/tmp."""
    made, before = tmp_path / "lib/hil/latches", tmp_path / "tmp/hil-latches"
    made.mkdir(parents=True)
    before.mkdir(parents=True)
    monkeypatch.setattr("hil.guardian.latch.PLACES", (made, before))
    left = before / f"{hashlib.sha256(port.encode()).hexdigest()[:24]}.latch"
    left.write_text(json.dumps(asdict(LATCH)), encoding="utf-8")
    with pytest.raises(Refused, match="bench 'battery' is latched since 2026-11-21"):
        refuse_latched(keys_of(port))
    assert clear_latches_of(LATCH.run) == (LATCH,)
    refuse_latched(keys_of(port))
    assert not left.exists()
