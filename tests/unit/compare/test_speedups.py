import math

import pytest

from taichi_rts.compare.speedups import at_equal_error, cost_at, fastest_at, ladder, pareto_front

UNIFORM = [(1.0, 1e-1), (10.0, 1e-3), (5.0, 1e-1), (2.0, 5e-1)]  # the last two are beaten by the first


def test_the_pareto_front_holds_what_no_run_beats_in_both():
    assert pareto_front(UNIFORM) == [0, 1]
    assert pareto_front([(1.0, 1.0), (1.0, 0.5)]) == [1]
    assert pareto_front([]) == []


def test_costs_are_interpolated_in_logarithms():
    cost, bound = cost_at(UNIFORM, 1e-2)
    assert cost == pytest.approx(math.sqrt(10.0))
    assert not bound
    assert cost_at(UNIFORM, 1e-3) == (pytest.approx(10.0), False)
    assert cost_at(UNIFORM, 1e-1) == (pytest.approx(1.0), False)


def test_beyond_the_smallest_error_nothing_is_extrapolated():
    assert cost_at(UNIFORM, 0.9e-3) == (None, False)
    assert at_equal_error(UNIFORM, (1.0, 1e-4)).speedup is None
    assert cost_at([], 1.0) == (None, False)


def test_above_the_largest_error_the_cheapest_counts_and_is_marked():
    assert cost_at(UNIFORM, 0.4) == (1.0, True)
    found = at_equal_error(UNIFORM, (0.5, 0.4))
    assert found.speedup == 2.0
    assert found.bound


def test_a_single_point_is_a_curve_too():
    assert cost_at([(3.0, 0.1)], 0.1) == (3.0, False)
    assert cost_at([(3.0, 0.1)], 0.2) == (3.0, True)
    assert cost_at([(3.0, 0.1)], 0.05) == (None, False)


def test_the_speedup_at_equal_error_is_the_ratio_of_costs():
    assert at_equal_error(UNIFORM, (2.0, 1e-2)).speedup == pytest.approx(math.sqrt(10.0) / 2.0)


def test_the_ladder_goes_in_thirds_of_decades():
    assert ladder(0.01, 0.1) == pytest.approx([0.1, 0.1 / 10 ** (1 / 3), 0.1 / 10 ** (2 / 3), 0.01])
    assert ladder(0.011, 0.02) == []


def test_the_fastest_at_an_error_may_change():
    other = [(2.0, 1e-2), (3.0, 1e-4)]
    curves = {"uniform": UNIFORM, "other": other}
    assert fastest_at(curves, 1e-1)[0] == "uniform"
    assert fastest_at(curves, 1e-2) == ("other", 2.0)
    assert fastest_at(curves, 1e-4) == ("other", 3.0)
    assert fastest_at(curves, 1e-9) is None
