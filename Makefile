PYTHON := .venv/bin/python

.PHONY: help setup test lint slow system window check long bench docs

help:  ## list the targets
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*##/\t/' | expand -t 10

setup:  ## create .venv with everything that development needs
	python3 -m venv .venv
	.venv/bin/pip install -c constraints.txt -e ".[dev]"

lint:  ## format, lint, types, import directions, prose
	$(PYTHON) -m ruff format --check .
	$(PYTHON) -m ruff check .
	$(PYTHON) -m mypy
	.venv/bin/lint-imports
	$(PYTHON) .ci/prose.py

test:  ## the fast tests and the doctests
	$(PYTHON) -m pytest -q

slow:  ## the slow tests: many digits, whole sessions, whole analyses
	$(PYTHON) -m pytest -q -m slow

system:  ## processes, ports, sound, windows, browser, firmware, docs; skips what is not installed
	$(PYTHON) -m pytest -q -m "" --dist loadgroup tests/system

window:  ## a participant's window, with PsychoPy: needs the extra `screen`
	TACTSTRIP_REQUIRED=screen $(PYTHON) -m pytest -q -m "" tests/system/test_window.py

check: lint test slow system  ## everything but the long tests

long:  ## calibrations, thousands of kills, fuzzing; TACTSTRIP_LONG=0.1 runs a seeded tenth
	$(PYTHON) -m pytest -q -m "" --dist loadgroup tests/long

bench:  ## run the benchmarks and write docs/benchmarks/results.md
	$(PYTHON) -m benchmarks

docs:  ## build the site in site/; a warning is an error
	$(PYTHON) -m sphinx -q -W --keep-going docs site
