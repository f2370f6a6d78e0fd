"""Scenes of other programs as the plain data that `taichi_rts.scene.scene_from` takes."""
