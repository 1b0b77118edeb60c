"""What a user is told about tables that cannot be right, and about those that only look odd."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

TAU_20 = 0.676
Text = tuple[list[str], list[str]]


def refused(
    command: Any, path: Path, *said: str, line: int | None = None, options: tuple[str, ...] = ()
) -> None:
    """Exit code 3, file and line, what was expected and found, and nothing on stdout."""
    code, out, err = command("gonio", "info", path, "--json", *options)
    assert code == 3
    assert out == ""
    assert path.name in err and "expected" in err and "found" in err
    if line is not None:
        assert f", line {line}:" in err
    for words in said:
        assert words in err


def accepted(command: Any, path: Path, *said: str, options: tuple[str, ...] = ()) -> dict[str, Any]:
    """The command ends well and its warnings say these words; the one entry of the file."""
    code, out, err = command("gonio", "info", path, "--json", *options)
    assert code == 0, err
    assert len(out["files"]) == 1
    entry = out["files"][0]
    for words in said:
        assert any(words in w for w in entry["warnings"])
        assert words in err
    return entry


def test_a_right_table_gives_tau_and_no_warning_about_its_form(
    command: Any, save: Callable[..., Path], table_text: Text
) -> None:
    header, rows = table_text
    entry = accepted(command, save(header + rows))
    assert entry["tau"] == pytest.approx(TAU_20, rel=0.005)
    assert abs(entry["tau"] - TAU_20) < 5 * entry["tau_se"]
    assert set(entry) >= {
        "file",
        "quantity",
        "side",
        "theta_i_deg",
        "phi_i_deg",
        "points",
        "negative",
        "coverage",
        "tau",
        "tau_se",
        "warnings",
    }
    assert entry["quantity"] == "DSF" and entry["side"] == "transmission"
    assert entry["points"] == len(rows)
    assert entry["negative"] == sum(float(r.split()[2]) < 0 for r in rows)
    assert entry["coverage"] == pytest.approx(1.0, abs=0.02)
    assert all("negative" in w for w in entry["warnings"])


def test_a_comment_inside_the_data_is_refused_with_its_line(
    command: Any, save: Callable[..., Path], table_text: Text
) -> None:
    header, rows = table_text
    path = save([*header, *rows[:700], "# lamp changed", *rows[700:]])
    refused(command, path, "comment inside the data", "lamp changed", line=len(header) + 701)


@pytest.mark.parametrize("word", ["nan", "NaN", "inf", "-inf", "1e999", "n/a", "-"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_a_value_that_is_no_finite_number_is_refused_with_its_line(
    command: Any, save: Callable[..., Path], table_text: Text, word: str, end: str
) -> None:
    header, rows = table_text
    row = " ".join([*rows[40].split()[:2], word])
    path = save([*header, *rows[:40], row, *rows[41:]], end=end)
    refused(command, path, word, line=len(header) + 41)


@pytest.mark.parametrize(
    "change", [lambda r: r.replace(".", ","), lambda r: r.replace(" ", ", "), lambda r: r.replace(" ", ";")]
)
def test_commas_and_semicolons_are_refused(
    command: Any, save: Callable[..., Path], table_text: Text, change: Callable[[str], str]
) -> None:
    header, rows = table_text
    refused(command, save(header + [change(r) for r in rows]), "commas", line=len(header) + 1)


def test_radians_are_refused(command: Any, save: Callable[..., Path], table_text: Text) -> None:
    header, rows = table_text
    turned = [[float(w) for w in r.split()] for r in rows]
    lines = [f"{math.radians(t):.6f} {math.radians(p):.6f} {v:.6e}" for t, p, v in turned]
    refused(command, save(header + lines), "degrees", "radians", line=len(header) + 1)


def test_an_angle_out_of_range_is_refused_with_its_line(
    command: Any, save: Callable[..., Path], table_text: Text
) -> None:
    header, rows = table_text
    path = save([*header, *rows[:9], "", "190.5 12.0 0.001", *rows[9:]])
    refused(command, path, "theta_s", "190.5", line=len(header) + 11)


def test_dsf_times_ten_is_refused_because_tau_exceeds_one(
    command: Any, save: Callable[..., Path], table_text: Text
) -> None:
    header, rows = table_text
    lines = [f"{r.rsplit(' ', 1)[0]} {10 * float(r.split()[2]):.6e}" for r in rows]
    named = next(k for k, h in enumerate(header, 1) if h.startswith("#format"))
    refused(command, save(header + lines), "tau of 1 at most", "6.7", line=named)


def test_bsdf_labelled_dsf_is_refused_where_tau_exceeds_one(
    command: Any, save: Callable[..., Path], measure: Any, tmp_path: Path
) -> None:
    from dataclasses import replace

    from specularia import gonio

    table = measure(60.0, shadow=False)
    # A clear pane of the same scattering: 0.9 instead of 0.41.
    wrong = replace(table, values=table.bsdf * 0.9 / 0.41)
    path = gonio.write(wrong, tmp_path / "wrong.dat")
    refused(command, path, "tau of 1 at most", "as BSDF it would be 0.9")


def test_bsdf_labelled_dsf_with_tau_below_one_is_warned_of(
    command: Any, measure: Any, tmp_path: Path
) -> None:
    from dataclasses import replace

    from specularia import gonio

    table = measure(20.0, shadow=False)
    path = gonio.write(replace(table, values=table.bsdf), tmp_path / "wrong.dat")
    entry = accepted(command, path, "as BSDF do", "--quantity BSDF")
    assert entry["tau"] > 1.05 * TAU_20
    entry = accepted(command, path, options=("--quantity", "BSDF"))
    assert entry["quantity"] == "BSDF"
    assert entry["tau"] == pytest.approx(TAU_20, rel=0.005)


def test_dsf_labelled_bsdf_is_warned_of(command: Any, save: Callable[..., Path], table_text: Text) -> None:
    header, rows = table_text
    relabelled = [h.replace("DSF", "BSDF") for h in header]
    entry = accepted(command, save(relabelled + rows), "as DSF do", "--quantity DSF")
    assert entry["tau"] < 0.95 * TAU_20


@pytest.mark.parametrize("truth,label", [("DSF", "BSDF"), ("BSDF", "DSF")])
def test_a_label_against_the_files_own_integral_is_refused(
    command: Any, measure: Any, tmp_path: Path, save: Callable[..., Path], truth: str, label: str
) -> None:
    from dataclasses import replace

    from specularia import gonio

    table = measure(60.0, shadow=False)
    values = table.values if truth == "DSF" else table.bsdf
    path = gonio.write(replace(table, quantity=label, values=values), tmp_path / "wrong.dat")
    stated = save(["#front_integral\t0.41", *path.read_text().splitlines()])
    refused(command, stated, "front_integral", f"--quantity {truth}")
    assert accepted(command, stated, options=("--quantity", truth))["tau"] == pytest.approx(0.41, rel=0.02)


@pytest.mark.parametrize("spoil", ["", "#format: theta phi", "#format: phi theta DSF"])
def test_a_header_without_quantity_is_refused(
    command: Any, save: Callable[..., Path], table_text: Text, spoil: str
) -> None:
    header, rows = table_text
    lines = [spoil if h.startswith("#format") else h for h in header] + rows
    refused(command, save(lines), "DSF", "BSDF", "quantity")


def test_the_user_can_state_a_missing_quantity(
    command: Any, save: Callable[..., Path], table_text: Text
) -> None:
    header, rows = table_text
    path = save([h for h in header if not h.startswith("#format")] + rows)
    assert accepted(command, path, options=("--quantity", "dsf"))["tau"] == pytest.approx(TAU_20, rel=0.005)


def test_rows_without_a_header_are_refused(command: Any, save: Callable[..., Path], table_text: Text) -> None:
    refused(command, save(table_text[1]), "incident")


@pytest.mark.parametrize(
    "given", ["", "#incident_angle 20", "#incident_angle north 0", "#incident_angle 90 0"]
)
def test_a_header_without_a_usable_incident_angle_is_refused(
    command: Any, save: Callable[..., Path], table_text: Text, given: str
) -> None:
    header, rows = table_text
    refused(command, save([given if h.startswith("#incident") else h for h in header] + rows), "incident")


@pytest.mark.parametrize(
    "change,found", [(lambda r: r + " 1.0 2.0", "5 columns"), (lambda r: r.rsplit(" ", 1)[0], "2 columns")]
)
def test_a_wrong_number_of_columns_is_refused(
    command: Any, save: Callable[..., Path], table_text: Text, change: Callable[[str], str], found: str
) -> None:
    header, rows = table_text
    refused(command, save(header + [change(r) for r in rows]), found, line=len(header) + 1)
    # Two faults that cancel in the count of numbers.
    path = save([*header, *rows[:5], "170 10", "1.0 170 12 1.0", *rows[5:]])
    refused(command, path, "columns", line=len(header) + 6)


def test_two_channels_announced_in_the_header_are_refused(
    command: Any, save: Callable[..., Path], table_text: Text
) -> None:
    header, rows = table_text
    lines = [h.replace("DSF", "X Y Z") for h in header]
    refused(command, save(lines + [r + " 1 1" for r in rows]), "one quantity")


def test_empty_missing_and_foreign_files_are_refused(
    command: Any, save: Callable[..., Path], table_text: Text, tmp_path: Path
) -> None:
    refused(command, save(table_text[0]), "no row of data")
    refused(command, save([""]), "an empty file")
    refused(command, tmp_path / "absent.dat", "nothing")
    refused(command, save(["<WindowElement/>"]), "pab-opto", "VIAVI")
    refused(command, save([*table_text[0], *table_text[1][:9]]), "16 points")
    code, _, err = command("gonio", "info", tmp_path)
    assert code == 3 and "folder" in err


def test_points_on_one_line_are_refused(command: Any, save: Callable[..., Path], table_text: Text) -> None:
    rows = [f"{100 + k:.2f} 180.0 0.01" for k in range(60)]
    refused(command, save(table_text[0] + rows), "spread over the hemisphere")


def test_a_label_of_transmission_on_the_side_of_the_light_is_refused(
    command: Any, save: Callable[..., Path], table_text: Text
) -> None:
    header, rows = table_text
    flipped = [f"{180 - float(r.split()[0]):.4f} {r.split(' ', 1)[1]}" for r in rows]
    labelled = save([h.replace("DSF", "BTDF") for h in header] + flipped)
    refused(command, labelled, "transmission", "--side transmission", line=4)
    # DSF says nothing about the side: that of the light is reflection, unless the user says not.
    assert "rho" in accepted(command, save(header + flipped))
    entry = accepted(command, save(header + flipped), options=("--side", "transmission"))
    assert entry["side"] == "transmission"
    assert entry["tau"] == pytest.approx(TAU_20, rel=0.005)


def test_theta_s_of_exactly_90_is_right_and_warned_of(
    command: Any, save: Callable[..., Path], table_text: Text
) -> None:
    header, rows = table_text
    level = [f"90.0000 {10 * k}.0 0.0" for k in range(36)] + ["90.0 5.0 0.3"]
    entry = accepted(command, save(header + level + rows), "37 points at theta_s = 90")
    assert entry["tau"] == pytest.approx(TAU_20, rel=0.005)
    assert entry["points"] == len(rows) + 37


def test_both_hemispheres_in_one_table_are_split_with_counts(
    command: Any, save: Callable[..., Path], table_text: Text
) -> None:
    header, rows = table_text
    back = [f"{180 - float(r.split()[0]):.4f} {r.split(' ', 1)[1]}" for r in rows[::2]]
    path = save([h for h in header if "datapoints" not in h] + [*rows, *back])
    code, out, err = command("gonio", "info", path, "--json")
    assert code == 0
    assert [(f["side"], f["points"]) for f in out["files"]] == [
        ("transmission", len(rows)),
        ("reflection", len(back)),
    ]
    assert f"{len(rows)} points transmitted, {len(back)} reflected" in err
    assert out["files"][0]["tau"] == pytest.approx(TAU_20, rel=0.005)
    assert out["files"][1]["rho"] == pytest.approx(TAU_20, rel=0.02)
    entry = accepted(command, path, "left out", options=("--side", "reflection"))
    assert entry["side"] == "reflection" and "tau" not in entry


def test_a_sparse_table_is_integrated_and_warned_of(command: Any, measure: Any, tmp_path: Path) -> None:
    from specularia import gonio

    for theta, tau in ((0.0, 0.697), (20.0, 0.676), (40.0, 0.579)):
        table = measure(theta, scale=0.0025, shadow=False)
        assert 380 <= len(table.values) <= 400
        path = gonio.write(table, tmp_path / "sparse.dat")
        entry = accepted(command, path, "a sparse table")
        assert entry["tau"] == pytest.approx(tau, rel=0.02)
        assert abs(entry["tau"] - tau) < entry["tau_systematic"] + 2 * entry["tau_se"]
        assert 0.001 < entry["tau_systematic"] < 0.1


def test_a_point_count_that_does_not_match_is_warned_of(
    command: Any, save: Callable[..., Path], table_text: Text
) -> None:
    header, rows = table_text
    lines = ["#datapoints_in_file: 160000" if "datapoints" in h else h for h in header]
    said = f"states 160000 points, the file holds {len(rows)}"
    assert accepted(command, save(lines + rows), said)["tau"] == pytest.approx(TAU_20, rel=0.005)


def test_negative_values_are_counted_and_kept(
    command: Any, save: Callable[..., Path], table_text: Text
) -> None:
    header, rows = table_text
    numbers = np.array([[float(w) for w in r.split()] for r in rows])
    far = numbers[:, 2] < np.quantile(numbers[:, 2], 0.3)
    numbers[far, 2] *= np.where(np.arange(far.sum()) % 2, 3.0, -1.0)
    lines = [f"{t:.4f} {p:.4f} {v:.6e}" for t, p, v in numbers]
    negative = int((numbers[:, 2] < 0).sum())
    entry = accepted(command, save(header + lines), f"{negative} of {len(rows)} values are negative")
    assert entry["negative"] == negative
    # Plus three and minus one average to what was there; clipping would add half of it.
    assert entry["tau"] == pytest.approx(TAU_20, rel=0.005)


def test_a_table_of_zeros_is_warned_of(command: Any, tmp_path: Path) -> None:
    phi = np.arange(0.0, 360.0, 15.0)
    rows = [f"{theta} {p} 0.0" for theta in range(91, 180, 4) for p in phi]
    path = tmp_path / "zeros.dat"
    path.write_text("\n".join(["#format: theta phi DSF", "#incident_angle 40 0", *rows]) + "\n")
    assert accepted(command, path, "every value is zero")["tau"] == 0.0


def test_repeated_directions_count_once_and_are_warned_of(
    command: Any, save: Callable[..., Path], table_text: Text
) -> None:
    header, rows = table_text
    header = [h for h in header if "datapoints" not in h]
    before = accepted(command, save(header + rows))
    after = accepted(command, save([*header, *rows, *rows[-2000:]]), "2000 rows repeat a direction")
    assert after["tau"] == pytest.approx(before["tau"], rel=1e-9)


def test_phi_i_of_0_and_180_are_turned_and_averaged(command: Any, measure: Any, tmp_path: Path) -> None:
    from specularia import bsdf, gonio

    files = [
        gonio.write(measure(theta, phi, seed=k), tmp_path / f"t{theta:g}_p{phi:g}.dat")
        for k, (theta, phi) in enumerate([(0.0, 0.0), (40.0, 0.0), (40.0, 180.0), (60.0, 180.0)])
    ]
    out = tmp_path / "m.nc"
    code, result, err = command("gonio", "fit", *files, "-o", out, "--json")
    assert code == 0
    assert "turned to one azimuth and averaged" in err
    assert "tables at phi_i = 0, 180 in one set" in err
    assert "tables at phi_i = 0, 180 in one set" in command("gonio", "info", *files)[2]
    assert "in one set" not in command("gonio", "info", *files[:2])[2]
    assert result["theta_deg"] == [0.0, 40.0, 60.0]
    assert result["measured"] == pytest.approx([0.697, 0.579, 0.41], rel=0.01)
    model = bsdf.read(out)
    for theta in (40.0, 60.0):
        q = model.quadrature("transmission_front", theta)
        value = q.weight * model.evaluate("transmission_front", theta, 0.0, q.ux, q.uy)
        middle = np.sum(value * q.ux) / np.sum(value)
        assert -np.sin(np.radians(theta)) < middle < -0.7 * np.sin(np.radians(theta))


def test_transmission_that_rises_with_theta_is_warned_of(command: Any, measure: Any, tmp_path: Path) -> None:
    from dataclasses import replace

    from specularia import gonio

    files = []
    for theta, scale in ((0.0, 1.0), (40.0, 1.3)):
        table = measure(theta, shadow=False)
        files.append(gonio.write(replace(table, values=scale * table.values), tmp_path / f"t{theta:g}.dat"))
    code, _, err = command("gonio", "info", *files)
    assert code == 0
    assert "tau rises" in err and "--quantity" in err


def test_fit_leaves_no_file_where_it_fails(
    command: Any, save: Callable[..., Path], table_text: Text, tmp_path: Path
) -> None:
    header, rows = table_text
    bad = save([*header, *rows[:5], "# no", *rows[5:]], name="bad.dat")
    good = save([*header, *rows], name="good.dat")
    before = sorted(p.name for p in tmp_path.iterdir())
    assert command("gonio", "fit", bad, "-o", tmp_path / "m.nc")[0] == 3
    code, _, err = command("gonio", "fit", good, "-o", tmp_path / "absent" / "m.nc")
    assert code == 3 and "absent" in err
    code, _, err = command("gonio", "fit", good, "-o", tmp_path / "m.txt")
    assert code == 2 and "m.txt" in err
    assert command("gonio", "fit", good, "-o", tmp_path / "m.xml", "--resolution", "9")[0] == 2
    assert command("gonio", "info", good, "--quantity", "luminance")[0] == 2
    assert sorted(p.name for p in tmp_path.iterdir()) == before
