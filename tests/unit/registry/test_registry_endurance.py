"""Small runs of ``python -m benchmarks robustness``: readers during nightly runs, and flipped bits in live files."""


def test_flipped_bits_in_live_files_change_no_row_and_each_file_is_reported(repository, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(repository))
    from benchmarks.bit_flips import flip_bits

    flips = flip_bits(tmp_path, n_file=25)
    assert (flips.n_flipped, flips.n_named, flips.n_different) == (25, 25, 0) and flips.n_row >= 25


def test_readers_find_every_file_of_their_generation_while_others_are_published(repository, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(repository))
    from benchmarks.registry_race import race_of_readers

    n_read, problems, n_commit = race_of_readers(tmp_path / "registry", n_reader=2, n_read=40)
    assert n_read == 40 and problems == [] and n_commit >= 1
