# Everything but `make lock` needs only git, make and Python 3.11 to 3.13.
PYTHON ?= python3
BIN := .venv/bin
PIP = $(BIN)/python -m pip --quiet --disable-pip-version-check install
PYTEST = $(BIN)/python -m pytest --numprocesses 2
.PHONY: help fit test test-slow test-all check format lock clean

help:
	@echo 'make fit         fit real recordings; figures and reports go to out/'
	@echo 'make test        the tests that take seconds'
	@echo 'make test-slow   those that take minutes'
	@echo 'make test-all    both'
	@echo 'make check       format, lint, types; notebooks without outputs'
	@echo 'make format      format, and mend what the linter can'
	@echo 'make lock        resolve the dependencies again (needs uv)'
	@echo 'make clean       remove .venv, out and every cache'
	@echo 'Another Python: make fit PYTHON=python3.12'

fit: .venv/run
	$(BIN)/python -m calibration.fit

test: .venv/dev
	$(PYTEST) -m "not slow"

test-slow: .venv/dev
	$(PYTEST) -m slow

test-all: .venv/dev
	$(PYTEST)

check: .venv/dev
	$(BIN)/python -m ruff format --check .
	$(BIN)/python -m ruff check .
	$(BIN)/python -m pyright --pythonpath $(BIN)/python
	$(BIN)/python -m nbstripout --verify notebooks/*.ipynb

format: .venv/dev
	$(BIN)/python -m ruff format .
	$(BIN)/python -m ruff check --fix .

# .venv/run and .venv/dev stand for finished installations and are written last. One
# that was cut short has no .venv/run: the next make starts from an empty .venv, since
# pip takes a half-copied package for an installed one.
.venv/run: pyproject.toml .ci/run.lock
	@if test -e $@ && $(BIN)/python -m pip --version >/dev/null; then rm $@; else \
	  $(PYTHON) -c 'import sys; v = sys.version_info[:2]; sys.exit(None if (3, 11) <= v <= (3, 13) else \
	    "jblast needs Python 3.11, 3.12 or 3.13, and $(PYTHON) is %d.%d: name another, as in make PYTHON=python3.12" % v)' && \
	  echo 'Setting up .venv, once: this takes a minute or two.' && \
	  $(PYTHON) -m venv --clear .venv; fi
	$(PIP) --require-hashes --requirement .ci/run.lock
	$(PIP) --no-deps --no-build-isolation --editable .
	@touch $@

.venv/dev: .venv/run .ci/dev.lock
	@rm .venv/run
	$(PIP) --require-hashes --requirement .ci/dev.lock
	@touch .venv/run $@

# Hashed requirements for every Python from 3.11 to 3.13.
COMPILE = uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header --no-emit-index-url
lock:
	$(COMPILE) pyproject.toml --group build --output-file .ci/run.lock
	$(COMPILE) pyproject.toml --group build --group dev --constraint .ci/run.lock --output-file .ci/dev.lock

clean:
	rm -rf .venv out build dist .pytest_cache .ruff_cache .hypothesis .jax_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
