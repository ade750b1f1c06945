from __future__ import annotations

import time

import pytest
import yaml

from hil.documents import strict_yaml
from hil.documents.findings import Findings
from hil.documents.node import Mapping, Place, Scalar, ScalarKind, Sequence
from hil.documents.strict_yaml import parse_yaml, read_yaml
from hil.documents.text import MOST_BYTES
from hil.model.errors import ConfigurationError


@pytest.fixture(params=["CSafeLoader", "SafeLoader"], autouse=True)
def loader(request, monkeypatch):
    """Everything holds for the compiled parser and for the pure one."""
    if not hasattr(yaml, request.param):
        pytest.skip("this PyYAML has no compiled parser")
    monkeypatch.setattr(strict_yaml, "_LOADER", getattr(yaml, request.param))


def parse(text):
    """Return the root and the findings of a document."""
    findings = Findings()
    node = parse_yaml(text if isinstance(text, bytes) else text.encode(), "bench.yaml", findings)
    return node, [str(finding) for finding in findings]


def only_finding(text):
    """Return the one finding of a document."""
    _, findings = parse(text)
    assert len(findings) == 1, findings
    return findings[0]


def test_a_tree_knows_where_everything_stands():
    """Mappings, sequences and scalars carry path, line and column, counted from 1."""
    node, findings = parse("name: flight\naxes:\n- x\n- 'y'\n")
    assert findings == []
    assert isinstance(node, Mapping)
    (name, value), (_, axes) = node.entries
    assert (name.text, name.line, name.column) == ("name", 1, 1)
    assert isinstance(value, Scalar)
    assert (value.path, value.line, value.column, value.quoted) == ("bench.yaml", 1, 7, False)
    assert isinstance(axes, Sequence)
    quoted = axes.items[1]
    assert isinstance(quoted, Scalar)
    assert (quoted.text, quoted.line, quoted.column, quoted.quoted) == ("y", 4, 3, True)


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("true", ScalarKind.FLAG),
        ("false", ScalarKind.FLAG),
        ("12", ScalarKind.INTEGER),
        ("-3", ScalarKind.INTEGER),
        ("0x1E", ScalarKind.INTEGER),
        ("~", ScalarKind.NOTHING),
        ("null", ScalarKind.NOTHING),
        ("", ScalarKind.NOTHING),
        ("y", ScalarKind.TEXT),
        ("n", ScalarKind.TEXT),
        ("2026-11-21", ScalarKind.TEXT),
        ("1.2.3", ScalarKind.TEXT),
        ("'12'", ScalarKind.TEXT),
        ("'true'", ScalarKind.TEXT),
        ("!!str 1.10", ScalarKind.TEXT),
        ("|\n  12", ScalarKind.TEXT),
    ],
)
def test_scalars_are_what_every_reader_agrees_on(text, kind):
    """Flags, whole numbers and nothing are recognised; quoted scalars are always text."""
    node, findings = parse(f"key: {text}\n")
    assert findings == []
    assert node.entries[0][1].kind is kind


@pytest.mark.parametrize(
    "text",
    ["NO", "no", "on", "Off", "YES", "1.10", "1e3", ".5", "12:30", "12:30:45", "017", "08", "0o17",
     "0b11", "1_000", "="],
)  # fmt: skip
def test_yaml_surprises_are_refused_as_values_and_as_keys(text):
    """What YAML versions read differently, or would change, has to be quoted."""
    finding = only_finding(f"key: {text}\n")
    assert finding.startswith(f"bench.yaml:1:6: `{text}` ")
    assert f'write it in quotes: "{text}"' in finding
    assert parse(f"key: '{text}'\n")[1] == []
    assert parse(f"{text}: value\n")[1] != []


@pytest.mark.parametrize(
    ("text", "advice"),
    [
        ("True", "is a boolean to some YAML readers only, write true or false"),
        ("FALSE", "is a boolean to some YAML readers only, write true or false"),
        (".inf", "is not a finite number, give a value, or leave the key out"),
        ("-.INF", "is not a finite number, give a value, or leave the key out"),
        (".nan", "is not a finite number, give a value, or leave the key out"),
    ],
)
def test_what_quotes_would_not_mend_is_not_to_be_quoted(text, advice):
    """In quotes it would be a text, which no key takes that this was meant for."""
    assert only_finding(f"key: {text}\n") == f"bench.yaml:1:6: `{text}` {advice}"


def test_a_tab_is_called_a_tab():
    """The parser of YAML only says that no token starts with it."""
    assert only_finding("key:\n\tother: 1\n").endswith(
        ":2:1: not readable as YAML: a character that is not allowed here, such as a tab; indent with spaces"
    )


