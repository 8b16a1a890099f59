#!/usr/bin/env bash
# Every check and every test. Needs a Rust toolchain and Python 3; installs what else it uses below target/.
set -euo pipefail
cd "$(dirname "$0")/.."

step() { printf '\n== %s\n' "$*"; }

step "format"
cargo fmt --all --check

step "lints"
cargo clippy --quiet --release --workspace --all-targets --locked -- -D warnings

step "licences and sources"
# The advisory database is not asked: it would need a network beyond the package registries.
if ! command -v cargo-deny >/dev/null && [ ! -x target/tools/bin/cargo-deny ]; then
    cargo install --quiet --locked --root target/tools cargo-deny@0.20.2
fi
PATH="$PWD/target/tools/bin:$PATH" cargo deny --locked check --hide-inclusion-graph licenses bans sources

step "tests in Rust"
cargo test --release --workspace --locked

step "tests in Python"
if [ ! -x target/venv/bin/python ]; then
    python3 -m venv target/venv
fi
target/venv/bin/pip install --quiet --disable-pip-version-check -r tests/python/requirements.txt
target/venv/bin/pip install --quiet --disable-pip-version-check ./crates/btr-py
target/venv/bin/python -m pytest --quiet -rs tests/python
