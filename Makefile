# Each target does its own set-up on a bare Debian 12 or 13 machine, is quick when that is done, and says what it does.
SHELL := /bin/bash
.DEFAULT_GOAL := help
.PHONY: help setup demo test test-fast test-wheel test-debian13 wheel lint style serve firmware bench measured lock clean mutants flips fuzz fuzz-import hunt soak

# Containers forbid Python to keep what it compiled; then every process of the tests compiles all that it imports.
unexport PYTHONDONTWRITEBYTECODE

PYTHON := .venv/bin/python
TOOLS := env PATH="$(CURDIR)/.venv/bin:$$PATH"
DEBIAN_PACKAGES := python3-venv python3-dev python3-gi gir1.2-aravis-0.8 iproute2 gcc g++ gcc-arm-none-eabi make chromium fonts-dejavu-core
# For tests and linters alone: compiler and emulator of another processor, and npm, from wherever it came.
TEST_PACKAGES := cppcheck g++-aarch64-linux-gnu qemu-user $(shell command -v npm >/dev/null || echo nodejs npm)
FIRMWARE_PACKAGES := gcc gcc-arm-none-eabi libc6-dev make python3
DEBIAN13 := build/debian13
TARGETS := demo test
AS_ROOT := $(shell [ "$$(id -u)" = 0 ] || echo sudo)
KERNEL_SOURCES := $(shell find processing/kernels -name '*.[ch]pp' -o -name CMakeLists.txt)
FIRMWARE_SOURCES := $(shell find firmware -name '*.[chS]' -o -name 'image.*' -o -name Makefile)

# Those of the Debian packages that are missing.
define install
missing=$$(for name in $(1); do dpkg-query -W -f='$${db:Status-Status}' $$name 2>/dev/null | grep -qx installed || echo $$name; done); \
	if [ -n "$$missing" ]; then \
	    echo "Installing Debian packages:" $$missing; \
	    $(AS_ROOT) apt-get update -qq && \
	    $(AS_ROOT) env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $$missing >/dev/null; \
	fi
endef

# A network of its own, so that no camera broadcast leaves the machine; without it where the machine forbids user namespaces.
PRIVATE_NETWORK := $(shell unshare -rn true 2>/dev/null && echo .ci/private-network)
# Tests run side by side, up to four at a time, where each can have such a network; the addresses of cameras are the same.
TEST_WORKERS := $(shell n=$$(nproc); echo $$((n < 4 ? n : 4)))
SIDE_BY_SIDE := $(if $(PRIVATE_NETWORK),--dist worksteal --tx "$(TEST_WORKERS)*popen//python=$(PRIVATE_NETWORK) $(PYTHON)")
# Each has one processor: threads of a BLAS would wait for each other, which took two fifths of the CPU of some tests.
test test-fast test-wheel: export OPENBLAS_NUM_THREADS := 1

help: ## Show this list.
	@grep -hE '^[a-z0-9-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z0-9-]+):.*## /  make \1\t/' | expand -t 22

setup: .venv/.native firmware ## Install Debian packages, the Python environment and the native parts.

demo: setup ## Run the whole chain on the simulated rig; writes demo-out/report.html.
	$(PRIVATE_NETWORK) $(PYTHON) -m server.cli demo --out demo-out $(DEMO_OPTIONS)

# Types are checked beside the tests, which leave a processor idle now and then.
test: style build/rp2040js/node_modules ## Run linters and all tests.
	@.venv/bin/mypy >build/mypy.log 2>&1 & types=$$!; \
	$(PYTHON) -m pytest $(SIDE_BY_SIDE) $(TEST_OPTIONS); tests=$$?; \
	wait $$types; types=$$?; cat build/mypy.log; exit $$((tests || types))

# Quick ones; calibration, reconstruction, firmware, pages and cameras need the rest.
FAST_TESTS := $(wildcard tests/test_*.py tests/processing/test_*.py) tests/daq \
	$(addprefix tests/processing/,analysis runs synthetic) $(addprefix tests/server/,doctor pictures rig)
