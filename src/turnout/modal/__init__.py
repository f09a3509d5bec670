"""Modal identification of free decays: realisation, maximum likelihood, mode selection, mean over the impacts."""

from turnout.modal.comparison import Shift, compare_tests, welch_test
from turnout.modal.era import Realisation, era
from turnout.modal.frf import FrfMode, FrfModes, modes_of_frf
from turnout.modal.identification import identify
from turnout.modal.poles import continuous_pole, discrete_pole, modal_parameters
from turnout.modal.state_space import balanced_pair, block_model
from turnout.modal.summary import Summary, cramer_rao_bound, summarise

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
