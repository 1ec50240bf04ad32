# bevy_burrow: diggable ground for Bevy. `make help` lists what can be done.
#
# One feature set and one profile for everything that compiles Bevy, so that it is compiled once:
#   without Bevy   cargo ... --no-default-features --features cuda,net,store,import,scatter,navigation   the model: tests, soak
#   with Bevy      cargo ... --release --features examples           the plugin and the examples
#
# Builds are in CARGO_TARGET_DIR, outside the clone unless set otherwise.

SHELL := /bin/sh
export PATH := $(HOME)/.cargo/bin:$(PATH)
export CARGO_TARGET_DIR ?= $(HOME)/.cache/bevy_burrow/target

WITHOUT_BEVY := --no-default-features --features cuda,net,store,import,scatter,navigation
comma := ,
# What somebody may choose besides.
SETS_WITHOUT_BEVY := '' format store net import scatter navigation
SETS_WITH_BEVY := plugin replicon render avian egui debug render,scatter landmass picking
# Those that need headers.
SETS_WITH_HEADERS := examples,gamepad examples,sound
# Features besides: `make run MORE=gamepad` or MORE=gamepad,sound compiles some crates more.
WITH_BEVY := --release --features examples$(MORE:%=$(comma)%)
# `make run` has sound where it compiles: on Linux that takes ALSA's headers.
SOUND = $(shell { [ "$$(uname -s)" != Linux ] || pkg-config --exists alsa 2>/dev/null; } && echo $(comma)sound)

# Tests of the plugin open with #![cfg(feature = ...)]; the others test the model, and need not run twice. Those of plants and of
# navigation have parts of both kinds.
PLUGIN_TESTS := $(patsubst tests/%,--test %,$(patsubst %/main,%,$(basename \
	$(shell grep -ls '^.!.cfg.feature' tests/*.rs tests/*/main.rs)))) --test scatter --test navigation

# Examples that save pictures without a display.
DRAWING := digger sculpt physics custom_material agents

# Random worlds of `make soak`.
WORLDS ?= 10000
# Repeats of each run of `make paper`.
REPEATS ?= 10
# Where `make test` saves pictures and meshes.
PROOF := $(CARGO_TARGET_DIR)/proof

# In CI, a test without a GPU, compiler or renderer fails instead of being skipped. Only Linux can
# have all of them.
ifeq ($(CI) $(shell uname -s),true Linux)
export BURROW_REQUIRE ?= 1
endif

.NOTPARALLEL:
.PHONY: help setup run example test test-model test-plugin test-examples features features-model features-plugin features-bevy drive soak crowd paper figures pictures scenes bench bench-backends peers instructions ptx sanitize

help: ## List the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-12s %s\n", $$1, $$2 }' Makefile

run: ## Install what is missing, then dig: first person on a real landscape (ARGS="--headless" for pictures only, MORE=gamepad)
	@tools/setup.sh run
	cargo run $(WITH_BEVY)$(if $(findstring sound,$(MORE)),,$(SOUND)) --example digger -- $(ARGS)

example: ## Run another example (NAME=sculpt ARGS="--headless")
	@tools/setup.sh run
	cargo run $(WITH_BEVY) --example $(NAME) -- $(ARGS)

test: setup test-model test-plugin test-examples ## Install what is missing, then run every test
	@tools/setup.sh skipped

setup: ## Install what is missing
	@tools/setup.sh test

# Model tests, in the dev profile: optimised, with overflow checks. Their examples in the documentation run with the plugin's.
test-model:
	cargo test $(WITHOUT_BEVY) --lib --tests --example export --example figures --example paper

# Optimising the library with its tests takes longer than these tests do.
test-plugin:
	cargo test --config 'profile.release.package.bevy_burrow.opt-level=0' $(WITH_BEVY) --lib -- threads:: plugin:: saves:: together:: view:: physics:: panel:: debug:: plants:: paths:: brush::request:: brush::shapes::mesh_grid::
	cargo test $(WITH_BEVY) $(PLUGIN_TESTS) --example digger --example minimal --example physics --example sculpt --example server --example together
	cargo test $(WITH_BEVY) --doc

# The examples as a user starts them. For those that draw, a test checks that pictures are made in time and show ground.
test-examples:
	cargo build $(WITH_BEVY) $(DRAWING:%=--example %)
	cargo test $(WITH_BEVY) --test pictures -- --ignored --nocapture
	rm -rf '$(PROOF)/export' && mkdir -p '$(PROOF)'
	cargo run $(WITH_BEVY) --example server -- --script examples/server/brushes.jsonl
	@cargo run $(WITH_BEVY) --example server -- --brushes 2000 2>'$(PROOF)/server.txt' | head -n 1 && \
		! grep panicked '$(PROOF)/server.txt' && echo 'server: ends where nobody reads on'
	cargo run $(WITH_BEVY) --example together -- loopback --count 4 --seconds 5
	cargo run $(WITHOUT_BEVY) --example export -- --heights assets/jacksboro_fault.png --voxels-per-sample 3 \
		--height-range 0 150 --edits examples/export/edits.jsonl --chunk-size 32 --out '$(PROOF)/export'
	@grep -q '"flawless": true' '$(PROOF)/export/report.json' && echo 'export: the mesh is flawless'
	@$(MAKE) --no-print-directory drive

