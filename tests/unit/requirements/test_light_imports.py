from __future__ import annotations

import subprocess
import sys


def test_reading_a_catalogue_starts_without_heavy_libraries():
    """pint, scipy and numpy are loaded when a unit or a figure is looked at, not before."""
    code = (
        "import sys, hil.requirements.catalogue, hil.requirements.decision, hil.requirements.parameters\n"
        "print(sorted({'pint', 'scipy', 'numpy', 'click', 'pytest'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_list_of_runs_that_are_known_starts_without_what_verifies_them():
    """It takes most of the time of a list of 1,000 runs."""
    code = (
        "import sys, hil.evidence.runs\n"
        "print(sorted({'pydantic', 'h5py', 'numpy', 'hil.evidence.package.consistent'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
