"""What holds for every byte of a package, every event, and every journal."""

from __future__ import annotations

import shutil
from pathlib import Path

import msgspec
import pytest
import sweeps
from evidence_runs import begin, check, sealed_run, write_report
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hil.documents.canonical import JsonError, canonical, digest, parse_strict
from hil.evidence.events.codec import is_text_of, quick_canonical
from hil.evidence.package.sealing import seal
from hil.evidence.package.verification import State, verify

TAG_FILES = ("bagit.txt", "bag-info.txt", "manifest-sha256.txt", "tagmanifest-sha256.txt")


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Return a writable sealed package without recordings."""
    folder = tmp_path_factory.mktemp("small") / "run"
    journal = begin(folder)
    check(journal)
    seal(folder, journal, exit_code=1, write_reports=write_report)
    return made_writable(folder)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return a writable sealed package with everything in it."""
    folder = tmp_path_factory.mktemp("whole") / "run"
    sealed_run(folder)
    return made_writable(folder)


def made_writable(folder: Path) -> Path:
    """Return a copy that can be changed."""
    copy = shutil.copytree(folder, folder.with_name("copy"), copy_function=shutil.copyfile)
    for path in (copy, *copy.rglob("*")):
        path.chmod(0o755)
    return copy


def is_found(folder: Path, path: Path, offset: int, flip: int) -> bool:
    """Change one byte, ask whether verification finds it, and change it back."""
    data = path.read_bytes()
    path.write_bytes(data[:offset] + bytes([data[offset] ^ flip]) + data[offset + 1 :])
    try:
        return verify(folder).state is not State.SEALED
    finally:
        path.write_bytes(data)


@pytest.mark.timeout(600)
def test_any_changed_byte_of_a_tag_file_is_found(small):
    """Every single byte of manifests, facts and seal, each changed in another way."""
    assert verify(small).state is State.SEALED
    for name in TAG_FILES:
        for offset in sweeps.sample(range((small / name).stat().st_size), 12):
            flip = 0x20 if offset % 2 else 1 + offset % 255
            assert is_found(small, small / name, offset, flip), (name, offset, flip)
    assert verify(small).state is State.SEALED


def test_any_changed_byte_of_the_data_is_found(whole):
    """A sample of bytes of every file of a package that has everything."""
    assert verify(whole).state is State.SEALED
    for path in sorted((whole / "data").rglob("*")):
        if path.is_file():
            size = path.stat().st_size
            for offset in {*range(0, size, max(1, size // sweeps.chosen(2, 11))), size - 1}:
                assert is_found(whole, path, offset, 1 << offset % 8), (path, offset)
    assert verify(whole).state is State.SEALED


@pytest.mark.parametrize("name", TAG_FILES)
def test_any_lost_end_of_a_tag_file_is_found(small, name):
    """A file that is cut off anywhere is not the one that was written."""
    data = (small / name).read_bytes()
    for size in {0, 1, len(data) // 2, len(data) - 1}:
        (small / name).write_bytes(data[:size])
        assert verify(small).state is not State.SEALED, size
    (small / name).write_bytes(data)


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.sampled_from(list(State)),
    lambda inner: st.lists(inner) | st.tuples(inner) | st.dictionaries(st.text(), inner),
    max_leaves=20,
)


@given(VALUES)
@settings(max_examples=sweeps.examples(300))
def test_the_quick_writer_writes_what_the_complete_one_writes(value):
    """Same bytes, or the same refusal, for whatever JSON can and cannot hold."""
    try:
        due = canonical(value)
    except JsonError:
        with pytest.raises(JsonError):
            quick_canonical(value)
    else:
        assert quick_canonical(value) == due


AWKWARD = st.sampled_from([":1.0,", "1.0", 'a":1.0,', "1e5", "\U0001f600", "\ufb00", "0" * 17])
READABLE = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**53) + 1, 2**53 - 1) | st.floats(allow_nan=False, allow_infinity=False)
    | st.sampled_from([1.0, -0.0, 1e16, 1e21, 1e-7, 5e-324, 0.1, -3.0]) | st.text() | AWKWARD,
    lambda inner: st.lists(inner) | st.dictionaries(st.text() | AWKWARD, inner),
    max_leaves=20,
)  # fmt: skip


@given(READABLE)
@settings(max_examples=sweeps.examples(300))
def test_a_text_is_known_again_as_the_writer_writes_it(value):
    """Its own text is, and one that says the same otherwise is not; the library's own text of it is often another."""
    read = parse_strict(canonical(value))
    for text in (canonical(value), msgspec.json.encode(read, order="sorted"), msgspec.json.encode([read])[1:-1]):
        assert is_text_of(text, read) is (text == canonical(read))


@given(READABLE)
@example(0.0)
@example(-3.0)
@settings(max_examples=sweeps.examples(300))
def test_a_digest_is_the_same_where_numbers_are_known_to_be_finite(value):
    """The library writes the text only where it is the canonical one."""
    assert digest(value, finite=True) == digest(value)


@pytest.mark.parametrize(
    "number", [1.0, -0.0, 1e16, 1e21, 1e-7, 1e-5, 123456789012345680.0, 5e-324, 0.1, 2.0**53, 1e15]
)
def test_numbers_look_as_ecmascript_writes_them(number):
    """Where Python's digits are others, the complete writer writes them."""
    assert quick_canonical([number]) == canonical([number])
