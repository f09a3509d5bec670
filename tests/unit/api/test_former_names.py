"""A script that imports a module by its former name gets an error with the present name."""

from importlib import import_module

import pytest

from turnout.former_names import former_names


@pytest.mark.parametrize(
    ("former", "now"),
    [
        ("turnout.chains.hammer", "turnout.stages.hammer"),
        ("turnout.identify.hankel", "turnout.modal.era"),
        ("turnout.mismatch.track.rolling", "turnout.mismatch.turnout.passage_observation"),
        ("turnout.atomic", "turnout.files"),
        ("turnout_blind.world", "turnout_blind.true_site"),
    ],
)
def test_the_error_names_the_present_module(former, now):
    with pytest.raises(ModuleNotFoundError, match=f"{former} was renamed in Turnout 0.2. Import {now} instead"):
        import_module(former)


def test_the_error_of_an_import_from_a_former_package_names_the_present_package():
    with pytest.raises(ImportError, match=r"Import modes_of_frf from turnout\.modal instead"):
        from turnout.identify import modes_of_frf  # noqa: F401


def test_a_module_that_never_existed_gives_the_usual_error():
    with pytest.raises(ModuleNotFoundError, match=r"No module named .turnout\.nothing."):
        import_module("turnout.nothing")


def test_every_present_name_in_the_table_exists(repository):
    """Every module that the table names exists, so the table cannot become outdated."""
    for former, now in former_names().items():
        root = repository if now.split(".")[0] in ("benchmarks", "examples", "tests") else repository / "src"
        path = root.joinpath(*now.split("."))
        assert path.with_suffix(".py").is_file() or (path / "__init__.py").is_file(), f"{former} -> {now}"
