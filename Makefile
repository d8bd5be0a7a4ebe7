# Two commands: `make demo` and `make test`. Both make the environment they need.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test test-slow lint check urdf figures report soundness mutants bench dist clean

demo: $(VENV)/.installed
	$(BIN)/vdsm batch --out out/demo

test: $(VENV)/.installed
	$(BIN)/pytest -n 2 -m "not slow"

test-slow: $(VENV)/.installed
	$(BIN)/pytest -n 2 -m slow

lint: $(VENV)/.installed
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

check: lint test

urdf: $(VENV)/.installed
	$(BIN)/vdsm urdf hrm8 --out urdf/hrm8.urdf

figures: $(VENV)/.installed
	$(BIN)/python analysis/figures.py --out reports/paper
	$(BIN)/python analysis/readme_animation.py --out reports
	$(BIN)/python analysis/conventions.py

report: figures
	$(BIN)/python analysis/paper_table.py --out reports/paper
	$(BIN)/python analysis/obs2_orientations.py --out reports/paper
	$(BIN)/python analysis/scaling_choices.py --out reports/paper

soundness: $(VENV)/.installed
	$(BIN)/python analysis/soundness.py --queries 10000000 --save reports/soundness.md

mutants: $(VENV)/.installed
	$(BIN)/python -m analysis.mutation --sample 1000 --save reports/mutants.md

bench: $(VENV)/.installed
	$(BIN)/python -m benchmarks.report --save reports/performance

dist: $(VENV)/.installed
	.ci/test-wheel

clean:
	rm -rf $(VENV) build dist out test-output

# The environment: made once, refreshed when what it is made from changes.
$(VENV)/.installed: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	@echo "compiling what runs fast, once: about a minute"
	-@$(BIN)/vdsm batch paper/free paper/obs1 --out $(VENV)/warm >/dev/null
	touch $@