def test_many_underscores_do_not_slow_the_reader_down():
    """Recognising surprises takes linear time."""
    before = time.thread_time()
    parse(f"key: 1{'_' * 200_000}x\n")
    assert time.thread_time() - before < 2


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a: 1\nb: 2\na: 3\n", "bench.yaml:3:1: duplicate key 'a', first on line 1"),
        ("1: x\n'1': y\n", "bench.yaml:2:1: duplicate key '1', first on line 1"),
        ("a: &x 1\n", "bench.yaml:1:4: the anchor &x is not allowed"),
        ("a: *x\n", "bench.yaml:1:4: the alias *x is not allowed"),
        ("<<: {a: 1}\n", "bench.yaml:1:1: the merge key << is not allowed"),
        ("a: !!python/object:os.system {}\n", "bench.yaml:1:4: the tag tag:yaml.org,2002:python/object:os.system"),
        ("a: !mine 3\n", "bench.yaml:1:4: the tag !mine is not allowed"),
        ("a: !!int '3'\n", "bench.yaml:1:4: the tag tag:yaml.org,2002:int is not allowed"),
        ("a: 1\n---\nb: 2\n", "bench.yaml:2:1: a second document begins"),
        ("[a, b]: 1\n", "bench.yaml:1:1: a list cannot be a key"),
        ("true: 1\n", "bench.yaml:1:1: `true` cannot be a key"),
        ("~: 1\n", "bench.yaml:1:1: `~` cannot be a key, write it in quotes"),
        ("? \n: 1\n", "bench.yaml:1:2: a key is missing before the colon"),
        ("", "bench.yaml: the file is empty"),
        ("# nothing but a comment\n", "bench.yaml: the file is empty"),
        ('a: "\\0"\n', "bench.yaml:1:4: the text holds character U+0000"),
        ('a: "\\u202e"\n', "bench.yaml:1:4: the text holds character U+202E"),
        ("a: b\x00c\n", "bench.yaml:1:5: character U+0000 is not allowed"),
        ("a: b\nc: \u202ed\n", "bench.yaml:2:4: character U+202E is not allowed"),
        (b"a: b\nc: \xff\n", "bench.yaml:2:4: not UTF-8 at byte 8"),
        (f"a: {'[' * 40}{']' * 40}\n", "bench.yaml:1:24: nested deeper than 20 levels"),
        ("a: [b\n", "not readable as YAML"),
        ("a: b: c\n", "bench.yaml:1:5: not readable as YAML"),
        (b"a" * (MOST_BYTES + 1), f"bench.yaml: the file is larger than {MOST_BYTES} bytes"),
    ],
)
def test_what_is_refused_is_named_with_its_place(text, expected):
    """Every refusal is one finding with file, line and column."""
    assert expected in only_finding(text)


def test_all_findings_come_at_once():
    """Reading goes on after a refusal."""
    _, findings = parse("a: NO\nb: 1.10\na: 2\nc: &x 1\n")
    assert [finding.split(":")[1] for finding in findings] == ["1", "2", "3", "4"]


def test_a_document_with_findings_still_has_its_nodes():
    """The schema can be read over a refused scalar, so its findings show too."""
    node, findings = parse("a: NO\nb: x\n")
    assert len(findings) == 1
    assert [key.text for key, _ in node.entries] == ["a", "b"]


def test_an_alias_bomb_is_refused_at_once():
    """Aliases are never followed, so the bomb is as small as its bytes."""
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 40)]
    before = time.thread_time()
    _, findings = parse("\n".join(lines))
    assert time.thread_time() - before < 0.1
    assert "not allowed" in findings[0]
    assert len(findings) == 101
    assert findings[-1] == "bench.yaml: more than 100 findings, the rest was not read"


def test_byte_order_mark_and_line_ends_do_not_matter():
    """A file saved on another system gives the same tree."""
    plain, _ = parse("a: b\nc: |\n  one\n  two\n")
    foreign, findings = parse(b"\xef\xbb\xbfa: b\r\nc: |\r\n  one\r\n  two\r\n")
    assert findings == []
    assert foreign == plain


def test_a_missing_file_and_a_folder_are_findings(tmp_path):
    """What is not a readable file is said in a plain sentence."""
    findings = Findings()
    assert read_yaml(tmp_path / "none.yaml", "none.yaml", findings) is None
    assert read_yaml(tmp_path, "folder", findings) is None
    with pytest.raises(ConfigurationError) as error:
        findings.raise_if_any()
    assert str(error.value) == "folder: this is not a file\nnone.yaml: the file is missing"


def test_an_oversized_file_is_not_read_whole(tmp_path):
    """A file beyond the limit is refused by its size."""
    file = tmp_path / "large.yaml"
    file.write_bytes(b"#" * (MOST_BYTES + 10))
    findings = Findings()
    assert read_yaml(file, "large.yaml", findings) is None
    assert "larger than" in str(next(iter(findings)))


def test_many_values_without_quotes_are_told_together():
    """The first ones with their places, the others with their lines; everything else stands by itself."""
    findings = Findings()
    parse_yaml("".join(f"key{number}: {number}.5\n" for number in range(30)).encode() + b"x: yes\n", "a.yaml", findings)
    with pytest.raises(ConfigurationError) as caught:
        findings.raise_if_any()
    *first, flag, rest = str(caught.value).splitlines()
    assert len(caught.value.findings) == 31
    assert first[4] == 'a.yaml:5:7: `4.5` would lose its digits as a number, write it in quotes: "4.5"'
    assert len(first) == 5
    assert flag.startswith("a.yaml:31:4: `yes` is a boolean")
    assert rest.startswith("a.yaml: 25 more values without quotes, in lines 6, 7, 8,")


def test_what_is_required_is_given_only_without_findings():
    """A reader that gives a value beside a finding gives nothing on."""
    findings = Findings()
    assert findings.require("read") == "read"
    with pytest.raises(ConfigurationError):
        findings.require(None)
    findings.add(Place(path="a.yaml", line=1, column=1), "wrong")
    with pytest.raises(ConfigurationError, match="a.yaml:1:1: wrong"):
        findings.require("read")
