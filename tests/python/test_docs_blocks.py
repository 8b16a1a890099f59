"""Every command, script and model file of the book works, and prints what the book says."""

import sys
from collections import Counter
from pathlib import Path

import pytest

if sys.version_info < (3, 11):
    pytest.skip("TOML is read by tomllib", allow_module_level=True)

import docs_blocks
from docs_blocks import Reader, blocks, difference


@pytest.mark.parametrize(
    "page", [page for page in docs_blocks.pages() if list(blocks(page))], ids=lambda page: page.stem
)
def test_the_blocks_of_a_page_work_in_order(page: Path, tmp_path: Path) -> None:
    reader = Reader(tmp_path)
    for block in blocks(page):
        assert block.language in docs_blocks.LANGUAGES, f"{block.place}: {block.language or 'no language'}"
        reader.follow(block)


def test_few_blocks_are_not_run_and_each_says_why() -> None:
    stated = (block.attributes.get("no-run") for page in docs_blocks.pages() for block in blocks(page))
    reasons = Counter(reason for reason in stated if reason is not None)
    assert reasons.keys() <= docs_blocks.REASONS.keys(), reasons
    assert all(many <= docs_blocks.REASONS[reason] for reason, many in reasons.items()), reasons


def test_every_fence_is_a_block() -> None:
    for page in docs_blocks.pages():
        fences = page.read_text(encoding="utf-8").count("```")
        assert fences == 2 * len(list(blocks(page))), f"{page}: a fence without a language, or without an end"


def test_differences_are_found() -> None:
    printed = "step  error\n----  -----\nfitted  1.000  0.0005\n\nmissing: friction on yaw\n12 rollouts in 3 s"
    assert difference("step error\n---\nfitted 1.01 0.0005\n(...)\n12 rollouts in (...) s", printed) is None
    assert difference("missing: (...) on yaw", printed) is None
    for wrong in ("fitted 1.03 0.0005", "missing: friction on elbow", "step error\nfitted 1.000 0.0005", "missing"):
        assert difference(wrong, printed) is not None, wrong
