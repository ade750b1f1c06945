# The commands of this project. Each sets up what it needs.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.set-up
# The tests of a file start on one worker, because they share fixtures; an idle one takes over tests of another.
SHARED := --numprocesses auto --dist worksteal
# Many tests wait, for disks and for each other's processes: half a worker more for each core.
CORES := $(shell getconf _NPROCESSORS_ONLN)
RUNS := --numprocesses $(shell expr $(CORES) + $(CORES) / 2) --dist worksteal
# Tests of live timing mostly wait: each takes an eighth of a core. Those of a soak try again what a busy core delayed.
WAITING := --numprocesses 6 --dist worksteal
SOAKING := --numprocesses $(shell expr $(CORES) \* 8) --dist worksteal

# Keep byte code even if the environment says otherwise: without it a third of `make test` is compiling.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: setup run test check system soak

# Compile byte code now, so that the first start is as fast as the next; unchanged files are not compiled again.
setup: $(STAMP)
	@$(BIN)/python -m compileall -q src

$(STAMP): pyproject.toml requirements.lock
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "hil needs Python 3.11 or newer; name one with PYTHON=python3.11")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --requirement requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --editable .
	touch $@

# The magnetorquer campaign on the simulated bench, from the first byte to the sealed package.
run: setup
	$(BIN)/hil run testplans/magnetorquer --bench adcs --source simulated --dut SIM-ADCS-1

# Every rule once, in two minutes on two cores. Sweeps and random tests run a sample; what costs is timed by `.ci/run`.
test: setup
	$(BIN)/python -m pytest -m "not system" --ignore tests/bench $(RUNS)

# A sample of whole campaigns and runs, and statistics of many trials. Tests of live timing run last.
system: setup
	$(BIN)/python -m pytest -m "system and not alone" $(RUNS)
	$(BIN)/python -m pytest -m "system and alone" $(WAITING)

# Everything, every sweep in full: two to three hours on two cores. Run it before a release. If it is interrupted,
# or something failed by chance, it goes on with what has not passed on this commit; a changed tree starts
# from the first.
soak: SOAKED = --passed-before=.soak/$(shell git diff --quiet HEAD && git rev-parse HEAD || date +changed-%s)
soak: setup
	$(BIN)/python -m pytest --soak -m "not alone" $(SHARED) $(SOAKED)
	$(BIN)/python -m pytest --soak -m "alone" $(SOAKING) $(SOAKED)

# What a reviewer would find before reading: layout, style, types, layers.
check: setup
	$(BIN)/ruff format --check src tests fixtures testplans
	$(BIN)/ruff check src tests fixtures testplans
	$(BIN)/mypy
	$(BIN)/lint-imports
