"""Thin films: closed forms, energy, and the tracer against an exact flat pane."""

from dataclasses import replace

import numpy as np
import pytest
from glass_reference import smooth_map

from specularia.errors import FormatError, PhysicsError
from specularia.glass import (
    Face,
    Film,
    Medium,
    Slab,
    amplitudes,
    closed_form,
    film_spread,
    flat_slab_with_films,
    model,
    peer,
    read_slab,
    trace,
)
from specularia.glass.colour import WAVELENGTHS_NM
from specularia.glass.thin_film import tables

NONE = Film((1e-6,), (1.0 + 0j,))


@pytest.mark.parametrize("n", [1.38, 2.1])
def test_a_quarter_wave_layer_reflects_as_its_closed_form_at_any_order(n):
    for odd in (1, 3, 5):
        layer = Film((odd * 520.0 / (4 * n),), (complex(n),))
        found = amplitudes(layer, 1.0, wavelength_nm=520.0, index_from=1.0, index_to=1.52)
        exact = ((n**2 - 1.52) / (n**2 + 1.52)) ** 2
        assert found.Rs == pytest.approx(exact, abs=1e-9) and found.Rp == pytest.approx(exact, abs=1e-9)
        half = replace(layer, thickness_nm=(2 * layer.thickness_nm[0],))
        absent = amplitudes(half, 1.0, wavelength_nm=520.0, index_from=1.0, index_to=1.52)
        assert absent.Rs == pytest.approx((0.52 / 2.52) ** 2, abs=1e-9)


def test_a_layer_of_the_root_of_the_glass_s_index_is_invisible_at_its_wavelength():
    n = np.sqrt(1.52)
    layer = Film((520.0 / (4 * n),), (complex(n),))
    assert amplitudes(layer, 1.0, wavelength_nm=520.0, index_from=1.0, index_to=1.52).Rs < 1e-20


def test_a_stack_of_quarter_waves_reflects_as_its_closed_form():
    low, high, pairs = 1.38, 2.3, 6
    layers = [(520.0 / (4 * n), complex(n)) for _ in range(pairs) for n in (high, low)]
    film = Film(*(tuple(v) for v in zip(*layers)))
    ratio = 1.52 * (high / low) ** (2 * pairs)
    found = amplitudes(film, 1.0, wavelength_nm=520.0, index_from=1.0, index_to=1.52)
    assert found.Rs == pytest.approx(((1 - ratio) / (1 + ratio)) ** 2, abs=1e-9)


def test_one_layer_is_airy_s_sum_over_its_reflections_at_any_angle():
    n, d, wavelength = 1.45, 310.0, 470.0
    c0 = np.linspace(0.05, 1.0, 30)
    c1, c2 = np.sqrt(1 - (1 - c0**2) / n**2), np.sqrt(1 - (1 - c0**2) / 1.52**2)
    turn = np.exp(4j * np.pi * n * d * c1 / wavelength)
    found = amplitudes(Film((d,), (n,)), c0, wavelength_nm=wavelength, index_from=1.0, index_to=1.52)
    for share, (a, b) in (
        (found.Rs, ((c0 - n * c1) / (c0 + n * c1), (n * c1 - 1.52 * c2) / (n * c1 + 1.52 * c2))),
        (found.Rp, ((n * c0 - c1) / (n * c0 + c1), (1.52 * c1 - n * c2) / (1.52 * c1 + n * c2))),
    ):
        assert share == pytest.approx(np.abs((a + b * turn) / (1 + a * b * turn)) ** 2, abs=1e-12)


def test_clear_films_keep_all_energy_and_transmit_alike_both_ways():
    rng = np.random.default_rng(1)
    for _ in range(100):
        count = rng.integers(1, 7)
        film = Film(tuple(rng.uniform(5, 3000, count)), tuple(map(complex, rng.uniform(1.1, 2.8, count))))
        c = rng.uniform(0.01, 1.0, 40)
        wavelength = rng.uniform(380, 780, 40)
        out = amplitudes(film, c, wavelength_nm=wavelength, index_from=1.0, index_to=1.52)
        inner = np.sqrt(1 - (1 - c**2) / 1.52**2)
        back = amplitudes(film.reversed, inner, wavelength_nm=wavelength, index_from=1.52, index_to=1.0)
        for a, b in ((out.Rs + out.Ts, 1.0), (out.Rp + out.Tp, 1.0), (out.Ts, back.Ts), (out.Tp, back.Tp)):
            assert np.max(np.abs(a - b)) < 1e-6
        beyond = amplitudes(
            film.reversed, 0.999 * np.sqrt(1 - 1 / 1.52**2) * c, wavelength_nm=wavelength,
            index_from=1.52, index_to=1.0,
        )  # fmt: skip
        assert np.max(np.abs(beyond.Rs - 1)) < 1e-6 and not beyond.Ts.any()


