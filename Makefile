# Every target sets itself up: a virtual environment in the tree, the pinned packages, strokestyle itself.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

# The paper's experiments: DATA is a data set (experiments/dataset.py), TRAIN its training shape where
# it has no dataset.json; STYLES some of its styles. What is in RESULTS already is not made again.
DATA ?= $(STROKESTYLE_SHARED)
TRAIN ?=
STYLES ?=
RESULTS ?= out/experiments
JOBS ?= 1
OF_SET = --data "$(DATA)" $(if $(TRAIN),--train $(TRAIN))
OF_STYLES = $(if $(STYLES),--styles $(STYLES))

.PHONY: help demo test lint bench experiments clean

help:
	@echo "make demo    learn two styles from examples/drawings and draw other shapes with them, into out/demo"
	@echo "make test    run the tests"
	@echo "make lint    check the code's style and types"
	@echo "make bench   print the tables that the README's numbers come from"
	@echo "make experiments DATA=... TRAIN=shape    run the paper's experiments on a data set, and print their tables"
	@echo "make clean   remove what the others made, the environment included"

$(READY): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "the pinned packages need Python 3.11 or newer; try: make PYTHON=python3.12 $(MAKECMDGOALS)"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[dev]"
	@touch $@

demo: $(READY)
	$(BIN)/python examples/demo.py

test: $(READY)
	$(BIN)/python -m pytest -n auto --dist loadfile

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: $(READY)
	@for script in $(filter-out benchmarks/compare.py benchmarks/line_art.py,$(sort $(wildcard benchmarks/*.py))); do echo "== $$script"; $(BIN)/python $$script || exit 1; done

experiments: $(READY)
	@[ -d "$(DATA)/styles" ] || { echo "make experiments needs a data set: make experiments DATA=... (experiments/README.md)"; exit 1; }
	$(BIN)/python experiments/fetch_weights.py
	$(BIN)/python experiments/compare_methods.py $(RESULTS) $(OF_SET) $(OF_STYLES) --jobs $(JOBS)
	$(BIN)/python experiments/measure.py $(RESULTS) $(OF_SET) $(OF_STYLES)
	$(BIN)/python experiments/fid_bias.py $(RESULTS) $(OF_SET) $(OF_STYLES) --methods ours_quick
	$(BIN)/python experiments/pictures.py $(RESULTS) $(OF_SET) $(OF_STYLES)

clean:
	rm -rf $(VENV) out build dist .pytest_cache .ruff_cache .mypy_cache
