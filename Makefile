# make run | test | test-mutants | verify | check | bench: each sets up .venv by itself, from the hashed locks.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
CORES ?= all
BIN := .venv/bin
SHELL := /bin/bash
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.DEFAULT_GOAL := help
.PHONY: help run test test-mutants verify check bench lock generated

help:
	@echo "make run    the embedded cohort on all cores, then its results and where things are (CORES=2 for fewer)"
	@echo "make test   the test suite"
	@echo "make test-mutants  hundreds of damaged, altered and mistaken inputs; minutes"
	@echo "make verify the verification of the finite elements, with what takes minutes"
	@echo "make check  formatting, lint, types, import boundaries, workflow lint"
	@echo "make bench  time and memory of the solver, beside peers, and of a two-view case, stage by stage"

run: .venv/runtime
	$(BIN)/mammoreg run --cores $(CORES)

test: .venv/development
	$(BIN)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder

test-mutants: .venv/development
	$(BIN)/python -m pytest -s -m slow tests/mutants

verify: .venv/development
	$(BIN)/python -m pytest -n auto --dist loadfile -m "slow or not slow" tests/verification

check: .venv/development
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/snakefmt --check Snakefile workflow/rules
	$(BIN)/snakemake --lint json 2>&1 | $(BIN)/python workflow/scripts/check_lint.py

bench: .venv/runtime
	$(BIN)/python -m benchmarks.solver
	$(BIN)/python benchmarks/two_view_case.py

# The locks hold no index address, so that any mirror serves.
COMPILE = $(BIN)/pip-compile --quiet --strip-extras --allow-unsafe --generate-hashes --no-annotate --no-header \
	--no-emit-index-url --no-emit-find-links --no-emit-trusted-host
lock: .venv/development
	$(COMPILE) --extra install -o requirements.lock pyproject.toml
	$(COMPILE) --extra dev -c requirements.lock -o requirements-dev.lock pyproject.toml

# What is written from the pydantic models: schemas, config.yaml, the key tables of config/README.md.
generated: .venv/runtime
	$(BIN)/python -m stages.reference

.venv/runtime: requirements.lock pyproject.toml | .venv/bin/python
	$(BIN)/python -m pip install --quiet --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation -e .
	@touch $@

.venv/development: requirements-dev.lock .venv/runtime
	$(BIN)/python -m pip install --quiet --require-hashes -r requirements-dev.lock
	@touch $@

.venv/bin/python:
	@test -n "$(PYTHON)" || { echo "Python 3.11 is missing: install it (Debian: apt install python3 python3-venv)"; exit 1; }
	@"$(PYTHON)" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' || \
		{ echo "$(PYTHON) is not Python 3.11: name one with make PYTHON=/path/to/python3.11"; exit 1; }
	@"$(PYTHON)" -c 'import venv, ensurepip' 2>/dev/null || \
		{ echo "Python's venv module is missing: install it (Debian: apt install python3-venv)"; exit 1; }
	"$(PYTHON)" -m venv .venv