def test_absorbing_films_take_energy_and_never_give_any():
    film = Film((40.0, 300.0), (1.8 + 0.4j, 1.45 + 0j))
    c = np.linspace(0.01, 1.0, 100)
    for order, before, behind in ((film, 1.0, 1.52), (film.reversed, 1.52, 1.0)):
        a = amplitudes(order, c, wavelength_nm=520.0, index_from=before, index_to=behind)
        assert np.all(a.Rs + a.Ts < 1) and np.all(a.Rp + a.Tp < 1) and np.all(a.Ts >= 0)
    with pytest.raises(PhysicsError, match="no light"):
        amplitudes(Film((1e5,), (2.0 + 5j,)), c, wavelength_nm=520.0, index_from=1.0, index_to=1.52)


def test_no_film_is_fresnel_and_the_phase_of_total_reflection():
    theta = np.array([0.0, 30.0, 60.0, 89.0])
    tau, rho, absorbed = flat_slab_with_films(
        theta, wavelength_nm=520.0, index=1.52, absorption_per_mm=0.07, thickness_mm=3.0
    )
    exact = closed_form.flat_slab(theta, index=1.52, absorption_per_mm=0.07, thickness_mm=3.0)
    assert np.allclose([tau, rho, absorbed], exact, atol=1e-9)
    c, n = 0.3, 1.52
    a = amplitudes(NONE, c, wavelength_nm=520.0, index_from=n, index_to=1.0)
    s2 = 1 - c * c
    delta = 2 * np.arctan(c * np.sqrt(n * n * s2 - 1) / (n * s2))
    assert a.rs * np.conj(a.rp) == pytest.approx(np.exp(1j * delta), abs=1e-6)


def test_the_tables_of_the_tracer_are_right_between_their_entries():
    film = Film((700.0, 200.0), (1.46 + 0j, 1.7 + 0.02j))
    table = tables(film, wavelength_nm=520.0, index=1.52)
    x = np.random.default_rng(2).uniform(0.001, 1.0, 500)
    where = np.linspace(0, 1, table.shape[1])
    out = amplitudes(film, x, wavelength_nm=520.0, index_from=1.0, index_to=1.52)
    inner = np.sqrt(1 - (1 - x * x) / 1.52**2)
    inside = amplitudes(film.reversed, inner, wavelength_nm=520.0, index_from=1.52, index_to=1.0)
    for kind, a in ((0, out), (1, inside)):
        for entry, exact in ((0, a.Rs), (1, a.Rp), (4, a.Ts), (5, a.Tp)):
            assert np.interp(x, where, table[kind, :, entry]) == pytest.approx(exact, abs=3e-6)
    both = np.interp(x, where, table[0, :, 6]) + 1j * np.interp(x, where, table[0, :, 7])
    assert np.abs(both) == pytest.approx(np.sqrt(out.Ts * out.Tp), abs=3e-6)


FILMS = {
    "a clear film": Film((310.0,), (1.45 + 0j,)),
    "three layers, one of which absorbs": Film((90.0, 150.0, 60.0), (1.45 + 0j, 1.9 + 0.15j, 1.6 + 0j)),
}


@pytest.mark.parametrize("name", FILMS)
@pytest.mark.parametrize("where", ["front", "back", "both"])
def test_a_traced_flat_pane_with_a_film_is_the_exact_one(name, where):
    film = FILMS[name]
    front, back = film if where != "back" else None, film if where != "front" else None
    slab = Slab(
        thickness_mm=3.0,
        medium=Medium(absorption_per_mm=0.05),
        front=Face.flat("front", film=front),
        back=Face.flat("back", film=back),
    )
    theta = [0.0, 40.0, 60.0, 82.5]
    found = trace(slab, theta_deg=theta, paths=64_000, seed=2, wavelength_nm=480.0)
    exact = flat_slab_with_films(
        theta,
        wavelength_nm=480.0,
        index=1.52,
        front=front,
        back=back,
        absorption_per_mm=0.05,
        thickness_mm=3.0,
    )
    for share, error, value in zip(
        (found.tau, found.rho, found.absorbed), (found.tau_se, found.rho_se, found.absorbed_se), exact
    ):
        assert np.all(np.abs(share - value) < 4.5 * error + 1e-5)
    assert found.tau + found.rho + found.absorbed == pytest.approx(1.0, abs=1e-9)


def test_a_polarised_beam_meets_a_film_with_its_own_share():
    film = FILMS["a clear film"]
    a = amplitudes(film, np.cos(np.radians(60.0)), wavelength_nm=480.0, index_from=1.0, index_to=1.52)
    inner = np.sqrt(1 - np.sin(np.radians(60.0)) ** 2 / 1.52**2)
    b = amplitudes(NONE, inner, wavelength_nm=480.0, index_from=1.52, index_to=1.0)
    for q, r, t, r_b in ((1.0, a.Rs, a.Ts, b.Rs), (-1.0, a.Rp, a.Tp, b.Rp)):
        slab = Slab(thickness_mm=1.0, front=Face.flat(film=film), incident=(q, 0.0, 0.0))
        found = trace(slab, theta_deg=[60.0], paths=64_000, wavelength_nm=480.0)
        exact = t * (1 - r_b) / (1 - r * r_b)
        assert abs(found.tau[0] - exact) < 4.5 * found.tau_se[0] + 1e-5


