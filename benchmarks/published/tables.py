"""Tables 1 to 4 of the paper as printed: values and printed uncertainties, digit for digit.

P. Barkhordari, R. Galeazzi, A. de Miguel Tejada, I. F. Santos, Identification of Behavioural Models for
Railway Turnouts Monitoring. Sampling rate 20 kHz. Wrong entries are listed in ``misprints``.
"""

from dataclasses import dataclass

RATE = 20_000.0
LOCATIONS = ("OT", "SP", "CLP", "CP A7", "CP A8", "CP A9", "AS main", "AS diverging")


@dataclass(frozen=True)
class PrintedPair:
    """One row of Table 1 (band "low") or 2 ("high"): a second-order model and its printed ± values."""

    location: str
    band: str
    a11: float
    a12: float
    a21: float
    a22: float
    c1: float
    c2: float
    plus_minus: tuple[float, float, float, float, float, float]

    @property
    def key(self) -> tuple[str, str]:
        """Location and band."""
        return self.location, self.band


@dataclass(frozen=True)
class PrintedMode:
    """One row of Table 3: eigenvalue pair, natural frequency [Hz] with its ±, damping ratio."""

    location: str
    band: str
    real: float
    imaginary: float
    frequency: float
    frequency_plus_minus: float
    damping: float

    @property
    def key(self) -> tuple[str, str]:
        """Location and band."""
        return self.location, self.band


@dataclass(frozen=True)
class PrintedFit:
    """One row of Table 4: fit [%] on hammer tests, and mean ± on trains of the two tracks, None where absent."""

    location: str
    validation: float
    main: tuple[float, float] | None
    diverging: tuple[float, float] | None


TABLE_1 = tuple(
    PrintedPair(location, "low", *values, plus_minus)
    for location, values, plus_minus in (
        (
            "OT",
            (0.9988, -0.0481, 0.0481, 0.9803, 0.0618, 1.0313),
            (0.0004, 0.0038, 0.0038, 0.0030, 0.0018, 0.0214),
        ),
        (
            "SP",
            (0.9969, -0.0524, 0.0524, 0.9966, 0.2261, 1.0110),
            (0.0004, 0.0022, 0.0022, 0.0004, 0.0242, 0.0287),
        ),
        (
            "CLP",
            (0.9967, -0.0326, 0.0326, 0.9887, 0.5373, 0.8676),
            (0.0004, 0.0069, 0.0069, 0.0110, 0.0108, 0.02335),
        ),
        (
            "CP A7",
            (0.9986, -0.0307, 0.0307, 0.9824, 0.3642, 1.2523),
            (0.0001, 0.0016, 0.0016, 0.0011, 0.0537, 0.0226),
        ),
        (
            "CP A8",
            (0.9964, -0.0542, 0.0542, 0.9899, 1.1782, 2.0409),
            (0.0005, 0.0009, 0.0009, 0.0014, 0.0273, 0.1328),
        ),
        (
            "CP A9",
            (0.9809, -0.0359, 0.0359, 0.9987, 1.2712, 0.1894),
            (0.0001, 0.0053, 0.0053, 0.0011, 0.0067, 0.0129),
        ),
        (
            "AS main",
            (0.9973, -0.0482, 0.0482, 0.9830, 0.3147, 0.8447),
            (0.0002, 0.0075, 0.0075, 0.0032, 0.04388, 0.0608),
        ),
        (
            "AS diverging",
            (0.9961, 0.0406, -0.0406, 0.9888, 0.5895, 0.9803),
            (0.0004, 0.00820, 0.0820, 0.0036, 0.0193, 0.0940),
        ),
    )
)

TABLE_2 = tuple(
    PrintedPair(location, "high", *values, plus_minus)
    for location, values, plus_minus in (
        (
            "OT",
            (0.9626, -0.1882, 0.1882, 0.9755, 2.7193, 1.1605),
            (0.0002, 0.0005, 0.0005, 0.0000, 0.0003, 0.0001),
        ),
        (
            "SP",
            (0.9764, -0.1550, 0.1550, 0.9854, 0.2341, 1.0023),
            (0.0012, 0.0003, 0.0003, 0.0001, 0.0081, 0.0088),
        ),
        (
            "CLP",
            (0.9918, 0.1270, -0.1270, 0.9809, 0.1738, 1.7160),
            (0.0045, 0.0049, 0.0049, 0.0031, 0.0369, 0.0245),
        ),
        (
            "CP A7",
            (0.9612, -0.1898, 0.1898, 0.9768, 3.3554, 1.0429),
            (0.0089, 0.0015, 0.0015, 0.0026, 0.03557, 0.05262),
        ),
        (
            "CP A9",
            (0.9763, -0.1694, 0.1694, 0.9777, 2.8610, 2.0952),
            (0.0006, -0.0011, 0.0011, 0.0005, 0.1067, 0.0639),
        ),
        (
            "AS main",
            (0.9695, -0.1955, 0.1955, 0.9782, 2.3626, 0.7891),
            (0.0016, 0.0013, 0.0013, 0.0014, 0.0781, 0.0768),
        ),
        (
            "AS diverging",
            (0.9421, -0.2104, 0.2104, 0.9679, 2.8449, 0.9905),
            (0.0648, 0.0112, 0.0112, 0.0201, 0.0396, 0.0369),
        ),
    )
)

TABLE_3 = tuple(
    PrintedMode(*row)
    for row in (
        ("OT", "low", 0.9895, 0.0472, 154.5534, 11.7249, 0.1932),
        ("OT", "high", 0.9691, 0.1881, 611.5569, 1.6490, 0.0673),
        ("SP", "low", 0.9968, 0.0524, 167.1953, 6.9777, 0.0353),
        ("SP", "high", 0.9814, 0.1553, 499.1206, 1.0661, 0.0441),
        ("CLP", "low", 0.9927, 0.0324, 105.8538, 19.9734, 0.2042),
        ("CLP", "high", 0.9864, 0.1269, 407.6153, 13.4926, 0.0432),
        ("CP A7", "low", 0.9905, 0.0296, 99.5863, 5.2133, 0.2917),
        ("CP A7", "high", 0.9690, 0.1896, 616.4479, 1.0853, 0.0656),
        ("CP A8", "low", 0.9931, 0.0541, 174.0117, 2.6834, 0.0986),
        ("CP A9", "low", 0.9899, 0.0347, 115.7699, 17.6306, 0.2648),
        ("CP A9", "high", 0.9770, 0.1694, 547.6198, 3.7399, 0.0491),
        ("AS main", "low", 0.9902, 0.0476, 155.5657, 24.4137, 0.1788),
        ("AS main", "high", 0.9739, 0.1955, 630.8860, 2.9081, 0.0304),
        ("AS diverging", "low", 0.9925, 0.0404, 131.3086, 25.3344, 0.1633),
        ("AS diverging", "high", 0.9550, 0.2100, 692.6417, 5.9791, 0.1033),
    )
)

TABLE_4 = (
    PrintedFit("OT", 78.3, (58.7, 4.1), None),
    PrintedFit("SP", 72.3, (53.4, 2.4), None),
    PrintedFit("CLP", 62.3, None, None),
    PrintedFit("CP A7", 73.3, (63.9, 4.8), None),
    PrintedFit("CP A8", 68.2, (30.4, 3.5), None),
    PrintedFit("CP A9", 60.2, None, (55.9, 4.3)),
    PrintedFit("AS main", 62.3, (54.5, 4.4), None),
    PrintedFit("AS diverging", 67.0, None, (53.4, 4.9)),
)
