"""The committed reference package: whole, repeatable, and no byte of it can change unseen."""

from __future__ import annotations

import random
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import sweeps

from hil.evidence.package.verification import verify
from hil.report.write import make_reports

REFERENCE = Path(__file__).parents[3] / "reports" / "reference"
FILES = sorted(path.relative_to(REFERENCE).as_posix() for path in REFERENCE.rglob("*") if path.is_file())
TAGS = [name for name in FILES if "/" not in name]
PLACES_PER_FILE = sweeps.chosen(1, 6)


@pytest.fixture
def copy(tmp_path):
    """A copy that may be damaged."""
    shutil.copytree(REFERENCE, tmp_path / "reference")
    return tmp_path / "reference"


def flip(path: Path, place: int, bit: int) -> None:
    """Change one bit of a file."""
    path.chmod(0o644)
    data = bytearray(path.read_bytes())
    data[place] ^= 1 << bit
    path.write_bytes(data)


def test_the_reference_package_is_whole():
    """This version verifies a package of format 1."""
    found = verify(REFERENCE)
    assert found.findings == ()
    assert found.ok
    assert found.verdict == "PASS"


def test_its_report_derives_to_the_same_bytes():
    """The page and the JUnit file inside are what this version makes of the evidence."""
    for name, content in make_reports(REFERENCE).items():
        assert (REFERENCE / "data" / "report" / name).read_bytes() == content


@pytest.mark.system
def test_its_cases_replay_to_the_same_verdicts():
    """The bytes in the package lead to the verdicts in the package, through the cases in the package."""
    command = [sys.executable, "-m", "hil.cli", "verify", str(REFERENCE), "--replay"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("reference: SEALED\n")
    assert "\nreplay           2 cases with 10 checks replayed from their bytes: no difference\n" in done.stdout


@pytest.mark.parametrize("name", FILES)
def test_any_one_changed_byte_is_found(copy, name):
    """Wherever a byte of any file changes, verification says so; damage is undone between tries."""
    path = copy / name
    path.parent.chmod(0o755)
    size = path.stat().st_size
    chosen = random.Random(name)
    ends = sweeps.chosen((), (0, size - 1))
    places = {*ends, *(chosen.randrange(size) for _ in range(PLACES_PER_FILE))} if size else set()
    for place in sorted(places):
        bit = chosen.randrange(8)
        flip(path, place, bit)
        assert not verify(copy).ok, f"byte {place}"
        flip(path, place, bit)
    assert path.read_bytes() == (REFERENCE / name).read_bytes()  # which is whole, see above


@pytest.mark.parametrize("name", TAGS)
@pytest.mark.timeout(600)
def test_every_byte_of_the_tag_files_counts(copy, name):
    """Not one byte of seal, description and manifests is free, white space included."""
    for place in sweeps.sample(range(0, (copy / name).stat().st_size, 7), 6):
        flip(copy / name, place, place % 8)
        assert not verify(copy).ok, f"byte {place}"
        flip(copy / name, place, place % 8)