test-fast: setup ## Run ruff, import-linter and the quick tests, in less than two minutes of CPU.
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/lint-imports --no-cache
	$(PRIVATE_NETWORK) $(PYTHON) -m pytest -q -m "not slow and not network" $(FAST_TESTS)

wheel: setup ## Build a wheel, for all Linux whose glibc is not older than this one's, and an sdist; into dist/.
	@rm -rf build/wheel dist
	@$(TOOLS) pyproject-build --no-isolation --sdist --wheel --outdir build/wheel . >/dev/null
	@$(TOOLS) auditwheel repair --wheel-dir dist build/wheel/*.whl
	@mv build/wheel/*.tar.gz dist && ls dist

test-wheel: wheel ## Install the wheel into an environment without Aravis, and use it there.
	@/usr/bin/python3 -m venv --clear build/analysis
	@build/analysis/bin/python -m pip install --quiet --disable-pip-version-check --no-compile -c requirements.lock dist/*.whl
	$(PRIVATE_NETWORK) env TOMOSHADOW_PROGRAMS=$(CURDIR)/build/analysis/bin $(PYTHON) -m pytest tests/system/test_wheel.py

test-debian13: ## Run TARGETS="demo test" on a Debian 13 that debootstrap lays below DEBIAN13=build/debian13; needs root.
	@$(call install,debootstrap git)
	@$(AS_ROOT) .ci/debian13 $(DEBIAN13) $(TARGETS)

lint: style ## Run ruff, mypy, import-linter and cppcheck.
	.venv/bin/mypy

style: setup build/.test-packages
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/lint-imports --no-cache
	@$(MAKE) --no-print-directory -C firmware lint

serve: setup ## Start server and web page on the simulated rig, http://127.0.0.1:8080.
	$(PYTHON) -m server.cli serve --config configs/simulated.toml

bench: setup ## Measure kernels, recorder, commands and server, ten minutes; writes bench.json. BENCH_OPTIONS="--table docs/measured.md" renews the table there, BENCH_OPTIONS="--only average --table ..." some of its lines.
	@$(PRIVATE_NETWORK) env -u OPENBLAS_CORETYPE -u OPENBLAS_L2_SIZE $(PYTHON) -m server.cli bench --json $(BENCH_OPTIONS) | tail -n 1 >bench.json

measured: setup ## Write the tables of docs/measured.md anew, those of bench apart; ten minutes.
	@$(PRIVATE_NETWORK) $(PYTHON) -m tests.support.write_measured $(MEASURED)

firmware: $(FIRMWARE_SOURCES) | build/.toolchain ## Build the firmware: image for the Pico, core for this computer.
	@$(MAKE) --no-print-directory -C firmware host
	@if command -v arm-none-eabi-gcc >/dev/null; then $(MAKE) --no-print-directory -C firmware images; \
	else echo "No image for the Pico: arm-none-eabi-gcc is missing (apt install gcc-arm-none-eabi)"; fi

mutants: setup build/rp2040js/node_modules ## Shoot a long series and many plans, plant faults in the firmware, and show that its tests find each; fifteen minutes of CPU time.
	@TOMOSHADOW_SERIES_SHOTS=1000 TOMOSHADOW_PLANS=100 $(PYTHON) -m pytest -q tests/firmware/test_rp2040_waveform.py
	@$(PYTHON) firmware/tests/mutants.py $(MUTANTS)

fuzz-import: setup ## Damage manifests, tables and images in FUZZ_IMPORTS=2000 ways: each is imported or refused in a sentence.
	@$(PYTHON) -m tests.support.fuzz_import $(FUZZ_IMPORTS) 2>/dev/null

HUNT = $(if $(MINUTES),--minutes $(MINUTES)) $(if $(SEED),--seed $(SEED)) $(if $(CASES),--cases $(CASES)) \
	$(if $(WORLD),--world "$(WORLD)") $(if $(DISTORTIONS),--distortions "$(DISTORTIONS)") $(if $(AMOUNT),--amount $(AMOUNT))
hunt: export OPENBLAS_NUM_THREADS := 1
hunt: setup ## Hunt for lies for MINUTES=10: known sprays, distorted by chance, are measured and judged; build/hunt.jsonl keeps each. SEED=7 CASES=1 is one of them again; WORLD=few, DISTORTIONS="veil+gamma" and AMOUNT=0.5 choose. TABLE=lights writes the table of lights in docs/droplets-found.md anew.
	@$(PYTHON) -m $(if $(TABLE),tests.hunt.$(TABLE),tests.hunt --json build/hunt.jsonl $(HUNT))

soak: setup ## PART=kill: kill the server TIMES=100 times while it records, and count what is lost; goes on where it was interrupted. PART=faults: lose each device TIMES=10 times, and time the next run. PART=light: let everything go wrong in runs TIMES=20 times, and time how it becomes dark. PART=cluster: kill and cut off parts of a cluster TIMES=20 times. PART=workers: how busy two workers are with TIMES=16 shots. PART=long: record TIMES=10000 shots, count what is lost, and watch the memory.
	@$(PRIVATE_NETWORK) $(PYTHON) -m tests.support.soak_$(or $(PART),kill) $(TIMES)

flips: setup ## Flip 200 bits in flash, RAM and the state machines of an armed board, one at a time; six minutes of CPU time.
	@TOMOSHADOW_FLIPS=200 $(PYTHON) -m pytest -q tests/firmware/test_rp2040_bit_flips.py

fuzz: | build/.toolchain ## Feed the firmware's core hostile input by libFuzzer, for FUZZ_S=60 seconds.
	@$(call install,clang libclang-rt-dev)
	@$(MAKE) --no-print-directory -C firmware fuzz

# A second emulator of the Pico, for the tests alone; without it they skip what it would have to say.
build/rp2040js/node_modules: firmware/tests/rp2040js/package-lock.json | build/.test-packages
	@mkdir -p $(@D) && cp firmware/tests/rp2040js/package*.json $(@D)
	@npm ci --prefix $(@D) --silent --no-audit --no-fund --ignore-scripts && touch $@ || echo "No rp2040js: npm cannot install it"

lock: .venv/.python ## Pin the newest versions of all Python packages.
	$(PYTHON) -m pip install --quiet uv
	.venv/bin/uv pip compile --universal --python-version 3.11 --extra dev --no-emit-index-url --upgrade --quiet pyproject.toml -o requirements.lock

clean: ## Remove everything that was built.
	rm -rf .venv build dist demo-out .mypy_cache .ruff_cache .pytest_cache

.venv/.debian: Makefile
	@mkdir -p .venv
	@$(call install,$(DEBIAN_PACKAGES))
	@touch $@

build/.test-packages: Makefile
	@mkdir -p build
	@$(call install,$(TEST_PACKAGES))
	@touch $@

build/.toolchain: Makefile
	@mkdir -p build
	@$(call install,$(FIRMWARE_PACKAGES))
	@touch $@

# Both OpenCV packages own the folder cv2: whichever goes takes it from the one that stays.
REMOVE_CV2 := $(PYTHON) -m pip uninstall -qq --yes opencv-python-headless opencv-contrib-python-headless

.venv/.python: requirements.lock | .venv/.debian
	@echo "Installing Python packages into .venv"
	@/usr/bin/python3 -m venv --system-site-packages .venv
	@if compgen -G '.venv/lib/*/site-packages/opencv_python_headless-*' >/dev/null; then $(REMOVE_CV2); fi
	@$(PYTHON) -m pip install --quiet --disable-pip-version-check --no-compile -r requirements.lock
	@touch $@

# An editable install remembers where each module was, and finds one that has moved no more.
MODULES := $(sort $(shell find daq processing server tomoshadow -name '*.py'))
build/.modules: FORCE
	@mkdir -p build
	@echo $(MODULES) | cmp -s - $@ || echo $(MODULES) >$@
FORCE:

.venv/.native: .venv/.python pyproject.toml build/.modules $(KERNEL_SOURCES)
	@echo "Building the reconstruction kernels, installing tomoshadow into .venv"
	@$(PYTHON) -m pip install --quiet --disable-pip-version-check --no-build-isolation --no-deps --editable .
	@touch $@
