# skillframe: `make demo` shows what it does, `make test` says whether it still does. Each target installs what it needs
# into .venv, once.

PYTHON ?= python3
OUT ?= demo
VENV := .venv
LEROBOT := .venv-lerobot
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --quiet --disable-pip-version-check
# Compiled files are kept whatever the environment says: each test that starts a program would compile it all again.
PYTEST := PYTHONDONTWRITEBYTECODE= OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 $(BIN)/python -m pytest -q --timeout 900
# Tests run side by side; figures and ratios do not, since some of them measure time.
SIDE_BY_SIDE := --numprocesses auto --maxprocesses 4 --dist worksteal
PROJECTS := pyproject.toml plugins/all.txt $(wildcard plugins/*/pyproject.toml)

EXAMPLES := $(wildcard examples/*.py)
GALLERY := docs/gallery/pictures
PICTURES := $(EXAMPLES:examples/%.py=$(GALLERY)/%.png)

.PHONY: demo install wheels test test-core test-rest test-beside test-step test-lerobot test-slow mutants figures reproduced bench docs gallery world-pictures lint clean

demo: install
	$(BIN)/skillframe demo --out $(OUT)

install: $(VENV)/.installed

$(VENV)/.installed: $(PROJECTS)
	@$(BIN)/python -c "" 2>/dev/null || $(PYTHON) -c "import sys; sys.exit(sys.version_info < (3, 11))" || \
	  { echo "skillframe needs Python 3.11 or newer; type for example: make PYTHON=python3.12 demo"; exit 1; }
	@$(PIP) --version >/dev/null 2>&1 || $(PYTHON) -m venv --clear $(VENV) || \
	  { echo "could not make $(VENV); on Debian and Ubuntu type: sudo apt install python3-venv"; exit 1; }
	@echo "installing skillframe, its plug-ins and what they need into $(VENV); once, a minute or two"
	@$(PIP) install -e '.[all]' -r plugins/all.txt
	@touch $@

# A wheel of every distribution, in dist/.
wheels: $(VENV)/.installed
	@rm -rf dist
	@$(PIP) wheel --no-deps --wheel-dir dist . $(patsubst %/pyproject.toml,./%,$(wildcard plugins/*/pyproject.toml))
	@echo "dist/: install one with: pip install --find-links dist 'skillframe[sim]' skillframe-lmc"

$(VENV)/.test: $(VENV)/.installed
	$(PIP) install "pip>=25.1"
	$(PIP) install --group test
	@touch $@

$(VENV)/.dev: $(VENV)/.test
	$(PIP) install --group dev
	@touch $@

test: test-core test-rest

# The core with the worlds, and no other plug-in.
test-core: $(VENV)/.test
	SKILLFRAME_PLUGINS=worlds $(PYTEST) $(SIDE_BY_SIDE) -m "core and not slow and not figures" tests/unit

# Everything else, with all plug-ins.
test-rest: $(VENV)/.test
	$(PYTEST) $(SIDE_BY_SIDE) -m "not core and not slow and not figures"

# The core's tests once more, beside the plug-ins.
test-beside: $(VENV)/.test
	$(PYTEST) $(SIDE_BY_SIDE) -m "core and not slow and not figures" tests/unit

# What reads STEP, whose library is 99 MB and not among the others.
test-step: $(VENV)/.test
	$(PIP) install -e '.[step]'
	$(PYTEST) plugins/parts/tests/test_step.py

# What runs inside LeRobot. It brings gigabytes and holds libraries back, so it has an environment of its own, and CI does
# not run it.
$(LEROBOT)/.installed: plugins/lerobot/pyproject.toml
	$(PYTHON) -m venv --clear $(LEROBOT)
	$(LEROBOT)/bin/python -m pip install --quiet -e '.[sim]' -e plugins/lmc -e plugins/reports -e plugins/gym -e plugins/lerobot \
	  pytest pytest-timeout hypothesis
	@touch $@

test-lerobot: $(LEROBOT)/.installed
	OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 $(LEROBOT)/bin/python -m pytest -q -W ignore --timeout 900 plugins/lerobot

test-slow: $(VENV)/.test
	$(PYTEST) $(SIDE_BY_SIDE) -m "slow and not figures"

# Single changes of the core mathematics: does the everyday test that is named beside each notice it?
mutants: $(VENV)/.test
	$(BIN)/python -m tests.mutants.run --jobs 2 --results tests/mutants/caught.csv

figures: $(VENV)/.test
	$(PYTEST) -s -m figures

bench: $(VENV)/.test
	$(BIN)/python tests/benchmarks/run.py

docs: $(VENV)/.dev $(PICTURES)
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs docs/_build/html
	@echo "docs/_build/html/index.html"

# The gallery's pictures, small where they are missing; `make gallery` makes all of them in full.
$(GALLERY)/%.png: examples/%.py | $(VENV)/.dev
	@mkdir -p $(GALLERY)
	MPLBACKEND=Agg $(BIN)/python $< --quick --out $(GALLERY) > $(GALLERY)/$*.txt

gallery: $(VENV)/.dev
	@mkdir -p $(GALLERY)
	@for script in $(EXAMPLES); do echo $$script; MPLBACKEND=Agg $(BIN)/python $$script --out $(GALLERY) \
	  > $(GALLERY)/$$(basename $$script .py).txt || exit 1; done

# The pictures of the shipped worlds on the page docs/reference/worlds.md.
world-pictures: $(VENV)/.dev
	SKILLFRAME_PLUGINS=worlds,reports $(BIN)/skillframe worlds --pictures docs/images/worlds

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

clean:
	rm -rf $(VENV) $(LEROBOT) build dist docs/_build docs/gallery

# The papers' results, computed again and put into the committed tables. `make reproduced
# ROWS="3 5"` does some of them, QUICK=--quick the quick ones. A verdict that changes is told, and is no error here.
ROWS ?=
QUICK ?=
reproduced: $(VENV)/.installed
	OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 $(BIN)/skillframe reproduce $(ROWS) $(QUICK) --fresh --out build/reproduced || [ $$? -eq 1 ]
	$(BIN)/python -m skillframe_papers.refresh build/reproduced
