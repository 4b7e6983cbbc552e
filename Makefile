# `make run` and `make test` are all a fresh machine needs (Python >= 3.11 and make).
PYTHON ?= python3
CORES ?= 2
# more options for snakemake, such as SNAKEMAKE_ARGS=--dry-run
SNAKEMAKE_ARGS ?=
# more options for pytest, such as PYTEST_ARGS='-m "not slow"'
PYTEST_ARGS ?=

VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.installed
DOCS := .venv-docs
SNAKEMAKE := $(BIN)/snakemake --cores $(CORES) $(SNAKEMAKE_ARGS)

# Snakemake's jobs start `python` and `imuarray` by name.
export PATH := $(CURDIR)/$(BIN):$(PATH)

.PHONY: help install run quick paper publish crate test test-slurm bench docs dist lint lock clean
.DEFAULT_GOAL := help

help:
	@echo "make install the package alone, without the pipeline, for a board of your own"
	@echo "make run     all results and figures at the default scale"
	@echo "make quick   the same pipeline, smallest useful sizes"
	@echo "make paper   the papers' own sizes (long)"
	@echo "make publish all of paper_figures/ (hours)"
	@echo "make crate   results/ro-crate-metadata.json: what the results are, for an archive"
	@echo "make test    the tests"
	@echo "make test-slurm   the quick run through a Slurm of one node, brought up here (root, a container)"
	@echo "make bench   the benchmarks"
	@echo "make docs    the documentation as a site to open without a network: site/index.html"
	@echo "make dist    a wheel and a source archive in dist/"
	@echo "make lint    ruff, mypy, snakefmt and snakemake --lint"
	@echo "make lock    resolve pyproject.toml into the two lock files anew (needs uv)"
	@echo "make clean   remove the environment and the caches, not the results"

# The stamp is newer than the lock: nothing is installed again until the lock or the project changes.
# What `make install` made is kept and added to.
$(READY): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; v = sys.version_info; v >= (3, 11) or sys.exit("imuarray: expected Python 3.11 or newer, found %d.%d; set PYTHON=..." % v[:2])'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	touch $@

# The versions of the lock; its hashes are for all of it. An environment that has the pipeline has the package.
install:
	@test -e $(READY) || { set -e; test -x $(BIN)/python || $(PYTHON) -m venv $(VENV); \
	  grep -oE '^[A-Za-z0-9_.-]+==[^\]*' requirements.lock > $(VENV)/versions.txt; \
	  $(BIN)/python -m pip install --quiet --disable-pip-version-check -c $(VENV)/versions.txt '.[ros,papers]'; }
	@echo "$(CURDIR)/$(BIN)/imuarray board log.csv --columns columns.yaml --gravity 9.81 --out answer/"

run: $(READY)
	$(SNAKEMAKE)

quick: $(READY)
	$(SNAKEMAKE) quick

paper: $(READY)
	$(SNAKEMAKE) --config scale=paper

publish: $(READY)
	$(SNAKEMAKE) publish

crate: $(READY)
	$(BIN)/python -m imuarray_papers.pipeline.crate

test: $(READY)
	$(BIN)/python -m pytest -q -n $(CORES) --dist loadfile --no-loadscope-reorder $(PYTEST_ARGS)

# The executor is not in the lock: who has a cluster installs it as docs/cluster.md says.
test-slurm: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e .[slurm]
	tests/slurm/run.sh $$(mktemp -d)

bench: $(READY)
	$(BIN)/python benchmarks/run.py

# The site's tools have an environment of their own: they read the package's source and do not run it.
$(DOCS)/.installed: requirements-docs.lock
	rm -rf $(DOCS)
	$(PYTHON) -m venv $(DOCS)
	$(DOCS)/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements-docs.lock
	touch $@

docs: $(DOCS)/.installed
	NO_MKDOCS_2_WARNING=1 $(DOCS)/bin/mkdocs build --strict --quiet

dist: $(READY)
	rm -rf build dist
	$(BIN)/python -c "from setuptools import build_meta as made; made.build_sdist('dist'); made.build_wheel('dist')"

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/ruff format --check .
	$(BIN)/snakefmt --check Snakefile workflow
	$(BIN)/snakemake --lint

lock:
	uv pip compile pyproject.toml --universal --python-version 3.11 --extra test --extra build --extra pipeline --extra ros \
	    --generate-hashes --no-header --quiet -o requirements.lock
	$(PYTHON) -c 'import tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))["project"]["optional-dependencies"]["docs"], sep="\n")' | \
	    uv pip compile - --universal --python-version 3.11 --generate-hashes --no-header --quiet -o requirements-docs.lock

clean:
	rm -rf $(VENV) $(DOCS) site build dist src/*.egg-info .pytest_cache .ruff_cache .hypothesis
	find src tests workflow benchmarks -name __pycache__ -type d -prune -exec rm -rf {} + 2>/dev/null || true
