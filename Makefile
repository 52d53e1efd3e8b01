# Requires make and Python 3.11 or newer. `make` without arguments lists the commands.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

# The installed packages depend only on these two files; each stamp marks one installed set.
PINS := pyproject.toml constraints.txt
BASE := $(VENV)/base.stamp
FULL := $(VENV)/full.stamp
PIP := $(BIN)/python -m pip --quiet --disable-pip-version-check
INSTALL := install --no-compile --constraint
# pip compiles modules on one core; this does on all, and where PYTHONDONTWRITEBYTECODE is set nothing else does. Left
# out is what the tests hardly import: others' tests, torch's compiler, and tools. One module of torch is for another
# Python.
COMPILE := python -m compileall -qq -j 0 -x '/(tests|testing|_inductor|debugpy|mypy|mypyc|pip|setuptools)/'

# BenchMARL, RLlib and PufferLib need other versions. Their virtual environment holds these alone, and takes
# everything else, torch above all, from ours. What PufferLib pins no longer installs: it comes alone. AgileRL's pins
# differ from theirs, too: an environment of its own.
RECIPES := .venv-recipes
AGILERL := .venv-agilerl

# Suppresses a notice about later versions of mkdocs, which pyproject.toml excludes.
export NO_MKDOCS_2_WARNING := 1

.DEFAULT_GOAL := help
.PHONY: help demo test quick-tests kernels test-long recipes lint format docs bench bench-training bench-peers algorithms results reproduce tune train-shipped clean

help: ## List these commands
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-14s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

demo: $(BASE) ## Show teams in action; installs only the base packages, without torch
	$(BIN)/posse demo

test: $(FULL) ## Run all checks but the long tests: lint, types, tests, docs
	$(MAKE) --no-print-directory --jobs 2 lint kernels
	$(MAKE) --no-print-directory quick-tests

# Else each process of the tests would compile them.
kernels: $(FULL)
	$(BIN)/python -c "from posse_training import evaluate; [evaluate('ddcs-tuned', 'smart', 1, arena=arena) for arena in (20.0, (30.0, 20.0))]"

# They build the manual, too.
quick-tests: $(FULL)
	$(BIN)/python -m pytest -n auto --dist worksteal -m "not long"

test-long: $(FULL) ## Run the long tests: kills, full trainings, kernels compiled anew
	$(BIN)/python -m pytest -n auto --dist worksteal -m long

recipes: $(RECIPES)/recipes.stamp $(AGILERL)/recipes.stamp ## Install libraries with other pins, whose recipes the tests then run too

lint: $(FULL) ## Check style and types
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	MYPYPATH=benchmarks $(BIN)/mypy benchmarks/*.py scripts/*.py

format: $(FULL) ## Format the sources
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

docs: $(FULL) ## Build the manual into site/
	$(BIN)/mkdocs build --strict

bench: $(FULL) ## Measure throughput on this machine
	$(BIN)/python benchmarks/speed.py

bench-training: $(FULL) ## Measure throughput of PPO training, and the time to beat the script
	$(BIN)/python benchmarks/training.py

algorithms: $(FULL) ## Train the field's algorithms from nothing (hours); resumes
	$(BIN)/python benchmarks/algorithms.py

bench-peers: $(FULL) ## Compare throughput with other simulators
	$(BIN)/python benchmarks/peers.py

results: $(FULL) ## Evaluate every shipped policy on every scenario (takes long)
	$(BIN)/python benchmarks/results.py
	$(BIN)/python docs/drawing/readme_table.py

reproduce: $(FULL) ## Reproduce the paper's experiments
	$(BIN)/posse reproduce

tune: $(FULL) ## Tune the scripted teams that ship again (an hour); interrupted, it resumes
	$(BIN)/python scripts/tune_shipped.py

train-shipped: $(FULL) ## Train corrections and teams from nothing that ship again (hours); interrupted, it resumes
	$(BIN)/python scripts/train_shipped.py $(if $(SEEDS),--seed $(SEEDS)) $(if $(ONLY),--scenario $(ONLY))

clean: ## Remove everything that these commands created, including .venv
	rm -rf $(VENV) $(RECIPES) $(AGILERL) site build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find envs baselines training tests -name __pycache__ -type d -prune -exec rm -rf {} +

# Checked first, so that an old Python gives a clear message and not a syntax error.
$(BIN)/python:
	@command -v "$(PYTHON)" >/dev/null 2>&1 \
		|| { echo "posse: no '$(PYTHON)' found; install Python 3.11 or newer, or name one: make PYTHON=python3.12 ..." >&2; exit 1; }
	@"$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "posse needs Python 3.11 or newer, and '$(PYTHON)' is $$("$(PYTHON)" --version 2>&1); name another: make PYTHON=python3.12 ..." >&2; exit 1; }
	"$(PYTHON)" -m venv $(VENV)
	@# Python 3.11 brings a pip that takes minutes to choose among so many packages.
	$(PIP) install 'pip>=25' || true

$(BASE): $(PINS) | $(BIN)/python
	$(PIP) $(INSTALL) constraints.txt --editable .
	@$(BIN)/$(COMPILE) $(VENV)/lib || true
	@touch $@

$(FULL): $(PINS) | $(BIN)/python
	$(PIP) $(INSTALL) constraints.txt --editable '.[training,dev,docs]'
	@$(BIN)/$(COMPILE) $(VENV)/lib || true
	@touch $(BASE) $@

define BESIDE
rm -rf $(1)
$(BIN)/python -m venv --without-pip $(1)
echo "import site; site.addsitedir('$$($(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')')" \
	> "$$($(1)/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/posse_base.pth"
endef

$(RECIPES)/recipes.stamp: constraints-recipes.txt $(FULL)
	$(call BESIDE,$(RECIPES))
	grep -viE '^(gymnasium|tensordict|torchrl)==' constraints.txt > $(RECIPES)/constraints.txt
	$(PIP) --python $(RECIPES)/bin/python $(INSTALL) $(RECIPES)/constraints.txt \
		--constraint constraints-recipes.txt 'ray[rllib]' benchmarl skrl onnx onnxruntime
	$(PIP) --python $(RECIPES)/bin/python $(INSTALL) constraints-recipes.txt --no-deps \
		pufferlib gym gym-notices robotarium-python-simulator
	rm -rf $(RECIPES)/lib/python3*/site-packages/tests  # PufferLib's, which would hide ours
	@$(RECIPES)/bin/$(COMPILE) $(RECIPES)/lib || true
	@touch $@

$(AGILERL)/recipes.stamp: constraints-recipes.txt $(FULL)
	$(call BESIDE,$(AGILERL))
	grep -viE '^(gymnasium|pettingzoo|tensordict|torchrl)==' constraints.txt > $(AGILERL)/constraints.txt
	$(PIP) --python $(AGILERL)/bin/python $(INSTALL) $(AGILERL)/constraints.txt $$(grep -E '^(agilerl|peft)==' constraints-recipes.txt)
	@touch $@
