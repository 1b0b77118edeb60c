"""The page of a day: what a real browser reads out of it is what was put in. All of it is synthetic."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from specularia.daylight import DayHour, DayImage, DayResult, Place, Point, Time, sun_position
from specularia.report.day_page import write_day
from specularia.report.figures import day_curves

PLACE = Place(latitude_deg=37.94, longitude_deg=27.34, time_zone="solar")


def luminance(model: int, hour: float, date: int) -> np.ndarray:
    """A smooth room over four decades with a bright pane; no-data in one corner, no light in another."""
    r, c = np.mgrid[0:30, 0:40]
    picture = 2.0 * (1 + model) * (hour / 8) ** 2 * (1 + date) * 10 ** (c / 20 + r / 60)
    picture[10:14, 18:22] = 5000.0 / (1 + model)
    picture[0, 0], picture[29, 39] = np.nan, 0.0
    return picture


def lux(model: int, hour: float, date: int, point: int) -> float:
    return 100.0 * (1 + model) * (13 - abs(hour - 12)) * (1 + date) / (1 + point)


@pytest.fixture
def result(tmp_path: Path) -> DayResult:
    hours, out = [], []
    for d, date in enumerate(("0620-06-21", "0620-12-21")):
        for hour in (4.0, 8.0, 10.5, 14.0):
            time = Time(date=date, calendar="julian", hour=hour)
            if hour == 4.0:
                out.append((time, "night"))
                continue
            points, images = [], []
            for m, model in enumerate(("M", "C")):
                for p, name in enumerate(("floor", "wall <b>")):
                    e = lux(m, hour, d, p)
                    points.append(Point(name, model, e, 0.01 * e, 0.9 * e, 0.1 * e))
                npz = tmp_path / f"{date}_{hour}_{model}.npz"
                np.savez(npz, luminance=luminance(m, hour, d).astype(np.float32))
                images.append(DayImage(model, "view", npz, {"floor": (20.5, 25.5)}))
            hours.append(DayHour(time, sun_position(PLACE, time), "clear", 7e4, 9e3, points, images))
    return DayResult("a room", "true solar time", hours, out, {"synthetic": "yes"})


def read_out(html: str, k: int) -> tuple[float | None, str]:
    found = re.search(rf'<p [^>]*id="value-{k}"[^>]*>(.*?)</p>', html, re.S)
    assert found
    value = re.search(r'data-value="([^"]*)"', found.group(0))
    assert value
    return (float(value.group(1)) if value.group(1) else None), found.group(1)


def table(html: str) -> list[list[float]]:
    body = re.search(r"<tbody>(.*?)</tbody>", html, re.S)
    assert body
    return [
        [float(v) for v in re.findall(r'data-value="([^"]*)"', row)]
        for row in body.group(1).split("</tr>")[:-1]
    ]


def test_the_browser_shows_the_luminance_and_the_illuminances_of_the_chosen_hour(
    result, browse, tmp_path
) -> None:  # type: ignore[no-untyped-def]
    path = write_day(result, tmp_path / "day.html", synthetic=True)
    html, log = browse(path, "#date=0620-12-21&hour=10.5&column=7&row=22")
    assert "CONSOLE" not in log
    assert 'data-ready="yes"' in html
    assert '<span class="label">synthetic</span>' in html
    for k in range(2):
        value, text = read_out(html, k)
        assert value == pytest.approx(luminance(k, 10.5, 1)[22, 7], rel=1.2e-3)
        assert text.startswith("column 7, row 22: L = ")
    assert table(html) == [[lux(m, 10.5, 1, p) for m in range(2)] for p in range(2)]
    sun = result.hours[4].position
    assert f"sun {sun.apparent_elevation_deg:.1f}° high at {sun.azimuth_deg:.1f}° from north" in html
    assert "0620-12-21 (Julian), 10:30 true solar time" in html
    assert "Left out for want of light: 1 hour (04:00)." in html
    # Names of points are text, whatever they hold.
    assert "2  wall &lt;b&gt;</button>" in html


def test_slider_dates_and_exposure_change_what_is_shown(result, browse, tmp_path) -> None:  # type: ignore[no-untyped-def]
    path = write_day(result, tmp_path / "day.html")
    act = """<script>
    const move = (id, v) => {
      const s = document.getElementById(id);
      s.value = v; s.dispatchEvent(new Event("input"));
    };
    document.querySelector('[data-day="1"]').click();
    move("hour", "2");
    move("ev", "3");
    document.querySelectorAll("tbody button")[1].click();
    const map = document.getElementById("map-0");
    // Two steps right and a leap down from the middle, on the keyboard.
    setTimeout(() => {
      for (const [key, shiftKey] of [["ArrowRight", false], ["ArrowRight", false], ["ArrowDown", true]])
        map.dispatchEvent(new KeyboardEvent("keydown", { key, shiftKey, cancelable: true }));
      setTimeout(() => {
        const inner = map.getContext("2d").getImageData(2, Math.round(map.height / 2), 1, 1).data;
        document.documentElement.dataset.grey = [...inner.slice(0, 3)].join();
        const label = document.getElementById("exposing");
        document.documentElement.dataset.opaque = getComputedStyle(label).opacity;
      }, 300);
    }, 500);
    </script></body>"""
    path.write_text(path.read_text(encoding="utf-8").replace("</body>", act), encoding="utf-8")
    html, log = browse(path)
    assert "CONSOLE" not in log
    assert "synthetic</span>" not in html
    assert re.search(r'data-day="1" aria-pressed="true"', html)
    assert re.search(r'data-mode="picture" aria-pressed="true"', html)
    assert 'aria-valuetext="14:00"' in html and "+3 EV" in html
    assert 'data-opaque="1"' in html
    # From the middle (20, 15), where the mark first shows.
    value, text = read_out(html, 0)
    assert text.startswith("column 21, row 25")
    assert value == pytest.approx(luminance(0, 14.0, 1)[25, 21], rel=1.2e-3)
    assert re.search(r'aria-label="Illuminance at wall &lt;b&gt; over the hours of 0620-12-21"', html)
    grey = [int(v) for v in re.search(r'data-grey="([^"]*)"', html).group(1).split(",")]  # type: ignore[union-attr]
    assert grey[0] == grey[1] == grey[2] > 0


def test_the_value_under_the_pointer_is_shown_for_all_models_and_goes_when_it_leaves(  # type: ignore[no-untyped-def]
    result, browse, tmp_path
) -> None:
    path = write_day(result, tmp_path / "day.html")
    page = path.read_text(encoding="utf-8")
    act = """<script>
    setTimeout(() => {
      const map = document.getElementById("map-1"), box = map.getBoundingClientRect();
      // The middle of column 30, row 8.
      const clientX = box.left + box.width * 30.5 / 40, clientY = box.top + box.height * 8.5 / 30;
      map.dispatchEvent(new PointerEvent("pointermove", { clientX, clientY }));
      LEAVE
    }, 500);
    </script></body>"""
    path.write_text(page.replace("</body>", act.replace("LEAVE", "")), encoding="utf-8")
    html, log = browse(path, "#date=0620-06-21&hour=8")
    assert "CONSOLE" not in log
    for k in range(2):
        assert read_out(html, k)[0] == pytest.approx(luminance(k, 8.0, 0)[8, 30], rel=1.2e-3)
        assert read_out(html, k)[1].startswith("column 30, row 8: L = ")
    leave = 'map.dispatchEvent(new PointerEvent("pointerleave"));'
    path.write_text(page.replace("</body>", act.replace("LEAVE", leave)), encoding="utf-8")
    html, _ = browse(path, "#date=0620-06-21&hour=8")
    assert [read_out(html, k)[0] for k in range(2)] == [None, None]


def test_no_light_and_no_data_are_told_apart_in_the_browser(result, browse, tmp_path) -> None:  # type: ignore[no-untyped-def]
    path = write_day(result, tmp_path / "day.html")
    for place, says in [("column=0&row=0", "no data"), ("column=39&row=29", "no light")]:
        html, _ = browse(path, f"#hour=8&{place}")
        assert read_out(html, 0)[1].endswith(says)


def test_the_page_needs_no_network_and_stays_small(result, tmp_path) -> None:  # type: ignore[no-untyped-def]
    path = write_day(result, tmp_path / "day.html")
    text = path.read_text(encoding="utf-8")
    assert "http" not in text.replace("http-equiv", "")
    assert "default-src 'none'" in text
    assert path.stat().st_size < 12 * 30 * 40 * 2 * 4 / 3 + 45_000


def test_a_day_without_pictures_or_without_points_is_a_page_too(result, browse, tmp_path) -> None:  # type: ignore[no-untyped-def]
    from dataclasses import replace

    blind = replace(result, hours=[replace(h, images=[]) for h in result.hours])
    html, log = browse(write_day(blind, tmp_path / "blind.html"), "#hour=14")
    assert "CONSOLE" not in log and 'data-ready="yes"' in html
    assert table(html)[0] == [lux(m, 14.0, 0, 0) for m in range(2)]
    bare = replace(result, hours=[replace(h, points=[]) for h in result.hours])
    html, log = browse(write_day(bare, tmp_path / "bare.html"), "#hour=14&column=7&row=22")
    assert "CONSOLE" not in log
    assert read_out(html, 1)[0] == pytest.approx(luminance(1, 14.0, 0)[22, 7], rel=1.2e-3)


def test_the_curves_save_every_illuminance_beside_them(result, tmp_path) -> None:  # type: ignore[no-untyped-def]
    path = day_curves(result, tmp_path / "day.png", synthetic=True)
    assert path.stat().st_size > 10_000
    rows = (tmp_path / "day.csv").read_text().splitlines()
    assert rows[0] == "date,hour,point,model,illuminance_lx,se_lx"
    assert len(rows) == 1 + 2 * 3 * 2 * 2
    assert rows[1] == f"0620-06-21,8.0,floor,M,{lux(0, 8.0, 0, 0)!r},{0.01 * lux(0, 8.0, 0, 0)!r}"
