from pathlib import Path

from tools.house.words import words_by_hand


def test_words_are_those_of_documents_written_by_hand(tmp_path):
    for name, text in {
        "README.md": "Two words\n<!-- front: generated, begin -->\n| a | b |\n<!-- front: generated, end -->\nand two",
        "CHANGELOG.md": "none of these",
        "docs/index.md": "one",
        "docs/how-to/sweep.md": "<!-- a: generated, begin --> x <!-- b: generated, end --> ten",
        "docs/results/sensitivity.md": "none of these",
        "src/notes.md": "none of these",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    assert words_by_hand(tmp_path) == {
        Path("README.md"): 4, Path("docs/how-to/sweep.md"): 12, Path("docs/index.md"): 1,
    }  # fmt: skip
    (tmp_path / "CONTRIBUTING.md").write_text("three more words")
    assert words_by_hand(tmp_path)[Path("CONTRIBUTING.md")] == 3
