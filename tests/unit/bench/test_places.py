"""Where in a file something is that only its content is known of."""

from __future__ import annotations

import pytest

from hil.bench.file.places import place_of

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
        (("simulated", "peers", "psu1", "faults", "1", "by"), 6, 26),
        (("simulated", "peers", "psu1", "faults", "0"), 5, 9),
        (("simulated", "peers", "psu1", "truth", "serial"), 4, 7),
        (("simulated", "peers", "psu1", "faults", "2", "kind"), 5, 7),
        (("simulated", "peers", "psu1", "faults", "first"), 5, 7),
        (("simulated", "peers", "psu1", "faults", "0", "kind", "deeper"), 5, 16),
        ((), 1, 1),
    ],
)
def test_place_of_a_value_or_its_nearest_parent(tmp_path, keys, line, column):
    """What is there has its own place; what is missing has that of the part where it is missing."""
    (tmp_path / "bench.yaml").write_text(TEXT, encoding="utf-8")
    place = place_of(tmp_path / "bench.yaml", "shown.yaml", keys)
    assert (place.path, place.line, place.column) == ("shown.yaml", line, column)


def test_place_in_a_file_that_is_gone(tmp_path):
    """Without the file, the place is the file as a whole."""
    place = place_of(tmp_path / "none.yaml", "shown.yaml", ("simulated",))
    assert (place.path, place.line, place.column) == ("shown.yaml", 0, 0)