features: features-model features-plugin features-bevy ## Lint every set of features that can be chosen (features-model: those without Bevy)

features-model:
	@tools/setup.sh lint
	@set -e; for set in $(SETS_WITHOUT_BEVY); do \
		echo "features: $$set"; \
		cargo clippy --no-default-features --features "$$set" --lib -- -D warnings; \
	done
	cargo clippy $(WITHOUT_BEVY) --all-targets -- -D warnings

# With one build of Bevy. A test has to be there, or the dev-dependencies choose other features.
features-plugin:
	@tools/setup.sh lint
	@set -e; for set in $(SETS_WITH_BEVY); do \
		echo "features: $$set"; \
		cargo clippy --release --no-default-features --features "$$set,example_crates" --lib --test structure -- -D warnings; \
	done

# With the features of Bevy that each set chooses itself, so that much is checked anew.
features-bevy:
	@MORE=gamepad,sound tools/setup.sh lint
	@set -e; for set in $(SETS_WITH_BEVY) $(SETS_WITH_HEADERS); do \
		echo "features: $$set"; \
		cargo clippy --release --no-default-features --features "$$set" --all-targets -- -D warnings; \
	done

# They are drawn on a separate display, which needs the same libraries as any other.
drive: ## Play sculpt and the digger with real mouse and keyboard input under Xvfb; skipped where it can't be installed
	@DISPLAY=$${DISPLAY:-:0} tools/setup.sh drive
	cargo build $(WITH_BEVY) --example sculpt --example digger
	@for play in sculpt digger; do \
		python3 tools/drive.py $$play --out out/drive/$$play; status=$$?; \
		[ $$status -eq 0 ] || [ $$status -eq 77 ] || exit $$status; \
	done

soak: ## Dig WORLDS (10000) random worlds; check every seam, and compare every mesh with the reference mesher
	@tools/setup.sh build
	BURROW_WORLDS=$(WORLDS) cargo test --release $(WITHOUT_BEVY) --test seams --test plain --test increments -- --nocapture

crowd: ## 1,000 balls and 100 walkers for a minute, on ground that is dug ten times a second; nobody falls through or jumps
	@tools/setup.sh test
	BURROW_CROWD=1000 cargo test $(WITH_BEVY) --test physics crowd -- --nocapture

paper: ## Repeat the paper's experiment; overwrites docs/RESULTS.md and docs/plots, without GPU columns if there is no GPU (REPEATS=10)
	@tools/setup.sh build
	RUSTC_VERSION="$$(rustc --version)" cargo run --release $(WITHOUT_BEVY) --example paper -- --out out/paper --results docs/RESULTS.md --repeats $(REPEATS)

bench: ## Compare the dense mesher with public crates (ARGS="--quick" for a short look)
	@tools/setup.sh build
	cargo bench $(WITHOUT_BEVY) --bench meshers -- $(ARGS)

bench-backends: ## Compare the CPU with a CUDA GPU (ARGS="craters sweep" for some sections only)
	@tools/setup.sh build
	cargo bench $(WITHOUT_BEVY) --bench backends -- $(ARGS)

sanitize: ## Run the kernels' tests under compute-sanitizer on a GPU, or in an emulator that watches its own memory (BURROW_WORLDS=20 BURROW_RACE_WORLDS=1)
	@tools/setup.sh build
	@tools/sanitize.sh

ptx: ## Compile the CUDA kernels to PTX again; needs no GPU (ARGS=--check to compare only)
	@tools/setup.sh ptx
	@python3 tools/ptx.py $(ARGS)

peers: ## Compare the dense mesher with VTK, scikit-image and PyMCubes, installed outside the clone (ARGS=--gpu: GPU meshers)
	@tools/peers.sh $(ARGS)

instructions: ## Count the instructions of fixed workloads; fails where they grew (ARGS=--update for a new baseline)
	@tools/instructions.sh $(ARGS)

figures: ## Draw the figures of the guide
	cargo run $(WITHOUT_BEVY) --example figures

scenes: ## Render views of one country, and swatches of all layers, to look at (out/scenes; BURROW_ONLY=pit,works, BURROW_SIZE=1280x720)
	BURROW_SCENES=$(CURDIR)/out/scenes cargo test $(WITH_BEVY) --test golden -- --ignored --nocapture scenes_are_rendered

pictures: ## Render the still pictures of the README
	@tools/setup.sh run
	cargo run $(WITH_BEVY) --example digger -- --headless --plants --width 960 --height 540 --out out/pictures
	cargo run $(WITH_BEVY) --example sculpt -- --headless --width 960 --height 540 --out out/pictures/sculpt
	mkdir -p docs/pictures
	cp out/pictures/sculpt/2_sculpted.png docs/pictures/panel.png
	BURROW_SCENES='$(CURDIR)/docs/pictures' BURROW_ONLY=import BURROW_SIZE=960x540 cargo test $(WITH_BEVY) --test golden -- --ignored scenes_are_rendered
	cd out/pictures && cp 1_landscape.png 3_tunnel_outside.png 4_tunnel_inside.png 7_bridge.png 9_seam.png ../../docs/pictures/
