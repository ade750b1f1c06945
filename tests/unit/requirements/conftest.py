from __future__ import annotations

import pytest

from hil.requirements.catalogue import load_catalogue
from hil.requirements.lock import lock_text

_PLAN = """\
schema: hil/requirements/1
document: {id: ADCS-GYR, issue: "1.0", title: Gyroscope characterisation}
requirements:
- id: ADCS-GYR-030
  rev: 1
  text: The calibrated angular rate shall differ from the true rate by less than 0.5 deg/s.
  source: characterisation report, section 30
  parents: [ADCS-001]
  kind: limit
  method: test
  level: equipment
  stage: acceptance
  limits:
  - {parameter: rate_error, of: [x, y, z], unit: deg/s, min: "-0.5", max: "0.5", decision: guarded, min_tur: "2"}
  - {parameter: direction, equals: clockwise}
  over: {board: [x_plus, x_minus]}
- id: ADCS-GYR-010
  rev: 1
  text: Each gyroscope axis shall be recorded at rest.
  kind: record
  method: test
  records: {recording: rest, channels: [x, y, z], rate: 100 Hz, duration: 4 h, max_gap: 0.1 s}
- id: ADCS-GYR-011
  rev: 1
  text: The angle random walk of each axis shall be characterised.
  kind: characterise
  method: test
  limits:
  - {parameter: angle_random_walk, of: [x, y, z], unit: deg/s/sqrt(Hz)}
"""
_ABOVE = """\
schema: hil/requirements/1
requirements:
- {id: ADCS-001, rev: 1, text: The satellite shall know its attitude.}
"""


class Workspace:
    """A workspace in a temporary folder, with one plan that is in order."""

    def __init__(self, root):
        self.root = root
        self.plan = self.add("gyro", _PLAN)
        self.above = root / "testplans" / "requirements.yaml"
        self.above.write_text(_ABOVE)
        (root / "hil.toml").write_text("")
        self.lock()

    @property
    def file(self):
        """The plan's requirements."""
        return self.plan / "requirements.yaml"

    def add(self, name, text):
        """Add a plan."""
        folder = self.root / "testplans" / name
        folder.mkdir(parents=True)
        (folder / "requirements.yaml").write_text(text)
        return folder

    def edit(self, old, new):
        """Change the plan's requirements."""
        text = self.file.read_text()
        assert old in text
        self.file.write_text(text.replace(old, new))

    def load(self, *, locked=True):
        """Load the plan."""
        return load_catalogue(self.root, [self.plan], locked=locked)

    def lock(self):
        """Write the plan's lock without asking."""
        text = lock_text(self.load(locked=False).of_plan("gyro"))
        (self.plan / "requirements.lock.json").write_text(text)


@pytest.fixture
def workspace(tmp_path):
    """A workspace with one plan that is in order."""
    return Workspace(tmp_path)
