"""Files as answers: what is taken, what is refused and why, and that a run keeps what was given."""

from __future__ import annotations

import errno
import hashlib
import os
from types import SimpleNamespace

import msgspec
import pytest
from case_parts import Case
from given_files import CSV, JPEG, PDF, PNG, STEP, TEXT, WHOLE, png

from hil.evidence import events
from hil.evidence.journal.reader import JournalLine
from hil.executive.cases.effects import Recall
from hil.executive.ending.stop import Stopped
from hil.executive.people import files
from hil.executive.people.answers import Answered, AnswersFile, Nobody, TerminalPerson
from hil.executive.people.files import Shelf, Unfit, kinds_of, problem_of, said_path
from hil.executive.people.questions import Answer, Declined, Elsewhere, Question
from hil.model.errors import Misused

ALL = kinds_of(())
PICTURE = kinds_of(("picture",))


class Gives:
    """Answers with one file."""

    def __init__(self, path, by="Ben"):
        self.path = path
        self.by = by

    def answer(self, question):
        """Give the file."""
        return Answer(self.path.name, self.by, path=self.path)


@pytest.fixture
def shelf(tmp_path):
    """A shelf in a folder of its own."""
    folder = tmp_path / "attachments"
    folder.mkdir()
    return Shelf(folder, folder, lambda: None, set())


def put(folder, name, content):
    """Write a file and return its path."""
    path = folder / name
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("name", WHOLE)
def test_the_content_says_what_a_file_is(tmp_path, shelf, name):
    """It is copied under a name of the run's own, with its ending, kind, size and hash."""
    kind, content = WHOLE[name]
    given = shelf.take(put(tmp_path, name, content), "test_x-photo", ALL)
    assert (given.given, given.type, given.size) == (name, kind, len(content))
    assert given.sha256 == hashlib.sha256(content).hexdigest()
    kept = tmp_path / "attachments" / given.file
    assert given.file.startswith("test_x-photo.")
    assert kept.read_bytes() == content
    assert [path.name for path in kept.parent.iterdir()] == [given.file]
    assert shelf.content(given.file, given.sha256) == content


def test_a_picture_under_another_ending_gets_its_own(tmp_path, shelf):
    """A telephone may call a JPEG a PNG."""
    given = shelf.take(put(tmp_path, "photo.png", JPEG), "photo", PICTURE)
    assert (given.given, given.type, given.file) == ("photo.png", "jpeg", "photo.jpg")


@pytest.mark.parametrize(
    ("name", "content", "why"),
    [
        ("photo.png", PNG[:-12], "photo.png: this PNG is damaged; give a whole file: PNG or JPEG"),
        ("photo.png", PNG[:40] + b"\0" + PNG[41:], "this PNG is damaged"),
        ("photo.png", png(width=0), "this PNG is damaged"),
        ("photo.jpg", JPEG[:-2], "this JPEG is damaged"),
        ("photo.jpg", b"\xff\xd8\xff", "this JPEG is damaged"),
        ("photo.jpg", JPEG[:20] + JPEG[-14:], "this JPEG is damaged"),
        ("photo.png", b"no picture", "this is a text file; give PNG or JPEG"),
        ("photo.png", PDF, "this is a PDF file; give PNG or JPEG"),
        ("photo.png", b"\0\1\2\3", "this is no PNG or JPEG file; give one, or export it as one"),
        ("photo.png", b"GIF89a", "this is a text file"),
        ("photo.png", b"", "the file is empty; give one that holds something"),
    ],
)
def test_what_is_no_picture_is_refused(tmp_path, name, content, why):
    """Damaged ones and other files, whatever they are called."""
    assert why in problem_of(put(tmp_path, name, content), PICTURE)


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (PDF[:-6], "this PDF is cut off"),
        (STEP[:-20], "this STEP file is cut off"),
        ("Gr\u00fc\u00dfe".encode("latin-1"), "this is no PDF, PNG, JPEG, STEP, CSV or text file"),
        (b"\x1b[2J", "this is no PDF"),
    ],
)
def test_a_document_has_to_be_whole(tmp_path, content, why):
    """Text is UTF-8 without controls."""
    assert why in problem_of(put(tmp_path, "document", content), ALL)


