"""Where in a file something is that only its content is known of."""

from __future__ import annotations

import pytest

from hil.documents.findings import Findings
from hil.documents.node import Place, place_at
from hil.documents.strict_yaml import parse_yaml

TEXT = """\
simulated:
  peers:
    psu1:
      faults:
      - {kind: dead}
      - {kind: late, by: 1 s}
"""


@pytest.mark.parametrize(
    ("keys", "line", "column"),
    [
        (("simulated", "peers", "psu1", "faults", 1, "by"), 6, 26),
        (("simulated", "peers", "psu1", "faults", 0), 5, 9),
        (("simulated", "peers", "psu1", "truth", "serial"), 4, 7),
        (("simulated", "peers", "psu1", "faults", 2, "kind"), 5, 7),
        (("simulated", "peers", "psu1", "faults", "first"), 5, 7),
        (("simulated", "peers", "psu1", "faults", 0, "kind", "deeper"), 5, 16),
        ((), 1, 1),
    ],
)
def test_place_of_a_value_or_its_nearest_parent(keys, line, column):
    """What is there has its own place; what is missing has that of the part where it is missing."""
    place = place_at(parse_yaml(TEXT.encode(), "shown.yaml", Findings()), keys)
    assert (place.path, place.line, place.column) == ("shown.yaml", line, column)


def test_place_of_a_key():
    """The key itself may be meant, not its value."""
    place = place_at(parse_yaml(TEXT.encode(), "shown.yaml", Findings()), ("simulated", "peers", "psu1"), of_key=True)
    assert (place.line, place.column) == (3, 5)


def test_place_in_a_file_that_is_gone():
    """Without the document, the place is the file as a whole."""
    assert place_at(Place(path="shown.yaml"), ("simulated",)) == Place(path="shown.yaml")
