# make compiled | demo | test | coverage | lint | wheel | bench | docs | clean; everything lives in .venv of this checkout.
SHELL := /bin/sh
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/installed
COMPILED := $(VENV)/compiled

# Modules are kept compiled, wherever that is switched off: each command then starts 0.3 s sooner.
export PYTHONDONTWRITEBYTECODE :=

# The first Python from 3.11 on that can make environments; override with make PYTHON=...
USABLE := import ensurepip, sys; sys.exit(sys.version_info < (3, 11))
PYTHON ?= $(shell for p in python3.11 python3.12 python3.13 python3.14 python3; do \
	$$p -c '$(USABLE)' >/dev/null 2>&1 && echo $$p && break; done)

.PHONY: help compiled demo test coverage lint wheel bench faults rows docs clean

help:
	@echo "make demo   install, run the paper's study with three seeds, print its tables, write its report"
	@echo "make test   run all tests"
	@echo "make coverage  run all tests and show which branches they take"
	@echo "make compiled  install, and compile the kernels that most runs need"
	@echo "make lint   check style, types and layers"
	@echo "make wheel  build sdist and wheel, and run the wheel with each supported Python that is installed"
	@echo "make bench  measure speed, as ratios"
	@echo "make faults insert faults, one at a time, and report which test or check catches each"
	@echo "make rows   compare kept rows of runs with what the code gives now"
	@echo "make docs   build the docs site into out/site"
	@echo "make clean  remove the environment and all results under out/"

$(INSTALLED): pyproject.toml constraints.txt
	@test -n "$(PYTHON)" || { echo "Error: no Python 3.11 or newer with venv found; make PYTHON=/path/to/python"; exit 1; }
	$(PYTHON) -m venv --clear $(VENV)
	$(BIN)/pip install --disable-pip-version-check --quiet --constraint constraints.txt hatchling editables
	$(BIN)/pip install --disable-pip-version-check --quiet --constraint constraints.txt --no-build-isolation --editable '.[dev]'
	@touch $(INSTALLED)

# Kernels that several tests need, each compiled once: two workers would compile them side by side.
$(COMPILED): $(INSTALLED)
	@$(BIN)/coramp run paper --horizon 30 --mainline 3600 --ramp 1500 >/dev/null
	@printf '%s\n' "expressway --engine exact --horizon 60 --set 'vehicle=[{name=\"car\",share=0.6},{name=\"truck\",share=0.4}]'" \
		'paper --strategy ramp-priority --horizon 30 --mainline 3600 --ramp 1500' \
		'motorway --strategy slots --horizon 60 --mainline 2200 --ramp 700' \
		'paper --strategy mixed-slots --horizon 30 --set traffic.automated_share=0.5' \
		| xargs -P 2 -L 1 $(BIN)/coramp run >/dev/null
	@touch $(COMPILED)

compiled: $(COMPILED)

demo: $(COMPILED)
	$(BIN)/coramp study paper --out out/demo
	$(BIN)/coramp report out/demo

test: $(COMPILED)
	$(BIN)/pytest -n auto --dist loadfile --no-loadscope-reorder

coverage: $(COMPILED)
	$(BIN)/pytest -n auto --dist loadfile --no-loadscope-reorder --cov --cov-report=term --cov-report=html:out/coverage

wheel: $(INSTALLED)
	$(BIN)/python -m tests.wheel

lint: $(INSTALLED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

faults: $(INSTALLED)
	$(BIN)/python -m tests.faults

rows: $(COMPILED)
	$(BIN)/python -m tests.kept_rows

bench: $(COMPILED)
	$(BIN)/pytest benchmarks --benchmark-columns=min,median,rounds --benchmark-sort=fullname -s

# The variable silences a notice of the theme about its own future; warnings about the docs stay.
docs: $(INSTALLED)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@echo "Written: out/site/index.html"

clean:
	rm -rf $(VENV) out .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis .benchmarks
	find src tests benchmarks docs -name __pycache__ -type d -exec rm -rf {} +