def test_what_is_no_file_is_refused_without_waiting_for_it(tmp_path):
    """A missing one, a folder, a pipe, a device and one of 3 GB."""
    os.mkfifo(tmp_path / "pipe")
    with (tmp_path / "large.txt").open("wb") as large:
        large.truncate(3_000_000_000)
    for name, why in (
        ("missing.png", "there is no such file; check its path"),
        (".", "this is a folder; give one file"),
        ("pipe", "it cannot be read: expected a regular file"),
        ("/dev/zero", "it cannot be read: expected a regular file"),
        ("large.txt", "3,000 MB are more than 200 MB; give a part of it"),
        ("missing/../../x.png", "there is no such file"),
        ("a\0b", "it cannot be read"),
        ("x" * 300, "it cannot be read"),
    ):
        assert why in problem_of(tmp_path / name, ALL), name


def test_a_drawing_with_a_script_is_text_and_no_picture(tmp_path, shelf):
    """SVG runs what is in it: it is refused as a picture, and kept as plain text where documents are taken."""
    drawing = put(tmp_path, "photo.svg", b'<svg xmlns="http://www.w3.org/2000/svg"><script>alert(1)</script></svg>')
    assert "this is a text file; give PNG or JPEG" in problem_of(drawing, PICTURE)
    given = shelf.take(drawing, "x", ALL)
    assert (given.type, given.file) == ("text", "x.txt")


def test_documents_of_the_same_name_are_both_kept(tmp_path, shelf):
    """From two folders, to two questions and to one."""
    for folder in ("a", "b", "c"):
        (tmp_path / folder).mkdir()
        put(tmp_path / folder, "r\u00e9port 1.pdf", PDF + folder.encode() + b"\n%%EOF\n")
    kept = [
        shelf.take(tmp_path / f"{folder}/r\u00e9port 1.pdf", stem, ALL) for folder, stem in (("a", "x"), ("b", "y"))
    ]
    kept.append(shelf.take(tmp_path / "c/r\u00e9port 1.pdf", "x", ALL))
    assert [(each.file, each.given) for each in kept] == [
        ("x.pdf", "r\u00e9port 1.pdf"), ("y.pdf", "r\u00e9port 1.pdf"), ("x-2.pdf", "r\u00e9port 1.pdf"),
    ]  # fmt: skip
    assert len({each.sha256 for each in kept}) == 3


def test_a_link_is_followed(tmp_path, shelf):
    """A person may keep photos elsewhere."""
    put(tmp_path, "photo.png", PNG)
    (tmp_path / "link.png").symlink_to("photo.png")
    assert shelf.take(tmp_path / "link.png", "x", ALL).given == "link.png"
    (tmp_path / "circle").symlink_to("circle")
    assert "it cannot be read" in problem_of(tmp_path / "circle", ALL)


@pytest.mark.parametrize("name", ["two\nlines.png", "\x1b[2Jwipe.png", b"\xff\xfe.png", "..png", "\u202egnp.exe.png"])
def test_a_name_drives_neither_terminal_nor_folder(tmp_path, shelf, name):
    """The package uses a name of its own; what it was called is told in letters that show."""
    path = tmp_path / (os.fsdecode(name) if isinstance(name, bytes) else name)
    path.write_bytes(PNG)
    given = shelf.take(path, "x", ALL)
    assert given.file == "x.png"
    assert given.given.isprintable()
    assert "\u202e" not in given.given


def test_a_file_that_changes_while_it_is_copied_is_refused(tmp_path):
    """Nothing of it stays."""
    path = put(tmp_path, "notes.txt", TEXT)
    folder = tmp_path / "attachments"
    folder.mkdir()
    for change in (lambda: path.write_bytes(TEXT * 2), lambda: os.utime(path, ns=(1, 1)), path.unlink):
        with pytest.raises(Unfit, match=r"it changed while it was copied|there is no such file"):
            Shelf(folder, folder, change, set()).take(path, "x", ALL)
        assert not list(folder.iterdir())
        path.write_bytes(TEXT)


def test_a_copy_that_is_stopped_leaves_nothing(tmp_path):
    """Scheduling points pass between its blocks."""
    folder = tmp_path / "attachments"
    folder.mkdir()

    def stop():
        raise Stopped("SIGINT")

    with pytest.raises(Stopped):
        Shelf(folder, folder, stop, set()).take(put(tmp_path, "notes.txt", TEXT), "x", ALL)
    assert not list(folder.iterdir())


