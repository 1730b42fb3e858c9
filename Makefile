# make demo   build specs/vehicle.yaml, simulate a log, run the filter over it, plot; report on a recorded drive
# make test   all tests but those that are marked long
# make lint   style, types, and whether generated/ is up to date
# make bench  instructions, flash, RAM and stack on an emulated Cortex-M4F
# make golden rewrite generated/ and the README's piece of C
#
# Each sets up .venv first. PYTHON chooses the interpreter (3.11 or later).

PYTHON ?= $(shell for p in python3.11 python3.12 python3.13 python3; do \
	$$p -c 'import sys, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)

SPEC ?= specs/vehicle.yaml
NAME = $(basename $(notdir $(SPEC)))
SIMULATE ?= $(if $(filter vehicle,$(NAME)),--steps 1000 --seed 4 --every gnss=5)
REAL ?= $(wildcard tests/data/$(NAME).csv)
COMMA = ,
TESTFLAGS ?=

.PHONY: demo test lint bench golden clean

demo: .venv/.plot
	.venv/bin/kfgen build $(SPEC) -o out
	.venv/bin/kfgen simulate $(SPEC) $(SIMULATE) -o out/$(NAME)/log.csv
	.venv/bin/kfgen run $(SPEC) out/$(NAME)/log.csv -o out/$(NAME)/estimate.csv --plot out/$(NAME)/estimate.png
	$(if $(REAL),.venv/bin/kfgen report $(SPEC) --log $(REAL) -o out/$(NAME)/report.html)
	@echo
	@echo "the filter:        out/$(NAME)/$(NAME).h, out/$(NAME)/$(NAME).c"
	@echo "a simulated log:   out/$(NAME)/log.csv"
	@echo "what it estimates: out/$(NAME)/estimate.csv"
	@echo "truth, measurements, estimate and 2 sigma: out/$(NAME)/estimate.png"
	@$(if $(REAL),echo "what of it is consistent on $(REAL)$(COMMA) and what is not: out/$(NAME)/report.html")

test: .venv/.test
	.venv/bin/python -m pytest $(TESTFLAGS)

lint: .venv/.test
	.venv/bin/ruff check .
	.venv/bin/mypy
	.venv/bin/kfgen build --check specs/*.yaml

bench: .venv/.test
	.venv/bin/python -m tests.benchmarks

golden: .venv/.test
	.venv/bin/python -m pytest --update tests/golden

clean:
	rm -rf .venv out build dist .pytest_cache .hypothesis .mypy_cache .ruff_cache

.venv/bin/python:
	@test -n "$(PYTHON)" || { echo "Python 3.11 or later with venv is needed; name it: make PYTHON=..." >&2; exit 1; }
	$(PYTHON) -m venv .venv

.venv/.plot: pyproject.toml | .venv/bin/python
	.venv/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[plot]'
	@touch $@

.venv/.test: pyproject.toml | .venv/bin/python
	.venv/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[test,lint]'
	@touch $@ .venv/.plot
