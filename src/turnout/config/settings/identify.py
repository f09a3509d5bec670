"""Settings of the identification of modes from the free decays of hammer tests."""

from dataclasses import dataclass

from turnout.config.settings.setting import setting


@dataclass(frozen=True)
class IdentifySettings:
    """Settings of ``turnout.modal``; the bands name modes, they do not filter."""

    method: str = setting(
        "joint",
        why="joint: all modes on the unfiltered decay; paper: 200 Hz split, 2 + 2, -11 to +8 % off in simulation",
        choices=("joint", "paper"),
    )
    second_response: str = setting(
        "validate",
        why="what a second response is for; validate: the model is compared with it; joint: its poles count, too",
        choices=("validate", "joint"),
    )
    duration: float = setting(
        0.03, "s", "4 to 6 decay times of the paper's ballast modes; more adds noise", minimum=0.004, maximum=1.0
    )
    shortest_decay: float = setting(
        0.012,
        "s",
        "two decay times of the paper's ballast modes; less contains no mode",
        minimum=0.002,
        maximum=1.0,
    )
    ballast_low: float = setting(50.0, "Hz", "lower end of the ballast resonance in the literature", minimum=1.0)
    ballast_high: float = setting(300.0, "Hz", "upper end of the ballast resonance in the literature", minimum=1.0)
    railpad_low: float = setting(300.0, "Hz", "above the ballast band", minimum=1.0)
    railpad_high: float = setting(800.0, "Hz", "the paper's diverging sections reach 693 Hz", minimum=1.0)
    extra_bands: tuple[float, ...] = setting(
        (),
        "Hz",
        "[low, high, low, high, ...] of further resonances to keep as other1, other2 ...: two more states each",
    )
    order_maximum: int = setting(16, "", "16 states leave room for drift and eight modes", minimum=4, maximum=60)
    drift_maximum: int = setting(3, "", "highest degree of a polynomial drift of the zero; -1 for none", minimum=-1)
    hum_sources: tuple[float, ...] = setting(
        (50.0, 16.7),
        "Hz",
        "mains and railway traction current; hum at five harmonics of each is modelled where seen",
        minimum=1.0,
    )
    noise_order_maximum: int = setting(6, "", "highest order of the autoregressive noise; 0 for white", minimum=0)
    damping_maximum: float = setting(
        0.5,
        "",
        "1.7 times the paper's highest; a heavier pole cannot be distinguished from drift",
        minimum=0.01,
        maximum=0.95,
    )
    presence_minimum: float = setting(
        0.4, "", "share of orders and start samples in which a mode must reappear", minimum=0.0, maximum=1.0
    )
    pole_tolerance: float = setting(
        0.08,
        "",
        "distance of two poles over their magnitude within which they are one mode",
        minimum=0.001,
        maximum=1.0,
    )
    false_mode_probability: float = setting(
        1e-6, "", "significance of a mode over all impacts of a test", minimum=1e-12, maximum=0.05
    )
    impact_share: float = setting(
        0.5, "", "share of impacts in which a mode must show by itself", minimum=0.0, maximum=1.0
    )
    frequency_se_maximum: float = setting(
        0.05, "", "relative standard error of a frequency above which a mode counts as not found", minimum=0.001
    )
    damping_se_maximum: float = setting(
        0.5, "", "relative standard error of a damping above which a mode counts as not found", minimum=0.01
    )
    spread_maximum: float = setting(
        0.15,
        "",
        "relative spread of a frequency between impacts above which it is no property of the track",
        minimum=0.0,
    )
    gate_share: float = setting(
        0.5, "", "share of the half-power band of a mode that must pass the coherence gate", minimum=0.0, maximum=1.0
    )
    confidence: float = setting(0.95, "", "level of the intervals", minimum=0.5, maximum=0.999)
    null_draws: int = setting(
        60,
        "",
        "random pole sets behind the null of the fit; fewer than 19 have no 95 % quantile",
        minimum=19,
        maximum=10000,
    )
    split_frequency: float = setting(200.0, "Hz", "frequency at which method paper splits its bands", minimum=1.0)
    paper_band_high: float = setting(800.0, "Hz", "upper end of the paper's high band", minimum=1.0)
    paper_filter_order: int = setting(
        4, "", "Butterworth; the paper gives neither filter nor order", minimum=1, maximum=12
    )
    paper_zero_phase: bool = setting(True, "", "forwards and backwards; causal misses one ballast mode in eight")
    paper_bias_tests: int = setting(12, "", "simulated tests behind the bias printed with method paper", minimum=2)

    def bands(self) -> tuple[tuple[str, float, float], ...]:
        """(name, low, high) [Hz] of every band, in the order of the state vector.

        Raises
        ------
        ValueError
            ``extra_bands`` has an odd number of edges.
        """
        named = [
            ("ballast", self.ballast_low, self.ballast_high),
            ("railpad", self.railpad_low, self.railpad_high),
        ]
        edges = self.extra_bands
        if len(edges) % 2:
            raise ValueError(f"extra_bands needs pairs of low and high, got {len(edges)} numbers")
        named += [(f"other{i // 2 + 1}", edges[i], edges[i + 1]) for i in range(0, len(edges), 2)]
        return tuple(named)
