import textwrap
import types

import pytest

from taichi_rts.device import source_cache
from taichi_rts.device.backend import ti

kernel_impl, ast_transformer_utils = ti.lang.kernel_impl, ti.lang.ast.ast_transformer_utils


@pytest.mark.parametrize("text", ["", "   ", "x = 1", "    for i in range(3):\n", "y = " + " + ".join(["term"] * 40)])
def test_lines_are_those_of_textwrap(text):
    wrapper = source_cache.RememberingWrapper(width=80)
    for _ in range(2):
        lines = wrapper.wrap(text)
        assert lines == textwrap.wrap(text, 80)
        lines.append("a caller's own")


def test_taichi_still_does_what_is_remembered():
    """Else start-up takes half a second longer than it need: see whether there is something else to spare."""
    assert ast_transformer_utils.TextWrapper is source_cache.RememberingWrapper
    assert kernel_impl.textwrap.dedent("  a\n  b") == "a\nb"
    assert isinstance(kernel_impl.textwrap, types.SimpleNamespace)
    assert hasattr(kernel_impl.getsourcelines, "cache_info")


def test_another_taichi_is_left_as_it_is():
    other = types.SimpleNamespace(TextWrapper=print, getsourcelines=print)
    source_cache.remember(other, other)
    assert vars(other) == {"TextWrapper": print, "getsourcelines": print}


def test_errors_still_say_where(taichi_cpu_f64):
    @ti.kernel
    def wrong():
        nowhere()  # noqa: F821

    with pytest.raises(ti.TaichiCompilationError, match=r'(?s)test_source_cache\.py", line \d+, in wrong.*nowhere\(\)'):
        wrong()


def test_kernels_of_classes_are_told_from_others():
    @ti.kernel
    def alone(): ...

    @ti.data_oriented
    class Holder:
        @ti.kernel
        def inside(self): ...

    assert kernel_impl._inside_class is source_cache.is_in_class
    assert not alone._is_classkernel
    assert vars(Holder)["inside"]._is_classkernel
