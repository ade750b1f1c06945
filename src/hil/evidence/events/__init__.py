"""Events: the content of a journal, each kind a frozen type; `codec` writes and reads them.

The modules of events and models do not postpone their annotations: evaluating those of all events takes a hundredth of
the time of a short run.
"""

from __future__ import annotations

from hil.evidence.events import bench, cases, code, event, people, recordings, run
from hil.evidence.events.bench import *  # noqa: F403 - every kind is named once, where it is defined
from hil.evidence.events.cases import *  # noqa: F403
from hil.evidence.events.code import *  # noqa: F403
from hil.evidence.events.event import *  # noqa: F403
from hil.evidence.events.people import *  # noqa: F403
from hil.evidence.events.recordings import *  # noqa: F403
from hil.evidence.events.run import *  # noqa: F403

__all__: list[str] = []
__all__ += bench.__all__
__all__ += cases.__all__
__all__ += code.__all__
__all__ += event.__all__
__all__ += people.__all__
__all__ += recordings.__all__
__all__ += run.__all__
