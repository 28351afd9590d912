"""The template of all units, made once, and copies of it with other triangles."""

import pytest
from remeshing import remesh, template_of_units


@pytest.fixture(scope="session")
def template():
    return template_of_units()


@pytest.fixture(scope="session")
def remeshed(template):
    """Return a function: share of the triangles -> (surface, true motion (k, n, 3)), the face in other triangles."""
    pytest.importorskip("fast_simplification")
    made = {}

    def make(share):
        if share not in made:
            made[share] = remesh(template, share)
        return made[share]

    return make
