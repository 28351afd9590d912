"""The house rules that a machine can check: layers, README, packaging, and where data come from."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
MODULES = sorted((ROOT / "facegen").rglob("*.py"))
FIRST = "pip install . && facegen render happiness -o happiness.png"
SECOND = 'pip install -e ".[test]" && pytest'


def test_imports_go_down_only():
    lint = "from importlinter.cli import lint_imports_command; lint_imports_command()"
    done = subprocess.run([sys.executable, "-c", lint, "--no-cache"], capture_output=True, text=True,
                          timeout=120, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_two_commands_stand_in_the_readme_once_each():
    lines = README.splitlines()
    assert lines.count(FIRST) == 1
    assert lines.count(SECOND) == 1


def test_ci_reads_them_from_the_readme():
    ci = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    for prefix, command in re.findall(r"readme_command '(.*)'\)\"()", ci):
        matches = [line for line in README.splitlines() if re.match(prefix, line)]
        assert len(matches) == 1, (prefix, command)
    assert "pip install -e \"" not in ci
    assert "set -euo pipefail" in ci


def test_relative_links_in_the_docs_lead_somewhere():
    broken = []
    for page in [ROOT / "README.md", ROOT / "CHANGELOG.md", *(ROOT / "docs").glob("*.md")]:
        for target in re.findall(r"\]\(([^)#\s]+)", page.read_text(encoding="utf-8")):
            if "://" not in target and not (page.parent / target).exists():
                broken.append(f"{page.name}: {target}")
    assert not broken


def test_docs_pictures_stay_small():
    size = sum(path.stat().st_size for path in (ROOT / "docs" / "images").iterdir())
    assert size < 6_000_000


def _is_type_checking(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


@pytest.mark.parametrize("path", sorted((ROOT / "facegen" / "cli").glob("*.py")), ids=lambda path: path.stem)
def test_the_command_line_imports_heavy_things_inside_functions(path):
    heavy = re.compile(r"(numpy|scipy|PIL|yaml|rich|facegen\.(face|facs|render|fileio|geometry))\b")
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if _is_type_checking(node):
            continue
        names = [node.module or ""] if isinstance(node, ast.ImportFrom) else \
            [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        assert not [name for name in names if heavy.match(name)], path.name


def test_no_assert_guards_an_input():
    for path in MODULES:
        found = [node.lineno for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
                 if isinstance(node, ast.Assert)]
        assert not found, f"{path.name}: {found}"


def test_every_mesh_and_table_names_its_source():
    from facegen.facs.yamlfile import read_data

    pages = [*ROOT.glob("meshes/*/face.yaml"), *ROOT.glob("tables/**/*.yaml")]
    assert len(pages) >= 8
    for path in pages:
        data = read_data(path)
        assert data.get("source") or data.get("sources"), path


def test_no_reference_data_in_the_project():
    """Scans and their parts are kept out: only these files may be larger than a page, and none is binary."""
    for path in [*(ROOT / "meshes").rglob("*"), *(ROOT / "tables").rglob("*")]:
        if path.is_file() and "__pycache__" not in path.parts:
            assert path.suffix in {".mtl", ".obj", ".yaml", ".py", ".txt", ".md"}, path
            avatar = "avatars" in path.parts                # heads authored in quads, by the script beside them
            assert path.stat().st_size < (600_000 if avatar else 400_000), path
            path.read_text(encoding="utf-8")
    for path in (ROOT / "meshes").rglob("*.obj"):
        assert path.read_text(encoding="utf-8").count("\nv ") < (12_000 if "avatars" in path.parts else 5_000), path


def test_scripts_name_no_folder_of_ours():
    for path in [*MODULES, *(ROOT / "meshes").rglob("*.py"), *(ROOT / "tables").rglob("*.yaml"),
                 *(ROOT / "docs").glob("*.md")]:
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"/(work|home|root|Users)/", text), path
