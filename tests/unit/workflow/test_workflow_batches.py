"""Reading a batch gives the requested units and decodes no other unit."""

import pyarrow.parquet as pq

from turnout.workflow.batches import UnitResult, read_results, write_batch


def results(n, **row):
    return [
        UnitResult(
            f"t{i:02d}/hammer/A", f"t{i:02d}", "hammer", "k", "1", "ok", {"models": [{"model_id": str(i)} | row]}
        )
        for i in range(n)
    ]


def test_requested_units_are_read_in_order_and_as_written(tmp_path):
    written = results(100)
    batch = write_batch(tmp_path, reversed(written))
    assert list(read_results(batch)) == written
    assert list(read_results(batch, {"t70/hammer/A", "t03/hammer/A", "t99/hammer/B"})) == [written[3], written[70]]


def test_the_rows_of_other_units_are_not_decoded(tmp_path):
    """A stage reads every batch with a unit of its turnout: rows of other turnouts must not need time."""
    written = results(100, detail="x" * 30_000)
    batch = write_batch(tmp_path, written)
    last = pq.read_metadata(batch).row_group(pq.read_metadata(batch).num_row_groups - 1)
    rows = last.column(last.num_columns - 1)
    start = rows.dictionary_page_offset or rows.data_page_offset
    content = bytearray(batch.read_bytes())
    content[start : start + rows.total_compressed_size] = bytes(rows.total_compressed_size)
    batch.write_bytes(content)
    assert list(read_results(batch, {"t03/hammer/A"})) == [written[3]]


def test_small_results_share_a_row_group(tmp_path):
    """Each group needs 0.2 ms, which is more than the reading of eight small results."""
    assert pq.read_metadata(write_batch(tmp_path, results(400))).num_row_groups == 1
    assert pq.read_metadata(write_batch(tmp_path, results(16, detail="x" * 2**18))).num_row_groups == 2
