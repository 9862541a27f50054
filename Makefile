PYTHON := .venv/bin/python

.PHONY: help setup check test bench

help:  ## say what can be made
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*##/\t/' | expand -t 10

setup:  ## make .venv with everything that development needs
	python3 -m venv .venv
	.venv/bin/pip install -c constraints.txt -e ".[dev]"

check:  ## format, lint, types, import directions, tests with doctests
	$(PYTHON) -m ruff format --check .
	$(PYTHON) -m ruff check .
	$(PYTHON) -m mypy stimuli device experiment analysis tactstrip.py tests benchmarks docs/gallery docs/screens
	.venv/bin/lint-imports
	$(PYTHON) -m pytest -q -m "not long"

test:  ## the fast lane: tests and doctests in under a minute
	$(PYTHON) -m pytest

bench:  ## run the benchmarks and write docs/benchmarks.md
	$(PYTHON) -m benchmarks
