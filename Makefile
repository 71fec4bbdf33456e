# `make help` lists what there is. Needs Python 3.11 or newer; everything goes into .venv.

SHELL := bash
BIN := .venv/bin
PYTEST := $(BIN)/python -m pytest
# Each core takes tests from the others when it has none left (ARGS=-n0: one after the other).
PARALLEL := -n auto --maxprocesses 4 --dist worksteal

# A screen for the pictures of the examples; without one VTK draws off screen, and says so.
XVFB = $(if $(shell command -v xvfb-run),xvfb-run -a)

ROOM := rbf
RUNS := 5000
SEED := 0
MINUTES := 10

.DEFAULT_GOAL := help
.PHONY: help setup upgrade demo test quick test-all test-processors lint format docs golden bits smoke mutants bench laws fuzz kill gpu shots folder deb study clean

help: ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | while IFS=$$'\t' read -r name text; \
		do printf '  make %-10s %s\n' "$$name" "$$text"; done

setup: ## make .venv/bin/slideviz and all it needs (does nothing when it is there)
	@tools/setup.sh

upgrade: ## renew constraints.txt, the versions that setup installs (PYTHON=/path/to/python3.11)
	@tools/upgrade.sh

demo: ## deform a blade passage into demo/ and open it (WINDOW=no: do not open it)
	@tools/setup.sh run
	@tools/demo.sh

test: setup ## fast tests (ARGS="-k name": only some)
	$(PYTEST) $(PARALLEL) -m "not slow" --ignore=tests/benchmarks $(ARGS)

quick: setup ## tests of the files that changed since the last commit (ARGS="--since main")
	$(BIN)/python -m tools.quick $(ARGS)

test-all: setup ## all tests, slow reproductions too
	$(PYTEST) $(PARALLEL) --ignore=tests/benchmarks $(ARGS)

test-processors: setup ## fast tests with the arithmetic of other processors (nightly)
	@PYTEST="$(PYTEST) $(PARALLEL)" tools/test_processors.sh $(ARGS)

lint: setup ## style, types, the direction of imports, and the number of tokens
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python tools/size.py

format: setup ## let ruff put right what it can
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

docs: setup ## build the documentation into build/docs/html; its examples run
	@tools/setup.sh docs
	$(XVFB) $(BIN)/python -m sphinx -W --keep-going -q -j auto docs build/docs/html

golden: setup ## record what users get, which test-all compares (PARTS="films window")
	$(BIN)/python -m tests.golden.record $(PARTS)

bits: setup ## record the hashes of runs, which test compares with, after an intended change
	$(BIN)/python -m tests.bits.record

smoke: setup ## build the wheel and try it outside of the clone, also without Qt and VTK
	$(BIN)/python tools/smoke.py

mutants: setup ## faults that the tests of a package do not notice (ROOM=rbf ARGS="--sample 50")
	$(BIN)/python -m tools.mutants $(ROOM) $(ARGS)

bench: setup ## measure the speed (needs a quiet machine); all of it with ARGS='-m ""'
	$(PYTEST) tests/benchmarks -o python_files="bench_*.py test_*.py" --benchmark-only -m "not slow" $(ARGS)

laws: setup ## hold random runs against the laws of deformation (RUNS=5000 SEED=0)
	$(BIN)/python -m tools.laws --runs $(RUNS) --seed $(SEED) $(ARGS)

fuzz: setup ## search for faults with damaged files and absurd cases (MINUTES=10)
	$(BIN)/python -m tools.fuzz --minutes $(MINUTES) $(ARGS)

kill: setup ## end commands at random times: files are whole, old or new (MINUTES=10)
	$(BIN)/python -m tools.kill --minutes $(MINUTES) $(ARGS)

gpu: setup ## speed and errors of a graphics card (needs one, and the extra gpu); three minutes
	$(BIN)/python -m tools.gpu $(ARGS)

shots: setup ## draw the pictures in screenshots/ again
	$(BIN)/python -m tools.shots

folder: ## a folder with slideviz that runs without Python, into build/folder/slideviz (PyInstaller)
	@packaging/folder.sh

deb: ## a package for Debian 12 and newer, of that folder, into dist/
	@packaging/deb.sh

study: setup ## the thesis's cases, and a contest, into study/ (ARGS=--quick: small ones; MESHES=SU2's)
	$(BIN)/python -m tools.study $(ARGS)
	-$(BIN)/python -m tools.study.contest $(if $(MESHES),--meshes $(MESHES)) \
		$(if $(findstring --quick,$(ARGS)),--rows "^block in") -o study/contest

clean: ## remove what was built, the virtual environment and demo/ included
	rm -rf .venv demo study build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis .benchmarks \
		.import_linter_cache .coverage tests/golden/new docs/gallery docs/reference/{keys,commands}.md
	find slideviz tests -name __pycache__ -prune -exec rm -rf {} +
