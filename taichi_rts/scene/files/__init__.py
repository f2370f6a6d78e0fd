"""Scenes of other programs as the plain data that `taichi_rts.scene.loading.scene_from` takes."""
