#!/usr/bin/env bash
# Every check and every test. Needs a Rust toolchain and Python 3; installs what else it uses below target/.
set -euo pipefail
cd "$(dirname "$0")/.."

step() { printf '\n== %s (after %d s)\n' "$*" "$SECONDS"; }

step "format"
# Every file by name: `cargo fmt` does not find the modules that a macro declares (the effects).
git ls-files '*.rs' | xargs rustfmt --check --edition 2024

step "structure: circles, folders, lines, retired words"
python3 tests/structure.py

step "lints"
cargo clippy --quiet --release --workspace --all-targets --locked -- -D warnings

step "documentation"
RUSTDOCFLAGS="-D warnings" cargo doc --quiet --release --workspace --no-deps --locked

step "licences and sources"
if ! command -v cargo-deny >/dev/null && [ ! -x target/tools/bin/cargo-deny ]; then
    # Unoptimised: it takes a fraction of the time to compile, and checks in three seconds.
    cargo install --quiet --debug --locked --root target/tools cargo-deny@0.20.2
fi
PATH="$PWD/target/tools/bin:$PATH" cargo deny --locked check --hide-inclusion-graph licenses bans sources
# A new advisory is told, and does not turn a commit red that was green the day before.
if PATH="$PWD/target/tools/bin:$PATH" cargo deny --log-level off fetch db; then
    PATH="$PWD/target/tools/bin:$PATH" cargo deny --locked check --disable-fetch --hide-inclusion-graph advisories ||
        echo "advisories: see above"
else
    echo "advisories were not checked: the database could not be fetched"
fi

step "tests in Rust"
cargo test --release --workspace --locked

# uv where it is there: it does the same in a fraction of the time.
install() { # PYTHON, what
    if command -v uv >/dev/null; then
        uv pip install --quiet --python "$@"
    else
        "$1" -m pip install --quiet --disable-pip-version-check "${@:2}"
    fi
}

# A Python of this version, if the machine has one.
python_of() { # VERSION
    local python
    for python in "$(command -v "python$1")" "$HOME"/.pyenv/versions/"$1".*/bin/python; do
        if [ -n "$python" ] && "$python" -c 'import venv' 2>/dev/null; then
            echo "$python"
            return
        fi
    done
}

step "tests in Python: the wheel, built and installed in an environment of its own"
if [ ! -x target/venv/bin/python ]; then
    python3 -m venv target/venv
fi
python=target/venv/bin/python
install $python -r tests/python/requirements.txt
rm -f target/dist/btr-*.whl
if command -v uv >/dev/null; then
    uv build --quiet --wheel --out-dir target/dist .
else
    $python -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir target/dist .
fi
install $python --force-reinstall --no-deps target/dist/btr-*.whl
$python -m pytest --quiet -rs tests/python

step "packages: crates, wheel, source distribution, workflows"
# Without a build: the crates are built above. Crates that are not published yet are taken from the workspace.
cargo package --quiet --workspace --exclude btr-py --exclude btr-tests --exclude btr-fuzz --locked --no-verify --allow-dirty
rm -f target/dist/btr-*.tar.gz
$python -m maturin sdist --manifest-path crates/btr-py/Cargo.toml --out target/dist
$python -m twine check --strict target/dist/btr-*
actionlint=$(command -v actionlint || echo target/tools/bin/actionlint)
if [ ! -x "$actionlint" ] && command -v go >/dev/null; then
    GOBIN="$PWD/target/tools/bin" go install github.com/rhysd/actionlint/cmd/actionlint@v1.7.12
fi
if [ -x "$actionlint" ]; then
    "$actionlint" .github/workflows/*.yml
else
    echo "workflows were not checked: neither actionlint nor Go is there"
fi

# What needs no more than NumPy, on every Python that the wheel is for.
tested=$($python -c 'import sys; print("%d.%d" % sys.version_info[:2])')
for version in 3.10 3.11 3.12 3.13; do
    other=$(python_of $version)
    if [ "$version" = "$tested" ]; then
        continue
    elif [ -z "$other" ]; then
        step "tests in Python $version: skipped, it is not there"
        continue
    fi
    step "tests in Python $version: the same wheel"
    "$other" -m venv --clear "target/venv-$version"
    python=target/venv-$version/bin/python
    install "$python" pytest hypothesis target/dist/btr-*.whl
    "$python" -m pytest --quiet -rs tests/python/test_{import,verbs,search,distance,coevolve}.py
done
