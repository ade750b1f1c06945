"""`hil answer`: answer the question of a run from another terminal."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.cli.options import name_option
from hil.cli.run_names import answer_of, find_running
from hil.model.errors import Refused

if TYPE_CHECKING:
    from hil.evidence.events import AskedAgain
    from hil.evidence.events import Question as Asked
    from hil.executive.people.questions import Question

__all__ = ["command"]


@click.command(name="answer", epilog='Example: hil answer latest --by "A. Engineer"')
@click.argument("run", metavar="RUN")
@click.argument("answer", metavar="[ANSWER]", default="")
@name_option("--by", help="Who answers; prompted for if left out.")
@name_option("--witness", help="Who witnesses the answer, if the question needs a witness; prompted for if left out.")
def command(run: str, answer: str, by: str, witness: str) -> int:
    """Answer the question that a run is waiting on, for example a run started with --detach.

    Without ANSWER, show the question and read the answer from this terminal; a safety confirmation is always given
    this way. Where the question is for a file, answer with its path. Exit codes: 0, or 1 if the run does not accept
    the answer.
    """
    from hil.evidence.events import Anomaly, Answer  # noqa: PLC0415 - only when it is used
    from hil.evidence.inbox import post  # noqa: PLC0415 - only when it is used
    from hil.executive.people.files import said_path  # noqa: PLC0415 - only when it is used
    from hil.executive.people.questions import FILE  # noqa: PLC0415 - only when it is used
    from hil.report.live.following import Follower  # noqa: PLC0415 - only when it is used
    from hil.report.page.incidents import answered  # noqa: PLC0415 - only when it is used

    folder = find_running(run)
    follower = Follower(folder)
    follower.read()
    asked = follower.outlook.asked
    question = _asked(folder.name, asked)
    said = _given(question, answer) if answer else _read(question)
    name = by.strip() or _line("Your name")
    seen_by = _witness(question, name, witness)
    follower.read()
    if follower.outlook.asked is not asked:  # a person took time; another question may have the same name
        click.echo(f"not taken: '{question.name}' is no longer asked", err=True)
        return 1
    file = said_path(said, Path.cwd()) if question.form == FILE else None
    post(
        folder,
        "answer",
        text=file.name if file else said,
        by=name,
        answers=(question.name, seen_by),
        attach=file,
    )
    told = answer_of(follower, Answer, Anomaly)
    if told is None:
        click.echo("the run has not read the answer yet; hil status shows whether it is still running")
        return 0
    if isinstance(told, Anomaly):
        click.echo(f"not taken: {told.text}", err=True)
        return 1
    if isinstance(told, Answer):
        click.echo(f"answered {told.name}: {answered(told.value)} ({told.by})")
    return 0


def _asked(run: str, asked: Asked | AskedAgain | None) -> Question:
    from hil.executive.people.questions import Question  # noqa: PLC0415 - heavy

    if asked is None:
        raise Refused(f"{run} is not asking anything", "hil status shows what it is doing")
    return Question(
        name=asked.name,
        form=asked.form,
        text=asked.text,
        options=asked.options,
        unit=getattr(asked, "unit", ""),
        safety=asked.safety,
        witness=getattr(asked, "witness", ""),
        picture=getattr(asked, "picture", None),
    )


def _witness(question: Question, by: str, witness: str) -> str:
    """Return who witnesses the answer, prompted for if no name was given; empty if no witness is needed."""
    from hil.executive.people.questions import witness_problem  # noqa: PLC0415 - heavy

    if not question.witness:
        return ""
    name = witness.strip() or _line(f"Witness ({question.witness}), your name")
    if problem := witness_problem(question, by, name):
        raise Refused(problem, "name another person with --witness")
    return name


def _given(question: Question, answer: str) -> str:
    """Return the answer given on the command line, if that is allowed and it fits the question."""
    from hil.executive.people.questions import form, understood  # noqa: PLC0415 - heavy

    if question.safety:
        raise Refused(
            f"'{question.text}' is a safety confirmation: a person gives it live",
            "leave the answer out, and type it when asked",
        )
    if understood(question, answer) is None:
        raise Refused(f"'{answer}' does not answer '{question.text}'", f"answer {form(question)}")
    if problem := _problem(question, answer):
        raise Refused(problem, f"answer {form(question)}")
    return answer


def _problem(question: Question, answer: str) -> str:
    """Return why the run would not take a file, empty for any other answer."""
    from hil.executive.people.files import problem_of, said_path  # noqa: PLC0415 - heavy
    from hil.executive.people.questions import FILE  # noqa: PLC0415 - heavy

    return problem_of(said_path(answer, Path.cwd()), question.options) if question.form == FILE else ""


def _read(question: Question) -> str:
    """Return what a person at this terminal answers, prompting until the answer fits.

    A safety confirmation is not answered by what was typed before it was shown.
    """
    from hil.executive.people.questions import spoken, understood  # noqa: PLC0415 - heavy
    from hil.plugin.terminal.prompt import Terminal  # noqa: PLC0415 - only when it is used

    if question.safety:
        _require_terminal(spoken(question))
        Terminal().discard()
    while True:
        said = _line(spoken(question))
        problem = _problem(question, said)
        if understood(question, said) is not None and not problem:
            return said
        if problem:
            click.echo(problem, err=True)


def _line(text: str) -> str:
    _require_terminal(text)
    while not (line := str(click.prompt(text, default="", show_default=False, err=True)).strip()):
        pass
    return line


def _require_terminal(text: str) -> None:
    if not sys.stdin.isatty():
        raise Refused(f"'{text}' needs a person at this terminal", "run it in a terminal, not in a pipe")
