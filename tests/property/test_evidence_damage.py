"""Whatever is done to a package at random: verification raises nothing, hangs nowhere, and finds it."""

from __future__ import annotations

import os
import random
import shutil
from functools import partial

import pytest
import sweeps
from evidence_runs import sealed_run

from hil.evidence.package.bag import write_manifests
from hil.evidence.package.verification import State, verify

SEEDS = sweeps.sample(range(60), 20)
NAMES = ("data/new", "new", "data/a\nb", "data/\udcff", "data/recordings/9.h5", "data/journal.torn", "data/x.part")


def flip(chosen, path):
    """Change one bit."""
    data = bytearray(path.read_bytes())
    data[chosen.randrange(len(data))] ^= 1 << chosen.randrange(8)
    path.write_bytes(data)


def truncate(chosen, path):
    """Cut the end off."""
    data = path.read_bytes()
    path.write_bytes(data[: chosen.randrange(len(data))])


def scramble(chosen, path):
    """Write other bytes over a part, of another length."""
    data = path.read_bytes()
    place = chosen.randrange(len(data))
    junk = chosen.choice([b"\0" * 40, b"[" * 9000, b'{"body":1}\n', b"\xff\xfe", chosen.randbytes(60)])
    path.write_bytes(data[:place] + junk + data[place + chosen.randrange(50) :])


def delete(_, path):
    """Take the file away."""
    path.unlink()


def replace(chosen, path):
    """Put something in its place that is no file."""
    path.unlink()
    make = [
        partial(os.mkfifo, path),
        partial(path.symlink_to, "/dev/zero"),
        partial(path.symlink_to, path.name),
        partial(path.symlink_to, "/etc/hostname"),
        path.mkdir,
    ]
    chosen.choice(make)()


def swap(chosen, path):
    """Exchange two files of different content."""
    root = next(parent for parent in path.parents if (parent / "data").is_dir() and parent.name == "run")
    others = [other for other in files(root) if other.read_bytes() != path.read_bytes()]
    other = chosen.choice(others)
    mine, theirs = path.read_bytes(), other.read_bytes()
    path.write_bytes(theirs)
    other.write_bytes(mine)


def add(chosen, path):
    """Put a file, or an empty folder, where none was."""
    root = next(parent for parent in path.parents if (parent / "data").is_dir() and parent.name == "run")
    new = root / chosen.choice(NAMES)
    chosen.choice([new.mkdir, partial(new.write_bytes, b"new"), partial(new.write_bytes, b"")])()


DAMAGES = (flip, truncate, scramble, delete, replace, swap, add)


def files(root):
    """Return every plain file of a package, sorted."""
    return sorted(path for path in root.rglob("*") if path.is_file() and not path.is_symlink())


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """Return a sealed package that may be copied."""
    folder = tmp_path_factory.mktemp("sound") / "run"
    sealed_run(folder)
    return folder


@pytest.fixture
def copy(sound, tmp_path):
    """Return a writable copy of the package."""
    made = shutil.copytree(sound, tmp_path / "run", copy_function=shutil.copyfile)
    for path in (made, *made.rglob("*")):
        path.chmod(0o755)
    return made


@pytest.mark.parametrize("seed", SEEDS)
def test_any_damage_is_found_and_nothing_is_raised(copy, seed):
    """Between one and three damages of any kind, in any file."""
    chosen = random.Random(seed)
    for _ in range(chosen.randint(1, 3)):
        if there := [path for path in files(copy) if path.stat().st_size]:
            chosen.choice(DAMAGES)(chosen, chosen.choice(there))
    found = verify(copy)
    assert found.state is not State.SEALED
    assert found.findings
    assert (found.evidence_digest, found.verdict, found.ok) == ("", "", False)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_fresh_bag_hides_no_damage(copy, seed):
    """The same in the files that the journal names, with new manifests that fit."""
    chosen = random.Random(seed)
    named = [path for path in files(copy / "data") if path.name != "journal.jsonl" and path.parent.name != "report"]
    chosen.choice((flip, truncate, scramble, delete))(chosen, chosen.choice(named))
    write_manifests(copy, (copy / "bag-info.txt").read_bytes())
    found = verify(copy)
    assert found.state is State.DAMAGED
    assert any("data/" in finding.path for finding in found.findings)
