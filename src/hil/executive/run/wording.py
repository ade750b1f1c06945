"""What is said of a question, and what a line means as its answer."""

from __future__ import annotations

import math
import re

from hil.executive.case.operator import Question

__all__ = ["form", "spoken", "understood"]

_PERHAPS_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")
"""A comma that may be a decimal sign or not: nobody guesses a factor of 1000."""

_YES = frozenset({"true", "y", "yes"})
_NO = frozenset({"false", "n", "no"})


def spoken(question: Question) -> str:
    """Return the question with what can be answered."""
    return f"{question.text} [{form(question)}]"


def form(question: Question) -> str:
    """Return what can be answered, in words."""
    match question.form:
        case "confirm":
            return "yes or no"
        case "measure":
            return f"a number in {question.unit}, such as 1.5"
        case "attach":
            return "yes when it is done"
        case _:
            return " or ".join(question.options)


def understood(question: Question, line: str) -> str | float | bool | None:
    """Return the answer that a line gives, None where it gives none."""
    said = line.strip()
    match question.form:
        case "confirm":
            return True if said.lower() in _YES else False if said.lower() in _NO else None
        case "attach" if said.lower() in _YES:
            return question.options[0]
        case "measure":
            return _number(said)
        case _:
            return said if said in question.options else None


def _number(said: str) -> float | None:
    if _PERHAPS_THOUSANDS.fullmatch(said) or "_" in said:
        return None
    try:
        number = float(said.replace(",", "."))
    except ValueError:
        return None
    return number if math.isfinite(number) else None
