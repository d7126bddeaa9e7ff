# Two commands are enough on a fresh machine: `make demo` and `make test`.
.PHONY: demo test test-rare test-long test-stress test-faults test-cluster test-blender test-blender-program soak check bench screenshots manual setup clean
.DEFAULT_GOAL := help

BIN := .venv/bin

# The tests that need no cluster and no Blender, files side by side.
SUITE := --ignore tests/cluster --ignore tests/blender --ignore tests/soak/test_soak.py \
  -n auto --dist loadfile --no-loadscope-reorder

help:  ## Show this list
	@grep -hE '^[a-z%-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 16

setup:  ## Make .venv with everything pinned, and find an LLVM
	@bash deploy/setup.sh

demo: setup  ## Render scenes:box until it has converged; results in ./demo
	$(BIN)/plateau render scenes:box -D width=256 -D height=256 -o demo

test: setup  ## Run every test that a newcomer's machine can run
	$(BIN)/python -m pytest $(SUITE) --durations 20 $(OPTIONS)

test-cluster: setup  ## More than one machine: S3, Slurm, Ray, Kubernetes, networks (root on Debian); PARTS="s3 slurm"
	bash tests/cluster/install.sh $(PARTS)
	CLUSTER_TESTS=$(or $(CLUSTER_TESTS),long) $(BIN)/python -m pytest \
	  $(if $(PARTS),$(PARTS:%=tests/cluster/test_%*),tests/cluster) --durations 10 \
	  $(if $(filter short,$(CLUSTER_TESTS)),-n auto --dist loadfile --no-loadscope-reorder)

test-rare: setup  ## What is rare and dear: whole benches, wheel environments, long statistics; CI runs it too
	$(BIN)/python -m pytest $(SUITE) -m long --durations 10

test-long: test-rare  ## The same, and then the long forms of the statistical tests
	LONG_TESTS=1 $(BIN)/python -m pytest tests/statistical -m ""

test-stress: setup  ## The suite again and again, in random order, every second time beside LOAD busy processes; RUNS=20 LOAD=4
	@bash tests/stress.sh $(or $(RUNS),20) $(or $(LOAD),4) $(BIN)/python -m pytest -q $(SUITE)

test-faults: setup  ## The long fault suite; FAULT_MINUTES=30 FAULT_SEED=7 for the random part
	LONG_TESTS=1 FAULT_MINUTES=$(or $(FAULT_MINUTES),5) FAULT_SEED=$(or $(FAULT_SEED),1) \
	  $(BIN)/python -m pytest -s -m "" tests/faults tests/farm/bundle/test_bundle_fuzz.py \
	  tests/service/api/test_api_fuzz.py

soak: setup  ## A farm in use and under faults for two hours: nothing lost, nothing grows; SOAK_MINUTES=30 SOAK_SEED=7
	SOAK_MINUTES=$(or $(SOAK_MINUTES),120) SOAK_SEED=$(or $(SOAK_SEED),1) \
	  $(BIN)/python -m pytest -s tests/soak/test_soak.py

test-blender: setup  ## Blender's Cycles, in .venv-blender (2 GB, of which 400 MB are fetched; Python 3.11)
	bash tests/blender/install.sh
	.venv-blender/bin/python -m pytest tests/blender --ignore tests/blender/test_program.py --durations 10

test-blender-program: setup  ## The same by a `blender` program, on a Debian in .blender-program (3 GB; root on Debian)
	bash tests/blender/with_program.sh python -m pytest tests/blender --durations 10

check: export DENO_NO_UPDATE_CHECK = 1
check: setup  ## Style, types and the import law: what CI runs before the tests
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy $$($(BIN)/python -c 'import sys; print("--python-version=3.12" * (sys.version_info >= (3, 12)))')  # whose NumPy has other stubs
	$(BIN)/lint-imports
	$(BIN)/python -m tests.page.api_types plateau/service/page/api_types.d.ts
	$(BIN)/deno check --quiet plateau/service/page plateau/study/page
	$(BIN)/deno lint --quiet plateau/service/page plateau/study/page

bench: setup  ## Run every benchmark; results in bench/results
	@for file in bench/[!_]*.py; do $(BIN)/python -m bench.$$(basename $$file .py) || exit 1; done

bench-%: setup  ## Run one benchmark, bench/NAME.py
	$(BIN)/python -m bench.$*

screenshots: setup  ## Take the README's pictures of the web page (minutes; needs Chromium)
	$(BIN)/python -m tests.page.screenshots

manual: setup  ## Write docs/cli.md from the help of the commands, and what repeats the rules
	$(BIN)/python -m tests.cli_manual
	$(BIN)/python -m tests.rule_files

clean:  ## Remove .venv and caches
	rm -rf .venv .venv-blender .blender-program .mypy_cache .ruff_cache .pytest_cache .import_linter_cache demo
