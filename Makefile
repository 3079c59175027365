# The verbs of the project, the same for people and for CI. Each sets up .venv by itself when needed.
#
#   make reproduce PYTHON=python3.12     another Python (3.11 or later) for the environment
#   make test PYTEST_ARGS="-k two_fold"  anything pytest takes

PYTHON ?= python3
PYTEST_ARGS ?=

BIN := .venv/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check install -qq
PYTEST := $(BIN)/python -m pytest --quiet -n 2 --dist worksteal

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help reproduce test check bench testset docs lint wasm clean

help: ## list the verbs
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "  make %-10s %s\n", $$1, $$2 }' Makefile

reproduce: .venv/.test ## one paper reproduced and four models after papers, into build/
	@$(BIN)/python -m papers

test: .venv/.test ## the tests, without the slow ones
	@$(PYTEST) -m "not slow" $(PYTEST_ARGS)

check: lint ## everything that must hold before a release: lint, then all tests
	@HYPOTHESIS_PROFILE=$${HYPOTHESIS_PROFILE:-whole} $(PYTEST) $(PYTEST_ARGS)

bench: .venv/.bench ## measured speeds, beside the peers
	@$(BIN)/python -m benchmarks

testset: .venv/.bench ## the test set of nonsmooth problems, beside the peers that are installed
	@$(BIN)/python -m testset

docs: .venv/.docs .venv/.test ## the documentation, into build/docs/, with the records of the papers
	@test -f build/welander_1982/results.md || $(BIN)/python -m papers
	@NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs --quiet build --strict
	@echo "docs: build/docs/index.html"

lint: .venv/.dev ## formatting, lint, types and layers
	@$(BIN)/ruff format --quiet --check . || { echo "format: run '$(BIN)/ruff format .'"; exit 1; }
	@$(BIN)/ruff check --quiet .
	@$(BIN)/mypy
	@$(BIN)/lint-imports --no-logo

wasm: .venv/.compiler ## the driver for pages in a browser, nonsmooth/flow/engine/core.wasm
	@$(BIN)/python -m nonsmooth.flow.engine.building.webassembly

clean: ## remove what was made, except .venv
	@rm -rf build dist *.egg-info .pytest_cache .hypothesis .mypy_cache .ruff_cache .import_linter_cache
	@find . -name .venv -prune -o -name __pycache__ -type d -prune -exec rm -rf {} +

# One environment; a stamp in it for each set of extras that has been installed.
.venv/.python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "Python 3.11 or later is needed, and '$(PYTHON)' is $$($(PYTHON) --version 2>&1 || true)."; \
	  echo "Name another: make <verb> PYTHON=python3.12"; exit 1; }
	@echo "Setting up .venv (once; about a minute) ..."
	@$(PYTHON) -m venv .venv
	@touch $@

.venv/.%: .venv/.python pyproject.toml constraints.txt
	@echo "Installing nonsmooth-dynamics[$*] into .venv ..."
	@old=$$($(BIN)/python -c 'import importlib.metadata as m, json; print(json.loads(m.distribution("nonsmooth-dynamics").read_text("direct_url.json"))["url"])' 2>/dev/null); \
	  test -z "$$old" || test "$$old" = "file://$(CURDIR)" || echo ".venv imported $$old; from here on it imports $(CURDIR)."
	@$(PIP) -e '.[$*]' -c constraints.txt
	@touch $@
