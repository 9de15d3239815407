PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
PLUGINS := $(wildcard plugins/*/pyproject.toml)
OUT ?= demo

.PHONY: demo install test test-core test-slow figures bench docs lint clean

demo: $(STAMP)
	$(BIN)/skillframe quickstart --out $(OUT)

install: $(STAMP)

$(STAMP): pyproject.toml plugins/all.txt $(PLUGINS)
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e . -r plugins/all.txt
	touch $@

$(VENV)/.test: $(STAMP)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check "pip>=25.1"
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --group test
	touch $@

$(VENV)/.dev: $(VENV)/.test
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --group dev
	touch $@

test: $(VENV)/.test
	SKILLFRAME_PLUGINS= $(BIN)/python -m pytest tests/unit -q -m "not slow and not figures and not needs_plugins"
	$(BIN)/python -m pytest -q -m "not slow and not figures"

test-slow: $(VENV)/.test
	$(BIN)/python -m pytest -q -m "slow and not figures"

figures: $(VENV)/.test
	$(BIN)/python -m pytest -q -s -m figures

bench: $(VENV)/.test
	$(BIN)/python tests/benchmarks/run.py

docs: $(VENV)/.dev
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs docs/_build/html

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

clean:
	rm -rf $(VENV) build dist docs/_build
