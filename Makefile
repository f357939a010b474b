# The two commands that matter: `make demo` and `make test`.

CARGO ?= cargo
export CARGO_TERM_COLOR ?= auto

.PHONY: demo test forget-skipped test-python guide wheel wheel-programs wheel-aarch64 test-browser test-faults faults test-containers lint build install runtime browser toolchain tests-built bench instructions fuzz clean

# Builds the programs, runs the paper's single-sensor campaign on a learned embedding, and prints the path of the campaign's
# report.
demo: build runtime
	./target/release/murmuration run examples/single-sensor-latent.toml

# A change must pass this target and `lint`, `test-faults`, `test-containers` and `test-python` (.ci/run). This target runs the
# tests of all other test targets and lists failures at the end; after that, it builds the guide, and lists skipped checks. It
# counts instructions only with CARGO_INCREMENTAL=0 in the environment, as in .ci/run.
test: forget-skipped tests-built runtime browser
	python="$$(scripts/python-packages $(CURDIR)/target/python)"; \
		PATH="$${python:+$$python:}$$PATH" scripts/run-tests
	scripts/instruction-counts
	scripts/guide
	scripts/skipped

# Tests only the pages, in a real browser; screenshots are stored in target/screenshots.
test-browser: tests-built browser
	scripts/run-tests -E 'binary(machine) & test(/^browser/)'

# Injects faults into the real processes, in a short form; `make faults` fires all faults in full, for more than an hour.
test-faults: tests-built runtime
	@command -v bindfs >/dev/null || scripts/debian-packages bindfs
	MURMURATION_BINARIES=$(CURDIR)/target/debug "$$(scripts/test-binary tests faults)"

faults: build runtime
	MURMURATION_SCHEDULES=1000000 $(CARGO) test --release --workspace --lib schedules -- --nocapture
	MURMURATION_SCALE=long $(CARGO) test --release --workspace --test faults

# Tests a cluster in containers, some of which are killed. Without a Docker engine, these tests are ignored.
test-containers: tests-built runtime
	bases="$$(tests/containers/base-images)" && MURMURATION_TEST_BASES="$$bases" \
		MURMURATION_BINARIES=$(CURDIR)/target/debug "$$(scripts/test-binary tests containers)"

# Tests the Python library with the programs: formatting, types, tests, examples and notebooks.
test-python: tests-built
	scripts/test-python
	rm -rf target/tested-wheel
	scripts/test-wheel "$$(scripts/wheel target/debug target/tested-wheel)"

# Compiles the programs and every test. With BUILT=yes, this target compiles nothing.
tests-built: toolchain
ifndef BUILT
	scripts/build-tests
endif

# With BUILT=yes, other targets are already running beside this target, so their records must stay.
forget-skipped:
ifndef BUILT
	scripts/skipped --forget
endif

# Makes the guide, a book of the pages in docs/, in target/guide/html, and checks its links.
guide: toolchain
	$(CARGO) build --workspace --bins
	scripts/guide

# Makes a wheel of the Python library with the programs in it, for pip, in the folder dist. The programs are smaller than those of
# `build`, and take longer to build (the profile `wheel` in Cargo.toml).
wheel: wheel-programs
	scripts/wheel target/wheel dist

wheel-programs: toolchain
	$(CARGO) build --profile wheel --workspace --bins

# Makes a wheel for ARM64 on another kind of machine. This target needs `rustup target add aarch64-unknown-linux-gnu`, and
# Debian's packages gcc-aarch64-linux-gnu and g++-aarch64-linux-gnu.
wheel-aarch64: export CC_aarch64_unknown_linux_gnu = aarch64-linux-gnu-gcc
wheel-aarch64: export CXX_aarch64_unknown_linux_gnu = aarch64-linux-gnu-g++
wheel-aarch64: export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER = aarch64-linux-gnu-gcc
wheel-aarch64: wheel-programs
	$(CARGO) build --profile wheel --workspace --bins --target aarch64-unknown-linux-gnu
	STRIP=aarch64-linux-gnu-strip scripts/wheel target/aarch64-unknown-linux-gnu/wheel dist target/wheel/murmuration

lint: toolchain
	$(CARGO) fmt --all --check
	$(CARGO) clippy --workspace --all-targets --test faults --test containers -- -D warnings
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --workspace --no-deps
	scripts/validate-kubernetes $(CURDIR)/target/kubernetes-validate
	scripts/cargo-deny

build: toolchain
	$(CARGO) build --release --workspace --bins

# Installs the programs into cargo's folder for binaries, and the manual and completions beside it. INSTALL_ROOT names another folder.
INSTALL_ROOT ?= $(or $(CARGO_INSTALL_ROOT),$(CARGO_HOME),$(HOME)/.cargo)
install: build runtime
	install -d "$(INSTALL_ROOT)/bin"
	install target/release/murmuration target/release/murmuration-worker target/release/murmuration-trainer "$(INSTALL_ROOT)/bin"
	scripts/install-manual target/release/murmuration "$(INSTALL_ROOT)"

# Prints performance figures of this machine, each with a baseline from the same run.
bench: build runtime
	./target/release/murmuration lab bench simulate
	./target/release/murmuration lab bench cluster
	./target/release/murmuration lab bench train
	$(CARGO) bench --workspace

# Counts the instructions of fixed work with valgrind, and fails where they grew by more than 5 %. This target compiles the
# workspace's crates again, without incremental compilation, as .ci/run does.
instructions: export CARGO_INCREMENTAL = 0
instructions: tests-built
	scripts/instruction-counts

# Fuzzes every parser of outside input, for SECONDS each; `make test` runs the same targets on changed inputs.
SECONDS ?= 60
fuzz: toolchain
	scripts/fuzz $(SECONDS)

# Fetches ONNX Runtime, which runs embedders: a pinned version of the library, once, into the cache folder.
runtime:
	@scripts/fetch-onnxruntime

# Installs Chromium and its driver, which only tests need.
browser:
	@scripts/browser

toolchain:
	@command -v $(CARGO) >/dev/null || { echo "Rust 1.92 or newer is needed: https://rustup.rs" >&2; exit 1; }
	@command -v cc >/dev/null || { echo "A C compiler is needed for SQLite (Debian: apt-get install gcc)" >&2; exit 1; }

clean:
	$(CARGO) clean
