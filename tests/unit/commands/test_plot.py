"""Curves of time series, with what is drawn read back from the picture's data."""

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.commands.main import main
from taichi_rts.commands.plot import Curves, diagrams_of, series_of

SERIES = """time,kinetic_energy,max_speed,level_1,level_2,force_x-,pressure_P1
0,0,0,0,1,5,0
0.1,2,1,0.25,0.75,6,900
0.2,8,2,0.5,0.5,7,1000
"""


@pytest.fixture
def run(tmp_path):
    folder = tmp_path / "dam"
    folder.mkdir()
    (folder / "series.csv").write_text(SERIES)
    return folder


def test_each_kind_of_quantity_has_a_diagram(run):
    (curves,) = series_of(run, several=False)
    np.testing.assert_array_equal(curves.time, [0, 0.1, 0.2])
    np.testing.assert_array_equal(curves.values["pressure_P1"], [0, 900, 1000])
    assert diagrams_of([curves]) == {
        "energy [J]": ["kinetic_energy"],
        "largest speed [m/s]": ["max_speed"],
        "share of particles": ["level_1", "level_2"],
        "pressure [Pa]": ["pressure_P1"],
        "force [N]": ["force_x-"],
    }
    assert diagrams_of([curves], ["level", "max_speed"]) == {
        "largest speed [m/s]": ["max_speed"],
        "share of particles": ["level_1", "level_2"],
    }


def test_beside_measurements_only_what_was_measured_is_drawn(run):
    (run / "lab.csv").write_text("\ufefftime, pressure_P1, height_H1\n0.05, 450, 0.2\n0.15, , 0.1\n")
    measured = Curves.of(run / "lab.csv", "measured")
    np.testing.assert_array_equal(measured.values["pressure_P1"], [450, np.nan])
    assert diagrams_of(series_of(run, several=False), (), measured) == {"pressure [Pa]": ["pressure_P1"]}


@pytest.mark.parametrize(("kind", "begin"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")])
def test_the_ending_says_the_kind_of_picture(run, kind, begin, capsys):
    main(["plot", str(run), "--output", str(run / f"curves.{kind}")])
    assert (run / f"curves.{kind}").read_bytes().startswith(begin)
    assert "6 curves of 1 time series" in capsys.readouterr().out


def test_runs_are_drawn_together_and_a_picture_is_not_replaced(run, capsys):
    other = run.parent / "other"
    other.mkdir()
    (other / "series.csv").write_text(SERIES)
    (other / "series_2.csv").write_text(SERIES)
    main(["plot", str(run), str(other), "--columns", "level"])
    assert "2 curves of 3 time series" in capsys.readouterr().out
    assert [curves.name for curves in series_of(other, several=True)] == ["other, series", "other, series_2"]
    before = (run / "series.png").read_bytes()
    with pytest.raises(SystemExit, match="2"):
        main(["plot", str(run)])
    assert "is there already; give --overwrite" in capsys.readouterr().err
    assert (run / "series.png").read_bytes() == before


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "has no column 'time' .* names nothing"),
        ("t,x\n1,2\n", "has no column 'time' .* names t, x"),
        ("time,x\n1,2\n2\n", "line 3: 1 values for 2 columns"),
        ("time,x\n1,two\n", "line 2: 'two' is no number"),
        ("time,x\n", "has no rows"),
    ],
)
def test_what_is_no_series_is_refused(tmp_path, text, said):
    (tmp_path / "series.csv").write_text(text)
    with pytest.raises(rts.OutputError, match=said):
        series_of(tmp_path, several=False)


def test_columns_that_are_not_there_are_refused(run):
    curves = series_of(run, several=False)
    with pytest.raises(rts.OutputError, match="no run has a column 'max_sped'; did you mean 'max_speed'"):
        diagrams_of(curves, ["max_sped"])
    other = Curves("measured", np.zeros(1), {"height_H1": np.zeros(1)})
    with pytest.raises(rts.OutputError, match=r"no column of the measurements \(height_H1\) is one of the run's"):
        diagrams_of(curves, (), other)
