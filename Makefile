# Needs nothing but make and Python 3.11 or newer. `make` alone lists the commands.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
DEMO := posse_training.demo

# What is installed depends on these two files alone; each stamp records one set of packages.
PINS := pyproject.toml constraints.txt
BASE := $(VENV)/base.stamp
FULL := $(VENV)/full.stamp
PIP_INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt

# Quietens a notice about later versions of the docs tools; pyproject.toml keeps to these.
export NO_MKDOCS_2_WARNING := 1

.DEFAULT_GOAL := help
.PHONY: help demo test fuzz lint format docs bench bench-costs bench-training bench-peers results reproduce clean

help: ## List these commands
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-12s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

demo: $(BASE) ## Watch teams at work; installs the base packages only, no torch
	$(BIN)/python -m $(DEMO)

test: lint ## Everything that must pass: lint, types, tests, docs
	$(BIN)/python -m pytest -n auto --dist worksteal
	$(BIN)/mkdocs build --strict --quiet

fuzz: $(FULL) ## Look for faults at random, each campaign for MINUTES=1
	$(BIN)/python -m tests.fuzz --minutes $(or $(MINUTES),1) --seed $(or $(SEED),0)

lint: $(FULL) ## Style and types
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	MYPYPATH=benchmarks $(BIN)/mypy benchmarks/*.py

format: $(FULL) ## Rewrite the sources in the project's style
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

docs: $(FULL) ## Build the manual into site/
	$(BIN)/mkdocs build --strict

bench: $(FULL) ## Measure the speed of the worlds on this machine
	$(BIN)/python benchmarks/speed.py

bench-costs: $(FULL) ## Measure where the time of a step goes, and how it grows
	$(BIN)/python benchmarks/costs.py

bench-training: $(FULL) ## Measure how fast PPO learns, and whose the time is
	$(BIN)/python benchmarks/training.py

bench-peers: $(FULL) ## Measure the speed beside other simulators
	$(BIN)/python benchmarks/peers.py

results: $(FULL) ## Score every shipped policy on every scenario (long)
	$(BIN)/python benchmarks/results.py
	$(BIN)/python benchmarks/comparison.py $(if $(SEEDS),--groups $(SEEDS))

reproduce: $(FULL) ## Redo the paper's experiments
	$(BIN)/posse reproduce

clean: ## Remove what these commands made, the virtual environment too
	rm -rf $(VENV) site build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find envs baselines training tests -name __pycache__ -type d -prune -exec rm -rf {} +

# The check comes first, so that an old Python is named rather than met as a syntax error.
$(BIN)/python:
	@command -v "$(PYTHON)" >/dev/null 2>&1 \
		|| { echo "posse: no '$(PYTHON)' found; install Python 3.11 or newer, or name one: make PYTHON=python3.12 ..." >&2; exit 1; }
	@"$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "posse needs Python 3.11 or newer, and '$(PYTHON)' is $$("$(PYTHON)" --version 2>&1); name another: make PYTHON=python3.12 ..." >&2; exit 1; }
	"$(PYTHON)" -m venv $(VENV)

$(BASE): $(PINS) | $(BIN)/python
	$(PIP_INSTALL) --editable .
	@touch $@

$(FULL): $(PINS) | $(BIN)/python
	$(PIP_INSTALL) --editable '.[training,dev,docs]'
	@touch $(BASE) $@
