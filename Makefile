# Everything a person needs from a fresh clone. On a bare Debian 12: apt-get install make python3 python3-venv
# `make` alone says what there is.

PYTHON ?= python3
MODE ?= demo
TESTS ?=
JOBS ?= auto
VENV := .venv
BIN := $(VENV)/bin
UV_VERSION := 0.13.9

UV := $(shell command -v uv 2>/dev/null)
ifeq ($(UV),)
UV := .uv/bin/uv
UV_WANTED := .uv/bin/uv
endif
export UV_PYTHON_DOWNLOADS := never
ifneq ($(wildcard /etc/ssl/certs/ca-certificates.crt),)
# a network with its own certificate authority has it there
export UV_SYSTEM_CERTS := true
endif
PIP := $(UV) pip install --quiet --python $(BIN)/python

.DEFAULT_GOAL := help
.PHONY: help run test install install-dev lint bench lock warmup clean

help: ## say what there is
	@echo "Airside: surveillance of the airport surface"; echo
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1|\2/p' $(MAKEFILE_LIST) | while IFS='|' read -r goal text; do \
	  printf '%-20s %s\n' "$$goal" "$$text"; done
	@echo; echo "  make run MODE=serve AIRSIDE_SETTINGS=airside.toml    runs it on your own sensors"

run: install ## run the demonstration at http://127.0.0.1:8000 (another port: AIRSIDE_PORT=8080 make run)
	@exec $(BIN)/airside $(MODE)

test: install-dev ## run all tests, a process a processor (some: TESTS=tests/pipeline/alert make test; fewer: JOBS=1)
	$(BIN)/python -m pytest -n $(JOBS) --dist loadfile -rs $(TESTS)

install: $(VENV)/.installed ## make .venv with what running needs, from requirements.lock

install-dev: $(VENV)/.installed-dev ## make .venv with what testing and linting need too

lint: install-dev ## ruff, mypy, and the type check of static/ where node is installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	@if command -v npm >/dev/null && [ -f package-lock.json ]; then \
	  npm ci --silent --no-audit --no-fund && npm run --silent check && echo "static/: types are sound"; \
	else echo "lint: SKIPPED the type check of static/ (node and npm are not installed)"; fi

bench: install ## measure the stages, the delay and the feed on this machine
	$(BIN)/airside bench

warmup: install ## compile all kernels now, so that the next start is quick
	$(BIN)/airside warmup

lock: $(UV_WANTED) ## work out both lock files anew from pyproject.toml
	$(UV) pip compile -q --universal --generate-hashes --no-emit-index-url --no-header --python-version 3.11 \
	  pyproject.toml --extra build --extra dev -o requirements-dev.lock
	@# the versions that are tested are the versions that run
	$(UV) pip compile -q --universal --generate-hashes --no-emit-index-url --no-header --python-version 3.11 \
	  --constraint requirements-dev.lock pyproject.toml --extra build -o requirements.lock

clean: ## remove everything that was made here (not data/)
	rm -rf $(VENV) .uv node_modules build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis .benchmarks
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

.uv/bin/uv:
	@command -v $(PYTHON) >/dev/null || { echo "Python 3.11 or later is needed: apt-get install python3 python3-venv" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { \
	  echo "$(PYTHON) cannot make virtual environments: apt-get install python3-venv" >&2; exit 1; }
	@echo "fetching uv $(UV_VERSION) into .uv/"
	@rm -rf .uv && $(PYTHON) -m venv .uv
	@.uv/bin/pip install --quiet --disable-pip-version-check uv==$(UV_VERSION) || { rm -rf .uv; exit 1; }

$(BIN)/python: | $(UV_WANTED)
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] < (3, 14))' || { \
	  echo "Python 3.11, 3.12 or 3.13 is needed; choose one with: make PYTHON=python3.11 $(MAKECMDGOALS)" >&2; exit 1; }
	@$(UV) venv --quiet --python "$$($(PYTHON) -c 'import sys; print(sys.executable)')" $(VENV)

$(VENV)/.installed: requirements.lock pyproject.toml | $(BIN)/python
	@echo "installing what Airside needs into $(VENV)/"
	@$(PIP) --require-hashes -r requirements.lock
	@$(PIP) --no-deps --no-build-isolation --editable .
	@touch $@

$(VENV)/.installed-dev: requirements-dev.lock pyproject.toml | $(BIN)/python
	@echo "installing what Airside's tests need into $(VENV)/"
	@$(PIP) --require-hashes -r requirements-dev.lock
	@$(PIP) --no-deps --no-build-isolation --editable .
	@touch $@ $(VENV)/.installed
