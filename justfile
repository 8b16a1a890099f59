# `just` lists these; each is one line that one could type.

# Every check and every test.
test:
    bash tests/run.sh

# The Python package's reference, in target/api.
api:
    target/venv/bin/python tests/python/api.py target/api

# The book, in target/docs.
docs:
    target/venv/bin/mkdocs build

# The main job.
nao:
    cargo run --release -- coevolve robots/nao.toml

# Speed of the ant and the Nao.
bench:
    cargo bench -p btr-physics

# Mutated inputs through everything that reads: so many per target, from a seed.
fuzz inputs="100000" seed="1":
    cargo run --release -p btr-fuzz -- --inputs {{inputs}} --seed {{seed}}
