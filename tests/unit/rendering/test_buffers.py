from taichi_rts.device.backend import ti
from taichi_rts.rendering.buffers import Buffer


def test_a_buffer_is_freed_only_in_its_own_runtime(start_taichi, monkeypatch):
    freed = []
    monkeypatch.setattr(ti.ScalarNdarray, "__del__", lambda array: freed.append(array.shape))
    with start_taichi("cpu"):
        present, earlier = Buffer(ti.i32, 3), Buffer(ti.i32, 5)
        del present
        assert freed == [(3,)]
    with start_taichi("cpu"):
        del earlier
        assert freed == [(3,)]
