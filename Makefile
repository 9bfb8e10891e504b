# The front door: `make` lists the targets.

# The Python that makes the environment: any 3.11 or newer, for example make PYTHON=python3.12.
PYTHON ?= $(shell for name in python3.11 python3; do \
	  if $$name -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; \
	  then echo $$name; break; fi; done)
BIN := .venv/bin
STAMP := .venv/.installed

# Exact versions for everything, also for the build backend, which pip fetches on its own.
export PIP_CONSTRAINT := constraints.txt
export PIP_BUILD_CONSTRAINT := constraints.txt
export PIP_DISABLE_PIP_VERSION_CHECK := 1
# Byte code is kept whatever the shell says: tests and commands start many processes.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help .venv demo test test-slow test-kernels lint lint-js docs sentences figures reproduce bench cluster fuzz tools browser packages calibration faults owner-table \
  coverage dist matrix pythons binaries format clean

help: ## list the targets
	@awk -F ':.*## ' '/^[.a-z-]+:.*## / { printf "  make %-12s %s\n", $$1, $$2 }' Makefile

.venv: $(STAMP) ## install the package and its tools into .venv

$(STAMP): pyproject.toml constraints.txt
	@test -n "$(PYTHON)" || \
	  { echo "No Python 3.11 or newer found: install one, or say make PYTHON=/path/to/python."; exit 1; }
	@echo "Installing into .venv (a minute or so, once) ..."
	@test -x $(BIN)/pip || $(PYTHON) -m venv --clear .venv || \
	  { echo "$(PYTHON) cannot make an environment: install its venv module (python3-venv)."; exit 1; }
	@$(BIN)/pip install -qq -c constraints.txt -e '.[dev]'
	@touch $@

demo: $(STAMP) ## identify a virtual hoist from its tests, with a report, into demo/
	@$(BIN)/swashplate demo --out demo

test: lint ## lint, then the quick tests
	@echo; echo "== Tests"
	@$(BIN)/pytest -n 2 --durations=40 -m "not slow"

test-slow: $(STAMP) ## the slow tests: pages, examples, reproduction, searches, without the JIT
	@echo "== Slow tests"
	@$(BIN)/pytest -n 2 --durations=40 -m slow
	@echo; echo "== Tests marked 'interpreted', without the JIT"
	@SWASHPLATE_COMPILE=0 $(BIN)/pytest -n 2 -m interpreted
# the one that differs most from what the tests before ran with
	@$(MAKE) --no-print-directory test-kernels KERNELS="$(firstword $(KERNELS))" TESTS="$(ROUNDED)"

# Kernels of the linear algebra that differ in the order of sums: without and with fused operations, and with those of
# 512 bits on processors that have them.
KERNELS ?= Prescott Haswell Zen $(shell grep -qs avx512f /proc/cpuinfo && echo SkylakeX)
# What depends on rounding: searches, and what is computed from their results.
ROUNDED := tests/analysis tests/campaign tests/drafting tests/identification tests/linear tests/recovery tests/thesis
TESTS ?= tests

test-kernels: $(STAMP) ## the quick tests with other kernels of the linear algebra, and compiled for any processor
	@for kernel in $(KERNELS); do \
	  echo; echo "== Linear algebra for $$kernel, compiled for any processor"; \
	  OPENBLAS_CORETYPE=$$kernel SWASHPLATE_CPU=generic $(BIN)/pytest -n 2 -m "not slow" $(TESTS) || exit 1; \
	done

lint: $(STAMP) ## style, format, types and the direction of imports
	@echo "== Style";   $(BIN)/ruff check .
	@echo; echo "== Format";  $(BIN)/ruff format --check .
	@echo; echo "== Types";   $(BIN)/mypy
	@echo; echo "== Imports"; $(BIN)/lint-imports --no-logo
	@echo; echo "== Spelling"; $(BIN)/codespell
	@echo; echo "== JavaScript"
	@if command -v node >/dev/null && test -d $(JAVASCRIPT)/node_modules; \
	then $(MAKE) --no-print-directory lint-js; \
	else echo "Skipped: 'make lint-js' installs its tools where there is Node.js."; \
	fi

# Biome and TypeScript, in the versions of package-lock.json; tests and pages do without.
JAVASCRIPT := tools/javascript

lint-js: ## style, format and types of the pages' JavaScript (needs Node.js)
	@command -v npm >/dev/null || { echo "lint-js needs node and npm: install Node.js 20 or newer."; exit 1; }
	@cd $(JAVASCRIPT) && { test node_modules/.package-lock.json -nt package-lock.json || npm ci --silent; }
	@cd $(JAVASCRIPT) && npm run --silent lint

docs: $(STAMP) ## build the documentation into docs/_build/html; warnings are errors
	@$(BIN)/sphinx-build -q -W --keep-going -b html docs docs/_build/html
	@echo "Open docs/_build/html/index.html"

