from types import SimpleNamespace
from typing import get_type_hints

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.medium.medium import Medium
from taichi_rts.readings.levels import level_classes, milliseconds
from taichi_rts.readings.reading import Moment, Reading
from taichi_rts.rendering import legend, lighting
from taichi_rts.rendering.colours import level_colours, scalar_colours
from taichi_rts.rendering.painter import Painter, PictureChoices, PictureOptions, make_cameras, picture_options
from taichi_rts.rendering.tints import Tints

SCENE = rts.load_scene("dam_break_2d")
NOTHING = SimpleNamespace()  # these tests draw no particles


def reading(level, count=1, *, doubling=False, density=None, scene=SCENE, tick=0.0005):
    """A reading of four particles at rest that have these levels, of `count` in all, at t = 0.25 s."""
    level, zeros = np.array(level), np.zeros((4, scene.dim))
    return Reading(
        moment=Moment(0.25, 500, tick, 500, 4),
        scene=scene,
        local=scene,
        medium=Medium.of(scene, 1.0),
        stepper=rts.Uniform(),
        geometry=None,
        base_ticks=1,
        level_count=count,
        levels_double=doubling,
        ids=np.arange(4),
        local_positions=zeros + 1.0,
        velocities=zeros,
        densities=np.full(4, 1000.0) if density is None else density,
        accelerations=zeros,
        base_steps=level,
        evaluated=np.array([500, 499, 498, 502]),
        sound_speeds=np.full(4, 20.0),
        particle_updates=0,
        inflow=None,
        outflows=(),
        runaways=0,
        not_finite=0,
        born=4,
        start_fluids=np.zeros(4, int),
    )


def entries(now):
    return Tints(SCENE).entries(now, "level", "default")


def test_regional_levels_have_an_entry_each():
    got = entries(reading([1, 2, 2, 2], 3))
    assert [(name, share) for name, _, share in got] == [
        ("level 1: Δt_b", 0.25),
        ("level 2: 2 Δt_b", 0.75),
        ("level 3: 3 Δt_b", 0.0),
    ]
    assert np.allclose([colour for _, colour, _ in got], level_colours([1, 2, 3]))


def test_asynchronous_levels_have_an_entry_an_octave():
    got = entries(reading([1, 4, 6, 8], 8, doubling=True))
    assert [(name, share) for name, _, share in got] == [
        ("level 1: Δt_b", 0.25),
        ("level 2: 2 Δt_b", 0.0),
        ("level 4–6: 4–6 Δt_b", 0.5),
        ("level 8: 8 Δt_b", 0.25),
    ]
    assert np.allclose([colour for _, colour, _ in got], level_colours([1, 2, 3, 4]))


def test_of_many_levels_only_those_in_use_have_an_entry():
    got = entries(reading([1, 3, 1024, 1024], 1024, doubling=True))
    assert [name for name, _, _ in got] == ["level 1: Δt_b", "level 3: 3 Δt_b", "level 1024: 1024 Δt_b"]
    assert np.allclose(got[2][1], level_colours([11])[0])


def test_classes_of_levels_keep_the_whole():
    shares = np.arange(1.0, 21.0) / 210
    for doubling, count in ((False, 20), (True, 5)):
        classes = level_classes(shares, doubling)
        assert len(classes) == count
        assert sum(each.share for each in classes) == pytest.approx(1)
    assert [str(each) for each in classes] == ["1", "2–3", "4–7", "8–15", "16–20"]


@pytest.mark.parametrize(("mode", "values", "top"), [("step", [1, 2, 4, 8], 8), ("lead", [0, 0, 1, 9], 16)])
def test_steps_and_leads_are_coloured_up_to_the_longest_there_can_be(mode, values, top, monkeypatch):
    now = reading([1, 2, 4, 8], 8, doubling=True)
    assert now.longest_step == pytest.approx(0.004)
    painter = Painter(SCENE, PictureOptions(colour_by=mode), renderer=NOTHING)
    got = Tints(SCENE).of(now, mode, "default")
    assert np.allclose(got, scalar_colours(values, 0, top))
    bars = []
    monkeypatch.setattr(legend, "draw_colour_bar", lambda image, *bar: bars.append(bar) or image)
    painter.label(np.zeros((360, 640, 3), np.uint8), now)
    title, lower, upper, unit, _ = bars[0]
    assert title == {"step": "step", "lead": "ahead of the youngest"}[mode]
    assert (lower, upper, unit) == (0.0, pytest.approx(0.5 * top), "ms")


