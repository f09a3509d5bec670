"""The tables of the paper as data, their misprints, the models, and hammer tests computed from them."""

from benchmarks.published.models import PublishedModel, published_model
from benchmarks.published.synthetic import UNMODELLED, HammerTest, Nuisance, hammer_test
from benchmarks.published.tables import LOCATIONS, RATE, TABLE_1, TABLE_2, TABLE_3, TABLE_4

__all__ = [
    "LOCATIONS",
    "RATE",
    "TABLE_1",
    "TABLE_2",
    "TABLE_3",
    "TABLE_4",
    "UNMODELLED",
    "HammerTest",
    "Nuisance",
    "PublishedModel",
    "hammer_test",
    "published_model",
]
