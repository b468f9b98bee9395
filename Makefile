# GNU make and a POSIX shell. Paths are relative, so that a clone may lie in a
# folder with spaces in its name.

PYTHON ?= python3
PIP_DISABLE_PIP_VERSION_CHECK := 1
export PIP_DISABLE_PIP_VERSION_CHECK
# A hundred processes of the tests load the same files: their bytecode is kept.
unexport PYTHONDONTWRITEBYTECODE

PY := .venv/bin/python
PIP_INSTALL := $(PY) -m pip install -qq -c constraints.txt
PYTEST := $(PY) -m pytest
REQUIREMENTS := pyproject.toml constraints.txt
FIND_GLIB := import ctypes; ctypes.CDLL("libglib-2.0.so.0")

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help demo test test-fast test-long coverage browser-test lint typecheck docs results package bench attack mutate schemas clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "make %-13s %s\n", $$1, $$2 }' Makefile

demo: .venv/.installed ## run the default scenario, with full audio, into results/
	@$(PY) -m phonotaxis simulate

test: .venv/.installed ## run all tests but the long ones and those that need a browser
	@$(PYTEST) -n 2 --dist worksteal

test-fast: .venv/.installed ## run the tests that take seconds
	@$(PYTEST) -n 2 --dist worksteal -m "not slow and not browser and not long"

test-long: .venv/.installed ## run the checks that take minutes to hours
	@$(PYTEST) -n 2 --dist worksteal -m long

coverage: .venv/.installed-dev ## measure which lines and branches the fast tests reach
	@$(PYTEST) -n 2 --dist worksteal -m "not slow and not browser and not long" \
	  --cov --cov-report=term:skip-covered | tail -n 200

browser-test: .venv/.installed docs ## run the tests that open a page in Chromium
	@$(PYTEST) -n 2 --dist loadfile -m browser tests/test_browser_*.py

lint: .venv/.installed-dev ## check style, format, docstrings, imports and prose
	@$(PY) -m ruff check .
	@$(PY) -m ruff format --check .
	@.venv/bin/pydoclint -q systems diagrams analysis phonotaxis
	@.venv/bin/lint-imports
	@.venv/bin/codespell
	@$(PY) -m tools.prose
	@.venv/bin/hadolint Dockerfile

typecheck: .venv/.installed-dev ## check types
	@$(PY) -m mypy

docs: .venv/.installed-docs ## build the documentation into build/site, links checked
	@$(PY) -m sphinx -q -W --keep-going -c docs . build/site
	@echo "Open build/site/index.html; it needs no network."

results: .venv/.installed ## write the numbers of README and docs, and notebooks
	@$(PY) -m docs.building.result_blocks
	@$(PY) -m docs.building.notebooks

package: .venv/.installed-dev ## build the package, and use it where the sources are not
	@.ci/check_package

bench: .venv/.installed ## measure speed, memory and the time a frame takes to hear
	@$(PY) -m benchmarks
	@echo "More: $(PY) -m benchmarks.beams, .listen, .several_robots, .sweeps (minutes each)"

attack: .venv/.installed ## give the command line thousands of bad inputs
	@$(PY) -m tests.fuzz.attack

mutate: .venv/.installed ## make small faults in the code and count those that tests notice
	@$(PIP_INSTALL) -e '.[mutate]'
	@$(PY) -m tools.mutants

schemas: .venv/.installed ## write the JSON Schemas of scenarios and sweeps anew
	@$(PY) -m tools.schemas

clean: ## remove the environment, caches and builds; keep results/
	@rm -rf .venv .venv-newest build dist docs/reference phonotaxis.egg-info
	@rm -rf .hypothesis .mypy_cache .pytest_cache .ruff_cache
	@find . -name __pycache__ -type d -prune -exec rm -rf {} +

# The stamps are as old as the last complete installation. What can be known to
# fail is asked beforehand, since the packages take minutes to fetch.
.venv/.installed: $(REQUIREMENTS)
	@command -v $(PYTHON) >/dev/null || { \
	  echo "$(PYTHON) is not installed. On Debian: apt install python3 python3-venv"; \
	  exit 1; } >&2
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "$(PYTHON) is $$($(PYTHON) -V 2>&1); phonotaxis needs Python 3.11 or newer."; \
	  echo "Name another one: make PYTHON=python3.13 $(MAKECMDGOALS)"; \
	  exit 1; } >&2
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { \
	  echo "$(PYTHON) cannot make environments. On Debian: apt install python3-venv"; \
	  exit 1; } >&2
	@test "$$(uname -s)" != Linux || $(PYTHON) -c '$(FIND_GLIB)' 2>/dev/null || { \
	  echo "Drake needs the system library libglib-2.0.so.0, which is missing."; \
	  echo "On Debian: apt install libglib2.0-0"; \
	  exit 1; } >&2
	@echo "Installing into .venv (once; takes some minutes) ..." >&2
	@$(PY) -c 'import pip' 2>/dev/null || $(PYTHON) -m venv --clear .venv
	@$(PIP_INSTALL) -e '.[test]' || { \
	  echo "The installation failed; the message above says why."; \
	  echo "Drake has wheels for x86-64 Linux with glibc 2.34 or newer (Debian 12,"; \
	  echo "Ubuntu 22.04), and for macOS on Apple silicon with Python 3.13 or newer."; \
	  exit 1; } >&2
	@$(PY) -c 'import pydrake.common' || { \
	  echo "Drake is installed but does not load; the message above says why."; \
	  exit 1; } >&2
	@touch $@

.venv/.installed-dev: .venv/.installed
	@$(PIP_INSTALL) -e '.[dev]'
	@touch $@

.venv/.installed-docs: .venv/.installed
	@$(PIP_INSTALL) -e '.[docs]'
	@touch $@
