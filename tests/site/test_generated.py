from dataclasses import fields

import pytest
from tools.site import generated
from tools.site.generated import PAGES, api_page, commands_page, parameter_sets, parameters_page, public_names
from tools.site.links import Layout
from tools.site.navigation import navigation

import pretouch
from pretouch.cli.app import command_names
from pretouch.composition import field_docs


def test_every_public_name_is_on_one_page():
    sources = [name for _, packages in generated.API.values() for name in public_names(packages)]
    assert sorted(name.rpartition(".")[2] for name in sources) == pretouch.__all__
    assert "::: pretouch.controller.Controller\n" in api_page("Controller", ("controller",))


def test_every_command_is_shown_with_its_options():
    page = commands_page()
    assert [name for name in command_names() if f"## pretouch {name}\n" not in page] == []
    assert "## pretouch skin coverage\n" in page
    assert "--suggest INT" in page


def test_every_parameter_is_shown_with_default_unit_and_source():
    page = parameters_page()
    assert "| `f_base_n` | 10 | N | Base force F_b of a contact above the mean, eq. 9 (Table I). |" in page
    assert "## MovingThresholds\n" in page
    assert "## ThresholdParams\n" not in page  # the same parameters, of the class that has them
    assert page.count("\n| `") == sum(len(fields(kind)) for kind in parameter_sets())


@pytest.mark.parametrize("kind", parameter_sets(), ids=lambda kind: kind.__name__)
def test_a_parameter_says_what_it_is(kind):
    docs = field_docs(kind)
    assert [field.name for field in fields(kind) if len(docs.get(field.name, "")) < 5] == []


def test_a_link_leads_to_a_page_or_to_a_page_of_source(tmp_path):
    root = tmp_path / "repository"
    for name, text in {
        "docs/a.md": "[b](how-to/b.md#x) [c](../CONTRIBUTING.md) [s](../src/s.py) [w](https://w.org)\n```\n[no](x)\n```\n",
        "docs/how-to/b.md": "# B\n[a](../a.md)",
        "CONTRIBUTING.md": "[b](docs/how-to/b.md)",
        "src/s.py": "pass",
    }.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    layout = Layout(root, tmp_path / "pages", {"CONTRIBUTING.md": "contributing.md"})
    assert layout.rebased(root / "docs" / "a.md") == (
        "[b](how-to/b.md#x) [c](contributing.md) [s](source/src/s.py.md) [w](https://w.org)\n```\n[no](x)\n```\n"
    )
    assert layout.rebased(root / "docs" / "how-to" / "b.md") == "# B\n[a](../a.md)"
    assert layout.rebased(root / "CONTRIBUTING.md") == "[b](how-to/b.md)"
    assert layout.sources == {root / "src" / "s.py": tmp_path / "pages" / "source" / "src" / "s.py.md"}


def test_the_navigation_is_the_indexs():
    index = "# I\n\n- [no page]\n\n## How to\n\nWords:\n\n- [A](how-to/a.md): b.\n\n## Reference\n\n- [C](c.md)\n"
    assert navigation(index, {"d.md": "D"}) == [
        {"Home": "index.md"}, {"How to": [{"A": "how-to/a.md"}]}, {"Reference": [{"C": "c.md"}, {"D": "d.md"}]},
    ]  # fmt: skip
    assert set(PAGES) >= {"reference/commands.md", "reference/parameters.md"}
