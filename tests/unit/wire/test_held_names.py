"""Names that are held for the whole host: one holder at a time, known to everyone, free when it is gone."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys

import pytest
from tmpfiles import NOBODY, another_user, as_root

from hil.wire import held_names
from hil.wire.held_names import Holder, hold_name, holder_of, keepers_of, names_held, user_name


@pytest.fixture(params=["linux", "darwin"])
def system(request, tmp_path, monkeypatch):
    """Be on a system with the kernel's namespace, and on one without it, where only the present process is seen."""
    monkeypatch.setattr(held_names, "_FILES", tmp_path / "names")
    monkeypatch.setattr(sys, "platform", request.param)
    return request.param


@pytest.fixture
def name(tmp_path):
    """Return a name that no other test has."""
    return f"test-{tmp_path.name}-{os.getpid()}"


@pytest.mark.usefixtures("system")
def test_a_name_has_one_holder(name):
    """The second one is refused; it is listed while it is held, by its beginning, and free afterwards."""
    held = hold_name(name)
    with pytest.raises(OSError, match="in use") as refused:
        hold_name(name)
    assert refused.value.errno == errno.EADDRINUSE
    assert names_held(name[:-1]) == [name]
    os.close(held)
    assert names_held(name) == []
    os.close(hold_name(name))


def test_a_copy_of_the_descriptor_holds_the_name_as_well(name):
    """As the guardian has one."""
    held = hold_name(name)
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE, pass_fds=[held]) as other:
        os.close(held)
        with pytest.raises(OSError, match="in use"):
            hold_name(name)
        other.communicate(b"\n")
    os.close(hold_name(name))


def test_the_kernel_says_who_took_a_name(name):
    """Process and user, whatever either of them says; nobody where nobody has it."""
    assert holder_of(name) is None
    held = hold_name(name)
    assert holder_of(name) == Holder(os.getpid(), os.geteuid())
    assert holder_of(name).lives
    os.close(held)
    gone = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, check=True)
    assert not Holder(int(gone.stdout), 0).lives


@as_root
def test_another_user_sees_the_name_and_does_not_get_it(name):
    """Whoever it is; and theirs is not ours to take."""
    held = hold_name(name)
    with another_user():
        assert names_held(name) == [name]
        assert holder_of(name).user == "root"
        with pytest.raises(OSError, match="in use"):
            hold_name(name)
    os.close(held)
    with another_user():
        held = hold_name(name)
    assert holder_of(name).uid == NOBODY
    os.close(held)


def test_where_the_kernel_lists_nothing_nothing_is_told(name, tmp_path, monkeypatch):
    """Names are held all the same."""
    monkeypatch.setattr(held_names, "_TABLE", tmp_path / "missing")
    held = hold_name(name)
    assert names_held(name) == []
    assert holder_of(name) is not None
    os.close(held)


def test_a_user_without_a_name_is_a_number():
    """As in a container."""
    assert user_name(4_000_000_000) == "4000000000"


@pytest.mark.skipif(sys.platform != "linux", reason="the kernel's namespace is Linux's")
def test_whoever_keeps_a_name_is_found_although_its_first_holder_has_ended(name):
    """A guardian keeps the leases of a dead run; one that somebody stopped is told apart from one that works."""
    held = hold_name(name)
    keeper = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE, pass_fds=(held,))
    try:
        assert keepers_of(name) == {os.getpid(): False, keeper.pid: False}
        os.close(held)
        keeper.send_signal(signal.SIGSTOP)
        os.waitpid(keeper.pid, os.WUNTRACED)
        assert keepers_of(name) == {keeper.pid: True}
    finally:
        keeper.send_signal(signal.SIGCONT)
        keeper.communicate(b"\n", timeout=10)
    assert keepers_of(name) == {}
