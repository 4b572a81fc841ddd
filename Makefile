# make demo: the whole study of the paper, one report.   make test: everything a reviewer would run without ROS.
# make test-ros1, make test-ros2: the same components, and foreign ones, on real ROS.   make test-browser: pages in Chromium.
# make docs: the documentation, as a site.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PYTEST := $(BIN)/python -m pytest --numprocesses=auto --maxprocesses=4 --dist=worksteal
# First and by themselves: they fork workers by the hundred, which is quick in processes that have loaded little.
GUESTS := tests/navigation/guests tests/study/test_campaign_study.py
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt

# Tests and benchmarks start hundreds of commands: none of them should compile its modules again, as it would with this set.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test test-browser test-ros1 test-ros2 docs format lint types contracts tests fuzz bench clean

demo: $(VENV)/.runtime
	$(BIN)/parcours demo --out out/demo

test: lint types contracts tests

lint: $(VENV)/.developer
	$(BIN)/ruff format --check --quiet .
	$(BIN)/ruff check --quiet .

types: $(VENV)/.developer
	$(BIN)/mypy

contracts: $(VENV)/.developer
	$(BIN)/lint-imports

tests: $(VENV)/.developer
	$(BIN)/parcours compile --workers 2
	$(PYTEST) $(GUESTS)
	$(PYTEST) $(addprefix --ignore=,$(GUESTS))

test-browser: $(VENV)/.developer docs
	.ci/browser

test-ros1: $(VENV)/.developer
	.ci/ros1

test-ros2: $(VENV)/.developer
	.ci/ros2

docs: $(VENV)/.docs
	$(BIN)/python -m sphinx --builder html --fail-on-warning --keep-going --quiet docs out/docs

format: $(VENV)/.developer
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

fuzz: $(VENV)/.developer
	$(BIN)/python tests/fuzz/test_fuzz_readers.py --seconds 60

BENCHES := criteria.py solving.py "space.py --largest 5" "walking.py --steps 200000" arrays.py start.py agents.py \
	"worlds.py --tracks 300" growth.py "ground.py --pairs 20000" transport.py "hosts.py --repeats 10" "stuck.py --cases 300" \
	"stopping.py --campaigns 1000" "rare.py --known 4 --mutants 0" "requirements.py --formulas 1000" planners.py studio.py \
	compare.py system.py

bench: SHELL := bash
bench: export PYTHONUNBUFFERED := 1
bench: $(VENV)/.developer
	@mkdir -p out; set -o pipefail; for part in $(BENCHES); do echo "== $$part"; $(BIN)/python bench/bench_$$part || exit 1; done | tee out/bench.txt
	@grep -E '^(system cases/s/core|orca us/step|batched cases/s): ' out/bench.txt

clean:
	rm -rf $(VENV) .venv-ros1 .venv-ros2 out build dist .mypy_cache .ruff_cache .hypothesis .import_linter_cache

$(VENV)/.runtime: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(PIP) --editable .
	touch $@

$(VENV)/.developer: $(VENV)/.runtime
	$(PIP) --editable '.[dev]'
	$(PIP) --no-deps pyrvo
	touch $@

$(VENV)/.docs: $(VENV)/.runtime
	$(PIP) --editable '.[docs]'
	touch $@
