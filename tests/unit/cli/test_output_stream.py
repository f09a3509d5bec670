"""Standard output that lacks characters, is closed or full, or has no reader is never a fault of the program."""

import json
import os
import subprocess
import sys

import pytest

from turnout.registry.job import register

QUERY = "select 'm/s² → 日' as unit"
RUN = [sys.executable, "-m", "turnout"]


@pytest.fixture(scope="module")
def registry(tmp_path_factory):
    folder = tmp_path_factory.mktemp("registry")
    register([], folder, read=iter)
    return folder


def run(words, registry=None, encoding="utf-8", **options):
    environment = os.environ | {"PYTHONIOENCODING": encoding}
    words = [*RUN, *words, *(["--registry", str(registry)] if registry else [])]
    return subprocess.run(words, env=environment, stderr=subprocess.PIPE, check=False, **options)


@pytest.mark.parametrize("encoding", ["utf-8", "ascii", "latin-1", "cp1252"])
@pytest.mark.parametrize("form", [[], ["--csv", "-"], ["--json"]])
def test_a_character_that_the_encoding_lacks_is_printed_as_an_escape_sequence(registry, encoding, form):
    done = run(["query", QUERY, *form], registry, encoding, stdout=subprocess.PIPE)
    printed = done.stdout.decode(encoding)
    assert done.returncode == 0 and not done.stderr
    if form == ["--json"]:
        assert json.loads(printed)["result"] == [{"unit": "m/s² → 日"}]
    else:
        assert "m/s² → 日".encode(encoding, "backslashreplace").decode(encoding) in printed


def test_json_has_null_for_a_number_that_is_none(registry):
    """JSON has neither NaN nor infinity, also within a list."""
    numbers = "select 'nan'::double as a, '-inf'::double as b, ['inf'::double, 2.0] as c"
    done = run(["query", numbers, "--json"], registry, stdout=subprocess.PIPE)
    printed = json.loads(done.stdout, parse_constant=pytest.fail)
    assert printed["result"] == [{"a": None, "b": None, "c": [None, 2.0]}]


def test_json_has_a_number_for_a_decimal_number(registry):
    done = run(["query", "select 100.0 * 3 as a, [0.5] as b", "--json"], registry, stdout=subprocess.PIPE)
    assert json.loads(done.stdout)["result"] == [{"a": 300.0, "b": [0.5]}]


@pytest.mark.parametrize("words", [["query", "--list"], ["query", QUERY, "--json"], ["query", "from range(9999)"]])
def test_a_closed_pipe_is_no_fault(registry, words):
    reading, writing = os.pipe()
    os.close(reading)
    try:
        done = run(words, registry, stdout=writing)
    finally:
        os.close(writing)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="another system")
@pytest.mark.parametrize("form", [[], ["--json"]])
def test_a_full_disk_at_standard_output_is_reported_without_traceback(registry, form):
    with open("/dev/full", "wb") as full:
        done = run(["query", QUERY, *form], registry, stdout=full)
    assert done.returncode == 2 and b"Traceback" not in done.stderr
    assert b"standard output" in done.stderr and b"No space left on device" in done.stderr


def test_a_closed_standard_output_is_no_fault(registry):
    command = f"{sys.executable} -m turnout query --list --json --registry '{registry}' >&-"
    done = subprocess.run(["sh", "-c", command], stderr=subprocess.PIPE, check=False)
    assert (done.returncode, done.stderr) == (0, b"")


def test_a_closed_standard_input_is_an_empty_query(registry):
    command = f"{sys.executable} -m turnout query - --registry '{registry}' <&-"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and "Traceback" not in done.stderr and done.stderr.startswith("turnout query: ")


def test_a_query_that_is_not_utf8_is_reported(registry):
    done = run(["query", b"select '\xfc' as x"], registry, stdout=subprocess.PIPE)
    assert done.returncode == 2 and b"contains a byte that is not UTF-8" in done.stderr
