import json

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.sampling.sampling import sample
from taichi_rts.scene.loading import scene_from

BOX = rts.Box((0, 0), (2, 1))
SPACING = 0.1


def lattice(columns=5, rows=5, spacing=SPACING):
    axes = [spacing * (np.arange(n) + 0.5) for n in (columns, rows)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)


def scene(*fluids, **changes):
    return rts.Scene(**({"domain": BOX, "fluids": fluids, "spacing": SPACING} | changes))


def complaint(*fluids, **changes):
    with pytest.raises(rts.SceneError) as caught:
        scene(*fluids, **changes)
    return str(caught.value)


def test_a_lattice_given_one_by_one_is_the_block_it_is_from():
    x = lattice()
    given = scene(rts.Particles(x, np.tile((1.0, 0.0), (25, 1))))
    block = scene(rts.Block((0, 0), (0.5, 0.5), velocity=(1.0, 0.0)))
    one, two = sample(given), sample(block)
    np.testing.assert_array_equal(one.positions, two.positions)
    np.testing.assert_array_equal(one.velocities, two.velocities)
    np.testing.assert_array_equal(one.densities, two.densities)
    assert one.mass == two.mass
    assert given.volume == pytest.approx(block.volume)
    assert given.fluids[0].top_speed == 1.0
    assert given.estimate_max_speed() == pytest.approx(np.sqrt(1.0 + 2 * 9.81 * 0.45))  # from the top centre


def test_particles_are_copied_and_cannot_be_changed():
    x = lattice()
    fluid = rts.Particles(x)
    x[0] = 7.0
    assert fluid.positions[0].tolist() == pytest.approx([0.05, 0.05])
    with pytest.raises(ValueError, match="read-only"):
        fluid.positions[0] = 7.0
    assert fluid == rts.Particles(lattice())
    assert fluid != rts.Particles(lattice() + 1e-9)
    assert len({fluid, rts.Particles(lattice())}) == 1
    assert repr(fluid) == "Particles(25)"


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        ({}, ["give either positions or a file"]),
        ({"positions": lattice(), "file": "x.ply"}, ["give either positions or a file"]),
        ({"positions": np.zeros((3, 4))}, ["shape (3, 4)", "(N, 2) or (N, 3)"]),
        ({"positions": np.zeros((0, 2))}, ["shape (0, 2)", "N at least 1"]),
        ({"positions": "here"}, ["str is no array of numbers"]),
        ({"positions": [[0.0, 1.0], [2.0]]}, ["list is no array of numbers"]),
        ({"positions": [[0.0, 1.0], [np.nan, 1.0]]}, ["positions: that of particle 1", "nan", "finite"]),
        ({"positions": lattice(), "velocities": np.zeros((24, 2))}, ["(24, 2)", "(25, 2) is needed"]),
        ({"positions": lattice(), "velocities": np.full((25, 2), np.inf)}, ["velocities: that of particle 0", "inf"]),
        (
            {"positions": lattice(), "densities": np.zeros(25)},
            ["densities: that of particle 0 is 0; it must be above 0"],
        ),
        ({"positions": lattice(), "densities": np.ones(3)}, ["(3,)", "(25,) is needed"]),
        ({"positions": lattice(), "sha256": "00"}, ["others than those of sha256 00"]),
        ({"positons": lattice()}, ["did you mean 'positions'"]),
    ],
)
def test_wrong_arrays_are_refused(arguments, parts):
    with pytest.raises(rts.SceneError) as caught:
        rts.Particles(**arguments)
    for part in parts:
        assert part in str(caught.value)


def test_particles_must_fit_into_the_scene():
    x = lattice()
    assert "fluids.0: particles from (0.05, 0.05) to (0.45, 3.0) leaves the domain" in complaint(
        rts.Particles(np.concatenate([x, [[0.1, 3.0]]]))
    )
    near = np.concatenate([x, [[0.055, 0.05]]])
    said = complaint(rts.Particles(near))
    assert "particles 0 of fluids.0 and 25 of fluids.0 lie 0.005 apart, nearer than 0.1 spacings 0.01; remove" in said
    assert "of fluids.1 lie 1.41e-09 apart" in complaint(rts.Particles(x), rts.Particles(x[20:] + 1e-9))
    said = complaint(rts.Particles(lattice(12, 12, 0.04)))
    assert "spacing: 0.1 is too large for the particles of fluids.0" in said
    assert float(said.rpartition("use about ")[2]) == pytest.approx(0.04, rel=0.2)


