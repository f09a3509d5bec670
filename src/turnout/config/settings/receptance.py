"""Settings of the hammer test: impacts, their quality, and the averaged receptance."""

from dataclasses import dataclass

from turnout.config.settings.setting import setting


@dataclass(frozen=True)
class ReceptanceSettings:
    """How impacts are found and judged, and how receptance and coherence are averaged.

    >>> ReceptanceSettings().gate
    'limit'
    """

    trigger: float = setting(
        10.0, "sd", "an impact must exceed this many standard deviations of the force noise, which itself reaches 4",
        minimum=4.0, maximum=1000.0,
    )  # fmt: skip
    minimum_peak_share: float = setting(
        0.05, "1", "in a record with many impacts, a peak below this share of the usual one is handling of the hammer",
        minimum=0.01, maximum=0.5,
    )  # fmt: skip
    minimum_peak_force: float = setting(
        50.0, "N", "a test whose median impact is softer has a wrong unit (kN for N?); 0 for small hammers on beams",
        minimum=0.0, maximum=1e5,
    )  # fmt: skip
    contact_level: float = setting(
        0.02, "1", "contact is where the force exceeds this share of its peak", minimum=0.005, maximum=0.2
    )
    decay_gap: float = setting(
        2e-4, "s", "the decay starts this long after the last contact: 4 samples at 20 kHz", minimum=0.0, maximum=0.01
    )
    separation: float = setting(
        0.3, "s", "contacts closer than this belong to one impact; a person cannot repeat an impact faster",
        minimum=0.06, maximum=5.0,
    )  # fmt: skip
    pre_trigger: float = setting(
        0.05, "s", "longest part of the record before an impact that is used, for its noise", minimum=1e-3, maximum=1.0
    )
    window: float = setting(
        1.0, "s", "longest part of the record after an impact that is used", minimum=0.02, maximum=60.0
    )
    double_hit: str = setting(
        "move", "", "'move' starts the decay after the last contact if enough of it is left, 'reject' never uses it",
        choices=("move", "reject"),
    )  # fmt: skip
    double_hit_level: float = setting(
        0.02, "1", "a second contact counts from this share of the peak on", minimum=0.005, maximum=0.5
    )
    double_hit_prominence: float = setting(
        0.015, "1", "and if it stands out from its surroundings by this share", minimum=0.004, maximum=0.5
    )
    double_hit_remaining: float = setting(
        0.5, "1", "after a second contact this share of the decay's amplitude must be left to use it",
        minimum=0.0, maximum=1.0,
    )  # fmt: skip
    minimum_decay: float = setting(
        0.02, "s", "a shorter decay holds less than two periods of the ballast resonance", minimum=1e-3, maximum=5.0
    )
    weak: float = setting(
        0.4, "1", "a peak below this share of the test's median is weak: its noise counts 2.5 times",
        minimum=0.05, maximum=0.9,
    )  # fmt: skip
    out_of_range: float = setting(
        3.0, "1", "no impact is this many times the median: the channel overflowed", minimum=1.5, maximum=50.0
    )
    deviation: float = setting(
        5.0, "sd", "and both must lie this far from the median in robust standard deviations", minimum=3.0, maximum=20.0
    )
    noise: float = setting(
        0.15,
        "1",
        "rms before the impact over the largest sample: 0.09 at 20 dB; from 15 dB on the decay is noise",
        minimum=0.01,
        maximum=1.0,
    )
    noise_over_median: float = setting(
        4.0, "1", "an impact this many times noisier than its test's median, and above 2 %, is not used",
        minimum=1.5, maximum=100.0,
    )  # fmt: skip
    cut_off: float = setting(
        0.01, "1", "amplitude left at the end of the record over the peak: more leaks into other lines",
        minimum=1e-4, maximum=1.0,
    )  # fmt: skip
    agreement_low: float = setting(20.0, "Hz", "impacts are compared from here", minimum=0.0, maximum=1e5)
    agreement_high: float = setting(800.0, "Hz", "to here, or to the hammer's band edge", minimum=1.0, maximum=1e5)
    agreement_gap: float = setting(
        0.05,
        "1",
        "an outlier's median pairwise coherence lies this far below that of the other impacts",
        minimum=0.005,
        maximum=0.9,
    )
    agreement_factor: float = setting(
        8.0, "1", "and its incoherence is this many times theirs; half the force makes four", minimum=2.0, maximum=100.0
    )
    gain: float = setting(
        0.02, "1", "relative deviation from the mean that makes a response an outlier, if others scatter less",
        minimum=0.005, maximum=1.0,
    )  # fmt: skip
    best_impacts: int = setting(
        0, "", "of more accepted impacts, this many (at least minimum_impacts) that agree best; 0 uses all",
        minimum=0, maximum=1000,
    )  # fmt: skip
    minimum_impacts: int = setting(
        3, "", "with fewer accepted impacts the limits of the coherence carry no information", minimum=2, maximum=100
    )
    force_window: bool = setting(False, "", "set the force to zero after the contact: for noisy force channels")
    exponential_window: float = setting(
        0.0, "1/s", "decay rate of an exponential window on both channels; 0 for none", minimum=0.0, maximum=1000.0
    )
    highest_frequency: float = setting(
        2000.0, "Hz", "lines above are not kept: the paper uses 0 ... 800 Hz", minimum=10.0, maximum=1e5
    )
    gate: str = setting(
        "limit", "", "'limit' compares the lower one-sided 95 % limit, 'paper' the estimate itself",
        choices=("limit", "paper"),
    )  # fmt: skip
    gate_level: float = setting(0.8, "1", "the paper's required coherence", minimum=0.0, maximum=0.999)
    gate_share: float = setting(
        0.5, "1", "a band is usable if this share of its lines passes the gate", minimum=0.0, maximum=1.0
    )
