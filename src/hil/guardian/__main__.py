"""Entry point of the guardian's process: `python -I -S …/hil/guardian/__main__.py DESCRIPTOR`, as its client starts it.

Started by its path, without the site packages, it depends on nothing in the executive's environment: no
variables, no working directory, no hooks of other packages. The folder that holds `hil` comes last on the path, so that
nothing in it can replace a module of the standard library.
"""

from __future__ import annotations

import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path.append(str(Path(__file__).resolve().parents[2]))
    from hil.guardian.process import main

    main(sys.argv[1:])
