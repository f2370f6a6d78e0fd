import numpy as np
import pytest

from taichi_rts.scene import near_pairs
from taichi_rts.scene.near_pairs import near_pairs as pairs


def found(x, support, others=None):
    listed = [np.stack(part[:2], axis=1) for part in pairs(x, support, others)]
    listed = np.concatenate(listed) if listed else np.zeros((0, 2), int)
    return sorted(map(tuple, listed.tolist()))


@pytest.mark.parametrize("dim", [2, 3])
def test_all_pairs_are_found_once(dim, monkeypatch):
    monkeypatch.setattr(near_pairs, "PART", 70)
    random = np.random.default_rng(dim)
    x = random.uniform(-3.0, 3.0, (200, dim))
    x[:3] = np.array([[1e6], [-1e6], [2.9]])  # far outside, and near the edge
    others = random.uniform(-2.0, 2.0, (150, dim))
    for two in (x, others):
        distance2 = ((x[:, None] - two) ** 2).sum(axis=2)
        assert found(x, 0.7, None if two is x else others) == list(map(tuple, np.argwhere(distance2 < 0.7**2).tolist()))
    i, j, distance2 = (np.concatenate(part) for part in zip(*pairs(x, 0.7, others), strict=True))
    assert len(i) > 100
    assert np.array_equal(distance2, ((x[i] - others[j]) ** 2).sum(axis=1))


def test_without_points_there_are_no_pairs():
    assert found(np.zeros((0, 3)), 1.0) == []
    assert found(np.zeros((2, 3)), 1.0, np.zeros((0, 3))) == []
