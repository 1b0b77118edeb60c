"""The view: what the browser reads out of it is what Python put in."""

from __future__ import annotations

import re

import numpy as np
import pytest

from specularia.report import viewer
from specularia.report.figures import _hemisphere


def shown(html: str, name: str) -> tuple[float | None, str]:
    """The exact value and the text of one of the page's read-outs."""
    found = re.search(rf'<p [^>]*id="{name}"[^>]*>(.*?)</p>', html, re.S)
    assert found, name
    value = re.search(r'data-value="([^"]*)"', found.group(0)).group(1)
    return (float(value) if value else None), found.group(1)


@pytest.fixture
def view(lobe, tmp_path):
    models = {"Model M": lobe(width=0.05), "Model C": lobe(width=0.1, even=0.02, last_deg=70.0)}
    path = viewer.write_view(models, tmp_path / "view.html", theta_deg=[0, 20, 40, 60, 80])
    return models, path


def test_values_in_the_browser_equal_those_in_python(view, browse):
    models, path = view
    html, log = browse(path, "#side=transmission_front&theta=40&x=-38&y=5")
    assert "CONSOLE" not in log
    assert 'data-ready="yes"' in html
    grid = _hemisphere.pixels(120)
    for k, model in enumerate(models.values()):
        dsf = _hemisphere.mean_dsf(model, "transmission_front", 40.0, 0.0, grid)
        value, text = shown(html, f"value-{k}")
        # Pixel of (-38, 5) degrees: 1.5 degrees wide, counted from -90.
        assert value == pytest.approx(dsf[int(95 / 1.5), int(52 / 1.5)], rel=5e-4)
        assert text.startswith("38.3° off normal, φ 173°: DSF ")
        assert shown(html, f"tau-{k}")[0] == pytest.approx(float(model.direct_hemispherical("", 40.0)))


def test_buttons_and_slider_change_what_is_shown(view, browse):
    _, path = view
    text = path.read_text(encoding="utf-8")
    act = """<script>
    document.querySelector('[data-side="transmission_back"]').click();
    const s = document.getElementById("theta"); s.value = "4"; s.dispatchEvent(new Event("input"));
    </script></body>"""
    path.write_text(text.replace("</body>", act), encoding="utf-8")
    html, log = browse(path, "#x=0&y=0")
    assert "CONSOLE" not in log
    assert re.search(r'data-side="transmission_back"[^>]*aria-pressed="true"', html)
    assert "θᵢ = 80°" in html
    assert shown(html, "tau-0")[1] == "τ = 0.7000 (extrapolated)"
    assert shown(html, "tau-1") == (None, "no data at this angle")
    assert shown(html, "value-1")[1].endswith("no data")
    value, _ = shown(html, "value-0")
    # Far from the lobe only the even background is left: BSDF 0.1 / pi, near the normal also the DSF.
    assert value == pytest.approx(0.1 / np.pi, rel=2e-3)


def test_the_file_is_self_contained_and_small(view):
    models, path = view
    text = path.read_text(encoding="utf-8")
    assert "http" not in re.sub(r"<!--.*?-->", "", text).replace("Content-Security-Policy", "").replace(
        "http-equiv", ""
    )
    maps = len(models) * 2 * 5
    assert path.stat().st_size < maps * 120 * 120 * 2 * 4 / 3 * 1.02 + 40_000


def test_codes_keep_values_to_a_thousandth_and_tell_nothing_from_zero():
    values = np.concatenate([np.logspace(-7, 2, 1000), [0.0, -1.0, np.nan]])
    codes, low, step = viewer._coded(values)
    back = 10.0 ** (low + (codes[:1000].astype(float) - 2) * step)
    np.testing.assert_allclose(back, values[:1000], rtol=5e-4)
    assert codes[1000] == codes[1001] == 1
    assert codes[1002] == 0


def test_standard_angles_ascend_and_hold_those_of_the_paper():
    angles = list(viewer.ANGLES)
    assert angles == sorted(set(angles))
    assert {0, 20, 40, 60, 82.5} <= set(angles)
    assert max(angles) < 90
