# make demo, make test: each does all its own set-up.

SHELL := bash
.DEFAULT_GOAL := help
.PHONY: help demo scan test test-long bits build run-only with-tests setup lint site figures notebooks maps laws bench soak torture clean

# What a rebuild of the workspace depends on. Python sources are linked, not copied: editing them needs no rebuild,
# adding a file does.
PACKAGES := afm_model msgs afm_node_common afm_sim_node afm_controller_node afm_recorder_node afm_bringup tests
MANIFESTS := $(foreach p,$(PACKAGES),$(wildcard $(p)/src/* $(p)/package.xml $(p)/setup.py $(p)/setup.cfg $(p)/CMakeLists.txt $(p)/msg/*.msg $(p)/srv/*.srv $(p)/action/*.action $(p)/launch/*.py $(p)/config/*))
BUILT := ros2_ws/install/.built

help:
	@echo "make demo    close the paper's loop over ROS 2 topics; results in out/demo"
	@echo "make scan    approach, scan an image, withdraw; picture, .gwy, recording, table in out/scan; ARGS="--mode tapping""
	@echo "make test    run all tests; what fails first is kept in out/first_failures.txt"
	@echo "make test-long many more examples at random, and the long tests (SEED=...: the same again)"
	@echo "make bits    compare every bit of some 85 short runs with those kept (python tests/bits.py --write: keep these)"
	@echo "make build   set up and build only; then: . ./env.sh"
	@echo "make lint    check style and types"
	@echo "make site    all pages as a site, with a reference made from the code: out/site/index.html"
	@echo "make figures draw the figures of docs/paper.md again"
	@echo "make notebooks run the notebooks of notebooks/ and keep their figures in them"
	@echo "make maps    draw again where each law holds: docs/figures/maps, bode (some minutes)"
	@echo "make laws    make the tables of docs/laws.md and docs/predictive.md again, and the picture of wrong models (some minutes)"
	@echo "make bench   measure speed, each figure beside its floor (about 10 minutes on an idle machine)"
	@echo "make soak    a session for half an hour; what it uses has to stay what it was (ARGS=\"--minutes 5\": shorter)"
	@echo "make torture what is killed, stopped, filled or confused, and what then becomes of a run (about half an hour;"
	@echo "             ARGS=\"--tries 2\": a few of each; ARGS=--resume: go on with one that was stopped)"
	@echo "make clean   remove what was built, .venv and out/"

setup:
	@tools/bootstrap.sh

# Three sets of packages, each with a lock: what the nodes need, the extras of afm_model, what only tests need.
build: run-only
	@tools/add.sh extras

with-tests: build
	@tools/add.sh test

run-only: setup
	@if [ ! -e $(BUILT) ] || [ .venv/.complete -nt $(BUILT) ] || [ -n "$$(find $(MANIFESTS) -newer $(BUILT))" ]; then tools/build.sh; fi
	@[ ! -w afm_model ] || .venv/bin/python -m compileall -q $(wildcard afm_*/afm_*)

demo: run-only
	@. ./env.sh && ros2 run afm_bringup session closed_loop_tanh --out out/demo

scan: build
	@. ./env.sh && ros2 run afm_bringup scan --out out/scan $(ARGS)

test: with-tests
	@. ./env.sh && tools/test.sh

# Examples that no run has tried before: ten times as many, from a seed that is printed.
SEED ?= $(shell date +%s)
test-long: with-tests
	@echo "The seed is $(SEED); the same examples again: make test-long SEED=$(SEED)"
	@. ./env.sh && python -m pytest --numprocesses auto --maxprocesses 4 --dist loadfile -m "hypothesis or long" \
	  --timeout 0 --hypothesis-profile random --hypothesis-seed $(SEED)

bits: build
	@. ./env.sh && python tests/bits.py

lint: build
	@. ./env.sh && python -m pip install --quiet --disable-pip-version-check -r requirements/lint.txt && tools/lint.sh

# A warning is an error.
site: setup
	@.venv/bin/python -m pip install --quiet --disable-pip-version-check -r requirements/site.txt && NO_MKDOCS_2_WARNING=1 .venv/bin/mkdocs build --quiet
	@echo "out/site/index.html; with the search, which browsers refuse to pages from the disk: python3 -m http.server -d out/site"

figures: with-tests
	@. ./env.sh && python tools/make_figures.py

notebooks: with-tests
	@. ./env.sh && python -m pip install --quiet --disable-pip-version-check -r requirements/notebooks.txt && python tools/make_notebooks.py

maps: with-tests
	@. ./env.sh && python tools/make_maps.py

laws: with-tests
	@. ./env.sh && python tools/make_laws.py --write

bench: with-tests
	@. ./env.sh && python tests/bench

# Both write their figures into docs/reliability.md unless they are given arguments.
ARGS ?= --page docs/reliability.md
soak: with-tests
	@. ./env.sh && PYTHONPATH="$$PWD/tests$${PYTHONPATH:+:$$PYTHONPATH}" python tests/soak $(ARGS)

torture: with-tests
	@. ./env.sh && PYTHONPATH="$$PWD/tests$${PYTHONPATH:+:$$PYTHONPATH}" python tests/torture $(ARGS)

clean:
	rm -rf .venv out ros2_ws/build ros2_ws/install ros2_ws/log
