"""Pages that tell a reader what to type, followed to the letter.

- In a block fenced as `console`, a line that begins with `$ ` is a command. The lines below it are its output, where
  there are any; `…` stands for some text, or alone on its line for some lines.
- A command exits with 0, unless the next one is `echo $?`, whose output then says otherwise.
- A block below a line that ends in `second terminal:` is typed at another terminal, beside what follows until `echo $?`
  is typed there. A line of output such as `  ? Closed? [yes or no] yes` is a question, and what is answered there once
  it stands. Lines before a block's first command are further output of what goes on there.
- A block below a line that holds a path and a colon, such as "`hil.toml`:", is the content of that file.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

__all__ = ["Command", "Written", "follow", "steps_of"]

_BLOCK = re.compile(
    r"^(?:`(?P<path>[^`\n]+)`:\n\n|(?P<second>[^\n]*second terminal:)\n\n)?"
    r"```(?P<kind>\w*)\n(?P<body>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)
_ASKED = re.compile(r"  \? (.*\]) (\S.*)")
_TERMINAL = Path(__file__).with_name("terminals.py")
_ASKS_CODE = "echo $?"


@dataclass(frozen=True)
class Command:
    """One command, the lines that the page shows below it, and whether it is typed at the second terminal."""

    text: str
    shown: tuple[str, ...]
    second: bool = False

    @property
    def beside(self) -> bool:
        """Whether what follows is done while it goes on."""
        return self.second and self.text != _ASKS_CODE


@dataclass(frozen=True)
class Written:
    """One file that the reader writes."""

    path: str
    content: str


def steps_of(page):
    """Return everything that a page has its reader do, in order."""
    steps = []
    for block in _BLOCK.finditer(page.read_text(encoding="utf-8")):
        if block["path"]:
            steps.append(Written(block["path"], block["body"]))
        elif block["kind"] == "console":
            steps += _commands(block["body"].replace("\\\n", " "), second=bool(block["second"]))
    return _joined(steps)


def follow(steps, folder, *, without=()):
    """Do what a page says in a folder, and return what went otherwise than it says, empty where nothing did."""
    steps = [step for step in steps if not (isinstance(step, Command) and step.text in without)]
    script = "".join(_scripted(number, step, steps[:number]) for number, step in enumerate(steps))
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    environment["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{environment['PATH']}"
    done = subprocess.run(
        ["bash", "-c", f"exec 2>&1\n{script}"],
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        check=False,
    )
    told = {
        int(number): (output.removesuffix("\n"), int(code))
        for output, number, code in re.findall(r"(.*?)\x1e(\d+) (\d+)\n", done.stdout.decode(), re.DOTALL)
    }
    return "\n".join(
        fault
        for number, step in enumerate(steps)
        if isinstance(step, Command)
        for fault in _faults(step, *told.get(number, ("", -1)), _following(step, steps[number + 1 :]))
    )


def _commands(body, *, second):
    further, *parts = re.split(r"^\$ ", body, flags=re.MULTILINE)
    if second and further:
        yield Command("", tuple(further.rstrip("\n").split("\n")), second)
    for part in parts:
        text, *shown = part.rstrip("\n").split("\n")
        yield Command(text, tuple(shown), second)


def _joined(steps):
    """Return the steps with the further output of a command at the command."""
    joined = []
    for step in steps:
        if isinstance(step, Command) and not step.text:
            at = max(number for number, each in enumerate(joined) if isinstance(each, Command) and each.beside)
            joined[at] = replace(joined[at], shown=(*joined[at].shown, *step.shown))
        else:
            joined.append(step)
    return joined


def _following(step, steps):
    """Return the next step, of those at the second terminal for one there, in a list."""
    return [each for each in steps if not step.second or (isinstance(each, Command) and each.second)][:1]


def _scripted(number, step, before):
    if isinstance(step, Written):
        return (
            f"mkdir -p \"$(dirname '{step.path}')\"\ncat > '{step.path}' <<'end of file'\n{step.content}end of file\n"
        )
    if step.beside:
        asked = [found.groups() for line in step.shown if (found := _ASKED.fullmatch(line))]
        words = shlex.join([sys.executable, str(_TERMINAL), step.text, json.dumps(asked)])
        return f"{words} > .second-terminal 2>&1 & second=$!\n"
    if step.second:
        at = max(each for each, earlier in enumerate(before) if isinstance(earlier, Command) and earlier.beside)
        return (
            f"wait $second; code=$?; cat .second-terminal; printf '\\n\\x1e%d %d\\n' {at} $code\n"
            f"printf '%d\\n\\n\\x1e%d 0\\n' $code {number}\n"
        )
    return f"{step.text}\ncode=$?; printf '\\n\\x1e%d %d\\n' {number} $code; (exit $code)\n"


def _faults(step, output, code, following):
    asked = [later.text for later in following if isinstance(later, Command)] == [_ASKS_CODE]
    if code and not asked:
        yield f"`{step.text}` exits with {code}:\n{output[-2000:]}"
    if step.shown and not re.fullmatch(_pattern(step.shown), output.rstrip("\n") + "\n"):
        yield f"`{step.text}` does not print what is shown:\n{output[-6000:]}"


def _pattern(shown):
    lines = (r"(?:.*\n)*?" if line == "…" else re.escape(line).replace("…", ".*?") + r"\n" for line in shown)
    return "".join(lines)
