"""The all-weather sky of Perez, Seals and Michalsky, from direct and diffuse irradiance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

__all__ = ["PRECIPITABLE_WATER_CM", "SOLAR_CONSTANT_W_M2", "PerezSky", "perez_sky"]

Array = NDArray[np.float64]

SOLAR_CONSTANT_W_M2: Final = 1367.0
"""Outside the atmosphere at the mean distance of the sun, the value that the model was fitted with."""

PRECIPITABLE_WATER_CM: Final = 2.0
"""Water in the air above, for the luminous efficacies."""

_CLEARNESS: Final = (1.065, 1.230, 1.500, 1.950, 2.800, 4.500, 6.200)
"""Lower ends of the second to the eighth class of clearness (1990, table 1)."""

_RANGE: Final = {"clearness": (1.0, 12.1), "brightness": (0.01, 0.6)}
"""What the model was fitted to."""

# a, b, c, d, e, each as x1 + x2 Z + brightness (x3 + x4 Z) (1993, table 1);
# c and d of the first class differ.
_SHAPE: Final = np.array(
    [
        [
            [1.3525, -0.2576, -0.2690, -1.4366],
            [-0.7670, 0.0007, 1.2734, -0.1233],
            [2.8000, 0.6004, 1.2375, 1.0000],
            [1.8734, 0.6297, 0.9738, 0.2809],
            [0.0356, -0.1246, -0.5718, 0.9938],
        ],
        [
            [-1.2219, -0.7730, 1.4148, 1.1016],
            [-0.2054, 0.0367, -3.9128, 0.9156],
            [6.9750, 0.1774, 6.4477, -0.1239],
            [-1.5798, -0.5081, -1.7812, 0.1080],
            [0.2624, 0.0672, -0.2190, -0.4285],
        ],
        [
            [-1.1000, -0.2515, 0.8952, 0.0156],
            [0.2782, -0.1812, -4.5000, 1.1766],
            [24.7219, -13.0812, -37.7000, 34.8438],
            [-5.0000, 1.5218, 3.9229, -2.6204],
            [-0.0156, 0.1597, 0.4199, -0.5562],
        ],
        [
            [-0.5484, -0.6654, -0.2672, 0.7117],
            [0.7234, -0.6219, -5.6812, 2.6297],
            [33.3389, -18.3000, -62.2500, 52.0781],
            [-3.5000, 0.0016, 1.1477, 0.1062],
            [0.4659, -0.3296, -0.0876, -0.0329],
        ],
        [
            [-0.6000, -0.3566, -2.5000, 2.3250],
            [0.2937, 0.0496, -5.6812, 1.8415],
            [21.0000, -4.7656, -21.5906, 7.2492],
            [-3.5000, -0.1554, 1.4062, 0.3988],
            [0.0032, 0.0766, -0.0656, -0.1294],
        ],
        [
            [-1.0156, -0.3670, 1.0078, 1.4051],
            [0.2875, -0.5328, -3.8500, 3.3750],
            [14.0000, -0.9999, -7.1406, 7.5469],
            [-3.4000, -0.1078, -1.0750, 1.5702],
            [-0.0672, 0.4016, 0.3017, -0.4844],
        ],
        [
            [-1.0000, 0.0211, 0.5025, -0.5119],
            [-0.3000, 0.1922, 0.7023, -1.6317],
            [19.0000, -5.0000, 1.2438, -1.9094],
            [-4.0000, 0.0250, 0.3844, 0.2656],
            [1.0468, -0.3788, -2.4517, 1.4656],
        ],
        [
            [-1.0500, 0.0289, 0.4260, 0.3590],
            [-0.3250, 0.1156, 0.7781, 0.0025],
            [31.0625, -14.5000, -46.1148, 55.3750],
            [-7.2312, 0.4050, 13.3500, 0.6234],
            [1.5000, -0.6426, 1.8564, 0.5636],
        ],
    ]
)

# Luminous efficacies, lm/W, as a + b W + c f(Z) + d g(brightness), by class (1990, table 4).
_DIFFUSE: Final = np.array(
    [
        [97.24, -0.46, 12.00, -8.91],
        [107.22, 1.15, 0.59, -3.95],
        [104.97, 2.96, -5.53, -8.77],
        [102.39, 5.59, -13.95, -13.90],
        [100.71, 5.94, -22.75, -23.74],
        [106.42, 3.83, -36.15, -28.83],
        [141.88, 1.90, -53.24, -14.03],
        [152.23, 0.35, -45.27, -7.98],
    ]
)
_DIRECT: Final = np.array(
    [
        [57.20, -4.55, -2.98, 117.12],
        [98.99, -3.46, -1.21, 12.38],
        [109.83, -4.90, -1.71, -8.81],
        [110.34, -5.84, -1.99, -4.56],
        [106.36, -3.97, -1.75, -6.16],
        [107.19, -1.25, -1.51, -26.73],
        [105.75, 0.77, -1.26, -34.44],
        [101.18, 1.58, -1.10, -8.29],
    ]
)


@dataclass(frozen=True)
class PerezSky:
    """A sky of the model.

    Attributes
    ----------
    a, b, c, d, e : shape of the luminance: horizon, its gradient, circumsolar part, its width, backscatter.
    clearness, brightness : the model's parameters epsilon and Delta, within its range.
    outside : True where they had to be moved to the edge of that range.
    diffuse_illuminance, direct_illuminance : of the sky on the horizontal and of the sun square to it, lx.
    """

    a: float
    b: float
    c: float
    d: float
    e: float
    clearness: float
    brightness: float
    outside: bool
    diffuse_illuminance: float
    direct_illuminance: float

    def relative(self, directions: Array, sun: Array) -> Array:
        """Luminance of [..., 3] directions above the horizon, on a scale of its own.

        (1 + a exp(b / cos z)) (1 + c exp(d gamma) + e cos^2 gamma), with z from the zenith and gamma from the
        sun. Below 0.6 degrees above the horizon, where b / cos z runs away, it stays as it is there; a shape
        that falls below zero is cut off there.
        """
        z = np.maximum(directions[..., 2], 0.01)
        cosine = np.clip(directions @ sun, -1.0, 1.0)
        around = 1.0 + self.c * np.exp(self.d * np.arccos(cosine)) + self.e * cosine**2
        return np.maximum((1.0 + self.a * np.exp(self.b / z)) * around, 0.0)


def perez_sky(
    *,
    sun_elevation_deg: float,
    direct_normal_w_m2: float,
    diffuse_horizontal_w_m2: float,
    extraterrestrial_w_m2: float = SOLAR_CONSTANT_W_M2,
) -> PerezSky:
    """Shape and amount of the sky for an hour's irradiances.

    Parameters
    ----------
    sun_elevation_deg : above 0 to 90.
    direct_normal_w_m2 : of the sun on a plane square to it, 0 or more.
    diffuse_horizontal_w_m2 : of the sky alone on the horizontal, above 0.
    extraterrestrial_w_m2 : of the sun outside the atmosphere on that day.

    Notes
    -----
    Shape: Perez, Seals and Michalsky 1993, doi:10.1016/0038-092X(93)90017-I, with its erratum (Solar Energy
    51, 423). Clearness, brightness and luminous efficacies: Perez, Ineichen, Seals, Michalsky and Stewart
    1990, doi:10.1016/0038-092X(90)90055-H, with `PRECIPITABLE_WATER_CM`. Air mass: Kasten 1966. For clearness
    1.065 to 2.8 a brightness below 0.2 counts as 0.2 in the shape, as the later authors do (gendaylit).
    """
    zenith = np.radians(90.0 - sun_elevation_deg)
    cubed = 1.041 * zenith**3
    share = (diffuse_horizontal_w_m2 + direct_normal_w_m2) / diffuse_horizontal_w_m2
    mass = 1.0 / (np.cos(zenith) + 0.15 * (sun_elevation_deg + 3.885) ** -1.253)
    raw = {
        "clearness": float((share + cubed) / (1.0 + cubed)),
        "brightness": float(diffuse_horizontal_w_m2 * mass / extraterrestrial_w_m2),
    }
    held = {name: float(np.clip(value, *_RANGE[name])) for name, value in raw.items()}
    clearness, brightness = held["clearness"], held["brightness"]
    kind = int(np.searchsorted(_CLEARNESS, clearness, side="right"))

    shaped = max(brightness, 0.2) if 1.065 < clearness < 2.8 else brightness
    x = _SHAPE[kind]
    a, b, c, d, e = (float(v) for v in x[:, 0] + x[:, 1] * zenith + shaped * (x[:, 2] + x[:, 3] * zenith))
    if kind == 0:
        c = float(np.exp((shaped * (x[2, 0] + x[2, 1] * zenith)) ** x[2, 2]) - x[2, 3])
        d = float(-np.exp(shaped * (x[3, 0] + x[3, 1] * zenith)) + x[3, 2] + shaped * x[3, 3])

    water = PRECIPITABLE_WATER_CM
    diffuse = _DIFFUSE[kind] @ [1.0, water, np.cos(zenith), np.log(brightness)]
    direct = _DIRECT[kind] @ [1.0, water, np.exp(5.73 * zenith - 5.0), brightness]
    return PerezSky(
        a=a,
        b=b,
        c=c,
        d=d,
        e=e,
        clearness=clearness,
        brightness=brightness,
        outside=held != raw,
        diffuse_illuminance=float(diffuse * diffuse_horizontal_w_m2),
        direct_illuminance=float(max(direct, 0.0) * direct_normal_w_m2),
    )
