# The four commands of this project. Each sets up what it needs.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.set-up

.PHONY: setup run test check system

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

# Every test but whole campaigns and runs in processes of their own, which `make system` takes.
test: setup
	$(BIN)/python -m pytest -m "not system" --numprocesses auto --dist loadfile

# Those that hold live runs to their seconds go one by one, behind all others.
system: setup
	$(BIN)/python -m pytest -m "system and not alone" --numprocesses auto --dist loadfile
	$(BIN)/python -m pytest -m "system and alone"

# What a reviewer would find before reading: layout, style, types, layers.
check: setup
	$(BIN)/ruff format --check src tests fixtures testplans
	$(BIN)/ruff check src tests fixtures testplans
	$(BIN)/mypy
	$(BIN)/lint-imports
