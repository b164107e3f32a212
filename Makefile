# Everything works from a fresh clone with Python 3.11 and make; each target sets up what it needs.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
# tests start programs a hundred times: each would compile all of the source anew
unexport PYTHONDONTWRITEBYTECODE
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
LIVE := $(VENV)/.installed-live

.PHONY: setup demo live franka learn ros2 units meshes browser docs micropython test test-quick test-contracts test-skipped test-slow soak golden golden-values lint house bench peers \
	format wheel clean

setup: $(STAMP)

# what the page needs; everything for development and the lab comes with the next of `demo`, `test` and others
$(LIVE): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "Python 3.11 or newer is needed: say make PYTHON=/path/to/python3.11"; exit 1; }
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/python tools/install.py -c constraints.txt -e '.[live]'
	@$(BIN)/pretouch warm-up
	@touch $@

$(STAMP): $(LIVE) fci/pyproject.toml lab/pyproject.toml
	@$(BIN)/python tools/install.py -c constraints.txt -e '.[dev,figures,live,parquet]' -e ./fci -e './lab[sweep]'
	@touch $@

demo: setup
	$(BIN)/pretouch demo

live: $(LIVE)
	$(BIN)/pretouch live

# the vendor's libraries for the Panda and the FR3, 30 MB
franka: setup
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[franka]'

# Gymnasium, for the environment of the lab
learn: setup
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e './lab[learn]'

# what writes to sensor units over USB
units: setup
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[units]'

# DDS, which ROS 2 speaks: no ROS installation is needed
ros2: setup
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ./ros2

# what reads COLLADA meshes, and descriptions of arms with such meshes: 131 MB
meshes: setup
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[meshes]'

# what the tests of the page need beside a Chromium of the system's; without both they are skipped
browser: setup
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[browser]'

# the documentation site, as build/site
docs: setup
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[docs]'
	$(BIN)/python -m tools.site

# MicroPython in Node, which the tests of the firmware run in beside CPython; without it that half is skipped
micropython:
	@mkdir -p build/micropython && cp firmware/package.json build/micropython/
	npm install --prefix build/micropython --no-package-lock --no-audit --no-fund --silent

# how many examples properties are tried with; EXAMPLES=nightly for four times as many
EXAMPLES ?= pretouch
# what a test run says at its end: the fifty slowest tests, and what was skipped for which extra
PYTEST := $(BIN)/pytest --durations=50 --durations-min=1 --hypothesis-profile=$(EXAMPLES)

test: setup
	$(PYTEST) -n 2 --dist worksteal -m "not slow" --list-skipped=build/skipped

# imports, a trial, a recording and its replay, the page's start: whether another Python works
test-quick: setup
	$(PYTEST) -n 2 -m "not slow" tests/test_compiled.py tests/test_controller.py lab/tests/experiments/test_avoidance.py \
		tests/recording/test_writer.py tests/test_cli_replay.py tests/page/test_serve_live.py

# the files in which the last `make test` skipped something, with the real libraries, and the page in a browser
test-contracts: setup
	@test ! -s build/skipped || $(PYTEST) -n 2 --dist worksteal -m "not slow" \
		--skip-only="make meshes,make learn" $$(cat build/skipped)
	$(PYTEST) -n 2 --dist worksteal -m "not alone" --skip-only= tests/page/test_page_in_browser.py

# the same files once all that they need is installed: nothing may be skipped now
test-skipped: setup
	@test ! -s build/skipped || $(PYTEST) -n 2 --dist worksteal -m "not slow" --skip-only= $$(cat build/skipped)

test-slow: setup
	$(PYTEST) -n 2 --dist worksteal -m "slow and not alone" --skip-only=
	$(PYTEST) -n 0 -m alone --skip-only=

# two hours of everything at once, as long as nothing goes wrong (SECURITY.md); MINUTES=10 for fewer
MINUTES ?= 120
soak: franka
	$(BIN)/python -m fci.tests.soak --minutes $(MINUTES)

# every field of every control step, to the bit, here and in the commit BASE (docs/explanation/design.md, golden steps)
BASE ?= HEAD
golden: setup
	$(BIN)/python -m tests.golden $(BASE) $(foreach name,$(WITHOUT),--without "$(name)")

# the values the default tests hold: renewed only where the arm is meant to do something else, in a commit of its own
golden-values: setup
	$(BIN)/python -m tests.golden.values

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m tools.house.words
	PYTHONPATH=ros2/src $(BIN)/lint-imports  # where DDS is not installed

# what the house is like beside what is aimed at; fails where it is beyond what is held
house: setup
	PYTHONPATH=ros2/src $(BIN)/python -m tools.house

# how fast a simulation is, and what the receiver of sensor units takes
bench: setup
	$(BIN)/python -m pretouch_lab.bench.throughput
	$(BIN)/python -m tests.units.flood

# a quarter of an hour: sets up an environment for each peer, measures, and shows the tables of docs/explanation/peers.md
peers: setup
	$(BIN)/python -m lab.peers --set-up

# a wheel with machine code for this Python: an installation of it compiles nothing
wheel: setup
	$(BIN)/python -m tools.wheel

format: setup
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

clean:
	rm -rf $(VENV) build dist src/*.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
