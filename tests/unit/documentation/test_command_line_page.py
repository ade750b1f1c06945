"""The page about the command line and the commands themselves say the same."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path

import click
import pytest

from hil.cli.main import COMMANDS, cli

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "command-line.md"


def commands(group, context, above="hil"):
    """Yield every command below a group with its full name, groups included."""
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        yield f"{above} {name}", command
        if isinstance(command, click.Group):
            yield from commands(command, context, f"{above} {name}")


TREE = dict(commands(cli, click.Context(cli)))


def sections():
    """Return the text below every heading that names a command."""
    parts = re.split(r"^#+ `(hil [^`]+)`$", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    # A section ends where a heading follows that names no command.
    return {
        name: re.split(r"^#+ [^`]", text, flags=re.MULTILINE)[0]
        for name, text in zip(*2 * [iter(parts[1:])], strict=True)
    }


def test_the_page_has_every_command():
    """Every command has a section, and no section is left over."""
    assert sorted(sections()) == sorted(TREE)
    assert {name.split()[1] for name in TREE} == set(COMMANDS)


@pytest.mark.parametrize("name", sorted(TREE))
def test_a_section_has_every_option(name):
    """The table of a command has a row for every option, with all of its choices, and no row more."""
    options = [item for item in TREE[name].params if isinstance(item, click.Option) and item.name != "help"]
    rows = re.findall(r"^\| (`-[^|]*) \| ([^|]*?) ?\|", sections()[name], re.MULTILINE)
    assert sorted(row.replace("`", "") for row, _ in rows) == sorted(", ".join(item.opts) for item in options)
    choices = {", ".join(item.opts): item.type.choices for item in options if isinstance(item.type, click.Choice)}
    for row, value in rows:
        expected = choices.get(row.replace("`", ""))
        assert expected is None or value == ", ".join(f"`{choice}`" for choice in expected)


@pytest.mark.parametrize("name", sorted(TREE))
def test_a_section_names_values_as_help_does(name):
    """A value has one name on the page and in `--help`: that of what it is, not that of its type."""
    rows = dict(re.findall(r"^\| (`-[^|]*?) \| ([^|]*?) ?\|", sections()[name], re.MULTILINE))
    for item in TREE[name].params:
        valued = isinstance(item, click.Option) and not item.is_flag and not isinstance(item.type, click.Choice)
        if valued and item.name != "help":
            told = item.make_metavar(click.Context(TREE[name]))
            assert {row.replace("`", ""): value for row, value in rows.items()}[", ".join(item.opts)] == told


@pytest.mark.parametrize("name", sorted(name for name, item in TREE.items() if not isinstance(item, click.Group)))
def test_a_section_shows_the_call(name):
    """A section begins with the call, and it names every argument of the command."""
    call = next(line for line in sections()[name].splitlines() if line)
    assert call.startswith(f"`{name}")
    for argument in TREE[name].params:
        if isinstance(argument, click.Argument):
            assert argument.make_metavar(click.Context(TREE[name])).strip("[].") in call


def test_the_page_has_every_key_of_a_workspace():
    """A key that `hil.toml` knows and the page does not tell would be found by nobody."""
    from hil.executive.setup import workspace  # noqa: PLC0415 - only this test reads settings

    section = PAGE.read_text(encoding="utf-8").split("## The workspace and `hil.toml`")[1].split("\n## ")[0]
    told = set(re.findall(r"^\| (?:`\[\w+\]` )?`(\w+)`", section, flags=re.MULTILINE))
    hardware = {field.name for field in fields(workspace._Hardware)}
    assert told == {field.name for field in fields(workspace._Settings)} - {"hardware"} | hardware
