"""Every case of the gallery against its converged run (`validation/recorded/gallery_*.nc`).

When a case or the physics has changed on purpose, `validation/gallery.py --remake` computes these again.
"""

from __future__ import annotations

import gallery
import pytest


@pytest.mark.parametrize("name", gallery.NAMES)
def test_case_is_close_to_its_converged_run(name: str) -> None:
    found = gallery.compare(name)
    for quantity, bound in zip(gallery.QUANTITIES, gallery.BOUNDS[name], strict=True):
        assert found[quantity] <= bound, quantity


def test_the_gallery_is_recorded_whole() -> None:
    assert {gallery.recording(name).name for name in gallery.NAMES} == {
        file.name for file in gallery.RECORDED.glob("gallery_*.nc")
    }