def test_a_disk_without_room_is_told(tmp_path, shelf, monkeypatch):
    """Before the copy where the room is known, and where the disk says so during it."""
    path = put(tmp_path, "notes.txt", TEXT)
    monkeypatch.setattr(files.shutil, "disk_usage", lambda _: SimpleNamespace(free=1_000_000))
    with pytest.raises(Unfit, match="do not fit on the run's disk, 1 MB are free; free some space"):
        shelf.take(path, "x", ALL)
    monkeypatch.undo()

    def full(_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(files, "sync_open", full)
    with pytest.raises(Unfit, match="the disk of the run is full; free some space"):
        shelf.take(path, "x", ALL)
    assert not list((tmp_path / "attachments").iterdir())


def test_files_of_one_question_have_names_of_their_own(tmp_path, shelf):
    """The same content from before an interruption is not kept twice."""
    folder = tmp_path / "attachments"
    put(folder, "x.png", PNG)
    assert shelf.take(put(tmp_path, "a.png", PNG), "x", ALL).file == "x.png"
    assert shelf.take(put(tmp_path, "b.png", PNG), "x", ALL).file == "x-2.png"
    assert shelf.take(put(tmp_path, "c.png", png(9)), "x", ALL).file == "x-3.png"


def test_a_file_that_changed_in_the_package_is_no_answer(tmp_path, shelf):
    """What a case reads is what was given."""
    given = shelf.take(put(tmp_path, "a.png", PNG), "x", ALL)
    put(tmp_path / "attachments", given.file, png(9))
    with pytest.raises(Unfit, match="no longer the file that was given"):
        shelf.content(given.file, given.sha256)


@pytest.mark.parametrize(
    ("line", "path"),
    [
        ("photo.png\n", "photo.png"),
        ("'my photo.png'\n", "my photo.png"),
        ('"my photo.png"', "my photo.png"),
        ("my\\ photo.png", "my photo.png"),
        ("my photo.png", "my photo.png"),
        ("/photos/x.png", "/photos/x.png"),
    ],
)
def test_a_path_is_typed_or_dropped_on_the_terminal(tmp_path, line, path):
    """Some terminals put quotes around it, some a stroke before a space."""
    assert said_path(line, tmp_path) == tmp_path / path


def test_an_unknown_kind_is_refused_in_the_call(tmp_path):
    """With the nearest one."""
    case = Case(tmp_path)
    with pytest.raises(Misused, match="takes no files of kind 'pgn', did you mean 'png'"):
        case.run.operator.attach("Photo", name="photo", accepts=("pgn",))


def test_a_file_is_evidence_with_who_gave_it(tmp_path):
    """Question, answer and effect; the case reads what was given."""
    case = Case(tmp_path, answers=Gives(put(tmp_path, "curve.csv", CSV)))
    attached = case.run.operator.attach("The curve", name="iv curve", accepts=("csv",))
    assert attached.text() == CSV.decode()
    assert (attached.name, attached.type, attached.by) == ("curve.csv", "csv", "Ben")
    asked, answer, effect = case.written.events
    assert (asked["form"], asked["options"]) == ("file", ("csv",))
    digest = hashlib.sha256(CSV).hexdigest()
    expected = {"file": "test_x-iv-curve.csv", "given": "curve.csv", "type": "csv", "size": len(CSV), "sha256": digest}
    assert answer["file"] == expected
    assert effect["result"] == {**expected, "by": "Ben"}


def test_a_file_that_is_unfit_is_no_answer(tmp_path):
    """The journal has the question, and the effect without a result."""
    case = Case(tmp_path, answers=Gives(tmp_path / "missing.png"))
    with pytest.raises(Unfit, match="there is no such file"):
        case.run.operator.attach("Photo", name="photo")
    assert [event["kind"] for event in case.written.events] == ["question", "effect"]
    assert case.written.of("effect")[0]["raised"] == "Unfit"


def test_the_record_answers_with_the_file_of_the_package(tmp_path):
    """Nobody is asked in a replay, and the content is the one that was given."""
    (tmp_path / "first").mkdir()
    (tmp_path / "second").mkdir()
    before = Case(tmp_path / "first", answers=Gives(put(tmp_path, "curve.csv", CSV)))
    before.run.operator.attach("The curve", name="curve")
    [told] = before.written.of("effect")
    recorded = [events.Effect(**{key: value for key, value in told.items() if key not in {"kind", "seq", "t"}})]
    again = Case(tmp_path / "second", recall=Recall(recorded, frozenset({"asks"})))
    shelf = Shelf(tmp_path / "second/data/attachments", tmp_path / "first/data/attachments", lambda: None, set())
    again.run.operator._shelf = shelf
    assert again.run.operator.attach("The curve", name="curve").text() == CSV.decode()


def test_plans_of_older_packages_connect_with_attach(tmp_path):
    """A thing and a text are what `connect` takes today; the record has the form of its day."""

    class Says:
        def answer(self, question):
            return Answer(question.options[0], "Ben")

    case = Case(tmp_path, answers=Says())
    assert case.run.operator.attach("x", "Connect x", name="board", options=("x", "y")) is None
    [effect] = case.written.of("effect")
    assert (effect["arguments"]["form"], effect["arguments"]["options"]) == ("attach", ["x", "y"])


FILE = Question(name="photo", form="file", text="A photo of the jig", options=PICTURE)


def test_a_person_is_asked_again_for_a_file_that_is_unfit(tmp_path, monkeypatch):
    """The terminal says what is wrong with it."""
    monkeypatch.chdir(tmp_path)
    put(tmp_path, "photo.png", PNG)
    put(tmp_path, "notes.txt", TEXT)
    lines, shown = ["\n", "fhoto.png\n", "notes.txt\n", "photo.png\n"], []
    terminal = SimpleNamespace(show=shown.append, line=lambda: lines.pop(0))
    answer = TerminalPerson(terminal, "Ada", lambda: None).answer(FILE)
    assert answer == Answer("photo.png", "Ada", path=tmp_path / "photo.png")
    assert shown[0] == "A photo of the jig [the path of a PNG or JPEG file]"
    assert shown[1] == "Please answer the path of a PNG or JPEG file"
    assert "fhoto.png: there is no such file; check its path. Please give another" in shown[2]
    assert "this is a text file; give PNG or JPEG" in shown[3]


def test_a_file_of_answers_names_files_beside_it(tmp_path):
    """Wherever the run is started."""
    source = AnswersFile({"photo": "photos/jig.png"}, "a.yaml", tmp_path / "answers")
    assert source.answer(FILE).path == tmp_path / "answers/photos/jig.png"


def test_another_terminal_gives_a_file(tmp_path):
    """What came through the inbox has to be of a kind that is asked for."""
    elsewhere = Elsewhere()
    with elsewhere.asks(FILE):
        assert "none came" in elsewhere.take("photo", "photo.png", "Ben")
        assert "this is a text file" in elsewhere.take("photo", "photo.png", "Ben", put(tmp_path, "a", TEXT))
        assert not elsewhere.take("photo", "photo.png", "Ben", put(tmp_path, "b", PNG))
        assert elsewhere.answer == Answer("photo.png", "Ben", path=tmp_path / "b")


def test_what_came_through_the_inbox_is_moved(tmp_path, shelf):
    """It lies on the shelf already, under the name of its message."""
    path = put(tmp_path / "attachments", "20261121-ab-photo.png", PNG)
    given = shelf.take(path, "x", ALL, "photo.png")
    assert (given.file, given.given) == ("x.png", "photo.png")
    assert [each.name for each in (tmp_path / "attachments").iterdir()] == ["x.png"]


def test_a_source_without_a_file_is_declined(tmp_path):
    """The simulated person has none."""

    class Says:
        def answer(self, question):
            return Answer("photo.png", "Ben")

    with pytest.raises(Declined, match="'photo' needs a file"):
        Case(tmp_path, answers=Says()).run.operator.attach("Photo", name="photo")


def test_a_name_of_several_lines_is_one_line_everywhere(tmp_path):
    """In the answer as in the file's own name: a terminal prints both."""
    case = Case(tmp_path, answers=Gives(put(tmp_path, "photo\nPASS.png", PNG)))
    given = case.run.operator.attach("Photo", name="photo")
    assert given.name == case.written.of("answer")[0]["value"] == "photo\\nPASS.png"


def test_a_resumed_run_says_again_why_a_file_was_not_taken(tmp_path):
    """In the same words, which are in the reasons of its case; nobody is asked again."""
    case = Case(tmp_path, answers=Gives(tmp_path / "none.png"))
    with pytest.raises(Unfit) as first:
        case.run.operator.attach("Photo", name="photo")
    effect = msgspec.convert(case.written.of("effect")[0], events.Effect)
    assert (effect.raised, effect.hint) == ("Unfit", "check its path")
    told = JournalLine(number=1, event=effect, wall={}, raw=b"", rest=b"")
    again = Answered([told], Nobody(), lambda: True)
    with pytest.raises(Unfit) as second:
        again.answer(Question(name="photo", form="file", text="Photo"))
    assert str(second.value) == str(first.value)
