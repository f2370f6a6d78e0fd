import pytest
from trial import fill


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder, within another, with the files that bad scenes name."""
    made = tmp_path_factory.mktemp("outer") / "bad"
    made.mkdir()
    fill(made)
    return made
