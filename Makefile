# The two commands that matter: `make demo` and `make test`.

CARGO ?= cargo
export CARGO_TERM_COLOR ?= auto

.PHONY: demo test test-browser test-faults faults test-containers lint build install runtime browser toolchain bench fuzz clean

# Builds, runs the paper's single-sensor campaign on a learned embedding, and says where its report is.
demo: build runtime
	./target/release/murmuration run examples/single-sensor-latent.toml

# Everything that must hold before a change lands. Every test is run; what failed is said at the end.
test: lint build runtime browser
	python="$$(scripts/python-packages $(CURDIR)/target/python)"; \
		bases="$$(tests/containers/base-images)" && \
		MURMURATION_TEST_BASES="$$bases" PATH="$${python:+$$python:}$$PATH" \
		$(CARGO) test --release --workspace --no-fail-fast

# The pages in a real browser alone; pictures of them land in target/screenshots.
test-browser: build browser
	$(CARGO) test --release -p murmuration-tests --test browser

# Faults against the real processes in a short form; `make faults` fires all of them, for more than an hour.
test-faults: build runtime
	$(CARGO) test --release --workspace --test faults

faults: build runtime
	MURMURATION_SCHEDULES=1000000 $(CARGO) test --release --workspace --lib schedules -- --nocapture
	MURMURATION_SCALE=long $(CARGO) test --release --workspace --test faults

# A cluster in containers, some of which are killed. Ignored where there is no Docker engine.
test-containers: build runtime
	bases="$$(tests/containers/base-images)" && \
		MURMURATION_TEST_BASES="$$bases" $(CARGO) test --release --workspace --test containers

lint: toolchain
	$(CARGO) fmt --all --check
	$(CARGO) clippy --release --workspace --all-targets -- -D warnings
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --release --workspace --no-deps
	scripts/validate-kubernetes $(CURDIR)/target/kubernetes-validate
	scripts/cargo-deny

build: toolchain
	$(CARGO) build --release --workspace --bins

# The programs, where cargo puts what it installs. INSTALL_ROOT names another folder.
INSTALL_ROOT ?= $(or $(CARGO_INSTALL_ROOT),$(CARGO_HOME),$(HOME)/.cargo)
install: build runtime
	install -d "$(INSTALL_ROOT)/bin"
	install target/release/murmuration target/release/murmuration-worker target/release/murmuration-trainer "$(INSTALL_ROOT)/bin"

# Performance figures of this machine, each beside a baseline of the same run.
bench: build runtime
	./target/release/murmuration bench simulate
	./target/release/murmuration bench train
	$(CARGO) bench --workspace

# Every parser at the edge, for so many seconds each; `make test` runs the same targets on changed inputs.
SECONDS ?= 60
fuzz: toolchain
	scripts/fuzz $(SECONDS)

# ONNX Runtime, which embedders run on: a pinned library, fetched once into the cache folder.
runtime:
	@scripts/fetch-onnxruntime

# Chromium and its driver, which only tests want.
browser:
	@scripts/browser

toolchain:
	@command -v $(CARGO) >/dev/null || { echo "Rust 1.92 or newer is needed: https://rustup.rs" >&2; exit 1; }
	@command -v cc >/dev/null || { echo "A C compiler is needed for SQLite (Debian: apt-get install gcc)" >&2; exit 1; }

clean:
	$(CARGO) clean
