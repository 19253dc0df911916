# make demo: set up and run the main job on bundled motions.   make test: set up and run everything that CI runs.
# make quick: for the loop of a person who edits; what answers within half a minute.
# make wheel: build the wheel and run the demo from it in an empty environment.
# make package: build sdist and wheel into dist/ and check them.   make docs: build the documentation site into site/.
# PYTHON=python3.12 chooses the interpreter (range: `requires-python` in pyproject.toml); the default is the first one found.

SHELL := /bin/bash
VENV := .venv
BIN := $(VENV)/bin

# Bytecode is kept: without it every process compiles all sources anew, and pytest writes all assertions anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test test-data quick environment lint node wheel package docs clean

environment:
	@scripts/check_system_libraries.sh
	@PYTHON="$(PYTHON)" scripts/make_environment.sh $(VENV)

demo: environment
	$(BIN)/depthmocap demo --output demo

lint: environment
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/codespell

node:
	@scripts/install_node_packages.sh

quick:
	$(BIN)/ruff check .
	$(BIN)/pytest -x -m quick

# A file of tests stays with one worker, so that what its tests share is made once; the longest files come first.
test: lint node
	$(BIN)/pytest -n logical --dist loadfile --no-loadscope-reorder

# Needs data sets of others (`depthmocap data fetch`); DEPTHMOCAP_DATA names their folder.
test-data: environment
	$(BIN)/pytest -n logical --dist loadfile --no-loadscope-reorder -m data

wheel: environment
	scripts/check_wheel.sh $(BIN)/python

package: environment
	scripts/check_package.sh $(BIN)/python

docs: environment
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

clean:
	rm -rf $(VENV) build dist demo site
