from pathlib import Path

import yaml

import taichi_rts as rts

FILE = Path(__file__).parents[2] / "CITATION.cff"


def test_it_is_yaml_with_what_the_format_requires():
    data = yaml.safe_load(FILE.read_text(encoding="utf-8"))
    assert data.keys() >= {"cff-version", "message", "title", "authors"}
    assert data["cff-version"] == "1.2.0"
    assert data["authors"] == [{"name": "The taichi_rts authors"}]
    assert str(data["version"]) == rts.__version__
    assert data["license"] == "MIT"


def test_it_refers_to_the_papers():
    papers = yaml.safe_load(FILE.read_text(encoding="utf-8"))["references"]
    assert [paper["title"] for paper in papers] == [
        "Regional Time Stepping for SPH",
        "Asynchronous Liquids: Regional Time Stepping for Faster SPH and PCISPH",
        "Asynchronous Smoothed Particle Hydrodynamics",
    ]
    for paper in papers:  # what the format requires of a reference
        assert paper.keys() >= {"authors", "title", "type"}
        assert all(author["family-names"] for author in paper["authors"])
