import json

import numpy as np
import pytest
from PIL import Image

from taichi_rts.assembly.frame_times import frame_times
from taichi_rts.errors import OutputError
from taichi_rts.files.writing import prepare_folder, write_bytes, write_json, write_png


def test_write_leaves_no_temporary_and_replaces_whole_file(tmp_path):
    path = tmp_path / "new" / "run.json"
    write_json(path, {"a": 1})
    write_json(path, {"b": 2})
    assert json.loads(path.read_text()) == {"b": 2}
    assert [p.name for p in path.parent.iterdir()] == ["run.json"]


def test_nan_is_refused_and_the_old_file_stays(tmp_path):
    path = tmp_path / "run.json"
    write_json(path, {"a": 1})
    with pytest.raises(ValueError, match="Out of range"):
        write_json(path, {"a": float("nan")})
    assert json.loads(path.read_text()) == {"a": 1}


def test_unwritable_place_is_one_clear_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="--output-dir"):
        write_bytes(tmp_path / "file" / "x.png", b"1")


def test_an_earlier_run_is_kept_without_overwrite(tmp_path):
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames" / "000000.png").write_bytes(b"1")
    with pytest.raises(OutputError, match="--overwrite"):
        prepare_folder(tmp_path, overwrite=False)
    assert (tmp_path / "frames" / "000000.png").exists()


def test_overwrite_removes_only_what_a_run_wrote(tmp_path):
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames" / "000000.png").write_bytes(b"1")
    (tmp_path / "notes.txt").write_text("mine")
    prepare_folder(tmp_path, overwrite=True)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["notes.txt"]


def test_a_file_in_the_way_is_refused(tmp_path):
    (tmp_path / "out").write_text("")
    with pytest.raises(OutputError, match="is a file"):
        prepare_folder(tmp_path / "out", overwrite=True)


def test_frames_are_at_exact_times_and_end_at_the_end():
    assert frame_times(0.5, 4) == [0.0, 0.25, 0.5]
    assert frame_times(0.6, 4) == [0.0, 0.25, 0.5, 0.6]
    assert len(frame_times(1.5, 60)) == 91
    with pytest.raises(OutputError, match="export_fps"):
        frame_times(1.0, 0.0)


@pytest.mark.parametrize("channels", [3, 4])
def test_a_picture_is_read_as_it_was_written(tmp_path, channels):
    wide = np.random.default_rng(0).integers(0, 256, (7, 22, channels), np.uint8)
    for number, image in enumerate((wide, wide[:1, :1], wide[:, ::2])):  # the last is not contiguous
        write_png(tmp_path / f"{number}.png", image)
        found = Image.open(tmp_path / f"{number}.png")
        found.load()
        assert np.array_equal(np.asarray(found), image)
        assert found.mode == {3: "RGB", 4: "RGBA"}[channels]
