"""The built wheel, installed alone with what it depends on, has all it needs to run the demo."""

from pathlib import Path

import pytest
import wheel

import taichi_rts as rts


@pytest.mark.slow
def test_the_wheel_alone_runs_the_demo(tmp_path, quick_environment):
    try:
        python = wheel.environment(tmp_path)
        built = wheel.build(tmp_path)
        wheel.call(python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", built, cwd=tmp_path)
    except RuntimeError as error:
        if any(words in str(error) for words in ("Connection", "No matching distribution", "Temporary failure")):
            pytest.skip(f"no package registry can be reached: {error}")
        raise
    modules, scenes, *extras = wheel.try_out(python, tmp_path)
    sources = [path for path in Path(rts.__file__).parent.rglob("*.py") if path.name != "__main__.py"]
    assert int(modules) == len(sources) - 1  # the package itself
    assert int(scenes) == len(rts.scene_names())
    assert extras == []
