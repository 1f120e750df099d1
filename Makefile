# make demo   derive, compile and simulate a slider-crank; writes demo_output/slider_crank.png, .gif and a page, .html
# make quick  in 20 seconds: tests without a compiler for what differs from the last commit (the table in tests/conftest.py)
# make test   make lint, then the tests of all that users see, on all processors; fails if anything was skipped;
#             PROGRAMS=all fails too where a program that some tests need is missing, as continuous integration does
# make thorough  make test with everything that is marked thorough: long sweeps, C of all examples, sanitizers, packages
# make bench  timings beside SymPy; BENCHMARKS='derive call' runs only these, results in benchmarks/results.md
# make notebooks  executes the notebooks anew and stores their outputs; NOTEBOOKS=FILE only this one
# make lint   ruff, codespell, mypy and tools/lint.py alone
# make docs   the documentation as a site, docs/_build/html/index.html; a warning is an error
# make pictures  draws the stored pictures of the documentation anew: of pages, of their blocks, of the gallery
# make mutations  puts deliberate faults into a copy of the sources; fails if no test notices one (half an hour)
# make fuzz   attacks the package with hostile files, texts, calls and objects: CASES=100000, or HOURS=8 with new ones;
#             KINDS='yaml sympy' only these, and SEED=4711 one case of one kind, shown
# make clean  removes what the other targets made, .venv included
# Each makes its own .venv (Python 3.11 or later) and installs what it needs; a second call goes straight to work.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
VENV := .venv
BIN := $(VENV)/bin
export PIP_DISABLE_PIP_VERSION_CHECK := 1

NOTEBOOKS := $(wildcard notebooks/*.ipynb)
# Of tests too: pytest rewrites their files at each start otherwise, which takes as long as the quick ones.
KEEP_BYTECODE := PYTHONDONTWRITEBYTECODE=

.PHONY: demo quick test thorough bench notebooks lint docs pictures mutations fuzz clean
.DELETE_ON_ERROR:

demo: $(VENV)/.installed-plot
	@$(BIN)/eomgen run examples/slider_crank.yaml --plot demo_output/slider_crank.png --animate demo_output/slider_crank.gif
	@$(BIN)/eomgen view examples/slider_crank.yaml --end 2 --out demo_output/slider_crank.html

test thorough: lint
	@$(KEEP_BYTECODE) OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 $(BIN)/python -m pytest --no-skips --numprocesses=logical --maxprocesses=8 --dist=worksteal \
	  $(if $(filter thorough,$@),--thorough) $(if $(PROGRAMS),--programs)

quick: $(VENV)/.installed-test
	@$(KEEP_BYTECODE) OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 $(BIN)/python -m pytest --quick -q tests

lint: $(VENV)/.installed-$(if $(PROGRAMS),all-tests,test)
	@$(BIN)/ruff check .
	@$(BIN)/codespell benchmarks docs eomgen examples notebooks templates tools *.md *.py Makefile pyproject.toml
	@$(BIN)/python tools/stubs.py
	@$(BIN)/mypy
	@$(BIN)/python tools/lint.py

bench: $(VENV)/.installed-docs
	@$(BIN)/python -m benchmarks.run $(BENCHMARKS)

docs: $(VENV)/.installed-docs
	@$(BIN)/sphinx-build -b html -W -n -q --keep-going -j 2 docs docs/_build/html
	@echo docs/_build/html/index.html

pictures: $(VENV)/.installed-test
	@$(BIN)/python docs/make_pictures
	@$(BIN)/python docs/pictures_of_pages.py
	@$(BIN)/python docs/make_gallery.py

notebooks: $(VENV)/.installed-test
	@$(BIN)/python notebooks/execute.py $(NOTEBOOKS)

mutations: $(VENV)/.installed-test
	@$(BIN)/python tests/mutations/run.py --jobs 2

fuzz: $(VENV)/.installed-test
	@cd tests && ../$(BIN)/python -m attack.fuzz $(KINDS) $(if $(HOURS),--hours $(HOURS)) $(if $(CASES),--cases $(CASES)) \
	  $(if $(SEED),--seed $(SEED))

clean:
	@rm -rf $(VENV) build dist eomgen/_native*.so demo_output docs/_build docs/tutorials/*.ipynb docs/tutorials/*.png eomgen.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	@find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(VENV)/.installed-plot: EXTRAS := plot
$(VENV)/.installed-docs: EXTRAS := dev
$(VENV)/.installed-test: EXTRAS := test,dev
$(VENV)/.installed-all-tests: EXTRAS := test,dev,cuda

# uv installs in seconds what takes pip a minute; where uv cannot be had or cannot reach the index, pip does it.
# Bytecode is made now: without it every start costs a second more where PYTHONDONTWRITEBYTECODE is set.
$(VENV)/.installed-%: pyproject.toml | $(VENV)/pyvenv.cfg
	@echo "installing eomgen[$(EXTRAS)] into $(VENV)" >&2
	@if $(BIN)/python -m pip install --quiet uv && $(BIN)/uv pip install --quiet --compile-bytecode -p $(BIN)/python -e ".[$(EXTRAS)]"; \
	then :; else $(BIN)/python -m pip install --quiet -e ".[$(EXTRAS)]"; fi
	@$(BIN)/python -m compileall -q eomgen templates
	@touch $@

$(VENV)/pyvenv.cfg:
	@for python in $(PYTHON) python3 python3.13 python3.12 python3.11 python3.14; do \
	  if "$$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; \
	  then exec "$$python" -m venv $(VENV); fi; \
	done; echo "eomgen needs Python 3.11 or later with venv (Debian: apt install python3-venv)" >&2; exit 1
