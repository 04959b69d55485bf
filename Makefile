# make demo, make test: each does all its own set-up. `make help` lists the targets.

SHELL := bash
.DEFAULT_GOAL := help
.PHONY: help demo scan test test-long bits build run-only with-tests setup lint site release figures notebooks maps laws bench soak torture clean

# What a rebuild of the workspace depends on. Python sources are linked, not copied: editing them needs no rebuild,
# adding a file does.
PACKAGES := afm_model afm_predictive msgs afm_node_common afm_sim_node afm_controller_node afm_recorder_node afm_bringup afm_nanonis afm_ros2_control tests
MANIFESTS := $(foreach p,$(PACKAGES),$(wildcard $(p)/src/* $(p)/package.xml $(p)/setup.py $(p)/setup.cfg $(p)/CMakeLists.txt $(p)/msg/*.msg $(p)/srv/*.srv $(p)/action/*.action $(p)/launch/*.py $(p)/config/*))
BUILT := ros2_ws/install/.built

# Arguments of a tool: ARGS if given, otherwise its own defaults, or with QUICK=1 those of the short form.
arguments = $(or $(ARGS),$(if $(QUICK),$(2),$(1)))

# Every target that somebody calls says after ## what it does.
help:
	@sed -n 's/^\([a-z-]*\):.*## /make \1\t/p' Makefile | expand -t 16
	@echo "ARGS='...' gives arguments to the tool of scan, figures, notebooks, maps, laws, bench, soak and torture: make scan ARGS='--mode tapping'"
	@echo "QUICK=1 makes the short form of these, for a test that they run; it writes into out/quick and not into the docs"

# Scripts of .venv hold its path: those of a clone that was moved or copied would run nothing, or what the other clone has.
setup:
	@built=$$(sed -n 's/^command = .* //p' .venv/pyvenv.cfg 2> /dev/null); \
	if [ -n "$$built" ] && [ "$$built" != "$$(cd .venv && pwd -P)" ]; then \
	  echo "This clone was built in $${built%/.venv} and then moved or copied: it is set up again."; rm -rf .venv; \
	fi
	@tools/bootstrap.sh

# Three sets of packages, each with a lock: what the nodes need, the extras of afm_model, what only tests need.
build: run-only ## set up and build only; then: . ./env.sh
	@tools/add.sh extras

with-tests: build
	@tools/add.sh test

run-only: setup
	@if [ ! -e $(BUILT) ] || [ .venv/.complete -nt $(BUILT) ] || [ -n "$$(find $(MANIFESTS) -newer $(BUILT))" ]; then tools/build.sh; fi
	@[ ! -w afm_model ] || .venv/bin/python -m compileall -q $(wildcard afm_*/afm_*)

demo: run-only ## close the paper's loop over ROS 2 topics; results in out/demo
	@. ./env.sh && ros2 run afm_bringup session closed_loop_tanh --out out/demo

scan: build ## approach, scan an image, withdraw; picture, .gwy, recording and table in out/scan
	@. ./env.sh && ros2 run afm_bringup scan --out out/scan $(call arguments,,--pixels 16 --lines 8)

test: with-tests ## run all tests; what fails first is kept in out/first_failures.txt
	@. ./env.sh && tools/test.sh

# Examples that no run has tried before: ten times as many, from a seed that is printed.
SEED := $(or $(SEED),$(shell date +%s))
test-long: with-tests ## many more examples at random, and the long tests (SEED=...: the same again)
	@echo "The seed is $(SEED); the same examples again: make test-long SEED=$(SEED)"
	@. ./env.sh && python -m pytest --numprocesses auto --maxprocesses 4 --dist loadfile -m "hypothesis or long" \
	  --timeout 0 --hypothesis-profile random --hypothesis-seed $(SEED)

bits: build ## compare every bit of some 85 short runs with those kept (python tests/bits.py --write: keep these)
	@. ./env.sh && python tests/bits.py

lint: build ## check style and types
	@. ./env.sh && python -m pip install --quiet --disable-pip-version-check -r requirements/lint.txt && tools/lint.sh

# A warning is an error.
site: setup ## make a site of all pages, with a reference made from the code: out/site/index.html
	@.venv/bin/python -m pip install --quiet --disable-pip-version-check -r requirements/site.txt && NO_MKDOCS_2_WARNING=1 .venv/bin/mkdocs build --quiet
	@echo "out/site/index.html; with the search, which browsers refuse to pages from the disk: python3 -m http.server -d out/site"

release: build ## wheels of all packages and the site, from what is committed, tried in an empty environment: out/release
	@tools/release.sh

figures: with-tests ## draw the figures of docs/paper.md and docs/tuning.md again
	@. ./env.sh && python tools/make_figures.py $(call arguments,,--duration 2e-3 --dpi 40 --out out/quick/figures)

notebooks: with-tests ## run the notebooks of notebooks/ and keep their figures in them
	@. ./env.sh && python -m pip install --quiet --disable-pip-version-check -r requirements/notebooks.txt && python tools/make_notebooks.py $(call arguments,,--out out/quick/notebooks notebooks/tapping.ipynb)

maps: with-tests ## draw again where each law holds: docs/figures/maps, bode (some minutes)
	@. ./env.sh && python tools/make_maps.py $(call arguments,,--laws pid --cycles 0.6 --out out/quick/figures)

laws: with-tests ## make the tables of docs/laws.md and docs/predictive.md again, and the picture of wrong models (some minutes)
	@. ./env.sh && python tools/make_laws.py $(call arguments,--write,"predictive late")

bench: with-tests ## measure speed, each figure with its floor (about 10 minutes on an idle machine)
	@. ./env.sh && python tests/bench $(call arguments,,kernel --out out/quick/bench.json)

# Both write their figures into docs/reliability.md unless they are given arguments.
PAGE := --page docs/reliability.md
soak: with-tests ## a session for half an hour; what it uses has to stay what it was (ARGS='--minutes 5': shorter)
	@. ./env.sh && PYTHONPATH="$$PWD/tests$${PYTHONPATH:+:$$PYTHONPATH}" python tests/soak $(call arguments,$(PAGE),--minutes 0.2 --warm-up 2 --every 1 --out out/quick/soak)

torture: with-tests ## kill, stop, fill and confuse, and see what happens to a run (about an hour; ARGS='--tries 2': less; ARGS=--resume: go on)
	@. ./env.sh && PYTHONPATH="$$PWD/tests$${PYTHONPATH:+:$$PYTHONPATH}" python tests/torture $(call arguments,$(PAGE),--tries 1 --only "recorder killed" --out out/quick/torture)

clean: ## remove what was built, .venv and out/
	rm -rf .venv out ros2_ws/build ros2_ws/install ros2_ws/log
