# Everything on a fresh machine: Python 3.11 or newer, pip and make are all that is assumed. Each target makes what it needs.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/ready

.PHONY: run test quick test-slow lint docs gallery pages mutants fuzz kills package clean

run: $(READY)
	mkdir -p out
	$(BIN)/macs solve goddard --seed 1 --out out/goddard.nc --plot out/goddard.png

test: $(READY)
	$(BIN)/python -m pytest -m "not slow" -n 2

# The quick tests of what has changed since the last commit, in seconds.
quick: $(READY)
	$(BIN)/python -P tests/quick.py

test-slow: $(READY)
	$(BIN)/python -m pytest -m slow -n 2 --dist loadgroup --no-loadscope-reorder

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# The manual, in out/docs/index.html. A warning is an error; no network is needed once its packages are installed.
docs: $(READY)
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs out/docs

# The gallery's pages that are out of date, in docs/gallery: some minutes for all of them.
gallery: $(READY)
	$(BIN)/python docs/gallery/make.py

# The pages of measured results that are out of date, in docs/measured, or `make pages STUDY=goddard-table3`: all in about eight hours on two
# processors. Stopped, the same again goes on. `python docs/measured/make.py --check` says which are out of date and why.
pages: $(READY)
	$(BIN)/python docs/measured/make.py $(STUDY)

# Changes the lines that judge, one by one, and counts what the tests notice: about an hour, or one with `make mutants MODULE=dominance`.
mutants: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[test,mutants]"
	$(BIN)/python tests/mutants.py $(MODULE)

# By hand: random problems and black boxes, about an hour; a hundred kills at random times, some minutes. A minute of each is in `test-slow`.
fuzz: $(READY)
	$(BIN)/python tests/fuzz/fuzzing.py --flights 2000 --boxes 1000

kills: $(READY)
	$(BIN)/python tests/runs/kills.py --kills 100

# The wheel and the source distribution, in dist/, built and tried in a fresh environment away from this folder: some minutes, and the network.
package: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[package]"
	$(BIN)/python tests/package.py

$(READY): pyproject.toml constraints.txt
	@$(PYTHON) -c "import sys; sys.exit(sys.version_info < (3, 11))" || \
	  { echo "MACS needs Python 3.11 or newer; say which one with: make PYTHON=/path/to/python3.11" >&2; exit 1; }
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[test]"
	touch $(READY)

clean:
	rm -rf .venv out build dist docs/api/generated .pytest_cache .mypy_cache .ruff_cache .hypothesis *.egg-info
