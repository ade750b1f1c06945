"""The people of a run on a bench outside of this process, connected with it."""

from __future__ import annotations

from hil.executive.people.notifying import Notifier
from hil.executive.people.on_call import OnCall, People
from hil.executive.people.questions import Declined
from hil.executive.session import Session
from hil.plugin.terminal.answering import answers_of

__all__ = ["attend"]


def attend(session: Session, notifier: Notifier) -> None:
    """Let the bench be armed only with the people that it needs; one that lives in this process needs nobody.

    Args:
        session: the run, before its bench is armed.
        notifier: reaches whoever is on call.
    """
    outside, configuration = session.keeper.outside, session.configuration
    if outside is None:
        return

    def idle() -> bool:
        session.keeper.tick()
        return not session.flags.reason

    def pass_by() -> None:
        if not idle():
            raise Declined("the run is to end")

    answers = answers_of(configuration.request, configuration.workspace.shown)(
        session.bench, pass_by, session.record.upkeep.elsewhere
    )
    people = People(_on_call(session, notifier), answers, session.keeper.journal, idle)
    session.record.events.listen(people)
    outside.people = people.gates


def _on_call(session: Session, notifier: Notifier) -> OnCall | None:
    request = session.configuration.request
    if not request.unattended:
        return None
    on_call = OnCall(
        request.on_call, session.folder.name, request.acknowledge_within_s, notifier.send, session.keeper.journal
    )
    session.record.upkeep.knows_code = on_call.knows
    return on_call
