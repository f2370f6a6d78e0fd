import warnings

import imageio.v3 as imageio
import numpy as np
import pytest

from taichi_rts.errors import OutputError
from taichi_rts.files.film import opaque
from taichi_rts.files.writing import write_png
from taichi_rts.output.side_by_side import SideBySide

TIMES = (0.0, 0.1, 0.2)


def run_folder(folder, shade, times=TIMES, size=(90, 120), channels=3):
    """An output folder with a picture a time, each lighter than the one before."""
    for number in range(len(times)):
        image = np.full((*size, channels), shade + number, np.uint8)
        image[..., 3:] = 0
        write_png(folder / "frames" / f"{number:06d}.png", image)
    folder.mkdir(exist_ok=True)
    (folder / "series.csv").write_text("time,front\n" + "".join(f"{time:.9g},1\n" for time in times))
    return folder


def frames(folder):
    return [imageio.imread(path) for path in sorted((folder / "frames").iterdir())]


def test_pictures_of_two_runs_stand_side_by_side_at_the_same_times(tmp_path):
    one, two = run_folder(tmp_path / "one", 10), run_folder(tmp_path / "two", 200, size=(90, 150))
    SideBySide(one, two, tmp_path / "both", gif=True)()
    got = frames(tmp_path / "both")
    assert len(got) == 3
    for number, image in enumerate(got):
        assert image.shape[1] == 120 + 2 + 150
        assert image.shape[0] > 90  # the captions
        assert (image[-1, 0, 0], image[-1, -1, 0]) == (10 + number, 200 + number)
    with imageio.imopen(tmp_path / "both" / "video.gif", "r") as film:
        assert len(film.read(index=...)) == 3
    assert not (tmp_path / "both" / ".lock").exists()


def test_runs_of_other_times_are_refused_and_nothing_is_written(tmp_path):
    one, two = run_folder(tmp_path / "one", 10), run_folder(tmp_path / "two", 200, (0.0, 0.05, 0.2))
    with pytest.raises(OutputError, match=r"frame 1 shows t = 0.1 s in .*one and t = 0.05 s in .*two; .*--export-fps"):
        SideBySide(one, two, tmp_path / "both")()
    assert not (tmp_path / "both").exists()


def test_runs_of_other_heights_are_refused(tmp_path):
    one, two = run_folder(tmp_path / "one", 10), run_folder(tmp_path / "two", 200, size=(60, 80))
    with pytest.raises(OutputError, match="90 and 60 pixels high; run both with the same --height"):
        SideBySide(one, two, tmp_path / "both")()


def test_of_a_run_under_way_what_is_whole_is_shown(tmp_path):
    one, two = run_folder(tmp_path / "one", 10), run_folder(tmp_path / "two", 200)
    (two / "frames" / "000002.png").unlink()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        SideBySide(one, two, tmp_path / "both")()
    assert len(frames(tmp_path / "both")) == 2
    assert "the first 2 are shown" in str(caught[0].message)


def test_transparent_frames_stay_so_beside_opaque_ones(tmp_path):
    one, two = run_folder(tmp_path / "one", 10), run_folder(tmp_path / "two", 200, channels=4)
    SideBySide(one, two, tmp_path / "both")()
    image = frames(tmp_path / "both")[0]
    assert (image[-1, 0, 3], image[-1, -1, 3], image[0, 0, 3]) == (255, 0, 255)
    assert (opaque(image)[-1, 0], opaque(image)[-1, -1]) == (pytest.approx(10), pytest.approx(255))


@pytest.mark.parametrize("place", ["one", "one/frames/x"])
def test_a_run_is_never_written_into(tmp_path, place):
    one, two = run_folder(tmp_path / "one", 10), run_folder(tmp_path / "two", 200)
    with pytest.raises(OutputError, match="lies in the run"):
        SideBySide(one, two, tmp_path / place, overwrite=True)()
    assert len(frames(one)) == 3


def test_folders_without_frames_are_refused(tmp_path):
    one = run_folder(tmp_path / "one", 10)
    with pytest.raises(OutputError, match=r"series\.csv"):
        SideBySide(one, tmp_path / "none", tmp_path / "both")()
    with pytest.raises(OutputError, match=r"has no frames.*--no-frames"):
        SideBySide(one, run_folder(tmp_path / "none", 1, ()), tmp_path / "both")()
