# `make fit` and `make test` need git, make and Python >= 3.11; everything else they set up themselves.
PYTHON ?= python3
BIN := .venv/bin
.PHONY: fit test test-all check format lock clean

fit: .venv/run
	$(BIN)/python -m calibration.fit

test: .venv/dev
	$(BIN)/python -m pytest -n 2 -m "not slow"

test-all: .venv/dev
	$(BIN)/python -m pytest -n 2

test-slow: .venv/dev
	$(BIN)/python -m pytest -n 2 -m slow

check: .venv/dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright
	$(BIN)/nbstripout --verify notebooks/*.ipynb

format: .venv/dev
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

.venv/run: pyproject.toml .ci/run.lock
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r .ci/run.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	touch $@

.venv/dev: .venv/run .ci/dev.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r .ci/dev.lock
	touch $@

# Hashed requirements for every Python from 3.11 to 3.13 (needs uv).
COMPILE = uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header --no-emit-index-url
lock:
	$(COMPILE) pyproject.toml --group build --output-file .ci/run.lock
	$(COMPILE) pyproject.toml --group build --group dev --constraint .ci/run.lock --output-file .ci/dev.lock

clean:
	rm -rf .venv out build dist .pytest_cache .ruff_cache
