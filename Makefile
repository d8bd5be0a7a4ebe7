# Two commands: `make demo` and `make test`. Both make the environment they need.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Every process that a test starts would compile the package anew, a third of its time.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: demo test test-slow lint docs check urdf figures report claims soundness mutants bench dist clean

demo: $(VENV)/.installed
	$(BIN)/vdsm batch --out out/demo

test: $(VENV)/.installed
	$(BIN)/pytest -n 2 --dist worksteal -m "not slow and not pages"

test-slow: $(VENV)/.installed
	$(BIN)/pytest -n 2 --dist worksteal -m slow

lint: $(VENV)/.installed
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

docs: $(VENV)/.installed
	$(BIN)/pytest -n 2 -m pages
	$(BIN)/sphinx-build -q -W -n -c docs . out/site
	@echo "open out/site/docs/index.html"

check: lint test

urdf: $(VENV)/.installed
	$(BIN)/vdsm urdf hrm8 --out urdf/hrm8.urdf

figures: $(VENV)/.installed
	$(BIN)/python analysis/figures.py --out reports/paper
	$(BIN)/python analysis/readme_animation.py
	$(BIN)/python analysis/conventions.py
	$(BIN)/python analysis/theory_pictures.py
	$(BIN)/python analysis/architecture_picture.py
	$(BIN)/python analysis/module_index.py

report: figures
	$(BIN)/python analysis/paper_table.py --out reports/paper
	$(BIN)/python analysis/obs2_orientations.py --out reports/paper
	$(BIN)/python analysis/scaling_choices.py --out reports/paper
	$(BIN)/python analysis/step5_choices.py --out reports/paper
	$(BIN)/python analysis/moving_obstacle.py --out reports/paper
	$(BIN)/python analysis/closed_loop.py --out reports/paper
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[references]'
	PYTHONPATH=. $(BIN)/python analysis/baselines.py --out reports/paper --sample 12 --slow 6

claims: $(VENV)/.installed
	PYTHONPATH=. $(BIN)/python analysis/claims.py

soundness: $(VENV)/.installed
	$(BIN)/python analysis/soundness.py --queries 10000000 --save reports/soundness.md

mutants: $(VENV)/.installed
	$(BIN)/python -m analysis.mutation --save out/mutants.md

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
