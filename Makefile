# The front door. README.md, CONTRIBUTING.md, the pre-commit hooks and .ci/run call these targets.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
EXTRAS := io,view,neural,graph,mesh,dev
# What `make bench` races against besides the libraries that tests compare with.
RIVALS := faiss-cpu hnswlib scikit-learn
# The package is installed in place: a change of Python code needs no new installation.
COMPILED := pyproject.toml Cargo.toml Cargo.lock $(shell find rust -name '*.rs')

.DEFAULT_GOAL := help
.PHONY: help demo test lint format bench wheel-test clean

help: ## this list
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 14

demo: $(VENV)/installed ## install, then example → new volume → comparison → demo/report.html
	$(BIN)/poresynth demo

test: $(VENV)/installed-all ## all tests, Rust and Python, with every extra
	cargo test
	$(BIN)/python -m pytest

lint: $(VENV)/installed-all ## formatting, clippy, ruff, mypy, stubs
	cargo fmt --check
	cargo clippy --all-targets --all-features -- -D warnings
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/python -m mypy.stubtest poresynth._core

format: $(VENV)/installed-all ## format the Rust and the Python code
	cargo fmt
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

bench: $(VENV)/installed-all ## all benchmarks; writes the tables and pictures of README.md
	$(BIN)/pip install --quiet $(RIVALS)
	cargo bench -- --warm-up-time 0.3 --measurement-time 0.5 --sample-size 10
	$(BIN)/python benches/python/run.py
	$(BIN)/python benches/python/scaling.py
	$(BIN)/python benches/python/results.py
	$(BIN)/python benches/python/trade_off.py
	$(BIN)/python benches/python/bricks.py
	$(BIN)/python benches/python/known_voxels.py
	$(BIN)/python benches/python/images.py
	$(BIN)/python benches/python/gan.py
	$(BIN)/python benches/python/periodic_field.py
	$(BIN)/python benches/python/periodic_field_figures.py
	$(BIN)/python benches/python/opening_picture.py

wheel-test: $(VENV)/installed ## the wheel alone in an empty environment: no torch, a synthesis
	rm -rf dist target/wheel-test
	$(BIN)/pip wheel --quiet --no-deps --wheel-dir dist .
	$(PYTHON) -m venv target/wheel-test
	target/wheel-test/bin/pip install --quiet dist/poresynth-*.whl
	cd target/wheel-test && bin/python -c 'import importlib.util as u; assert not u.find_spec("torch")'
	cd target/wheel-test && bin/poresynth demo

clean: ## remove everything that these targets made
	cargo clean
	rm -rf $(VENV) demo dist python/poresynth/*.so .mypy_cache .pytest_cache .ruff_cache .hypothesis

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/installed: $(COMPILED) | $(VENV)/bin/python
	@echo "Installing into $(VENV); the first time takes a few minutes."
	$(BIN)/pip install --quiet --editable .
	touch $@

$(VENV)/installed-all: $(COMPILED) | $(VENV)/bin/python
	@echo "Installing into $(VENV) with all extras (PyTorch is large); the first time takes a while."
	$(BIN)/pip install --quiet --editable '.[$(EXTRAS)]'
	touch $(VENV)/installed $@