def test_short_base_steps_keep_their_digits():
    assert [milliseconds(t) for t in (0.8128e-3, 0.1016e-3, 0.8819e-6)] == ["0.813", "0.102", "0.000882"]


class Canvas:
    """Draws its camera's name of a picture: as many as there are cameras, each of another grey."""

    def __init__(self, width, height):
        self.shape, self.seen = (height, width, 3), []

    def draw(self, positions, colours, radius, camera, outline, box, floor):
        self.seen.append((camera, positions))
        return np.full(self.shape, 100 + 20 * len(self.seen), np.uint8)


def test_two_views_show_the_same_state_at_one_time_in_a_picture_of_the_asked_size(monkeypatch):
    scene = rts.load_scene("dam_break")
    options = PictureOptions(width=1280, height=720, views=("front", "side"))
    canvas = Canvas(*options.view_size)
    painter = Painter(scene, options, renderer=canvas)
    asked, now = [], reading([1, 2, 2, 2], 2, scene=scene)
    sim = SimpleNamespace(read=lambda: asked.append(1) or now)
    panels = []
    draw = legend.draw_legend
    monkeypatch.setattr(legend, "draw_legend", lambda *a, **k: panels.append(a[1:]) or draw(*a, **k))
    picture = painter.paint(sim)
    assert picture.shape == (720, 1280, 3)
    assert len(asked) == 1
    (front, first), (side, second) = canvas.seen
    assert first is second
    assert np.allclose(front.basis()[2], (0, 0, -1))
    assert np.allclose(side.basis()[2], (-1, 0, 0))
    assert (picture[360, 300], picture[360, 900]) == (pytest.approx(120), pytest.approx(140))
    assert [panel[0] for panel in panels] == ["front", "side", ""]
    assert panels[2][2][0] == "t = 0.250 s"


@pytest.mark.parametrize(
    ("scene", "options", "complaint"),
    [
        ("dam_break_2d", {"views": ("front",)}, "two dimensions has one view only"),
        ("dam_break", {"views": ("front",), "azimuth": 3.0}, "leave out --azimuth"),
        ("dam_break", {"views": ("front",) * 5}, "5 views in one picture; at most 4"),
        ("dam_break", {"transparent": True, "renderer": "ggui"}, "--renderer splatter"),
        ("dam_break", {"views": ("front",), "zoom": 2.0}, "leave out .* --zoom"),
        ("dam_break_2d", {"eye": (1, 1, 9), "target": (1, 1, 0)}, "seen from the front; leave them out"),
        ("dam_break", {"eye": (1, 1, 1), "target": (1, 1, 1)}, "must be two places"),
    ],
)
def test_views_that_cannot_be_are_refused(scene, options, complaint):
    with pytest.raises(rts.Error, match=complaint):
        make_cameras(rts.load_scene(scene), PictureOptions(**options))


def test_eye_target_zoom_and_angle_are_the_cameras():
    scene = rts.load_scene("dam_break")
    (camera,) = make_cameras(scene, PictureOptions(eye=(9, 5, 3), target=(1, 1, 0), zoom=2.0, fov=50.0))
    assert (camera.eye, camera.target, camera.field_of_view) == ((5, 3, 1.5), (1, 1, 0), 50.0)
    near, far = (make_cameras(scene, PictureOptions(zoom=zoom))[0] for zoom in (3.0, None))
    assert near.view_height() == pytest.approx(far.view_height() / 3.0)


