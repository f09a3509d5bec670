# Two commands do everything on a machine with Python 3.11 and make:
#   make demo   set up, make a demonstration fleet, run the whole pipeline, say what was found
#   make test   set up, run all that CI needs
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
# Versions with which the demonstration and the tests were run; `make LOCK= demo` takes the newest ones.
LOCK ?= requirements.lock
STAMP := $(VENV)/.ready
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

.PHONY: help demo test real bench env clean
help:
	@sed -n 's/^#   //p' Makefile; echo "make real   the same pipeline on recordings made by others"; \
	echo "make bench  every measured figure beside its bar"; echo "make clean  takes away what was computed; recordings in raw/ stay"

env: $(STAMP)
$(STAMP): pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Turnout needs Python 3.11 or newer")'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --no-compile $(if $(LOCK),--constraint $(LOCK)) --editable '.[dev]'
	-$(BIN)/python -m compileall -qq -j 0 -x '/tests?/' $(VENV)/lib  # on all cores, without tests; pip uses one, for 30 s
	touch $(STAMP)

demo: $(STAMP)
	$(BIN)/turnout demo

test: $(STAMP)
	$(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder

real: $(STAMP)
	$(BIN)/turnout real

bench: $(STAMP)
	$(BIN)/python -m benchmarks

clean:
	rm -rf results work demo real .snakemake
