# Everything needs only git, make and Python 3.11 to 3.13.
PYTHON ?= python3
BIN := .venv/bin
# compiled Python is kept: without it every start takes seconds longer
export PYTHONDONTWRITEBYTECODE =
PYTEST = $(BIN)/python -m pytest --numprocesses 2 --dist loadfile --no-loadscope-reorder
# shapes and types of arguments: to check them takes as long as to import
TYPED = --jaxtyping-packages=jblast,beartype.beartype
.PHONY: help fit chart stability test quick test-slow test-all check docs tutorials format lock bench-start clean

help:
	@echo 'make fit         fit real recordings; figures and reports go to out/'
	@echo 'make chart       cost against error of every method; make stability where each fails'
	@echo 'make test        the tests that take seconds'
	@echo 'make quick       those of the packages that changed since the last tag, or SINCE=COMMIT'
	@echo 'make test-slow   those that take minutes'
	@echo 'make test-all    both'
	@echo 'make check       format, lint, spelling, types; notebooks without outputs; figures that pages quote'
	@echo 'make docs        the manual, into site/'
	@echo 'make tutorials   run the notebooks; the next make docs shows their outputs'
	@echo 'make format      format, and mend what the linter can'
	@echo 'make lock        resolve the dependencies again'
	@echo 'make bench-start how long all this takes on a fresh clone'
	@echo 'make clean       remove .venv, out and every cache'
	@echo 'Another Python: make fit PYTHON=python3.12'

fit: .venv/run
	$(BIN)/python -m calibration.fit

# Page and figures of the kept tables; MEASURE=--measure measures again.
chart: .venv/run
	$(BIN)/python -m calibration.charts $(MEASURE)

stability: .venv/run
	$(BIN)/python -m calibration.stability $(MEASURE)

test: .venv/dev
	$(PYTEST) -m "not slow"

quick: .venv/dev
	packages=$$($(BIN)/python tests/tools/changed.py $(SINCE)) && $(PYTEST) -m "not slow" -o addopts= $$packages

# FIRST names what comes first; ORDER is a word that the order of the other files follows
# from. After UNTIL (seconds since 1970) no test begins.
test-slow: .venv/dev
	$(PYTEST) $(TYPED) -m slow --first="$(FIRST)" $(if $(ORDER),--order=$(ORDER)) $(if $(UNTIL),--until=$(UNTIL))

test-all: .venv/dev
	$(PYTEST) $(TYPED)

check: .venv/dev
	$(BIN)/pyrefly check --python-interpreter-path $(BIN)/python --output-format min-text
	$(BIN)/python -m ruff format --check .
	$(BIN)/python -m ruff check .
	$(BIN)/codespell
	$(BIN)/python -m nbstripout --verify notebooks/*.ipynb
	$(BIN)/python -m calibration.figures

# A link that leads nowhere stops it; pages need no network to be read.
docs: .venv/docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet
	@echo 'Written: site/index.html'

tutorials: .venv/dev
	@mkdir -p out/tutorials
	$(BIN)/jupyter-execute --timeout=900 --output='../out/tutorials/{notebook_name}' notebooks/*.ipynb

format: .venv/dev
	$(BIN)/python -m ruff format .
	$(BIN)/python -m ruff check --fix .

.venv/run: pyproject.toml .ci/setup .ci/setup.lock .ci/run.lock
	@PYTHON=$(PYTHON) .ci/setup run

.venv/dev: pyproject.toml .ci/setup .ci/setup.lock .ci/dev.lock
	@PYTHON=$(PYTHON) .ci/setup dev

.venv/docs: .venv/run .ci/docs.lock
	@PYTHON=$(PYTHON) .ci/setup docs

# Hashed requirements for every Python from 3.11 to 3.13.
COMPILE = $(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header --no-emit-index-url
lock: .venv/run
	echo uv | $(COMPILE) - --output-file .ci/setup.lock
	$(COMPILE) pyproject.toml --group build --output-file .ci/run.lock
	$(COMPILE) pyproject.toml --all-extras --group build --group dev --constraint .ci/run.lock --output-file .ci/dev.lock
	$(COMPILE) pyproject.toml --group build --group docs --constraint .ci/dev.lock --output-file .ci/docs.lock

bench-start:
	$(PYTHON) calibration/first_minutes.py

clean:
	rm -rf .venv out site build dist .pytest_cache .ruff_cache .hypothesis .jax_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
