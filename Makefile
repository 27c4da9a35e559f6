# The few commands of this project; `make` alone lists them.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
PIP    := $(BIN)/python -m pip --disable-pip-version-check --quiet

# One thread per library call: the tests use both cores by running two workers.
TEST_ENV := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1

.DEFAULT_GOAL := help
.PHONY: help demo test deep defects flake lint bench clean

help:  ## list the commands
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /\t/' | expand -t 10

demo: $(VENV)/.run  ## simulate three leaks, find them, score them: demo/report.html
	@$(BIN)/leakloc demo -o demo --force

test: $(VENV)/.dev  ## the test suite, under 5 minutes on 2 cores
	@$(TEST_ENV) $(BIN)/python -m pytest -n 2 --dist loadgroup -m "not deep"

deep: $(VENV)/.dev  ## fresh seeds and the slow physics (long)
	@$(TEST_ENV) HYPOTHESIS_PROFILE=deep $(BIN)/python -m pytest -n 2 --dist loadgroup

defects: $(VENV)/.dev  ## plant faults one at a time; the tests must kill each (some 8 minutes)
	@$(BIN)/python tests/defects/run.py

flake: $(VENV)/.dev  ## three random orders of the suite, twenty fresh seeds of what is statistical (an hour or more)
	@$(BIN)/python tests/flake/run.py

lint: $(VENV)/.dev  ## style and types
	@$(BIN)/ruff check . && $(BIN)/ruff format --check . && $(BIN)/mypy

bench: $(VENV)/.run  ## speed beside the straightforward versions, one line a case
	@for script in benchmarks/*.py; do $(BIN)/python $$script; done

clean:  ## remove the environment and everything that was built
	rm -rf $(VENV) demo dist build .pytest_cache .ruff_cache .mypy_cache .hypothesis

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "Python 3.11 or newer is needed (make PYTHON=python3.12 ...)"; exit 2; }
	@$(PYTHON) -m venv $(VENV)

$(VENV)/.run: $(VENV)/bin/python pyproject.toml constraints.txt
	@echo "Installing into $(VENV) ..."
	@$(PIP) install -c constraints.txt -e .
	@touch $@

$(VENV)/.dev: $(VENV)/.run
	@echo "Installing the test tools into $(VENV) ..."
	@$(PIP) install -c constraints.txt -e '.[test,lint]'
	@touch $@