def test_a_film_of_no_thickness_leaves_a_rough_pane_as_it_is():
    """Every angle, both polarisations, their phases and total reflection: path by path as Fresnel's
    equations."""
    relief = smooth_map((48, 48), seed=3, rms_slope=0.5)
    bare = Slab(thickness_mm=1.0, front=Face(relief, 1.5, 1.5), back=Face(relief, 1.5, 1.5))
    thin = replace(bare, front=Face(relief, 1.5, 1.5, film=NONE), back=Face(relief, 1.5, 1.5, film=NONE))
    a = trace(bare, theta_deg=[0.0, 60.0], paths=32_000, seed=1)
    b = trace(thin, theta_deg=[0.0, 60.0], paths=32_000, seed=1)
    assert np.allclose(a.tau, b.tau, atol=3e-4) and np.allclose(a.rho, b.rho, atol=3e-4)


def test_a_rough_pane_with_a_film_transmits_the_same_both_ways():
    film = Film((150.0, 200.0), (2.2 + 0j, 1.45 + 0.05j))
    slab = Slab(
        thickness_mm=1.0,
        medium=Medium(absorption_per_mm=0.1),
        front=Face(smooth_map((48, 48), seed=3, rms_slope=0.4), 1.5, 1.5, film=film),
        back=Face(smooth_map((48, 48), seed=4, rms_slope=0.2), 1.5, 1.5),
    )
    theta = np.degrees(np.arcsin(np.sqrt((np.arange(24) + 0.5) / 24)))
    sides = [trace(slab, side=s, theta_deg=theta, phi_deg=None, paths=16_000) for s in ("front", "back")]
    # By reciprocity the means over the hemisphere agree.
    means = [f.tau.mean() for f in sides]
    error = np.sqrt(sum(np.sum(f.tau_se**2) for f in sides)) / len(theta)
    assert abs(means[0] - means[1]) < 4 * error + 1e-3
    assert all(np.allclose(f.tau + f.rho + f.absorbed, 1.0, atol=1e-9) for f in sides)


def test_a_laser_on_a_fringe_is_far_from_the_mean_over_the_spectrum():
    thick = Film((520.0 / 4 / 2.2 * 5,), (2.2 + 0j,))
    spread = film_spread(
        theta_deg=[0.0],
        index=np.full(WAVELENGTHS_NM.size, 1.52),
        absorption_per_mm=np.zeros(WAVELENGTHS_NM.size),
        thickness_mm=3.0,
        front=thick,
        back=None,
        laser=(520.0, 1.52, 0.0),
    )
    assert spread.rho_laser[0] == pytest.approx(spread.rho_range[0, 1], abs=2e-3)
    assert spread.rho_laser[0] > 1.15 * spread.rho_visible[0]
    assert spread.rho_range[0, 0] == pytest.approx(float(spread.rho_bare.min()), abs=5e-3)
    assert np.allclose(spread.tau + spread.rho, 1.0, atol=1e-9)


TOML = """thickness_mm = 3.0
[front]
flat = true
{film}
[back]
flat = true
"""


@pytest.mark.parametrize(
    ("film", "word"),
    [
        ("[front.film]\nthickness_nm = 300.0\nindx = 1.4", "index"),
        ("[front.film]\nthickness_nm = [300.0, 20.0]\nindex = 1.4", "as many"),
        ("[front.film]\nthickness_nm = -1.0\nindex = 1.4", "greater than 0"),
        ("sealant_index = 1.4\n[front.film]\nthickness_nm = 10.0\nindex = 1.4", "not both"),
    ],
)
def test_a_wrong_film_is_refused(tmp_path, film, word):
    (tmp_path / "glass.toml").write_text(TOML.format(film=film))
    with pytest.raises(FormatError, match=word):
        read_slab(tmp_path / "glass.toml")


def test_the_command_reports_the_spread_and_colour_refuses_films(tmp_path, command):
    text = "[front.film]\nthickness_nm = [300.0, 50.0]\nindex = [1.45, [1.8, 0.1]]"
    (tmp_path / "glass.toml").write_text(TOML.format(film=text))
    slab = read_slab(tmp_path / "glass.toml")
    assert slab.front.film == Film((300.0, 50.0), (1.45 + 0j, 1.8 + 0.1j))
    words = ("--theta", "0,60", "--wavelength", 532, "-o", tmp_path / "film.png", "--json")
    code, found, err = command("glass", "film", tmp_path / "glass.toml", *words)
    assert code == 0, err
    exact = flat_slab_with_films([0.0, 60.0], wavelength_nm=532.0, index=1.52, front=slab.front.film)
    assert found["tau_laser"] == pytest.approx(exact[0]) and found["rho_laser"] == pytest.approx(exact[1])
    assert (tmp_path / "film.png").is_file() and (tmp_path / "film.csv").is_file()
    with pytest.raises(PhysicsError, match="glass film"):
        model(slab, colour="D65", paths=320)
    with pytest.raises(PhysicsError, match="films"), peer.scene(slab, array_mm=2.0):
        pass
