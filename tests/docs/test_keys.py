"""The page of all keys of scene files is what the schema says now, and what the tutorial begins with."""

import importlib.util
from pathlib import Path

import numpy as np
from documents import scene_files, shell_commands

import taichi_rts as rts
from taichi_rts.rendering.tints import Tints
from taichi_rts.scene.files.reading import tomllib
from taichi_rts.scene.loading import scene_from

DOCS = Path(__file__).parents[2] / "docs"


def test_the_page_is_the_schemas():
    spec = importlib.util.spec_from_file_location("keys", DOCS / "keys.py")
    keys = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(keys)
    assert keys.PAGE.read_text(encoding="utf-8") == keys.page(), "run: python docs/keys.py"


def test_the_tutorial_begins_with_colours_and_with_a_right_pressure(taichi_cpu, unstarted):
    words = next(words for words in shell_commands("docs/tutorial.md") if words[:2] == ["taichi-rts", "run"])
    sim = rts.Simulation(rts.load_scene(words[2], spacing=0.1), rts.Uniform())
    colours = Tints(sim.scene).of(sim.read(), words[words.index("--colour-by") + 1], "default")
    assert len(np.unique(colours, axis=0)) >= 2
    scene = scene_from(tomllib.loads(scene_files("docs/tutorial.md")["splash.toml"]))
    assert scene.probes
    assert scene.density == "continuity"
