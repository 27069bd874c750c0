# Needs python3 (>= 3.11), make and git; everything else comes by pip into .venv.
PYTHON ?= python3
VENV := .venv
RELEASE := .venv-release
BIN := $(VENV)/bin
OUT ?= demo-out
WORKERS ?= 2
RULES := tests/test_layout.py tests/test_prose.py
# Kernels are compiled single-threaded; more threads of numpy's library only disturb each other.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

# Tests start many processes: each compiles what it imports anew where bytecode may not be kept.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: browsers native demo test nightly check style types rules page docs records bench clean FORCE lock sbom mutation fuzz

demo: $(VENV)/installed
	$(BIN)/cuecast demo --out $(OUT)

# Two workers for two cores: live tests keep time with the clock. Tests of one file share what they
# made, and files that take long come first (tests/conftest.py). CHECKED: files that ran already.
test: $(VENV)/installed
	$(BIN)/python -m pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder $(CHECKED:%=--ignore=%)

# Firefox for the player's slow tests, with what it decodes AAC by and a sound device to play to.
browsers:
	apt-get update && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends \
	  chromium firefox-esr libavcodec59 pulseaudio

# Everything, the slow sweeps too, to its end whatever fails; `make browsers` first, as root.
nightly: $(VENV)/installed
	$(BIN)/python -m pytest -m "slow or not slow"

# Side by side with `make -j 2 check`: types take as long as the rest together.
check: style types rules page

style: $(VENV)/installed
	$(BIN)/ruff check
	$(BIN)/ruff format --check

types: $(VENV)/installed
	$(BIN)/mypy

rules: $(VENV)/installed
	$(BIN)/reuse lint --quiet
	$(BIN)/python -m pytest -q -n 0 $(RULES)

page: node_modules/installed
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/npm run --silent lint
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/npm run --silent types

docs: $(VENV)/installed
	$(BIN)/python -m docs.generate site

# Measures the figures of docs/ again; CLIPS and FILMS are folders of sounds and films.
RECORDS := codec synthesis chain audio models capture video
records: $(VENV)/installed $(RECORDS:%=docs/records/%.json)
	$(BIN)/python -m docs.generate

docs/records/%.json: FORCE
	$(BIN)/cuecast evaluate $* --record $@ > /dev/null
	$(if $(and $(CLIPS),$(filter audio,$*)),$(BIN)/cuecast evaluate audio --clips $(CLIPS) --record docs/records/audio-clips.json > /dev/null)
	$(if $(and $(FILMS),$(filter video,$*)),$(BIN)/cuecast evaluate video --clips $(FILMS) --record docs/records/video-clips.json > /dev/null)

FORCE:

# The receiver in C as a shared library and a WebAssembly module, by zig from PyPI.
native: $(VENV)/installed
	$(BIN)/python -m pip install --quiet --group native
	$(BIN)/python -m receiver.native.build library
	$(BIN)/python -m receiver.native.build wasm

# What a release is installed with: `pip install --require-hashes -r requirements.lock`.
lock: $(VENV)/installed
	$(BIN)/python -m pip install --quiet --group supply
	$(BIN)/uv pip compile --quiet pyproject.toml --extra c3d --universal --generate-hashes \
	  --python-version 3.11 --no-header --output-file requirements.lock

# What is in it, with licences: CycloneDX, of an environment made from the lock.
sbom: $(VENV)/installed
	$(BIN)/python -m pip install --quiet --group supply
	$(PYTHON) -m venv --clear $(RELEASE)
	$(RELEASE)/bin/python -m pip install --quiet --require-hashes --no-deps -r requirements.lock
	$(BIN)/cyclonedx-py environment $(RELEASE)/bin/python --pyproject pyproject.toml \
	  --output-file sbom.cdx.json
	rm -rf $(RELEASE)

# Changes the core rooms line by line and counts what the tests do not notice: hours.
mutation: $(VENV)/installed
	$(BIN)/python -m pip install --quiet --group mutation
	$(BIN)/python -m tests.mutation $(ROOMS)

# Feeds every target with mutated bytes: an hour by default, divided among them.
FUZZ_S ?= 3600
fuzz: $(VENV)/installed
	$(BIN)/python -m pip install --quiet --group fuzz
	$(BIN)/python -m tests.fuzz.night --seconds $(FUZZ_S)

bench: $(VENV)/installed
	$(BIN)/python -m pytest tests/bench -o python_files="bench_*.py" -m "slow or not slow"

clean:
	rm -rf $(VENV) $(RELEASE) node_modules site $(OUT) .mypy_cache .pytest_cache .ruff_cache .benchmarks

# Python compiles what is imported then: compiling all that is installed took longer than unpacking it.
$(VENV)/installed: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --no-compile --upgrade "pip>=25.1"
	$(BIN)/python -m pip install --quiet --no-compile --editable ".[c3d]" --group dev
	touch $@

# ESLint and TypeScript look over the television's page; node itself comes by pip.
node_modules/installed: package-lock.json $(VENV)/installed
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/npm ci --silent --no-fund --no-audit
	touch $@
