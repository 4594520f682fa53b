# make demo: sets this machine up and runs the main job end to end      make test: sets up and passes the tests
# make bounds: tests of compiled loops, which then look whether they index within bounds
# make notebooks: runs the notebooks, and prints how long each takes; fails if a cell fails
# make docs: builds the pages of documentation, with an environment of its own (requirements-docs.lock)
# make results: all pages of results, in days; RESULTS=--smoke a short trial of each part, RESULTS=walks one page
# make lint: style, types, and words that are not the field's (docs/words.yaml)
# make lowest: tests, in an environment of their own, with the lowest versions that pyproject.toml allows
# make documents: types every command of docs, too, as `make test` does of README, and where nothing is compiled yet
RUN := runs/demo
# What is imported stays compiled, see setup.sh.
unexport PYTHONDONTWRITEBYTECODE
# A file's tests share what it makes; files begin in the order of tests/conftest.py. A worker that crashes ends the run
# with a failure: with another in its place, xdist waits for ever.
PYTEST := .venv/bin/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder --max-worker-restart 0

.PHONY: setup demo test bounds documents notebooks docs results lowest lint clean

setup:
	@./setup.sh

demo: setup
	@.venv/bin/radarsim simulate office -o $(RUN)/office.h5 --platform handheld --duration 40 --seed 0
	@.venv/bin/radarize run $(RUN)/office.h5 -o $(RUN)/doppler --odometry doppler --scans first-echo
	@.venv/bin/radarize run $(RUN)/office.h5 -o $(RUN)/learned --odometry learned
	@.venv/bin/radarize run $(RUN)/office.h5 -o $(RUN)
	@.venv/bin/radarize evaluate $(RUN) --beside $(RUN)/learned --beside $(RUN)/doppler
	@.venv/bin/radarize report $(RUN) --beside $(RUN)/learned --beside $(RUN)/doppler

test: setup
	@$(PYTEST) $(TESTS)

bounds: setup
	@NUMBA_BOUNDSCHECK=1 NUMBA_CACHE_DIR=build/bounds $(PYTEST) \
		$(or $(TESTS),tests/slam tests/odometry tests/propagation tests/receiver tests/fuzzing)

documents: setup
	@DOCUMENTS=1 .venv/bin/python -m pytest tests/documents

notebooks: setup
	@.venv/bin/python -m docs.notebooks

docs: setup
	@cmp -s requirements-docs.lock build/docs/.ready || { .venv/bin/python -m venv --clear build/docs && \
		build/docs/bin/python -m pip install -qq --no-deps -r requirements-docs.lock && \
		cp requirements-docs.lock build/docs/.ready; }
	@.venv/bin/python -m docs.notebooks --changed
	@build/docs/bin/jupyter nbconvert --log-level WARN --to markdown --output-dir build/notebooks/pages \
		build/notebooks/*.ipynb
	@.venv/bin/python docs/pages.py
	@NO_MKDOCS_2_WARNING=1 build/docs/bin/mkdocs build --strict --quiet
	@echo build/site/index.html

results: setup
	@.venv/bin/python -m benchmarks.make $(RESULTS)
	@.venv/bin/python -m benchmarks.figures

lowest:
	@$(or $(PYTHON),python3) -m venv --clear build/lowest && build/lowest/bin/python -m pip install -qq uv
	@build/lowest/bin/uv pip install -q --python build/lowest --resolution lowest-direct '.[test]'
	@NUMBA_CACHE_DIR=build/kernels build/lowest/bin/python -m pytest $(or $(TESTS),tests/radar tests/world tests/slam \
		tests/io/importers tests/io/exporters tests/io/test_recording.py tests/io/test_hdf5.py tests/learning/nets \
		tests/evaluation tests/pipeline/test_pipeline.py tests/recording/test_simulate.py tests/test_cli.py)

lint: setup
	@.venv/bin/ruff check .
	@.venv/bin/ruff format --check .
	@.venv/bin/mypy --cache-dir build/mypy
	@.venv/bin/python docs/words.py

clean:
	rm -rf .venv $(RUN) build *.egg-info
