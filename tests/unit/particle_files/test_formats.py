"""Every format is read back by a library that others wrote, and by our own reader where there is one."""

import gzip
import subprocess
import sys

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.particle_files.formats import FORMATS, READ

COUNT = 11**3


def frame(dim=3, dtype=np.float32, seed=0):
    """A cube (square) of water whose every number is different."""
    random = np.random.default_rng(seed)
    axis = 0.05 * np.arange(11)
    x = np.stack(np.meshgrid(*[axis] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
    x = (x + 0.01 * random.random(x.shape)).astype(dtype)
    attributes = {
        "id": np.arange(len(x), dtype=np.int32),
        "velocity": random.normal(size=x.shape).astype(dtype),
        "density": (1000.0 + random.random(len(x))).astype(dtype),
        "level": random.integers(1, 9, len(x), dtype=np.int32),
    }
    return rts.ParticleFrame(x, attributes, time=0.125, spacing=0.05)


def written(folder, name, content):
    each = FORMATS[name]
    path = folder / f"particles{each.suffix}"
    path.write_bytes(each.write(content))
    return path


def flat(vectors):
    """Two-dimensional vectors as tools in three dimensions see them."""
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("name", [name for name, each in FORMATS.items() if each.read and each.write])
def test_our_own_reader_gets_it_back(tmp_path, name, dim):
    content = frame(dim)
    found = rts.read_particles(written(tmp_path, name, content))
    np.testing.assert_array_equal(found.positions, content.positions)
    for key, values in content.attributes.items():
        np.testing.assert_array_equal(found.attributes[key], values)
        assert found.attributes[key].dtype.kind == values.dtype.kind
    assert found.time == (0.0 if name == "bgeo" else 0.125)
    assert found.spacing == (0.05 if name == "npz" else None)


def test_npz_and_vtu_keep_double_precision(tmp_path):
    content = frame(3, np.float64)
    for name in ("npz", "vtu"):
        found = rts.read_particles(written(tmp_path, name, content))
        assert found.positions.dtype == np.float64
        np.testing.assert_array_equal(found.positions, content.positions)
    single = rts.read_particles(written(tmp_path, "ply", content)).positions
    np.testing.assert_array_equal(single, content.positions.astype(np.float32))


@pytest.mark.parametrize("dim", [2, 3])
def test_meshio_reads_vtu(tmp_path, dim):
    meshio = pytest.importorskip("meshio")
    content = frame(dim)
    mesh = meshio.read(written(tmp_path, "vtu", content))
    np.testing.assert_array_equal(mesh.points, flat(content.positions))
    np.testing.assert_array_equal(mesh.point_data["velocity"], flat(content.attributes["velocity"]))
    for name in ("id", "density", "level"):
        np.testing.assert_array_equal(mesh.point_data[name], content.attributes[name])
    np.testing.assert_array_equal(mesh.cells_dict["vertex"][:, 0], np.arange(len(content.positions)))
    assert mesh.field_data["TimeValue"] == [0.125]


def test_meshio_reads_vtu_whatever_the_number_of_particles(tmp_path):
    """It mistakes one array for another where an offset in its copy of the file is one in the file."""
    meshio = pytest.importorskip("meshio")
    for count in (*range(1, 40), 1025):
        numbers = np.arange(count)
        attributes = {
            "id": numbers.astype(np.int32),
            "speed": numbers.astype(np.float32),
            "fluid": -numbers.astype(np.int32),
        }
        content = rts.ParticleFrame(np.outer(numbers, [1.0, 2.0, 3.0]).astype(np.float32), attributes)
        mesh = meshio.read(written(tmp_path, "vtu", content))
        np.testing.assert_array_equal(mesh.points, content.positions)
        for name, values in attributes.items():
            np.testing.assert_array_equal(mesh.point_data[name], values)


def test_meshio_reads_ply(tmp_path):
    meshio = pytest.importorskip("meshio")
    content = frame()
    mesh = meshio.read(written(tmp_path, "ply", content))
    np.testing.assert_array_equal(mesh.points, content.positions)
    for d, name in enumerate(("vx", "vy", "vz")):
        np.testing.assert_array_equal(mesh.point_data[name], content.attributes["velocity"][:, d])
    np.testing.assert_array_equal(mesh.point_data["level"], content.attributes["level"])


@pytest.mark.parametrize("name", ["vtu", "vtkhdf"])
def test_vtk_reads_vtu_and_vtkhdf(tmp_path, name):
    pyvista = pytest.importorskip("pyvista")
    if name == "vtkhdf":
        pytest.importorskip("h5py")
    content = frame()
    cloud = pyvista.read(written(tmp_path, name, content))
    np.testing.assert_array_equal(cloud.points, content.positions)
    for key, values in content.attributes.items():
        np.testing.assert_array_equal(cloud.point_data[key], values)
    assert cloud.n_cells == COUNT
    assert set(cloud.celltypes) == {pyvista.CellType.VERTEX}
    assert cloud.field_data["TimeValue"][0] == 0.125


def test_the_blender_loaders_reader_reads_bgeo(tmp_path):
    """`pysplashsurf.bgeo` holds that of the sequence loader; it takes gzipped files only."""
    pytest.importorskip("meshio")
    bgeo = pytest.importorskip("pysplashsurf.bgeo")
    content = frame()
    path = written(tmp_path, "bgeo", content)
    zipped = tmp_path / "zipped.bgeo"
    zipped.write_bytes(gzip.compress(path.read_bytes()))
    mesh = bgeo.readbgeo_to_meshio(zipped)
    np.testing.assert_array_equal(mesh.points, content.positions)
    np.testing.assert_array_equal(mesh.point_data["v"], content.attributes["velocity"])
    np.testing.assert_array_equal(mesh.point_data["level"], content.attributes["level"])
    np.testing.assert_array_equal(mesh.point_data["pscale"], np.full(COUNT, 0.025, np.float32))
    np.testing.assert_array_equal(rts.read_particles(zipped).positions, content.positions)


@pytest.mark.parametrize("name", ["bgeo", "ply"])
def test_splashsurf_reads_particles(tmp_path, name):
    """Its command line, in a process of its own, because it starts its log only once."""
    pytest.importorskip("pysplashsurf")
    path, surface = written(tmp_path, name, frame()), tmp_path / "surface.ply"
    words = [
        "splashsurf",
        "reconstruct",
        str(path),
        "-r",
        "0.025",
        "-l",
        "2",
        "-c",
        "1",
        "-t",
        "0.6",
        "-o",
        str(surface),
    ]
    code = f"import pysplashsurf; pysplashsurf.run_splashsurf({words})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout
    corners = rts.read_particles(surface).positions
    np.testing.assert_allclose(np.ptp(corners, axis=0), 0.55, atol=0.06)  # as large as the water, from cell to cell


def test_the_surface_is_closed_and_holds_the_water(tmp_path):
    pytest.importorskip("pysplashsurf")
    pyvista = pytest.importorskip("pyvista")
    content = frame()
    content.attributes["velocity"][:] = (1.0, 2.0, 3.0)
    surface = pyvista.read(written(tmp_path, "surface", content))
    assert surface.n_open_edges == 0
    assert surface.volume == pytest.approx(0.55**3, rel=0.1)
    corners = rts.read_particles(tmp_path / "particles.ply")
    np.testing.assert_allclose(
        corners.attributes["velocity"], np.tile((1.0, 2.0, 3.0), (surface.n_points, 1)), rtol=1e-5
    )


@pytest.mark.parametrize(
    ("text", "columns"),
    [
        ("x,y,z,vx,vy,vz\n1,2,3,4,5,6\n7,8,9,10,11,12\n", 3),
        ("x;y;density\n1;2;1000\n3;4;1001\n", 2),
        ("x y\n1 2\n3 4\n", 2),
    ],
)
def test_tables_of_text_are_read(tmp_path, text, columns):
    path = tmp_path / "particles.csv"
    path.write_text(text)
    found = rts.read_particles(path)
    assert found.positions.shape == (2, columns)
    assert found.positions[0].tolist() == [1.0, 2.0, 3.0][:columns]
    if columns == 3:
        assert found.attributes["velocity"].tolist() == [[4.0, 5.0, 6.0], [10.0, 11.0, 12.0]]
    if "density" in text:
        assert found.attributes["density"].tolist() == [1000.0, 1001.0]


def test_text_ply_of_other_tools_is_read(tmp_path):
    path = tmp_path / "cloud.ply"
    rows = "0.5 1 2 255\n3 4 5.25 0\n"
    head = "ply\r\nformat ascii 1.0\r\ncomment x\r\nelement vertex 2\r\nproperty float32 x\r\nproperty double y\r\n"
    path.write_bytes((head + "property float z\r\nproperty uchar red\r\nend_header\r\n" + rows).encode())
    found = rts.read_particles(path)
    assert found.positions.tolist() == [[0.5, 1.0, 2.0], [3.0, 4.0, 5.25]]
    assert found.attributes["red"].tolist() == [255, 0]


@pytest.mark.parametrize("suffix", sorted(READ))
@pytest.mark.parametrize("damage", ["cut", "noise", "empty", "words"])
def test_a_damaged_file_is_one_error(tmp_path, suffix, damage):
    path = tmp_path / f"particles{suffix}"
    each = next(each for each in FORMATS.values() if each.suffix == suffix)
    whole = each.write(frame()) if each.write else b"x,y,z\n1,2,3\n"
    cut = whole[: len(whole) // 2] if each.write else b"x,y,z\n1,2\n"
    noise = np.random.default_rng(1).bytes(1000)
    path.write_bytes({"cut": cut, "noise": noise, "empty": b"", "words": b"no particles\nhere\n"}[damage])
    with pytest.raises(rts.SceneError, match=rf"particle file '.*{suffix}' is not a whole {suffix} file: .") as caught:
        rts.read_particles(path)
    assert "\n" not in str(caught.value)


def test_unknown_and_missing_files_are_one_error(tmp_path):
    with pytest.raises(
        rts.SceneError, match=r"has none of the known suffixes \.vtu, \.ply, \.npz, \.bgeo, \.csv; convert it"
    ):
        rts.read_particles(tmp_path / "particles.abc")
    with pytest.raises(
        rts.SceneError, match=r"missing\.ply' cannot be read: No such file or directory; check the path"
    ):
        rts.read_particles(tmp_path / "missing.ply")
    with pytest.raises(rts.OutputError, match="'abc' is no format"):
        rts.write_particles(tmp_path / "particles.abc", frame())
    rts.write_particles(tmp_path / "particles.PLY", frame())
    assert len(rts.read_particles(tmp_path / "particles.PLY").positions) == COUNT


def test_a_pickle_is_never_loaded(tmp_path):
    np.savez(tmp_path / "evil.npz", position=np.array([{"a": 1}], dtype=object))
    with pytest.raises(rts.SceneError, match="Object arrays cannot be loaded"):
        rts.read_particles(tmp_path / "evil.npz")
