import imageio.v3 as imageio
import numpy as np
import pytest

from taichi_rts.files.film import Gif, Video


def films(kind, path, fps, count, size=(48, 64)):
    film = kind(path, fps)
    for k in range(count):
        film.append(np.full((*size, 3), 10 * k, np.uint8))
    film.close()
    assert [file.name for file in path.parent.iterdir()] == [path.name]


@pytest.mark.parametrize(("fps", "frames", "duration"), [(10.0, 12, 100), (50.0, 6, 40), (60.0, 4, 50)])
def test_a_gif_keeps_the_speed_and_leaves_out_frames(tmp_path, fps, frames, duration):
    path = tmp_path / "video.gif"
    films(Gif, path, fps, 12)
    pictures = imageio.imread(path, index=None)
    assert pictures.shape == (frames, 48, 64, 3)
    assert imageio.immeta(path)["duration"] == duration
    every = 12 // frames
    assert [int(picture[0, 0, 0]) for picture in pictures] == [10 * every * k for k in range(frames)]


def test_a_gif_is_at_most_640_pixels_across(tmp_path):
    films(Gif, tmp_path / "video.gif", 10.0, 2, (360, 1280))
    assert imageio.imread(tmp_path / "video.gif", index=0).shape == (180, 640, 3)


def test_an_mp4_has_every_frame_and_even_sides(tmp_path):
    pytest.importorskip("imageio_ffmpeg")
    films(Video, tmp_path / "video.mp4", 10.0, 5, (49, 64))
    assert imageio.immeta(tmp_path / "video.mp4")["size"] == (64, 48)