def test_a_painter_takes_the_eye_in_the_scenes_own_coordinates():
    scene = rts.load_scene("dam_break")
    far = scene.replace(domain=rts.Box((1000, 0, 0), (1003, 2, 0.5)), fluids=(rts.Block((1000, 0, 0), (1001, 1, 0.5)),))
    painter = Painter(far, PictureOptions(eye=(1009, 5, 3), target=(1001, 1, 0)), renderer=NOTHING)
    assert np.subtract(painter.cameras[0].eye, painter.scene.domain.lower) == pytest.approx((9, 5, 3))


def test_text_and_panels_are_three_times_as_large_in_4k():
    now, sizes = reading([1, 2, 2, 2], 2), []
    for height in (720, 2160):
        painter = Painter(SCENE, PictureOptions(height=height), renderer=NOTHING)
        blank = np.full((height, height * 16 // 9, 4), (9, 9, 9, 0), np.uint8)
        rows, columns = np.nonzero(painter.label(blank, now)[..., 3])
        sizes.append((np.ptp(rows), np.ptp(columns)))
    assert np.divide(*sizes[::-1]) == pytest.approx(3, rel=0.05)


def test_pressure_is_coloured_up_to_that_of_the_largest_speed():
    tints = Tints(SCENE)
    assert tints.top_pressure == pytest.approx(500 * SCENE.estimate_max_speed() ** 2)
    law = Medium.of(SCENE, 1.0).equation_of_state
    rho = law.density(tints.top_pressure * np.array([0, 0.25, 0.5, 2]))
    got = tints.of(reading([1, 1, 1, 1], density=rho), "pressure", "default")
    assert np.allclose(got, scalar_colours([0, 0.25, 0.5, 1], 0, 1), atol=0.01)


@pytest.mark.parametrize("view", [{}, {"eye": (9, -9, 5), "target": (0, 0, 0)}])
def test_every_view_of_a_scene_with_z_up_has_z_up(view):
    scene = rts.load_scene("dam_break", gravity=(0, 0, -9.81), view=rts.View(**view))
    for camera in make_cameras(scene, PictureOptions(views=("scene", "front", "side"))):
        low, high = camera.project([[0.1, 0.1, 0.1], [0.1, 0.1, 0.2]], 320, 180)
        assert abs(low[0] - high[0]) < 2.0
        assert low[1] > high[1] + 1.0  # pixels count downward
    top = make_cameras(scene, PictureOptions(views=("top",)))[0]
    left, right = top.project([[0.1, 0.1, 0.1], [0.2, 0.1, 0.1]], 320, 180)
    assert right[0] > left[0] + 5.0


def test_floor_and_ground_lie_across_gravity():
    scene = rts.load_scene("dam_break", gravity=(0, 0, -9.81))
    camera = make_cameras(scene, PictureOptions())[0]
    basis, box = np.array(camera.basis()), (np.array(scene.domain.lower), np.array(scene.domain.upper))
    corner, across, along = lighting.floor_frame(camera, basis, box)
    spot = basis @ (0.5 * (box[0] + box[1]) * [1, 1, 0] - np.asarray(camera.eye)) - corner  # the middle of z = 0
    assert (spot @ across, spot @ along) == pytest.approx((0.5, 0.5))
    plane, _ = lighting.ground_plane(camera, basis, box, 1.0, True)
    np.testing.assert_allclose(plane, [*(basis @ [0, 0, 1]), camera.eye[2]], atol=1e-12)


def test_options_are_typed_as_they_are():
    assert get_type_hints(PictureChoices) == get_type_hints(PictureOptions)
    assert picture_options(colour_by="speed", views=("top",)) == PictureOptions(colour_by="speed", views=("top",))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"color_by": "speed"}, "picture option 'color_by' is unknown; did you mean 'colour_by'"),
        ({"colour_by": "sped"}, "colour_by 'sped' is unknown; did you mean 'speed'"),
        ({"views": ("frontt",)}, "view 'frontt' is unknown; did you mean 'front'"),
        ({"quality": "high"}, r"quality 'high' is unknown \(known: draft, good, best\)"),
    ],
)
def test_a_wrong_option_is_named_with_what_is_meant(options, said):
    with pytest.raises(rts.RenderError, match=said):
        picture_options(**options)