def test_particles_beside_blocks_and_spheres():
    x = lattice()
    scene(rts.Particles(x), rts.Block((0.5, 0), (1.0, 0.5)), rts.Sphere((1.5, 0.5), 0.2))
    assert "fluids.1: overlaps fluids.0" in complaint(rts.Particles(x), rts.Block((0.4, 0), (1.0, 0.5)))
    assert "fluids.1: overlaps fluids.0" in complaint(rts.Sphere((0.6, 0.5), 0.2), rts.Particles(x))
    assert "nearer than half a spacing" in complaint(rts.Sphere((0.68, 0.25), 0.2), rts.Particles(x))


def test_a_count_of_particles_does_not_go_with_them(tmp_path):
    write_scene(tmp_path, "cloud.npz")
    with pytest.raises(rts.SceneError, match="particles 500 cannot be had where the scene gives them one by one"):
        rts.load_scene(tmp_path / "scene.toml", particles=500)


def write_scene(folder, file, spacing=SPACING):
    velocities, rho = np.full((25, 2), 0.25), np.full(25, 1001.0)
    rts.write_particles(
        folder / "cloud.npz", rts.ParticleFrame(lattice(), {"velocity": velocities, "density": rho}, spacing=0.1)
    )
    path = folder / "scene.toml"
    path.write_text(
        f"spacing = {spacing}\ndomain = {{ lower = [0.0, 0.0], upper = [2.0, 1.0] }}\n[[fluids]]\nfile = '{file}'\n"
    )
    return path


def test_a_scene_file_names_a_particle_file_beside_it(tmp_path):
    loaded = rts.load_scene(write_scene(tmp_path, "cloud.npz"))
    start = sample(loaded)
    np.testing.assert_array_equal(start.positions, lattice())
    assert (start.velocities == 0.25).all()
    assert (start.densities == 1001.0).all()
    with pytest.raises(
        rts.SceneError, match=r"spacing: 0\.08 is not the 0\.1 with which the particles of fluids\.0 were made"
    ):
        rts.load_scene(tmp_path / "scene.toml", spacing=0.08)


def test_plain_data_names_the_file_or_the_hash(tmp_path):
    loaded = rts.load_scene(write_scene(tmp_path, "cloud.npz"))
    data = json.loads(json.dumps(loaded.to_dict()))
    assert data["fluids"] == [{"file": str(tmp_path / "cloud.npz"), "sha256": loaded.fluids[0].digest}]
    assert scene_from(data) == loaded
    rts.write_particles(tmp_path / "cloud.npz", rts.ParticleFrame(lattice(4), spacing=0.1))
    with pytest.raises(rts.SceneError, match="are others than those of sha256"):
        scene_from(data)
    data = scene(rts.Particles(lattice())).to_dict()
    assert data["fluids"] == [{"count": 25, "sha256": rts.Particles(lattice()).digest}]
    with pytest.raises(rts.SceneError, match="only says that there were 25 particles; write them to a file"):
        scene_from(json.loads(json.dumps(data)))


@pytest.mark.slow
def test_one_runs_output_is_the_nexts_input(start_taichi, quick, tmp_path):
    """Half a dam break, its file, and the other half: the same to rounding as in one go, but for the start of the steps."""
    first = scene(rts.Block((0, 0), (0.8, 0.8)), sound_speed=40.0)
    with start_taichi("cpu", "f64", **quick):
        sim = rts.Simulation(first, rts.Uniform())
        sim.run(0.1, on_frame=rts.Exporter(tmp_path, ["npz"]), fps=10)
        sim.advance_to(0.2)
        whole, moved = sim.positions(), np.linalg.norm(sim.positions() - sample(first).positions, axis=1).max()
    second = first.replace(fluids=[rts.Particles(file=str(tmp_path / "particles" / "000001.npz"))])
    with start_taichi("cpu", "f64", **quick):
        sim = rts.Simulation(second, rts.Uniform())
        assert sim.count == 64
        sim.advance_to(0.1)
        gap = np.linalg.norm(sim.positions() - whole, axis=1).max()
    assert moved > 0.15
    assert gap < 0.01 * moved
