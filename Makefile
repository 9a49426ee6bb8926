# hatlab: `make serve` runs it, `make test` proves it, `make help` lists the rest.
PYTHON ?= python3.11
# Address of a wheel index that holds a CPU build of PyTorch; empty: pip's own default.
TORCH_INDEX ?=
HOST ?= 127.0.0.1
PORT ?= 8000
WORKERS ?= 1
# Processes that share the tests.
JOBS ?= 2

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/pip --disable-pip-version-check install --quiet --constraint constraints.txt
RUNTIME := $(VENV)/.runtime
DEV := $(VENV)/.dev
NODE := node_modules/.installed
# Node 20 or newer, or nothing.
HAVE_NODE := $(shell node -e 'process.exit(Number(process.versions.node.split(".")[0]) >= 20 ? 0 : 1)' 2>/dev/null && echo yes)
RECIPE ?= models/recipes/parent-prototype-9.toml

.DEFAULT_GOAL := help
.PHONY: help serve test check format bench train learn torture screenshots docs figures tables clean hooks

help: ## list every target
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):[^#]*## */  make \1\t/' | expand -t 18

serve: $(RUNTIME) ## install, migrate, make the two demo studies, start the server and print the links
	@$(BIN)/hatlab init
	@$(BIN)/hatlab serve --host $(HOST) --port $(PORT) --workers $(WORKERS)

test: $(DEV) $(if $(HAVE_NODE),$(NODE)) ## run all tests (browser tests need Node 20 and Chromium)
	@.ci/need-browser "$(HAVE_NODE)"
	$(BIN)/python -m pytest -n $(JOBS) -m "not learn and not torture" --durations=25
	$(if $(HAVE_NODE),npm test --silent)

check: $(DEV) $(if $(HAVE_NODE),$(NODE)) ## lint, types, floors: what CI checks
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache
	$(BIN)/hadolint Dockerfile
	$(BIN)/check-jsonschema --builtin-schema vendor.compose-spec compose.yaml
	@.ci/need-browser "$(HAVE_NODE)"
	$(if $(HAVE_NODE),npm run --silent check)

format: $(DEV) $(if $(HAVE_NODE),$(NODE)) ## put every file into the agreed format
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(if $(HAVE_NODE),npm run --silent format)

bench: $(DEV) $(if $(HAVE_NODE),$(NODE)) ## print the speed of every hot path beside what it is compared with
	$(BIN)/python -m benchmarks

train: $(RUNTIME) ## train one recipe again: make train RECIPE=models/recipes/….toml
	$(BIN)/hatlab train $(RECIPE)

learn: $(DEV) ## slow tests: do the recipes still learn?
	$(BIN)/python -m pytest -m learn

torture: $(DEV) ## kill -9 the server under robots, and under a whole study with a made-up marketplace
	$(BIN)/python -m tests.torture

screenshots: $(RUNTIME) $(NODE) ## take the pictures of README and docs again (needs Node 20 and Chromium)
	node tests/e2e/screenshots.mjs docs/images

docs: $(DEV) ## write the generated documents again (data dictionary, journey, released agents)
	$(BIN)/python -m server.services.codebook > docs/data-dictionary.md
	$(BIN)/python -m server.web.journey_map > docs/journey.md
	$(BIN)/python -m models.roster > docs/released-agents.md

figures: $(RUNTIME) ## draw the paper's figures again from the released agents (a few minutes)
	$(BIN)/hatlab figures --out docs/figures

tables: $(RUNTIME) ## write docs/tables again from the stored cells, without training
	$(foreach table,table1 table2 parent-child human,$(BIN)/hatlab reproduce $(table) --no-run &&) true

hooks: ## run `make check` before every commit
	@printf '#!/bin/sh\nexec make check\n' > .git/hooks/pre-commit && chmod +x .git/hooks/pre-commit

clean: ## remove what was installed and built (never a database)
	rm -rf $(VENV) node_modules build *.egg-info artefacts

$(VENV)/bin/python:
	@command -v $(PYTHON) >/dev/null || { echo "hatlab needs Python 3.11: install it, or name yours with make PYTHON=…" >&2; exit 2; }
	$(PYTHON) -m venv $(VENV)

# PyTorch alone comes from its index, which holds other versions of what it needs; the rest comes from pip's default.
$(RUNTIME): $(VENV)/bin/python pyproject.toml constraints.txt
	$(PIP) --no-deps $(if $(TORCH_INDEX),--index-url $(TORCH_INDEX)) "torch==$$(sed -n 's/^torch==//p' constraints.txt)"
	$(PIP) --editable .
	@touch $@

$(DEV): $(RUNTIME)
	$(PIP) --editable '.[dev]'
	@touch $@

$(NODE): package.json package-lock.json
	npm ci --silent
	@touch $@
