"""Modal identification of free decays: realisation, maximum likelihood, selection, summary over impacts."""

from turnout.identify.bound import cramer_rao_bound
from turnout.identify.compare import Shift, compare_tests, welch_test
from turnout.identify.era import Realisation, era
from turnout.identify.frf_modes import FrfMode, FrfModes, modes_of_frf
from turnout.identify.identification import identify
from turnout.identify.poles import continuous_pole, discrete_pole, modal_parameters
from turnout.identify.realise import balanced_pair, block_model
from turnout.identify.summary import Summary, summarise

__all__ = [
    "FrfMode",
    "FrfModes",
    "Realisation",
    "Shift",
    "Summary",
    "balanced_pair",
    "block_model",
    "compare_tests",
    "continuous_pole",
    "cramer_rao_bound",
    "discrete_pole",
    "era",
    "identify",
    "modal_parameters",
    "modes_of_frf",
    "summarise",
    "welch_test",
]
