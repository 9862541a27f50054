PYTHON := .venv/bin/python

.PHONY: help setup test lint slow check long bench docs

help:  ## say what can be made
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*##/\t/' | expand -t 10

setup:  ## make .venv with everything that development needs
	python3 -m venv .venv
	.venv/bin/pip install -c constraints.txt -e ".[dev]"

test:  ## the fast lane: tests and doctests in one to two minutes
	$(PYTHON) -m pytest -q -n 2

lint:  ## format, lint, types, import directions
	$(PYTHON) -m ruff format --check .
	$(PYTHON) -m ruff check .
	$(PYTHON) -m mypy stimuli device experiment analysis tactstrip.py tests benchmarks docs/gallery docs/explanation docs/screens docs/_ext firmware/hal/qemu .ci
	.venv/bin/lint-imports

# tests that start processes run apart from those that fill both processors, and those that play sound one at a time
slow:  ## the slower tests: many digits, scripts and pages of docs/, processes
	$(PYTHON) -m pytest -q -n 2 -m "(slow or gallery) and not process and not firmware and not long"
	$(PYTHON) -m pytest -q -n 2 --dist loadgroup -m "process and not firmware and not long"

check: lint test slow  ## format, lint, types, import directions, all tests but the long ones

long:  ## calibrations, thousands of kills, fuzzing; TACTSTRIP_LONG=0.1 for a seeded tenth
	$(PYTHON) -m pytest -n 2 --dist loadgroup -m long

bench:  ## run the benchmarks and write docs/benchmarks.md
	$(PYTHON) -m benchmarks

docs:  ## build the site in site/; a warning is an error
	$(PYTHON) -m sphinx -q -W --keep-going docs site
