"""What `import facegen` promises."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module

import pytest

import facegen


def test_all_is_sorted_and_complete():
    assert facegen.__all__ == sorted(facegen.__all__)
    assert len(set(facegen.__all__)) == len(facegen.__all__)
    assert set(facegen._HOME) == set(facegen.__all__)
    assert set(facegen.__all__) <= set(dir(facegen))


@pytest.mark.parametrize("name", facegen.__all__)
def test_every_name_is_there_and_documented(name):
    value = getattr(facegen, name)
    assert value.__doc__
    home = facegen._HOME[name]
    if home != "facegen":
        assert value is getattr(import_module(home), name)
        assert name in vars(facegen)        # found once, kept


def test_no_other_name():
    with pytest.raises(AttributeError, match="no attribute 'smile'"):
        facegen.smile  # noqa: B018


@pytest.mark.parametrize("before", ["", "import facegen.render", "from facegen.render import render",
                                    "import facegen.render.shading"])
def test_render_is_a_package_and_can_be_called(before):
    code = f"""{before}
import facegen
face = facegen.load_face("akimoto-1986")
print(facegen.render(face, "neutral", size=32, detail=0).shape)
print(facegen.render.render(face, size=32, detail=0).dtype)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout == "(32, 32, 4)\nuint8\n", done.stderr


def test_types_are_announced():
    from pathlib import Path

    assert (Path(facegen.__file__).parent / "py.typed").is_file()


def test_version_is_the_packages():
    import tomllib
    from pathlib import Path

    project = Path(__file__).parents[1] / "pyproject.toml"
    assert tomllib.loads(project.read_text())["project"]["version"] == facegen.__version__
