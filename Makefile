# The commands of this project. Each sets up what it needs.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.set-up
# A file's tests begin on one core, for what they share; who has nothing left to do takes some of another's.
SHARED := --numprocesses auto --dist worksteal

# Byte code is kept, also where the environment says otherwise: without it a third of `make test` is compiling.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: setup run test check system soak

# Byte code lies ready, so that the first start is no slower than the next; what has not changed is not compiled again.
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

# Every rule once, in two minutes on two cores; of what is swept or drawn by lot a sample.
test: setup
	$(BIN)/python -m pytest -m "not system" $(SHARED)

# Whole campaigns, and runs in processes of their own: a sample of them. Those that hold live runs to their seconds go
# one by one, after all others.
system: setup
	$(BIN)/python -m pytest -m "system and not alone" $(SHARED)
	$(BIN)/python -m pytest -m "system and alone"

# Everything there is, and whole: hours. Before a release.
soak: setup
	$(BIN)/python -m pytest --soak -m "not alone" $(SHARED)
	$(BIN)/python -m pytest --soak -m "alone"

# What a reviewer would find before reading: layout, style, types, layers.
check: setup
	$(BIN)/ruff format --check src tests fixtures testplans
	$(BIN)/ruff check src tests fixtures testplans
	$(BIN)/mypy
	$(BIN)/lint-imports