sentences: $(STAMP) ## write down all that the package says, for review, in tests/golden/sentences.txt
	@$(BIN)/python tools/sentences.py --write

figures: $(STAMP) ## make all figures of README and documentation again
	@$(BIN)/python docs/figures.py

reproduce: $(STAMP) ## compute the source's figures and tables anew, into reproduction/made
	@$(BIN)/python -m reproduction

bench: $(STAMP) tools ## measure the speed against C (needs a C compiler)
	@$(BIN)/python benchmarks/run.py

MINUTES ?= 3

fuzz: $(STAMP) tools ## read damaged files, and call FMUs in any order, for MINUTES=3 each
	@$(BIN)/python tests/fuzz/run.py --minutes $(MINUTES)
	@$(BIN)/python -m tests.export.fuzzer --minutes $(MINUTES)

cluster: $(STAMP) ## many starts on a local Dask cluster that loses a worker
	@$(BIN)/pip install -qq -c constraints.txt -e '.[dask]'
	@$(BIN)/python benchmarks/cluster.py

calibration: $(STAMP) ## how often intervals hold the truth of a machine written apart, 60 campaigns an axis (hours)
	@$(BIN)/python benchmarks/calibration.py --stated-spread 0.06
	@$(BIN)/python benchmarks/calibration.py --stated-spread 0.06 --without-current

faults: $(STAMP) ## what the verdict says of campaigns with a fault or few instruments (hours)
	@$(BIN)/python benchmarks/faults.py
	@$(BIN)/python benchmarks/faults.py --fewer

owner-table: $(STAMP) ## whether the numbers of a report's first page hold, over 40 virtual winches
	@$(BIN)/python benchmarks/owner_table.py

coverage: $(STAMP) ## which lines of src no test reaches; the kernels interpreted (ten minutes)
	@$(BIN)/coverage erase
	@$(BIN)/coverage run -m pytest -n 2
	@SWASHPLATE_COMPILE=0 $(BIN)/coverage run -m pytest -n 2 -m 'interpreted or traced'
	@$(BIN)/coverage combine -q
	@$(BIN)/coverage report

dist: $(STAMP) ## build wheel and sdist, and run the demo from the wheel in an environment of its own
	@rm -rf dist build/clean
	@$(BIN)/python -m build --no-isolation --outdir dist . >/dev/null
	@$(BIN)/python tools/check_dist.py dist
	@$(PYTHON) -m venv build/clean
	@build/clean/bin/pip install -qq -c constraints.txt dist/*.whl
	@cd build && clean/bin/swashplate demo --out clean/demo

pythons: $(STAMP) ## the demo and the engine's quick tests on the oldest and newest Python here, newest versions
	@$(BIN)/python tools/matrix.py --extremes

matrix: $(STAMP) ## try the wheel on each Python, with newest and lowest versions (an hour)
	@$(BIN)/python tools/matrix.py --write $(ENVIRONMENTS)
	@$(BIN)/python tools/matrix.py --wheels 3.14

binaries: $(STAMP) ## compile the libraries that FMUs carry, run them, write their manifest
	@$(BIN)/pip install -qq -c constraints.txt -e '.[binaries]'
	@$(BIN)/python tools/build_binaries.py

tools: ## make sure that there is a C compiler, for bench, fuzz and the tests of exported C
	@if command -v cc >/dev/null; then :; \
	elif [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	  echo "No C compiler found: installing gcc."; \
	  apt-get update -qq && apt-get install -qq -y gcc libc6-dev; \
	else \
	  echo "bench and exported C need a C compiler: install gcc and the C library's headers (libc6-dev)."; \
	  exit 1; \
	fi

packages: tools browser ## install what the tests need beside Python: a C compiler, a Chromium

browser: ## make sure that there is a Chromium, for the test of the report's page
	@if command -v chromium >/dev/null || command -v chromium-browser >/dev/null; then :; \
	elif [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	  echo "No Chromium found: installing it."; \
	  apt-get update -qq && apt-get install -qq -y chromium; \
	else \
	  echo "Install Chromium to see the report tested in a browser; without it that test is skipped."; \
	fi

format: $(STAMP) ## sort the imports, mend what can be mended, format
	@$(BIN)/ruff check --fix-only -q .
	@$(BIN)/ruff format .
	@if test -d $(JAVASCRIPT)/node_modules; then cd $(JAVASCRIPT) && npm run --silent format; fi

clean: ## remove the environment, caches and everything made
	rm -rf .venv demo benchmarks/build build dist $(JAVASCRIPT)/node_modules docs/_build docs/generated htmlcov .coverage .coverage.* .hypothesis \
	  .import_linter_cache .mypy_cache .pytest_cache .ruff_cache
	find . -name .git -prune -o -name __pycache__ -type d -prune -exec rm -rf {} +
